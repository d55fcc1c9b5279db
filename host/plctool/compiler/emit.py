"""From LLVM IR in text form to one ELF object: llvmlite parses, verifies, optimises and emits."""

from __future__ import annotations

from functools import cache

import llvmlite.binding as llvm

from plctool.compiler.targets import Target


@cache
def _initialise() -> None:
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()


def target_machine(target: Target, opt_level: int) -> llvm.TargetMachine:
    """LLVM's code generator for a target."""
    _initialise()
    return llvm.Target.from_triple(target.triple).create_target_machine(
        cpu=target.cpu, features=target.features, opt=opt_level, reloc="pic", codemodel="small", abiname=target.abi
    )


def optimised(text: str, target: Target, opt_level: int) -> tuple[llvm.ModuleRef, llvm.TargetMachine]:
    """The module after LLVM's standard pipeline of the level."""
    machine = target_machine(target, opt_level)
    module = llvm.parse_assembly(text, llvm.create_context())
    module.verify()
    options = llvm.create_pipeline_tuning_options(speed_level=opt_level)
    options.loop_vectorization = options.slp_vectorization = opt_level >= 2
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    return module, machine


def emit_object(text: str, target: Target, opt_level: int) -> bytes:
    """The ELF object of a module. A module that LLVM refuses is a bug of the lowering and raises RuntimeError."""
    module, machine = optimised(text, target, opt_level)
    data: bytes = machine.emit_object(module)
    return data


def emit_assembly(text: str, target: Target, opt_level: int) -> str:
    """What `emit_object` makes, for people."""
    module, machine = optimised(text, target, opt_level)
    assembly: str = machine.emit_assembly(module)
    return assembly
