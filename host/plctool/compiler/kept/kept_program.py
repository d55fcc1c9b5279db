"""A checked program that stays in a process: after a change of statements only the changed bodies are checked again.

What is kept is used only while the result is the one that a check of everything would have: the declarations are the
same, and the changed body asks for the same functions, variables and types as before, in the same order. Everything
else, and each program with something that is not looked at here, is checked as a whole.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

from plctool.compiler.base.garbage import no_collection
from plctool.compiler.base.nesting import NestingError, room_for_nesting
from plctool.compiler.base.source import Source
from plctool.compiler.front import CheckResult, Trees, declared_names_asked_for, place
from plctool.compiler.semantics import lints
from plctool.compiler.semantics.body_records import BodyRecord, BodyRecords, unused_variables
from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.construction import Construction, construct_new
from plctool.compiler.semantics.participants import Files, Participant
from plctool.compiler.semantics.program import Program
from plctool.compiler.semantics.rules.control import write_body
from plctool.compiler.semantics.stable_places import StablePlaces
from plctool.compiler.semantics.stages import Checked
from plctool.compiler.semantics.symbols import VarSymbol
from plctool.compiler.semantics.trail import lets_out
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.changed_body import changed_body, words_asked_for
from plctool.compiler.syntax.diagnostics import Diagnostics, TooManyErrors
from plctool.compiler.typed.nodes import (
    Call,
    Const,
    FbCall,
    MemberPlace,
    Pou,
    Storage,
    VarPlace,
)
from plctool.compiler.typed.online_change import Previous
from plctool.compiler.typed.typed_nodes import walk
from plctool.iec.types import BOOL


class Observer(Participant):
    """Takes part in a check of everything to remember the program. Each is for one check."""

    def __init__(self) -> None:
        self.records = BodyRecords()
        self.files: Files = []
        self.declared = self.reported = 0
        self.offsets: list[int] = []
        self._program: Program | None = None

    def begin(self, program: Program) -> Participant:
        """Takes part in the check of this program."""
        self._program = program
        program.records = self.records
        return self

    def after_parse(self, files: Files) -> Files:
        """Remembers the declarations of each file."""
        self.files = files
        return files

    def after_check(self) -> None:
        """Remembers what lints and places are added to."""
        assert self._program is not None
        world = self._program.world
        self.reported = world.diagnostics.count
        self.offsets = [variable.offset for variable in world.allocation.variables]


class KeptProgram:
    """The program of the last check. It serves until one of its checks returns None."""

    def __init__(self, observer: Observer, result: CheckResult) -> None:
        assert result.placed is not None
        self._checked = result.placed.checked
        self._records = observer.records
        self._files = {source.path: (source, decls) for source, decls in observer.files}
        self._offsets = observer.offsets
        self._found = self._checked.diagnostics.since(0)[: observer.reported]
        self._startup_of_new = result.placed.program.startup_of_new
        self._has_tests = result.has_tests
        self.changed: list[Pou] = []  # the units whose bodies the last check has checked again

    @staticmethod
    def may_be_kept(result: CheckResult) -> bool:
        """True if all that depends on bodies is known here."""
        if result.placed is None or not result.ok:
            return False
        program = result.placed.checked.program
        world = program.world
        return not (
            program.libraries
            or program.trail is not None
            or world.io.description is not None
            or world.pools
            or world.closers
            or world.inferred
            or world.clock
            or world.allocation.once_placed
            or result.placed.program.accesses
        )

    def check(self, sources: Sequence[Source], previous: Previous | None, trees: Trees) -> CheckResult | None:
        """Returns what a check of everything would find; None if that is not known. `previous`: the program that the
        last check has made, or None if none has to be replaced."""
        if [source.path for source in sources] != list(self._files) or self._startup_of_new is not None:
            return None
        with no_collection(), room_for_nesting():
            try:
                return self._check_again(sources, previous, trees)
            except (NestingError, RecursionError, TooManyErrors):
                return None

    def _check_again(self, sources: Sequence[Source], previous: Previous | None, trees: Trees) -> CheckResult | None:
        program, diagnostics = self._checked.program, self._checked.diagnostics
        declared = declared_names_asked_for(program.world.names.library, (), sources)
        self.changed = []
        diagnostics.begin_again(self._found)
        for source in sources:
            if source != self._files[source.path][0] and not self._check_file(source, declared, trees):
                return None
        trees.keep(sources)  # a tree of an older text may have statements of a newer one now
        self._found = diagnostics.since(0)
        checked = Checked(program, self._checked.application, sources)
        lints.report(lints.CHECKED, checked)
        if not self._place_again(previous):
            return None
        placed = place(checked)
        lints.report(lints.PLACED, checked)
        if diagnostics.errors:
            return None
        return CheckResult(placed.program, diagnostics.sorted(), self._has_tests, placed.change, placed)

    def _place_again(self, previous: Previous | None) -> bool:
        allocation = self._checked.program.world.allocation
        allocation.stable = None if previous is None else StablePlaces(previous)
        allocation.sizes = dict.fromkeys(allocation.sizes, 0)
        if len(allocation.variables) != len(self._offsets):
            return False
        for variable, offset in zip(allocation.variables, self._offsets, strict=True):
            variable.offset = offset
        return construct_new(self._checked.program.world) is None

    # ---- a changed file ----

    def _check_file(self, source: Source, declared: frozenset[str], trees: Trees) -> bool:
        before, decls = self._files[source.path]
        reading = Diagnostics()
        text = trees.parse(source, declared, reading)
        if reading.errors:
            return False
        bodies = changed_body(before, decls, source, text.declarations)
        record = None if bodies is None else self._records.of(bodies[0])
        if bodies is None or record is None or not self._is_plain(record, source.path):
            return False
        old, new = bodies
        local = {name for names in (record.scope.names, record.scope.outer) for name, symbol in names.items()
                 if isinstance(symbol, VarSymbol)}  # fmt: skip
        if words_asked_for(before, old, local) != words_asked_for(source, new, local):
            return False
        if not self._check_body(record, source, new):
            return False
        old.body = new.body
        for decl in _parts(decls):
            decl.source = source
        self._files[source.path] = source, decls
        return True

    def _is_plain(self, record: BodyRecord, path: str) -> bool:
        """True if nothing but the check of a body itself depends on it."""
        world, pou = self._checked.program.world, record.scope.pou
        if pou is None or record.scope.library or world.dispatches.calls_of(pou) or lets_out(pou):
            return False
        own = set(record.found)
        line = record.scope.pos(record.decl.body[0].pos).line
        return not any(d.file == path and d.line >= line and d not in own for d in self._found)

    def _check_body(self, record: BodyRecord, source: Source, decl: ast.PouDecl) -> bool:
        """Checks the new body of a unit. False if it asks for something else than the old one."""
        world, scope = self._checked.program.world, record.scope
        pou = scope.pou
        assert pou is not None
        diagnostics, own = world.diagnostics, set(record.found)
        diagnostics.begin_again(d for d in diagnostics.since(0) if d not in own)
        asked, called, extent = _asked_for(pou), world.calls.of(pou), world.extent
        hidden = [v.type for v in pou.locals[len(record.declared) :]]
        loops = [number for number, (unit, _) in enumerate(world.loops) if unit is pou]
        symbols = [s for s in (*scope.names.values(), *scope.outer.values()) if isinstance(s, VarSymbol)]
        for symbol in symbols:
            if id(symbol) in record.used:
                symbol.used = False
        units, count, unused = len(world.pous), diagnostics.count, unused_variables(scope)
        world.calls.forget(pou)
        pou.locals[:] = record.declared
        scope.source = source
        at = loops[0] if loops else len(world.loops)
        rest = [loop for loop in world.loops if loop[0] is not pou]
        world.loops[:] = rest
        write_body(Checker(world, scope), decl.body)
        new_loops, world.loops[:] = world.loops[len(rest) :], rest
        world.loops[at:at] = new_loops
        del world.pous[units:]
        used = {id(symbol) for symbol in unused if symbol.used}
        if (
            diagnostics.errors
            or used != record.used
            or world.extent != extent
            or world.calls.of(pou) != called
            or _asked_for(pou) != asked
            or hidden != [v.type for v in pou.locals[len(record.declared) :]]
            or world.dispatches.calls_of(pou)
            or lets_out(pou)
        ):
            return False
        first = Construction(world, pou, Const(1, BOOL, pou.pos))
        if any(first.variable(variable) for variable in list(pou.locals)):
            return False
        record.found = diagnostics.since(count)
        self.changed.append(pou)
        return True


def _parts(decls: Collection[ast.Declaration]) -> Iterator[ast.PouDecl]:
    """The units of a file, and their members."""
    for decl in decls:
        if isinstance(decl, ast.PouDecl):
            yield decl
            yield from decl.members


def _asked_for(pou: Pou) -> list[object]:
    """What a body names that is not its own, in the order in which it does first."""
    found: dict[object, None] = {}
    for node in walk(pou.body):
        if isinstance(node, Call):
            found[node.function, node.dispatch] = None
        elif isinstance(node, FbCall):
            found[node.block, node.dispatch, tuple(variable for variable, _ in node.inputs)] = None
        elif isinstance(node, MemberPlace):
            found[node.base.type, node.offset] = None
        elif isinstance(node, VarPlace) and node.var.storage is Storage.AREA and not _is_own(node, pou):
            found[node.var] = None
    return list(found)


def _is_own(node: VarPlace, pou: Pou) -> bool:
    """True for a variable that a PROGRAM declares itself."""
    return node.var.name.startswith(f"{pou.name}.")
