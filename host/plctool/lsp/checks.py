"""Checks programs in a thread of their own, so that the editor never waits for one.

The newest text wins: a check whose program has changed ends at the next unit and begins again.
"""

from __future__ import annotations

import gc
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from plctool.compiler import check_with_tests
from plctool.compiler.syntax.diagnostics import Diagnostic
from plctool.errors import PlcError
from plctool.lsp.project import Snapshot

MAX_ERRORS = 10_000  # of a program; the command line stops earlier
_STACK = 64 << 20  # bytes for the nesting of a program
_GARBAGE = 8  # checks after which the memory of the old ones is freed


class Outdated(BaseException):
    """The program has changed while it was checked. Not an Exception, since the compiler reports those as bugs."""


@dataclass
class _Job:
    """`due`: when it may begin, as of time.monotonic."""

    key: object
    make: Callable[[], Snapshot]
    done: Callable[[Snapshot, Sequence[Diagnostic]], None]
    due: float
    failed: Callable[[str], None] = field(default=lambda message: None)


class Checks:
    """`take` runs a function in the thread that owns the programs and returns its result."""

    def __init__(self, take: Callable[[Callable[[], Snapshot]], Snapshot]) -> None:
        self._take = take
        self._jobs: dict[object, _Job] = {}
        self._running: object = None
        self._outdated = False
        self._ends = False
        self._changed = threading.Condition()
        self._count = 0
        old = threading.stack_size(_STACK)
        try:
            self._thread = threading.Thread(target=self._run, name="checks", daemon=True)
            self._thread.start()
        finally:
            threading.stack_size(old)

    def ask(self, job: _Job) -> None:
        """Queues a check. One of the same program that waits keeps its time, one that runs is dropped."""
        with self._changed:
            known = self._jobs.get(job.key)
            if known is not None:
                job.due = min(job.due, known.due)
            self._jobs[job.key] = job
            if self._running is job.key:
                self._outdated = True
            self._changed.notify()

    def drop(self, key: object) -> None:
        """Forgets the checks of a program."""
        with self._changed:
            self._jobs.pop(key, None)
            if self._running is key:
                self._outdated = True

    def stop(self) -> None:
        """Ends the thread; does not wait for it."""
        with self._changed:
            self._ends = self._outdated = True
            self._changed.notify()

    def _run(self) -> None:
        while (job := self._next()) is not None:
            try:
                snapshot = self._take(job.make)
                found = checked(snapshot, self._pause)
            except Outdated:
                continue
            except PlcError as error:
                job.failed(error.message)
                continue
            finally:
                self._finish()
            job.done(snapshot, found)

    def _next(self) -> _Job | None:
        with self._changed:
            while not self._ends:
                now = time.monotonic()
                due = min(self._jobs.values(), key=lambda j: j.due, default=None)
                if due is not None and due.due <= now:
                    self._running, self._outdated = due.key, False
                    return self._jobs.pop(due.key)
                self._changed.wait(None if due is None else due.due - now)
        return None

    def _finish(self) -> None:
        with self._changed:
            self._running = None
        self._count += 1
        if self._count % _GARBAGE == 0:
            gc.collect()

    def _pause(self) -> None:
        if self._outdated:
            raise Outdated


def checked(snapshot: Snapshot, pause: Callable[[], None] | None = None) -> list[Diagnostic]:
    """Returns all diagnostics of a program: those that `plctool check` prints, but for its limit of errors."""
    if not snapshot.sources:
        return list(snapshot.found)
    result = check_with_tests(
        snapshot.sources,
        snapshot.warnings,
        snapshot.load_io,
        snapshot.libraries,
        snapshot.dialect,
        pause,
        MAX_ERRORS,
    )
    return [*snapshot.found, *result.diagnostics]


def job(
    key: object,
    make: Callable[[], Snapshot],
    done: Callable[[Snapshot, Sequence[Diagnostic]], None],
    failed: Callable[[str], None],
    delay: float,
) -> _Job:
    """A check that begins after `delay` seconds."""
    return _Job(key, make, done, time.monotonic() + delay, failed)
