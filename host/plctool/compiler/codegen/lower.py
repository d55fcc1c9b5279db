"""From the typed program to LLVM IR: one module with an external function per task and event, those for initialisation
and one for the end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import groupby

from plctool.compiler.base.internal import note_position
from plctool.compiler.codegen.ir import Function
from plctool.compiler.codegen.lower_body import write_body, write_calls
from plctool.compiler.codegen.lower_classes import write_dispatcher
from plctool.compiler.codegen.lower_frame import Body, Frame, Ref, string_capacity
from plctool.compiler.codegen.lower_init import initialise, initialise_members
from plctool.compiler.codegen.lower_unit import Form, Options, Unit, value_type
from plctool.compiler.codegen.partition import KnownParts, Part, parts
from plctool.compiler.codegen.sections import sections
from plctool.compiler.codegen.signatures import (
    CONTEXT,
    CONTEXT_PARAMETER,
    SELF,
    block_signatures,
    parameter_list,
    passed_type,
    returned_type,
    returned_variable,
)
from plctool.compiler.codegen.string_functions import string_function
from plctool.compiler.codegen.transient import TransientVariables
from plctool.compiler.typed.analysis import Effects
from plctool.compiler.typed.nodes import External, Pou, Task, TypedProgram, Variable
from plctool.core import lib
from plctool.debug.bounds import BoundsCheck
from plctool.debug.passed_lines import PassedLine
from plctool.errors import UsageError
from plctool.iec.areas import EXCLUSIVE_AREAS, Area
from plctool.iec.types import BOOL
from plctool.image.targets import FASTEST

CODE_INIT = "code_init"
GLOBAL_INIT = "global_init"
GLOBAL_EXIT = "global_exit"
CHANGE_INIT = "change_init"


@dataclass(frozen=True)
class Lowered:
    """LLVM IR, in parts, and what an image of it needs. `tasks`: entry symbols in the order of the program's tasks;
    `functions`: those the runtime calls besides, by CDL_FUNCTION_...; `events`: those of the program's events, in their
    order; `exports`: the same of what components in C call, empty for a variable; `change_init`: what it calls at an
    online change, empty if nothing; `pous`: by symbol, all that are part of it; `imports`: in the order of their slots;
    `bounds`: what is checked; `transient`: variables of blocks that are not kept in memory; `passed_lines`: by the
    numbers in the trail of an exception, from 1."""

    parts: list[Part]
    tasks: list[str]
    functions: dict[int, str]
    events: list[str]
    exports: list[str]
    pous: dict[str, Pou]
    imports: list[External]
    bounds: list[BoundsCheck]
    transient: TransientVariables
    passed_lines: list[PassedLine]
    change_init: str = ""

    @property
    def entries(self) -> list[str]:
        """All that the runtime calls."""
        others = [*filter(None, self.exports), *([self.change_init] if self.change_init else [])]
        return [*self.tasks, *self.functions.values(), *self.events, *others]


def lower(program: TypedProgram, options: Options) -> Lowered:
    """Lowers what the tasks of a checked program reach."""
    unit = Unit(options, program.area_sizes, program.defaults)
    return finished(program, unit, lower_into(unit, program, write_pou))


@dataclass(frozen=True)
class Entries:
    """The symbols of what the runtime calls, as in `Lowered`."""

    tasks: list[str]
    functions: dict[int, str]
    events: list[str]
    exports: list[str]


def lower_into(unit: Unit, program: TypedProgram, write: Callable[[Unit, Pou, Effects, Form], None]) -> Entries:
    """Writes all functions into the module of a new unit; `write` writes that of a POU. Returns their entries."""
    options = unit.options
    unit.trail_variable = program.trail
    signatures = block_signatures(program, options)
    unit.handed, unit.transient, unit.closed = signatures.handed, signatures.transient, signatures.closed
    tasks = [_task_entry(unit, number, task) for number, task in enumerate(program.tasks)]
    _code_init(unit, program.globals)
    functions = {int(lib.CDL_FUNCTION_CODE_INIT): CODE_INIT}
    if program.startup is not None:
        _global_init(unit, program.startup)
        functions[int(lib.CDL_FUNCTION_GLOBAL_INIT)] = GLOBAL_INIT
    if program.shutdown is not None:
        _entry_of(unit, GLOBAL_EXIT, program.shutdown)
        functions[int(lib.CDL_FUNCTION_GLOBAL_EXIT)] = GLOBAL_EXIT
    if program.startup_of_new is not None:
        _entry_of(unit, CHANGE_INIT, program.startup_of_new)
    events = [f"event.{number}" for number in range(len(program.events))]
    for name, event in zip(events, program.events, strict=True):
        _entry_of(unit, name, event.pou)
    exports = []
    for number, export in enumerate(program.exports):
        exports.append("" if export.caller is None else f"export.{number}")
        if export.caller is not None:
            _entry_of(unit, exports[-1], export.caller)
    effects = Effects()
    done = chosen = 0
    while done < len(unit.pous) or chosen < len(unit.dispatchers):
        if done < len(unit.pous):
            pou, form = list(unit.pous)[done]
            try:
                write(unit, pou, effects, form)
            except Exception as error:
                note_position(error, pou.pos)
                raise
            done += 1
        else:
            (dispatch, form), name = list(unit.dispatchers.items())[chosen]
            write_dispatcher(unit, name, dispatch, form)
            chosen += 1
    if unit.exchanges and len(program.tasks) > 1 and not unit.target.exchanges:
        raise UsageError(
            f"__NEW in a program with several tasks needs a processor that compares and exchanges in one step, which "
            f"{unit.target.name} does not; use one task, or another target.",
            "target",
        )
    _struct_initialisers(unit)
    return Entries(tasks, functions, events, exports)


def finished(program: TypedProgram, unit: Unit, entries: Entries, known: KnownParts | None = None) -> Lowered:
    """Returns what is made of a unit in which all functions are written. `known`: as in
    `parts()`."""
    options = unit.options
    for name in sorted(unit.helpers):
        unit.module.add_helper(name, string_function(name, unit.target, unit.strings))
    pous = {name: pou for (pou, _), name in unit.pous.items()}
    bounds = [*dict.fromkeys(unit.bounds)]
    options.passes.left(("sections", "memory", "lengths", "splice"), unit.module.whole)
    cut, grouped = options.passes.runs("parts"), options.opt_level < FASTEST
    made = parts(unit.module, cut=cut, grouped=grouped, known=known)
    options.passes.left(("parts",), lambda: "\n".join(f"; part {n}\n{part.text}" for n, part in enumerate(made, 1)))
    return Lowered(
        made,
        entries.tasks,
        entries.functions,
        entries.events,
        entries.exports,
        pous,
        unit.imports,
        bounds,
        unit.transient,
        unit.trail.lines,
        CHANGE_INIT if program.startup_of_new is not None else "",
    )


def _task_entry(unit: Unit, number: int, task: Task) -> str:
    """Calls the programs of a task in order. What connects one is part of its function, where what is assigned to it
    is in a register when it is used."""
    name = f"task.{number}"
    fn = Function(f"void @{name}({CONTEXT_PARAMETER})", unit.plain)
    for program, run in groupby(task.programs, lambda pou: pou.connects or pou):
        pous = list(run)
        if len(pous) > 1:
            unit.runs[program] = pous
        fn.call(unit.symbol(program, Form.RUN if len(pous) > 1 else Form.PLAIN), [CONTEXT])
    fn.terminate("ret void")
    unit.module.add(name, fn, linkage="")
    return name


def write_pou(unit: Unit, pou: Pou, effects: Effects, form: Form) -> None:
    """Writes the function of a POU."""
    closed = unit.closed.get(pou)
    returned, name = returned_variable(pou, closed), unit.symbol(pou, form)
    signature = f"{returned_type(returned)} @{name}({parameter_list(pou, unit.handed, form, closed)})"
    fn = Function(signature, unit.attributes(pou), unit.inlining(pou, form))
    body = Body(unit, fn, pou, effects, form)
    whole = pou in unit.sections or not unit.options.passes.runs("sections")
    cut = [pou] if whole else sections(pou)
    if form is Form.RUN:
        write_calls(body, [unit.symbol(part) for part in unit.runs[pou]])
    elif len(cut) > 1:
        write_calls(body, [unit.section(part, form) for part in cut])
    else:
        body.open_scope(pou.name, pou.pos)
        write_body(body)
    body.write_given_up(returned)
    unit.module.add(name, fn)


def _code_init(unit: Unit, variables: list[Variable]) -> None:
    """Gives all variables their constant initial values; what is kept is put back afterwards, by the runtime."""
    fn = Function(f"void @{CODE_INIT}({CONTEXT_PARAMETER})", unit.plain)
    frame = Frame(unit, fn, None)
    overwriting = _overwriting(variables)
    for var in variables:
        bit = -1 if var.bit is None else var.bit
        base, capacity = frame.area_base(var.area), string_capacity(var.type)
        ref = Ref(base, var.offset, var.type, direct=True, capacity=capacity, bit=bit)
        if var in overwriting:
            frame.clear(ref)
        initialise(frame, ref, var.initial)
    fn.terminate("ret void")
    unit.module.add(CODE_INIT, fn, linkage="")


def _global_init(unit: Unit, startup: Pou) -> None:
    """Initial values that are calculated, and FB_Init."""
    fn = Function(f"void @{GLOBAL_INIT}({CONTEXT_PARAMETER}, i32 %init_retains)", unit.plain)
    flag = fn.value("icmp ne i32 %init_retains, 0")
    operand = fn.value(f"zext i1 {flag} to {value_type(BOOL)}")
    # Not inlined, because it has lines and this has none.
    fn.call(unit.symbol(startup), [CONTEXT, f"{passed_type(BOOL)} {operand}"], " noinline")
    fn.terminate("ret void")
    unit.module.add(GLOBAL_INIT, fn, linkage="")


def _entry_of(unit: Unit, name: str, pou: Pou) -> None:
    """A function of the image that calls one of the program."""
    fn = Function(f"void @{name}({CONTEXT_PARAMETER})", unit.plain)
    fn.call(unit.symbol(pou), [CONTEXT], " noinline")
    fn.terminate("ret void")
    unit.module.add(name, fn, linkage="")


def _overwriting(variables: list[Variable]) -> set[Variable]:
    """Variables at addresses (AT) with initial values, where one before them has put its own: zeros count there."""
    found = set()
    written: set[tuple[Area, int]] = set()
    for var in variables:
        if var.area in EXCLUSIVE_AREAS or var.initial is None:
            continue
        own = {(var.area, var.offset + i) for i in range(var.type.size)}
        if own & written:
            found.add(var)
        written |= own
    return found


def _struct_initialisers(unit: Unit) -> None:
    done = 0
    while done < len(unit.structs):
        name, struct = list(unit.structs.items())[done]
        fn = Function(f"void @{name}(ptr nonnull {SELF})", unit.plain)
        frame = Frame(unit, fn, None)
        initialise_members(frame, Ref(SELF, 0, struct, direct=True), struct, None)
        fn.terminate("ret void")
        unit.module.add(name, fn)
        done += 1
