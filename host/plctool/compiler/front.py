"""The front end of the compiler: from sources to a typed program, or to diagnostics.

`parse`, `declare`, `check` and `place` lead from each stage of `semantics/stages.py` to the next; `check_sources` does
all of it.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from plctool.compiler.base.garbage import no_collection
from plctool.compiler.base.information import NO_INFORMATION, Information
from plctool.compiler.base.missing_names import declared_names
from plctool.compiler.base.nesting import NestingError, room_for_nesting
from plctool.compiler.base.source import Source
from plctool.compiler.image.task_images import plan_images
from plctool.compiler.semantics import lints
from plctool.compiler.semantics.generic_blocks import with_instances
from plctool.compiler.semantics.io_channels import IoChannels, device_variables
from plctool.compiler.semantics.participants import DeviceTasks, Files, Guest
from plctool.compiler.semantics.permitted import check_declarations
from plctool.compiler.semantics.program import Program
from plctool.compiler.semantics.stages import Checked, Declared, Parsed, Placed
from plctool.compiler.semantics.world import World
from plctool.compiler.sources.imports import ImportedLibrary, needed_parts
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.attributes import check_attributes, check_pragmas
from plctool.compiler.syntax.broken_units import is_independent, remaining
from plctool.compiler.syntax.conditions import names_asked_for
from plctool.compiler.syntax.diagnostics import MAX_ERRORS, Diagnostic, Diagnostics, TooManyErrors, render
from plctool.compiler.syntax.library import Library, standard_library
from plctool.compiler.syntax.parser import ParsedText, parse_all
from plctool.compiler.syntax.warnings import ALL_WARNINGS, WarningOptions
from plctool.compiler.typed.nodes import Pos, TypedProgram
from plctool.compiler.typed.online_change import OnlineChange, Previous
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
    change: OnlineChange | None = None  # how it takes the place of the previous program
    placed: Placed | None = None  # the last stage, for those that keep it

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
    trees: Trees | None = None,
    observers: Sequence[Guest] = (),
    max_errors: int = MAX_ERRORS,
    information: Information = NO_INFORMATION,
    previous: Previous | None = None,
) -> CheckResult:
    """Checks the files of a program together.

    `library`: whether the standard library is there; `library_sources`: other library sources in place of it. `tests`:
    takes the TEST blocks; the program then runs them in place of its tasks. Without it they are passed over.
    `warnings`: which of them are wanted. `io`: the inputs and outputs; a description is for one check.
    `libraries`: what the program uses besides the standard library. `python`: functions that Python implements, in the
    simulator; raises UsageError for those that cannot be. `dialect`: the system whose rules it has. `trees`: keeps the
    syntax trees for another check. `observers` take part last; what they raise ends the check. `max_errors`: after so
    many the check ends. `information`: what plc.toml says about the program. `previous`: the program whose place it
    shall take while that runs.
    Whatever the sources contain, the result is a program or diagnostics, never another exception.
    """
    chosen = Library(library_sources) if library_sources else standard_library() if library else Library(())
    diagnostics = diagnostics_of(chosen, warnings, dialect, max_errors)
    guests: list[Guest] = [*((python,) if python is not None else ()), tests or DeviceTasks(), *observers]
    parsed: Parsed | None = None
    placed: Placed | None = None
    with reporting(diagnostics, sources):
        parsed = parse(sources, chosen, libraries, diagnostics, trees or Trees())
        parsed = replace(parsed, information=information, previous=previous)
        if parsed.broken:
            _check_whole_units(parsed, [DeviceTasks(), *observers])
        else:
            placed = _placed(parsed, io, guests)
    program = None if placed is None or diagnostics.errors else placed.program
    change = None if placed is None else placed.change
    return CheckResult(program, diagnostics.sorted(), parsed is not None and parsed.has_tests, change, placed)


def diagnostics_of(
    library: Library,
    warnings: WarningOptions = ALL_WARNINGS,
    dialect: Dialect = OWN,
    max_errors: int = MAX_ERRORS,
) -> Diagnostics:
    """Returns what collects the diagnostics of one check; there are no warnings about the library."""
    return Diagnostics((s.path for s in library.sources), options=warnings, dialect=dialect, limit=max_errors)


@contextmanager
def reporting(diagnostics: Diagnostics, sources: Sequence[Source]) -> Iterator[None]:
    """Runs stages. They end early when there are too many errors, or when something is nested too deeply, which is then
    among the diagnostics."""
    with no_collection(), room_for_nesting():
        try:
            try:
                yield
            except NestingError as error:
                diagnostics.nested_too_deeply(error)
            except RecursionError:
                diagnostics.error(sources[0].pos(0), "nesting", "something in the program is nested too deeply")
        except TooManyErrors:
            pass


def _placed(parsed: Parsed, io: Description | None, guests: Sequence[Guest]) -> Placed | None:
    """The stages after the first one, and the lints of each; None if the program cannot be declared."""
    declared = declare(parsed, io, guests)
    if declared is None:
        return None
    checked = check(declared)
    lints.report(lints.CHECKED, checked)
    placed = place(checked)
    lints.report(lints.PLACED, checked)
    return placed


# ---- parsing ----


KnownTree = tuple[ParsedText, list[tuple[int, str, str]]]
"""A syntax tree, and the errors in its text: offset, code and message."""


class Trees:
    """Syntax trees of sources, for several checks of a program of which a few files change."""

    def __init__(self) -> None:
        self._known: dict[tuple[Source, frozenset[str]], KnownTree] = {}

    def parse(self, source: Source, declared: frozenset[str], diagnostics: Diagnostics) -> ParsedText:
        """Returns the tree of a text, and reports the errors in it. `declared`: what {IF defined(pou: NAME)} finds."""
        report = diagnostics.at(source).error
        tree = self._known.get((source, declared)) or self.find(source, declared)
        if tree is not None:
            for error in tree[1]:
                report(*error)
        else:
            reports = list[tuple[int, str, str]]()

            def note(offset: int, code: str, message: str) -> None:
                reports.append((offset, code, message))
                report(offset, code, message)

            tree = parse_all(source, note, declared=declared), reports
            self.made(source, declared, tree)
        if not _has_chart(tree[0]):  # a chart is changed when its unit is declared
            self._known[source, declared] = tree
        return tree[0]

    def find(self, source: Source, declared: frozenset[str]) -> KnownTree | None:
        """Returns the tree of a text that another process has parsed."""
        return None

    def made(self, source: Source, declared: frozenset[str], tree: KnownTree) -> None:
        """Takes a tree that was parsed in this process."""

    def keep(self, sources: Sequence[Source]) -> None:
        """Forgets all trees but those of these sources."""
        wanted = set(sources)
        self._known = {key: tree for key, tree in self._known.items() if key[0] in wanted}


def _has_chart(text: ParsedText) -> bool:
    units = (d for d in text.declarations if isinstance(d, ast.PouDecl))
    return any(part.chart is not None for unit in units for part in (unit, *unit.members))


def parse(
    sources: Sequence[Source],
    library: Library,
    libraries: Sequence[ImportedLibrary],
    diagnostics: Diagnostics,
    trees: Trees,
) -> Parsed:
    """Parses the files of a program. Those of its libraries are parsed as far as `declare` needs them."""
    declared = declared_names_asked_for(library, libraries, sources)
    for source in sources:
        diagnostics.knows(source)
    texts = [(source, trees.parse(source, declared, diagnostics)) for source in sources]
    trees.keep(sources)
    syntax = [d for d in diagnostics.sorted() if d.severity == "error"]
    for source in sources:
        diagnostics.found_by_reader(source)
    return Parsed(texts, library, libraries, diagnostics, syntax)


def declared_names_asked_for(
    library: Library, libraries: Sequence[ImportedLibrary], sources: Sequence[Source]
) -> frozenset[str]:
    """What {IF defined(pou: NAME)} finds in a program."""
    names = [*library.names(), *(name for imported in libraries for name in imported.by_name)]
    return names_asked_for([source.text for source in sources], lambda: names)


def _check_whole_units(parsed: Parsed, guests: Sequence[Guest]) -> None:
    """Errors of the units without syntax errors: a mistake in one hides no others, nor a library that they need.
    What may follow from the broken units waits."""
    found = parsed.diagnostics
    whole: list[tuple[Source, ParsedText]] = []
    hidden: set[str] = set()
    for source, text in parsed.texts:
        hidden |= source.absent
        if source.is_unreadable:
            hidden |= declared_names(source.original or source.text)
            continue
        rest = remaining(source, text.declarations, [d.line for d in parsed.syntax if d.file == source.path])
        hidden |= rest.hidden
        whole.append((source, replace(text, declarations=rest.declarations)))
    others = Diagnostics((s.path for s in parsed.library.sources), dialect=found.dialect, limit=sys.maxsize)
    rest_of = Parsed(whole, parsed.library, parsed.libraries, others, information=parsed.information)
    declared = declare(rest_of, None, guests)
    if declared is not None:
        place(check(declared))
    for d in others.sorted():
        pos = Pos(d.file, d.line, d.column)
        if d.missing and d.missing.casefold() not in hidden:
            found.missing(pos, d.missing, d.message)
        elif d.severity == "error" and not d.missing and is_independent(d, (source for source, _ in whole), hidden):
            found.error(pos, d.code, d.message)


# ---- declaring ----


def declare(
    parsed: Parsed, io: Description | None = None, guests: Sequence[Guest] = (DeviceTasks(),)
) -> Declared | None:
    """Declares all that a program has, used or not. `io`: its inputs and outputs; `guests` take part in the check, and
    one of them decides the tasks. None after an error from which many others would follow."""
    program = Program(
        parsed.library, parsed.libraries, parsed.diagnostics, IoChannels(io), parsed.information, parsed.previous
    )
    world = program.world
    files: Files = [(source, looked_at(source, text, world.diagnostics)) for source, text in parsed.texts]
    participants = [guest.begin(program) for guest in guests]
    for participant in participants:
        files = participant.after_parse(files)
    files = with_instances(files, world.diagnostics)
    for source, declarations in files:
        world.names.register(declarations)
        world.names.register_globals(declarations, source)
    if not _import(program, parsed.sources):
        return None
    _declare_devices(world)
    world.io.begin(world.names, world.diagnostics)
    if not world.io.readable:
        return None
    program.declare_all()
    applications = [participant.after_declare() for participant in participants]
    application = next(a for a in applications if a is not None)
    return Declared(program, application, parsed.sources, participants)


def looked_at(source: Source, text: ParsedText, diagnostics: Diagnostics) -> list[ast.Declaration]:
    """The declarations of a file of the program, when what stands with them has been looked at: pragmas, attributes,
    names."""
    diagnostics.mute(source)
    reports = diagnostics.at(source)
    check_pragmas(text.pragmas, reports)
    check_attributes(text.attributes, text.places, reports)
    check_declarations(text.declarations, source, diagnostics)
    return text.declarations


def _import(program: Program, sources: Sequence[Source]) -> bool:
    """Parses what the program needs of its libraries. False after an error, from which many others would follow."""
    names, diagnostics = program.world.names, program.world.diagnostics
    before = diagnostics.errors
    names.begin_imports(program.libraries)
    needed = needed_parts((source.text for source in sources), program.libraries)
    diagnostics.quiet(part.source.path for _, part in needed)
    declared = declared_names_asked_for(names.library, program.libraries, [part.source for _, part in needed])
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


# ---- checking and placing ----


def check(declared: Declared) -> Checked:
    """Checks all bodies, and those of libraries that they need."""
    declared.program.check_bodies()
    for participant in declared.participants:
        participant.after_check()
    return Checked(declared.program, declared.application, declared.sources)


def check_file(declared: Declared, path: str) -> None:
    """Checks the bodies in one file alone, for an editor that shows their errors at once. `check` then does the rest;
    lints about the whole program come after that."""
    declared.program.check_bodies_in(path)


def place(checked: Checked) -> Placed:
    """Gives variables their offsets and tasks their images of inputs and outputs."""
    program, diagnostics = checked.program, checked.diagnostics
    world, allocation = program.world, program.world.allocation
    allocation.place()
    world.io.finish(allocation, diagnostics)
    for call in allocation.once_placed:
        call()
    _check_sizes(world, checked.sources)
    typed = TypedProgram(
        pous=world.pous,
        globals=allocation.variables,
        tasks=checked.application.tasks,
        area_sizes={area: allocation.sizes.get(area, 0) for area in Area},
        defaults=world.defaults,
        programs=program.programs.declared(),
        startup=program.startup,
        startup_of_new=program.startup_of_new,
        shutdown=program.shutdown,
        events=checked.application.events,
        exports=checked.application.exports,
        aliases=world.names.aliases(),
        accesses=program.config.accesses(),
        constants=world.constants,
        externals=program.external_functions(),
        io=world.io.description,
        may_recurse=program.may_recurse,
        inferred=world.inferred,
        trail=program.trail,
    )
    if not diagnostics.errors:
        plan_images(typed, diagnostics)
    return Placed(checked, typed, None if allocation.stable is None else allocation.stable.change)


def _check_sizes(world: World, sources: Sequence[Source]) -> None:
    for area, size in world.allocation.sizes.items():
        if size > MAX_SIZE and sources:
            world.diagnostics.error(
                sources[0].pos(0), "size", f"the {area.name} area has {size} bytes, which is too large"
            )
