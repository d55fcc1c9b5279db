"""The front end of the compiler: from sources to a typed program, or to diagnostics.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from plctool.compiler.base.garbage import no_collection
from plctool.compiler.base.missing_names import declared_names
from plctool.compiler.base.nesting import NestingError, room_for_nesting
from plctool.compiler.base.source import Source
from plctool.compiler.image.task_images import plan_images
from plctool.compiler.semantics.allocation import report_overlaps
from plctool.compiler.semantics.call_graph import report_shared_writes
from plctool.compiler.semantics.configuration import configure
from plctool.compiler.semantics.io_channels import IoChannels, device_variables
from plctool.compiler.semantics.permitted import check_declarations
from plctool.compiler.semantics.program import Program
from plctool.compiler.semantics.rules.builtin import is_built_in
from plctool.compiler.semantics.uncalled_blocks import report_uncalled_blocks
from plctool.compiler.semantics.world import World
from plctool.compiler.sources.imports import ImportedLibrary, needed_parts
from plctool.compiler.syntax.ast import Declaration
from plctool.compiler.syntax.attributes import check_attributes, check_pragmas
from plctool.compiler.syntax.broken_units import is_independent, remaining
from plctool.compiler.syntax.conditions import names_asked_for
from plctool.compiler.syntax.diagnostics import Diagnostic, Diagnostics, TooManyErrors, render
from plctool.compiler.syntax.library import Library, standard_library
from plctool.compiler.syntax.parser import Parsed, parse_all
from plctool.compiler.syntax.warnings import ALL_WARNINGS, WarningOptions
from plctool.compiler.typed.nodes import Pos, TypedProgram
from plctool.iec.areas import Area
from plctool.iec.dialect import OWN, Dialect
from plctool.iec.types import MAX_SIZE

if TYPE_CHECKING:
    from plctool.compiler.semantics.python_functions import PythonFunctions
    from plctool.compiler.semantics.unit_tests import TestSuite
    from plctool.io.model import Description

__all__ = ["CheckResult", "Diagnostic", "Source", "check_sources", "render"]


@dataclass
class CheckResult:
    """`program` is None when there are errors."""

    program: TypedProgram | None
    diagnostics: list[Diagnostic]
    has_tests: bool = False  # there are TEST blocks, whether they were looked at or not

    @property
    def ok(self) -> bool:
        """Whether there are no errors; warnings may be there."""
        return self.program is not None


def check_sources(
    sources: Sequence[Source],
    *,
    library: bool = True,
    library_sources: Sequence[Source] = (),
    tests: TestSuite | None = None,
    warnings: WarningOptions = ALL_WARNINGS,
    io: Description | None = None,
    libraries: Sequence[ImportedLibrary] = (),
    python: PythonFunctions | None = None,
    dialect: Dialect = OWN,
) -> CheckResult:
    """Checks the files of a program together.

    `library`: whether the standard library is there; `library_sources`: other library sources in place of it. `tests`:
    takes the TEST blocks; the program then runs them in place of its tasks. Without it they are passed over.
    `warnings`: which of them are wanted. `io`: the inputs and outputs; a description is for one check.
    `libraries`: what the program uses besides the standard library. `python`: functions that Python implements, in the
    simulator; raises UsageError for those that cannot be. `dialect`: the system whose rules it has. Whatever the
    sources contain, the result is a program or diagnostics, never an exception.
    """
    chosen = Library(library_sources) if library_sources else standard_library() if library else Library(())
    program = Program(chosen)
    diagnostics = program.world.diagnostics
    diagnostics.options = warnings
    program.world.dialect = diagnostics.dialect = dialect
    program.world.io = IoChannels(io)
    program.libraries = libraries
    with no_collection(), room_for_nesting():
        typed = _guarded(program, sources, tests, python)
    has_tests = bool(program.world.names.tests)
    return CheckResult(None if diagnostics.errors else typed, diagnostics.sorted(), has_tests)


def _guarded(
    program: Program, sources: Sequence[Source], tests: TestSuite | None, python: PythonFunctions | None
) -> TypedProgram | None:
    """The check, with an end to errors and to nesting."""
    try:
        try:
            typed = _check(program, sources, tests, python)
            world = program.world
            world.diagnostics.settle(
                lambda name: is_built_in(name) or world.names.lookup(name.casefold(), library=False) is not None
            )
            return typed
        except NestingError as error:
            program.world.nested_too_deeply(error)
        except RecursionError:
            program.world.diagnostics.error(
                sources[0].pos(0), "nesting", "something in the program is nested too deeply"
            )
    except TooManyErrors:
        pass
    return None


def _check(
    program: Program, sources: Sequence[Source], suite: TestSuite | None, python: PythonFunctions | None
) -> TypedProgram | None:
    world = program.world
    declared = _names_asked_for(program, sources)
    texts = [(source, parse_all(source, world.diagnostics.at(source).error, declared=declared)) for source in sources]
    syntax = [d for d in world.diagnostics.sorted() if d.severity == "error"]
    for source in sources:
        world.diagnostics.found_by_reader(source)
    if syntax or any(source.absent or _is_not_xml(source) for source in sources):
        _check_the_others(program, texts, syntax)
        return None
    return _check_parsed(program, sources, texts, suite, python)


def _is_not_xml(source: Source) -> bool:
    return any(found.code == "xml" for found in source.findings)


def _check_parsed(
    program: Program,
    sources: Sequence[Source],
    texts: Sequence[tuple[Source, Parsed]],
    suite: TestSuite | None,
    python: PythonFunctions | None,
) -> TypedProgram | None:
    """All but the syntax."""
    world = program.world
    parsed = [(source, _looked_at(source, text, world.diagnostics)) for source, text in texts]
    tests = None if suite is None else suite.begin(program)
    if tests is not None:
        parsed = tests.prepare(parsed)
    if python is not None:
        world.names.register(python.interface(), library=True)
        world.names.rewritten = python.rewritten
        parsed = [(source, python.rewritten(declarations)) for source, declarations in parsed]
    for source, declarations in parsed:
        world.names.register(declarations)
        world.names.register_globals(declarations, source)
    if not _import(program, sources):
        return None
    _declare_devices(world)
    world.io.begin(world.names, world.diagnostics)
    if not world.io.readable:
        return None
    program.declare_all()
    if python is not None:
        python.finish(program)
    if tests is None:
        application = configure(world, program.config)
    else:
        application = tests.configure()
        tests.add()
    program.check_bodies()
    world.io.finish(world.allocation, application.tasks if tests is None else None, world.diagnostics)
    if tests is None and application.tasks:
        program.programs.report_unused()
    world.calls.report_shared(application.tasks)
    if tests is None and not world.diagnostics.errors:
        report_shared_writes(application.tasks, world.diagnostics)
        world.io.report_written_inputs(world.pous, world.diagnostics)
        report_uncalled_blocks(world.pous, world.diagnostics)
    allocation = world.allocation
    _check_sizes(world, sources)
    if not world.diagnostics.errors:  # else channels may have no addresses yet
        report_overlaps(allocation.variables, world.diagnostics)
    runs_nothing = not application.tasks and not world.names.tests and not world.names.program_symbols()
    if runs_nothing and not world.diagnostics.errors and sources:
        world.diagnostics.warning(sources[0].pos(0), "no-program", "there is no PROGRAM, so nothing would run")
    typed = TypedProgram(
        pous=world.pous,
        globals=allocation.variables,
        tasks=application.tasks,
        area_sizes={area: allocation.sizes.get(area, 0) for area in Area},
        defaults=world.defaults,
        programs=program.programs.declared(),
        startup=program.startup,
        shutdown=program.shutdown,
        aliases=world.names.aliases(),
        accesses=program.config.accesses(),
        constants=world.constants,
        externals=program.external_functions(),
        io=world.io.description,
        may_recurse=program.may_recurse,
        trail=program.trail,
    )
    if not world.diagnostics.errors:
        plan_images(typed, world.diagnostics)
    return typed


def _names_asked_for(program: Program, sources: Sequence[Source]) -> frozenset[str]:
    return declared_names_asked_for(program.world.names.library, program.libraries, sources)


def declared_names_asked_for(
    library: Library, libraries: Sequence[ImportedLibrary], sources: Sequence[Source]
) -> frozenset[str]:
    """What {IF defined(pou: NAME)} finds in a program."""
    names = [*library.names(), *(name for imported in libraries for name in imported.by_name)]
    return names_asked_for([source.text for source in sources], lambda: names)


def _import(program: Program, sources: Sequence[Source]) -> bool:
    """Parses what the program needs of its libraries. False after an error, from which many others would follow."""
    names, diagnostics = program.world.names, program.world.diagnostics
    before = diagnostics.errors
    names.begin_imports(program.libraries)
    needed = needed_parts((source.text for source in sources), program.libraries)
    diagnostics.quiet(part.source.path for _, part in needed)
    declared = _names_asked_for(program, [part.source for _, part in needed])
    for library, part in needed:
        diagnostics.found_by_reader(part.source)
        parsed = parse_all(part.source, diagnostics.at(part.source).error, part.start, part.end, declared)
        names.add_import(library, part.source, parsed.declarations)
    return diagnostics.errors == before


def _declare_devices(world: World) -> None:
    """The variables of the devices that the description names."""
    if world.io.description is None:
        return
    source = device_variables(world.io.description, {g.name.casefold() for g in world.names.globals()})
    if source is not None:
        declarations = parse_all(source, world.diagnostics.at(source).error).declarations
        world.names.register(declarations)
        world.names.register_globals(declarations, source)


def _check_the_others(program: Program, texts: Sequence[tuple[Source, Parsed]], syntax: Sequence[Diagnostic]) -> None:
    """Errors of the units without syntax errors: a mistake in one hides no others, nor a library that they need.
    What may follow from the broken units waits."""
    found = program.world.diagnostics
    whole: list[tuple[Source, Parsed]] = []
    hidden: set[str] = set()
    for source, parsed in texts:
        hidden |= source.absent
        if _is_not_xml(source):
            hidden |= declared_names(source.original or source.text)
            continue
        rest = remaining(source, parsed.declarations, [d.line for d in syntax if d.file == source.path])
        hidden |= rest.hidden
        whole.append((source, replace(parsed, declarations=rest.declarations)))
    other = Program(program.world.names.library)
    other.libraries = program.libraries
    other.world.diagnostics.limit = sys.maxsize
    _check_parsed(other, [source for source, _ in whole], whole, None, None)
    for d in other.world.diagnostics.sorted():
        pos = Pos(d.file, d.line, d.column)
        if d.missing and d.missing.casefold() not in hidden:
            found.missing(pos, d.missing, d.message)
        elif d.severity == "error" and not d.missing and is_independent(d, (source for source, _ in whole), hidden):
            found.error(pos, d.code, d.message)


def _looked_at(source: Source, parsed: Parsed, diagnostics: Diagnostics) -> list[Declaration]:
    """The declarations of a file of the program, when what stands with them has been looked at."""
    diagnostics.mute(source)
    reports = diagnostics.at(source)
    check_pragmas(parsed.pragmas, reports)
    check_attributes(parsed.attributes, parsed.places, reports)
    check_declarations(parsed.declarations, source, diagnostics)
    return parsed.declarations


def _check_sizes(world: World, sources: Sequence[Source]) -> None:
    for area, size in world.allocation.sizes.items():
        if size > MAX_SIZE and sources:
            world.diagnostics.error(
                sources[0].pos(0), "size", f"the {area.name} area has {size} bytes, which is too large"
            )
