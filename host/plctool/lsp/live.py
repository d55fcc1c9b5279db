"""Values of the controller or simulator that the editor's settings name: for hover, read in a thread of its own."""

from __future__ import annotations

import queue
import threading
import time
from concurrent.futures import Future
from typing import TYPE_CHECKING

from plctool.errors import LinkError, PlcError

if TYPE_CHECKING:
    from plctool.device import Plc

PATIENCE = 0.5  # seconds that a hover waits for a value
_RETRY = 5.0  # seconds before a link that failed is opened again


class Live:
    """Reads variables from a link; their symbols are in the cache, where `plctool build` puts them."""

    def __init__(self, link: str) -> None:
        self.link = link
        self._asked: queue.Queue[str | None] = queue.Queue()
        self._waiting: dict[str, Future[str]] = {}
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="live", daemon=True)
        self._thread.start()

    def ask(self, name: str) -> Future[str]:
        """Returns what will be said of a variable: its value, or why there is none."""
        with self._lock:
            answer = self._waiting.get(name)
            if answer is None:
                answer = self._waiting[name] = Future()
                self._asked.put(name)
            return answer

    def close(self) -> None:
        """Ends the connection when what was asked is answered."""
        self._asked.put(None)

    def _run(self) -> None:
        from plctool.device import connect  # late, so that the server starts quickly

        plc: Plc | None = None
        refused, until = "", 0.0
        while (name := self._asked.get()) is not None:
            try:
                if plc is None and time.monotonic() < until:
                    said = refused
                else:
                    plc = plc or connect(self.link, tool="plctool lsp")
                    said = f"`{name} = {plc.sample([name]).marked_texts[name]}`"
            except PlcError as error:
                said = f"{self.link}: {error.message}"
                if plc is None or isinstance(error, LinkError):
                    refused, until = said, time.monotonic() + _RETRY
                    if plc is not None:
                        plc.close()
                    plc = None
            with self._lock:
                answer = self._waiting.pop(name)
            answer.set_result(said)
        if plc is not None:
            plc.close()
