"""A check that keeps what did not change: after an edit of statements only the bodies of that file are checked again.

What others see of a file is its interface (`Tree.interface`). While that stays the same, the declarations of the last
whole check hold for a new text. The result is shown at once; a whole check later finds what is about the whole program.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from plctool.compiler.base.garbage import no_collection
from plctool.compiler.base.nesting import NestingError, room_for_nesting
from plctool.compiler.base.source import Source
from plctool.compiler.front import looked_at
from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.participants import Files, Participant
from plctool.compiler.semantics.program import Program
from plctool.compiler.semantics.rules.control import report_unused, write_body
from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.sfc_statements import statements_of
from plctool.compiler.semantics.symbols import VarSymbol
from plctool.compiler.semantics.world import BodyQueue
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import MAX_MESSAGE, Diagnostic
from plctool.lsp.outline import UNITS
from plctool.lsp.tree import Tree

_UNUSED = "unused"

_Key = tuple[str, str]
"""A unit and a member of it, or ""."""


class _Recorded(BodyQueue):
    """Remembers the bodies of the program."""

    def __init__(self) -> None:
        super().__init__()
        self.own: dict[str, list[tuple[Scope, ast.PouDecl]]] = {}

    def add(self, scope: Scope, decl: ast.PouDecl) -> None:
        super().add(scope, decl)
        if not scope.library:
            if scope.edges:
                scope = replace(scope, names=scope.names | scope.edges)
            self.own.setdefault(scope.source.path, []).append((scope, decl))


class Observer(Participant):
    """Takes part in a check to remember its program, and to end it when the text has changed."""

    def __init__(self, pause: Callable[[], None]) -> None:
        self._pause = pause
        self.program: Program | None = None
        self.bodies = _Recorded()
        self.keys: dict[int, _Key] = {}
        self.used: set[int] = set()

    def begin(self, program: Program) -> Participant:
        """Takes part in the check of this program."""
        self.program = program
        program.world.pause = self._pause
        program.world.bodies = self.bodies = _Recorded()
        return self

    def after_parse(self, files: Files) -> Files:
        """Remembers which declaration is which."""
        self.keys = {id(decl): key for _, declarations in files for key, decl in _keyed(declarations).items()}
        return files

    def after_declare(self) -> None:
        """Remembers which variables declarations use."""
        scopes = [scope for bodies in self.bodies.own.values() for scope, _ in bodies]
        self.used = {id(symbol) for scope in scopes for symbol in _variables(scope) if symbol.used}


def _variables(scope: Scope) -> Iterator[VarSymbol]:
    return (symbol for symbol in scope.names.values() if isinstance(symbol, VarSymbol))


def _keyed(declarations: Iterable[ast.Declaration]) -> dict[_Key, ast.PouDecl]:
    found: dict[_Key, ast.PouDecl] = {}
    for unit in declarations:
        if isinstance(unit, ast.PouDecl):
            name = unit.full_name.casefold()
            found[name, ""] = unit
            found |= {(name, member.member_key): member for member in unit.members}
    return found


def _with_bodies(declarations: Mapping[_Key, ast.PouDecl]) -> set[_Key]:
    return {key for key, decl in declarations.items() if decl.body}


class Kept:
    """A program as the last whole check without syntax errors has left it, and what that has found."""

    def __init__(self, observer: Observer, sources: Sequence[Source], found: Iterable[Diagnostic]) -> None:
        assert observer.program is not None
        self._program = observer.program
        self._bodies = observer.bodies.own
        self._keys = observer.keys
        self._used = observer.used
        self.sources = {source.path: source for source in sources}
        self._found: dict[str, list[Diagnostic]] = {}
        self._trees: dict[str, Tree] = {}
        self._of_bodies: dict[str, frozenset[Diagnostic]] = {}
        for diagnostic in found:
            self._found.setdefault(diagnostic.file, []).append(diagnostic)

    def changed(self, sources: Sequence[Source]) -> list[Source] | None:
        """Returns the sources with another text; None if there are others than there were."""
        if {source.path for source in sources} != self.sources.keys() or len(sources) != len(self.sources):
            return None
        return [source for source in sources if self.sources[source.path] is not source]

    def _tree(self, path: str) -> Tree:
        if path not in self._trees:
            self._trees[path] = Tree(self.sources[path])
        return self._trees[path]

    def check(self, source: Source) -> list[Diagnostic] | None:
        """Returns the diagnostics of a file whose statements have changed; None if more has changed."""
        if source.pieces or source.findings:
            return None
        before, after = self._tree(source.path), Tree(source)
        if after.has_errors:
            return self._broken(before.source, after)
        if before.interface != after.interface or _attributes(before) != _attributes(after):
            return None
        if not (_is_plain(before) and _is_plain(after)):
            return None
        old = self._bodies.get(source.path, [])
        if source.path not in self._of_bodies:  # what another check of the same text reports again
            again = self._checked(old, before, _Moved(before.source, before.source))
            self._of_bodies[source.path] = frozenset(again)
        decls = _keyed(after.declarations)
        if _with_bodies(_keyed(before.declarations)) != _with_bodies(decls):
            return None  # whether a method has a body belongs to its declaration
        bodies = [(scope, decls.get(self._keys.get(id(decl), ("", "")))) for scope, decl in old]
        if any(
            new is None or bool(new.body) != bool(decl.body) for (_, decl), (_, new) in zip(old, bodies, strict=True)
        ):
            return None
        moved = _Moved(before.source, source)
        found = moved.all(d for d in self._found.get(source.path, ()) if not self._is_of_body(d, before))
        found += self._checked([(scope, decl) for scope, decl in bodies if decl is not None], after, moved)
        return _sorted(found)

    def _broken(self, before: Source, after: Tree) -> list[Diagnostic]:
        """Returns the syntax errors of a file, and what was found outside of the units that have them."""
        broken = _broken_lines(after)
        known = _Moved(before, after.source).all(self._found.get(before.path, ()))
        found = [d for d in known if not any(first <= d.line <= last for first, last in broken)]
        for offset, code, message in after.errors:
            pos = after.source.pos(offset)
            found.append(Diagnostic(pos.file, pos.line, pos.column, "error", code, message[:MAX_MESSAGE]))
        return _sorted(found)

    def _is_of_body(self, diagnostic: Diagnostic, tree: Tree) -> bool:
        """True for what the check of the bodies of a file reports again."""
        if diagnostic.code == _UNUSED:
            return _unit_at(tree, diagnostic) is not None  # else it is about a program that no task runs
        return diagnostic in self._of_bodies[tree.source.path]

    def _checked(self, bodies: Sequence[tuple[Scope, ast.PouDecl]], tree: Tree, moved: _Moved) -> list[Diagnostic]:
        world, source = self._program.world, tree.source
        diagnostics = world.diagnostics
        units = len(world.pous)
        for scope, _ in bodies:
            scope.source = source
            for symbol in _variables(scope):
                symbol.used = id(symbol) in self._used
        with no_collection(), room_for_nesting(), diagnostics.apart(source) as found:
            whole = []
            looked_at(source, tree.parsed, diagnostics)
            for scope, decl in bodies:
                errors = diagnostics.errors
                try:
                    write_body(Checker(world, scope), statements_of(world, decl, scope))
                except NestingError as error:
                    diagnostics.nested_too_deeply(error)
                if diagnostics.errors == errors:
                    whole.append(scope)
            of_bodies = set(found())
            for scope in whole:
                report_unused(scope, world.names.members_in_tests())
            result = [d if d in of_bodies else moved.moved(d) for d in found()]
        del world.pous[units:]
        return [d for d in result if d.file == source.path]

    def while_broken(self, source: Source) -> list[Diagnostic]:
        """Returns what still holds of the last whole check for a file, while a program has syntax errors: all warnings
        of one that has not changed, else those outside of the units with errors."""
        warnings = [d for d in self._found.get(source.path, ()) if d.severity == "warning"]
        before = self.sources.get(source.path)
        if before is None or before is source or source.pieces:
            return warnings if before is source else []
        moved = _Moved(before, source)
        broken = _broken_lines(Tree(source))
        return [d for d in moved.all(warnings) if not any(first <= d.line <= last for first, last in broken)]


def _sorted(found: Iterable[Diagnostic]) -> list[Diagnostic]:
    return sorted(dict.fromkeys(found), key=lambda d: (d.line, d.column, d.severity, d.message))


def _attributes(tree: Tree) -> list[dict[str, str]]:
    """The attributes in a text, which change declarations and are not among its tokens."""
    return [*tree.parsed.attributes.values()]


def _is_plain(tree: Tree) -> bool:
    """True if a text has nothing but units whose bodies are statements."""
    return not any(
        isinstance(d, ast.TestDecl)
        or (isinstance(d, ast.PouDecl) and any(part.chart is not None for part in (d, *d.members)))
        for d in tree.declarations
    )


def _offset(tree: Tree, diagnostic: Diagnostic) -> int:
    starts = tree.source.line_starts
    return starts[min(diagnostic.line, len(starts)) - 1] + diagnostic.column - 1


def _unit_at(tree: Tree, diagnostic: Diagnostic) -> object:
    """The unit that a diagnostic is in, after its name."""
    token = bisect_right(tree.starts, _offset(tree, diagnostic)) - 1
    return next((b for b in tree.blocks if b.kind in UNITS and b.first + 1 < token <= b.last), None)


def _broken_lines(tree: Tree) -> list[tuple[int, int]]:
    """The first and last lines of the outermost blocks with syntax errors."""
    found = []
    for offset, _, _ in tree.errors:
        token = max(0, bisect_right(tree.starts, offset) - 1)
        near = [b for b in tree.blocks if b.first - 1 <= token <= b.last + 1]
        first = min((tree.tokens[b.first].pos for b in near), default=offset)
        last = max((tree.tokens[b.last].end for b in near), default=offset)
        found.append((tree.source.pos(first).line, tree.source.pos(last).line))
    return found


class _Moved:
    """Where lines of a text are after a change of some that follow each other."""

    def __init__(self, before: Source, after: Source) -> None:
        old, new = before.text.split("\n"), after.text.split("\n")
        least = min(len(old), len(new))
        self._same = next((i for i in range(least) if old[i] != new[i]), least)
        tail = next((i for i in range(least - self._same) if old[-1 - i] != new[-1 - i]), least - self._same)
        self._end = len(old) - tail  # the first line of the old text that is the same again, from 0
        self._delta = len(new) - len(old)

    def moved(self, diagnostic: Diagnostic) -> Diagnostic:
        """Returns a diagnostic of the old text at its place in the new one."""
        if diagnostic.line - 1 < self._end or not self._delta:
            return diagnostic
        return replace(diagnostic, line=diagnostic.line + self._delta)

    def all(self, diagnostics: Iterable[Diagnostic]) -> list[Diagnostic]:
        """Returns those outside the lines that have changed."""
        return [self.moved(d) for d in diagnostics if not self._same <= d.line - 1 < self._end]
