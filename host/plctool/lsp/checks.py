"""Checks programs in a thread of their own, so that the editor never waits for one.

The newest text wins: a check whose program has changed ends at the next unit and begins again. After an edit of
statements the bodies of that file are checked first; the whole program follows when no key was hit for a while.
"""

from __future__ import annotations

import gc
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

from plctool.compiler import check_with_tests
from plctool.compiler.base.source import Source
from plctool.compiler.front import KnownTree, Trees
from plctool.compiler.kept.tree_cache import trees_of_user
from plctool.compiler.syntax.diagnostics import Diagnostic, Diagnostics
from plctool.compiler.syntax.parser import ParsedText
from plctool.errors import PlcError
from plctool.lsp.incremental import Kept, Observer
from plctool.lsp.project import Project, Snapshot

MAX_ERRORS = 10_000  # of a program; the command line stops earlier
PAUSE = 0.5  # seconds without a key before the whole program is checked
_STACK = 64 << 20  # bytes for the nesting of a program
_IDLE = 2.0  # seconds without a check before memory is freed, which stops all threads for a moment
_GARBAGE, _MUCH_GARBAGE = 200_000, 600_000  # objects made: memory is freed when idle, or at once


class Outdated(BaseException):
    """The program has changed while it was checked. Not an Exception, since the compiler reports those as bugs."""


@dataclass(frozen=True)
class Result:
    """What a check has found. `files`: those that it is about; None for all of the program."""

    snapshot: Snapshot
    found: Sequence[Diagnostic]
    files: frozenset[str] | None = None


@dataclass(frozen=True)
class _Job:
    """`due`: when it may begin, as of time.monotonic; `whole`: it checks the whole program."""

    project: Project
    due: float
    whole: bool


class _Trees(Trees):
    """Notes whether a text has syntax errors. The trees that builds have kept are used; those of what is typed are not
    kept."""

    broken = False

    def __init__(self) -> None:
        super().__init__()
        self._of_builds = trees_of_user()

    def find(self, source: Source, declared: frozenset[str]) -> KnownTree | None:
        """Returns the tree of a text that was built or checked."""
        return self._of_builds.find(source, declared)

    def parse(self, source: Source, declared: frozenset[str], diagnostics: Diagnostics) -> ParsedText:
        before = diagnostics.errors
        text = super().parse(source, declared, diagnostics)
        self.broken |= diagnostics.errors > before or bool(source.absent) or source.is_unreadable
        return text


class _State:
    """What is kept of a program between its checks."""

    def __init__(self) -> None:
        self.trees = _Trees()
        self.kept: Kept | None = None


class Checks:
    """`take` runs a function in the thread that owns the programs and returns its result. `done` and `failed` are
    called in the thread of the checks."""

    def __init__(
        self,
        take: Callable[[Callable[[], Snapshot]], Snapshot],
        done: Callable[[Project, Result], None],
        failed: Callable[[str], None],
    ) -> None:
        self._take = take
        self._done = done
        self._failed = failed
        self._jobs: dict[tuple[Project, bool], _Job] = {}
        self._running: Project | None = None
        self._outdated = False
        self._ends = False
        self._changed = threading.Condition()
        self._states: WeakKeyDictionary[Project, _State] = WeakKeyDictionary()
        old = threading.stack_size(_STACK)
        try:
            self._thread = threading.Thread(target=self._run, name="checks", daemon=True)
            self._thread.start()
        finally:
            threading.stack_size(old)

    def ask(self, project: Project, delay: float) -> None:
        """Queues a check after `delay` seconds. One of the same program that waits keeps its time; one that runs is
        dropped."""
        with self._changed:
            due = time.monotonic() + delay
            known = self._jobs.get((project, False))
            self._jobs[project, False] = _Job(project, min(due, known.due) if known else due, whole=False)
            self._jobs.pop((project, True), None)
            if self._running is project:
                self._outdated = True
            self._changed.notify()

    def drop(self, project: Project) -> None:
        """Forgets the checks of a program."""
        with self._changed:
            self._jobs.pop((project, False), None)
            self._jobs.pop((project, True), None)
            if self._running is project:
                self._outdated = True

    def stop(self) -> None:
        """Ends the thread; does not wait for it."""
        with self._changed:
            self._ends = self._outdated = True
            self._changed.notify()

    # ---- the thread ----

    def _run(self) -> None:
        while (job := self._next()) is not None:
            state = self._states.setdefault(job.project, _State())
            try:
                snapshot = self._take(job.project.snapshot)
                result = None if job.whole else self._quick(state, snapshot)
                if result is None:
                    result = Result(snapshot, self._whole(state, snapshot))
                else:
                    self._later(job.project)
            except Outdated:
                continue
            except PlcError as error:
                self._failed(error.message)
                continue
            finally:
                with self._changed:
                    self._running = None
            self._done(job.project, result)
            if gc.get_count()[0] > _MUCH_GARBAGE:
                gc.collect()

    def _next(self) -> _Job | None:
        with self._changed:
            while not self._ends:
                now = time.monotonic()
                job = min(self._jobs.values(), key=lambda j: j.due, default=None)
                if job is not None and job.due <= now:
                    self._running, self._outdated = job.project, False
                    return self._jobs.pop((job.project, job.whole))
                if job is not None:
                    self._changed.wait(job.due - now)
                elif not self._changed.wait(_IDLE if gc.get_count()[0] > _GARBAGE else None) and not self._ends:
                    gc.collect()
        return None

    def _later(self, project: Project) -> None:
        """Queues the check of the whole program, unless a newer text waits."""
        with self._changed:
            if (project, False) not in self._jobs:
                self._jobs[project, True] = _Job(project, time.monotonic() + PAUSE, whole=True)

    def _pause(self) -> None:
        if self._outdated:
            raise Outdated

    # ---- checks ----

    def _quick(self, state: _State, snapshot: Snapshot) -> Result | None:
        """Checks the bodies of the files that have changed; None if that is not enough."""
        changed = None if state.kept is None else state.kept.changed(snapshot.sources)
        if state.kept is None or not changed:
            return None
        found: list[Diagnostic] = []
        for source in changed:
            of_file = state.kept.check(source)
            if of_file is None:
                return None
            found += of_file
        return Result(snapshot, found, frozenset(source.path for source in changed))

    def _whole(self, state: _State, snapshot: Snapshot) -> list[Diagnostic]:
        observer = Observer(self._pause)
        state.trees.broken = False
        found = checked(snapshot, state.trees, observer)
        if state.trees.broken or observer.program is None:
            known = set(found)
            sources = snapshot.sources if state.kept is not None else ()
            more = [d for source in sources if state.kept for d in state.kept.while_broken(source)]
            return found + [d for d in more if d not in known]
        state.kept = Kept(observer, snapshot.sources, found)
        return found


def checked(snapshot: Snapshot, trees: Trees | None = None, observer: Observer | None = None) -> list[Diagnostic]:
    """Returns all diagnostics of a program: those that `plctool check` prints, but for its limit of errors."""
    if not snapshot.sources:
        return list(snapshot.found)
    result = check_with_tests(
        snapshot.sources,
        snapshot.warnings,
        snapshot.load_io,
        snapshot.libraries,
        snapshot.dialect,
        trees,
        () if observer is None else (observer,),
        MAX_ERRORS,
        snapshot.files.information,
    )
    return [*snapshot.found, *result.diagnostics]
