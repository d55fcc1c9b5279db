"""From the typed program to LLVM IR: one module with an external function per task and one for initialisation."""

from __future__ import annotations

from dataclasses import dataclass

from plctool.compiler.analysis import Effects
from plctool.compiler.ir import Function
from plctool.compiler.lower_classes import renumber, write_dispatcher
from plctool.compiler.lower_frame import Ref, string_capacity
from plctool.compiler.lower_helpers import MEMORY_FUNCTIONS, memory_functions, string_helper
from plctool.compiler.lower_init import Initialising
from plctool.compiler.lower_stmt import Body, parameter_list
from plctool.compiler.lower_unit import Options, Unit, value_type
from plctool.compiler.typed import Area, External, Pou, PouKind, Task, TypedProgram, Variable
from plctool.compiler.types import BOOL, is_scalar

GLOBAL_INIT = "global_init"
_WHOLE = 1_200_000  # characters of IR (about 5000 lines of ST) up to which a program is optimised as one


@dataclass(frozen=True)
class Lowered:
    """LLVM IR, in parts to be compiled each by itself, and what an image of it needs. `tasks`: entry symbols
    in the order of the program's tasks; `pous`: by symbol, all that are part of it; `imports`: in the order of their
    slots."""

    texts: list[str]
    tasks: list[str]
    pous: dict[str, Pou]
    imports: list[External]


def lower(program: TypedProgram, options: Options) -> Lowered:
    """Lowers what the tasks of a checked program reach."""
    unit = Unit(options, program.area_sizes, program.defaults)
    tasks = [_task_entry(unit, number, task) for number, task in enumerate(program.tasks)]
    _global_init(unit, program.globals, program.startup)
    effects = Effects()
    done = chosen = 0
    while done < len(unit.pous) or chosen < len(unit.dispatchers):
        if done < len(unit.pous):
            _pou(unit, list(unit.pous)[done], effects)
            done += 1
        else:
            dispatch, name = list(unit.dispatchers.items())[chosen]
            write_dispatcher(unit, name, dispatch)
            chosen += 1
    _struct_initialisers(unit)
    for name in sorted(unit.helpers):
        unit.module.add_helper(string_helper(name, unit.target, unit.plain))
    unit.module.add_helper(memory_functions(unit.target, unit.compact))
    for name in MEMORY_FUNCTIONS:
        unit.module.keep(name)
    return Lowered(unit.module.texts(_WHOLE), tasks, {name: pou for pou, name in unit.pous.items()}, unit.imports)


def _task_entry(unit: Unit, number: int, task: Task) -> str:
    """Calls the programs of a task in order."""
    name = f"task.{number}"
    fn = Function(f"define void @{name}(ptr noalias nonnull readonly %ctx) {unit.plain}")
    for pou in task.programs:
        fn.do(f"call void @{unit.symbol(pou)}(ptr %ctx)")
    fn.terminate("ret void")
    unit.module.add(name, fn.text())
    return name


def _pou(unit: Unit, pou: Pou, effects: Effects) -> None:
    result = value_type(pou.result.type) if pou.result is not None and is_scalar(pou.result.type) else "void"
    attributes = unit.plain
    if pou.kind is PouKind.PROGRAM or unit.options.debug:
        attributes = unit.noinline
    elif not pou.checks:
        attributes = unit.hinted
    fn = Function()
    body = Body(unit, fn, pou, effects)
    scope = body.open_scope(pou.name, pou.pos)
    fn.head = f"define internal {result} @{unit.symbol(pou)}({parameter_list(pou)}) {attributes} !dbg !{scope}"
    body.write()
    unit.module.add(unit.symbol(pou), fn.text())


def _global_init(unit: Unit, variables: list[Variable], startup: Pou | None) -> None:
    fn = Function(f"define void @{GLOBAL_INIT}(ptr noalias nonnull readonly %ctx, i32 %init_retains) {unit.plain}")
    frame = Initialising(unit, fn, None)
    _initialise_area(frame, variables, (Area.DATA, Area.OUTPUT, Area.MEMORY, Area.INPUT))
    if any(v.area is Area.RETAIN for v in variables):
        retains, kept, end = fn.label("retains"), fn.label("kept"), fn.label("end")
        fn.branch_if(fn.value("icmp ne i32 %init_retains, 0"), retains, kept)
        fn.begin(retains)
        _initialise_area(frame, variables, (Area.RETAIN,))
        fn.branch(end)
        fn.begin(kept)
        for var in variables:
            if var.area is Area.RETAIN:
                renumber(frame, Ref(frame.area_base(var.area), var.offset, var.type, direct=True))
        fn.begin(end)
    if startup is not None:
        flag = fn.value("icmp ne i32 %init_retains, 0")
        text = value_type(BOOL)
        operand = flag if text == "i1" else fn.value(f"zext i1 {flag} to {text}")
        fn.do(f"call void @{unit.symbol(startup)}(ptr %ctx, {text} {operand})")
    fn.terminate("ret void")
    unit.module.add(GLOBAL_INIT, fn.text())


def _initialise_area(frame: Initialising, variables: list[Variable], areas: tuple[Area, ...]) -> None:
    for var in variables:
        if var.area in areas:
            ref = Ref(frame.area_base(var.area), var.offset, var.type, direct=True, capacity=string_capacity(var.type))
            frame.initialise(ref, var.initial)


def _struct_initialisers(unit: Unit) -> None:
    done = 0
    while done < len(unit.structs):
        name, struct = list(unit.structs.items())[done]
        fn = Function(f"define internal void @{name}(ptr nonnull %self) {unit.plain}")
        frame = Initialising(unit, fn, None)
        frame.initialise_members(Ref("%self", 0, struct, direct=True), struct, None)
        fn.terminate("ret void")
        unit.module.add(name, fn.text())
        done += 1
