"""A program that is read and checked once, and built for several processors and at several levels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from plctool.compiler import Level, check_sources
from plctool.compiler.codegen.lower_unit import Options
from plctool.compiler.image.build import BuildResult, build_program
from plctool.compiler.typed.nodes import TypedProgram
from plctool.image.targets import DEFAULT_TARGET, find_target


@dataclass(frozen=True)
class CheckedProgram:
    """A program without errors."""

    program: TypedProgram

    def built(self, level: Level, target: str = DEFAULT_TARGET) -> BuildResult:
        """Returns what `compile_sources` makes of the program, without limits."""
        number, size = (2, True) if level == "s" else (level, False)
        return build_program(self.program, Options(find_target(target), number, size=size))


def checked(paths: Sequence[Path]) -> CheckedProgram:
    """Reads and checks the sources of a program without errors."""
    result = check_sources(paths)
    assert result.program is not None, result.diagnostics
    return CheckedProgram(result.program)
