"""From LLVM IR in text form to one ELF object: llvmlite parses, verifies, optimises and emits.

Its bytes are part of the key of each object that is kept (`objects.py`).
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from itertools import count
from threading import Lock
from typing import TypeVar

import llvmlite.binding as llvm

from plctool.compiler.codegen.elf_object import code_size
from plctool.compiler.codegen.lower_unit import Options
from plctool.compiler.codegen.partition import Part
from plctool.image.targets import FASTEST, Target

_LEAN = ("-disable-machine-cse", "-disable-machine-licm", "-disable-lsr")
"""Options of LLVM's code generator: what several blocks, or the iterations of a loop, could share is not kept in
registers for it."""

_WORTH = 1.03  # such code is a little slower

_NARROW = re.compile(r"^  (\S+) = (udiv|urem) (?:exact )?i(8|16) (\S+), (-?\d+)(.*)$", re.MULTILINE)
_LONG_SHIFT = re.compile(r" = (?:shl|lshr|ashr) [a-z ]*i64 [^,]+, %|@llvm\.fsh[lr]\.i64\(i64 [^,]+, i64 [^,]+, i64 %")
"""Of 64 bits by a variable."""

_Emitted = TypeVar("_Emitted", bytes, str)

_code_generator = Lock()  # its options are those of the process


@cache
def initialise() -> None:
    """Prepares LLVM, once in a process."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    # How far back an earlier load of a variable is looked for. What is loaded once and used far apart has to be kept
    # on the stack, which costs more than to load it again.
    llvm.set_option("", "-memdep-block-scan-limit=30")
    # A comparison would make words of the bytes before it: BOOLs would lose AND NOT, which is one instruction on Arm.
    llvm.set_option("", "-disable-type-promotion")
    # Code that several functions share would have no line of its own.
    llvm.set_option("", "-enable-machine-outliner=never")


@cache
def target_machine(target: Target, opt_level: int) -> llvm.TargetMachine:
    """Returns LLVM's code generator for a target: one for all programs of a process, because to make it takes a tenth
    of the time of a small program. llvmlite lets one thread at a time use it."""
    initialise()
    features = ",".join([target.features, *([target.features_for_speed] if opt_level >= FASTEST else [])])
    return llvm.Target.from_triple(target.triple).create_target_machine(
        cpu=target.cpu, features=features, opt=opt_level, reloc="pic", codemodel="small", abiname=target.abi
    )


def optimised(part: Part, options: Options) -> tuple[llvm.ModuleRef, llvm.TargetMachine]:
    """The module after LLVM's standard pipeline of the level. Of a large program's level 2, what pays in code that is
    long and has few loops: level 1, and dead stores. It takes half the time, and the code is as fast and smaller.
    What is plain needs still less."""
    target, passes = options.target, options.passes
    opt_level = options.opt_level if passes.runs("optimise") else 0
    machine = target_machine(target, opt_level)
    module = llvm.parse_assembly(part.text, llvm.create_context())
    module.verify()
    shorter = part.large and opt_level == 2
    tuning = llvm.create_pipeline_tuning_options(speed_level=1 if shorter else opt_level)
    tuning.loop_unrolling = not target.saves_room(opt_level)
    tuning.loop_vectorization = opt_level >= 2 and not shorter
    builder = llvm.create_pass_builder(machine, tuning)
    if shorter and part.plain:
        _simplify(module, builder)
    else:
        builder.getModulePassManager().run(module, builder)
    passes.left(("optimise",), lambda: str(module))
    if shorter and passes.runs("dead-stores"):
        _remove_dead_stores(module, builder)
    passes.left(("dead-stores",), lambda: str(module))
    if target.divides_words and passes.runs("widen"):
        module = _widen(module)
    passes.left(("widen",), lambda: str(module))
    if options.size and target.shortens and passes.runs("shorten"):
        _shorten(module)
    passes.left(("shorten",), lambda: str(module))
    return module, machine


def _simplify(module: llvm.ModuleRef, builder: llvm.PassBuilder) -> None:
    manager = llvm.create_new_function_pass_manager()
    manager.add_sroa_pass()
    manager.add_simplify_cfg_pass()
    manager.add_instruction_combine_pass()
    manager.add_simplify_cfg_pass()
    _run(manager, module, builder)


def _remove_dead_stores(module: llvm.ModuleRef, builder: llvm.PassBuilder) -> None:
    manager = llvm.create_new_function_pass_manager()
    manager.add_dead_store_elimination_pass()
    _run(manager, module, builder)


def _widen(module: llvm.ModuleRef) -> llvm.ModuleRef:
    """Has divisions by constants done in words. LLVM narrows them where it knows that the numbers are small, for
    processors that divide so in less time; here it only costs the instructions that cut the numbers. Names in modules
    have no quotes (`Unit.unique`), and none begins as those that are made here."""
    text = str(module)
    if not _NARROW.search(text):
        return module
    numbers = count()

    def widened(match: re.Match[str]) -> str:
        result, operation, bits, value, divisor, rest = match.groups()
        name = f"%wide.{next(numbers)}"
        return (
            f"  {name}.value = zext i{bits} {value} to i32{rest}\n"
            f"  {name} = {operation} i32 {name}.value, {int(divisor) % (1 << int(bits))}{rest}\n"
            f"  {result} = trunc nuw i32 {name} to i{bits}{rest}"
        )

    return llvm.parse_assembly(_NARROW.sub(widened, text), llvm.create_context())


def _shorten(module: llvm.ModuleRef) -> None:
    """Has short instructions chosen, and registers that they reach. Only now: with this attribute hardly anything is
    inlined, and the code is larger. A function that shifts 64 bits by a variable does without: LLVM would call the
    compiler runtime for it, whose shifts only the firmware of a Cortex-M0 has."""
    for function in module.functions:
        if not function.is_declaration and not _LONG_SHIFT.search(str(function)):
            function.add_function_attribute("minsize")


def _run(manager: llvm.FunctionPassManager, module: llvm.ModuleRef, builder: llvm.PassBuilder) -> None:
    for function in module.functions:
        if not function.is_declaration:
            manager.run(function, builder)


def emit_object(part: Part, options: Options) -> bytes:
    """The ELF object of a module. A module that LLVM refuses is a bug of the lowering and raises RuntimeError."""
    module, machine = optimised(part, options)
    again = module.clone() if options.passes.dump_after == "lean" else None
    chosen, switches = _chosen(module, machine, tries=(_LEAN,) if options.size and options.passes.runs("lean") else ())
    if again is not None:
        options.passes.left(("lean",), lambda: _emitted(again, machine.emit_assembly, switches))
    return chosen


def _chosen(
    module: llvm.ModuleRef, machine: llvm.TargetMachine, tries: tuple[tuple[str, ...], ...]
) -> tuple[bytes, tuple[str, ...]]:
    """The object, and the options of LLVM's code generator with which it is smaller, if it is by far."""
    best: bytes = _emitted(module.clone() if tries else module, machine.emit_object)
    switches: tuple[str, ...] = ()
    for options in tries:
        other = _emitted(module, machine.emit_object, options)
        if _WORTH * code_size(other) < code_size(best):
            best, switches = other, options
    return best, switches


def _emitted(
    module: llvm.ModuleRef, emit: Callable[[llvm.ModuleRef], _Emitted], switches: tuple[str, ...] = ()
) -> _Emitted:
    """What a module becomes with these options of the code generator, which changes the module."""
    with _code_generator:
        try:
            for switch in switches:
                llvm.set_option("", f"{switch}=true")
            return emit(module)
        finally:
            for switch in switches:
                llvm.set_option("", f"{switch}=false")
