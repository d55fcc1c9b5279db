"""The thread that a debugged program runs in: it stays in the middle of a cycle while the program is halted."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from queue import SimpleQueue
from typing import Any

from plctool.errors import UsageError

_POLL = 0.0005  # how often a halt is looked for [s]


class Worker:
    """Runs one call at a time. `is_halted` says whether the program in it is halted."""

    def __init__(self, is_halted: Callable[[], bool]) -> None:
        self._is_halted = is_halted
        self._calls: SimpleQueue[Callable[[], Any] | None] = SimpleQueue()
        self._done = threading.Event()
        self._done.set()
        self._result: Any = None
        self._error: BaseException | None = None
        threading.Thread(target=self._run, name="program", daemon=True).start()

    def _run(self) -> None:
        while (call := self._calls.get()) is not None:
            try:
                self._result = call()
            except BaseException as error:
                self._error = error
            self._done.set()

    @property
    def is_busy(self) -> bool:
        """Whether a call has not returned: its program is halted."""
        return not self._done.is_set()

    def run(self, call: Callable[[], Any]) -> Any:
        """The result of a call; None if its program is halted. Raises what it raises, UsageError while it is halted."""
        self.start(call)
        return self.settle()

    def start(self, call: Callable[[], Any]) -> None:
        """Begins a call, and waits until it has returned, or its program is halted. Raises UsageError while it is."""
        if self.is_busy:
            raise UsageError("The program is halted at a breakpoint; let it go on first.", "halted")
        self._done.clear()
        self._result = None
        self._calls.put(call)
        self.wait()

    def wait(self) -> None:
        """Waits until the call has returned, or its program is halted."""
        while not self._done.wait(_POLL) and not self._is_halted():
            pass

    def settle(self) -> Any:
        """The same; the result of the call, or what it raised."""
        self.wait()
        error, self._error = self._error, None
        if error is not None:
            raise error
        return self._result

    def end(self) -> None:
        """After the program went on for good: ends the thread."""
        with suppress(BaseException):
            self._done.wait()
            self.settle()
        self._calls.put(None)
