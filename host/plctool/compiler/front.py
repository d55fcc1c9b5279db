"""The front end of the compiler: from source texts to a typed program, or to diagnoses.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from plctool.compiler.configuration import configure
from plctool.compiler.diagnostics import Diagnostic, TooManyErrors, render
from plctool.compiler.expressions import NestingError
from plctool.compiler.library import Library, standard_library
from plctool.compiler.parser import parse
from plctool.compiler.source import Source
from plctool.compiler.typed import Area, TypedProgram
from plctool.compiler.world import World

__all__ = ["CheckResult", "Diagnostic", "Source", "check_sources", "render"]

_RECURSION_LIMIT = 20_000  # enough for MAX_DEPTH levels of nesting here and in the lowering


@dataclass
class CheckResult:
    """`program` is None when there are errors."""

    program: TypedProgram | None
    diagnostics: list[Diagnostic]

    @property
    def ok(self) -> bool:
        """Whether there are no errors; warnings may be there."""
        return self.program is not None


def check_sources(
    sources: Sequence[Source], *, library: bool = True, library_sources: Sequence[Source] = ()
) -> CheckResult:
    """Checks the files of a program together.

    `library`: whether the standard library is there; `library_sources`: other library texts in place of it. Whatever
    the texts hold, the answer is a program or diagnoses, never an exception.
    """
    chosen = Library(library_sources) if library_sources else standard_library() if library else Library(())
    world = World(chosen)
    with _limits():
        program = _guarded(world, sources)
    diagnostics = world.diagnostics
    return CheckResult(None if diagnostics.errors else program, diagnostics.sorted())


def _guarded(world: World, sources: Sequence[Source]) -> TypedProgram | None:
    """The check, with an end to errors and to nesting."""
    try:
        try:
            return _check(world, sources)
        except NestingError as error:
            world.nested_too_deeply(error)
        except RecursionError:
            world.diagnostics.error(sources[0].pos(0), "nesting", "something in the program is nested too deeply")
    except TooManyErrors:
        pass
    return None


def _check(world: World, sources: Sequence[Source]) -> TypedProgram | None:
    parsed = [(source, parse(source, world.diagnostics.at(source))) for source in sources]
    if world.diagnostics.errors:
        return None
    for source, declarations in parsed:
        world.register(declarations)
        world.register_globals(declarations, source)
    world.declare_all()
    application = configure(world)
    world.check_bodies()
    allocation = world.allocation
    _check_sizes(world, sources)
    if not application.tasks and not world.diagnostics.errors and sources:
        world.diagnostics.warning(sources[0].pos(0), "no-program", "there is no PROGRAM, so nothing would run")
    return TypedProgram(
        pous=world.pous,
        globals=allocation.variables,
        tasks=application.tasks,
        area_sizes={area: allocation.sizes.get(area, 0) for area in Area},
        defaults=world.defaults,
        programs=application.programs,
        aliases=world.aliases(),
    )


def _check_sizes(world: World, sources: Sequence[Source]) -> None:
    for area, size in world.allocation.sizes.items():
        if size > 0x7FFF_FFFF and sources:
            world.diagnostics.error(
                sources[0].pos(0), "size", f"the {area.name} area has {size} bytes, which is too large"
            )


@contextmanager
def _limits() -> Iterator[None]:
    """Room for deep nesting; and no garbage collection in between, which would only look at what stays."""
    collecting = gc.isenabled()
    gc.disable()
    sys.setrecursionlimit(max(sys.getrecursionlimit(), _RECURSION_LIMIT))
    try:
        yield
    finally:
        if collecting:
            gc.enable()
