"""An editor as the debug adapter sees it: sends requests, and waits for responses and events."""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Callable
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import Any, Self

from plctool.dap.messages import Message, read_message
from plctool.dap.server import serve

PATIENCE = 60.0  # s


class Refused(Exception):
    """A request was refused, with a sentence."""


class Editor:
    """Sends to `write`; `stream` has what comes back."""

    def __init__(self, write: Callable[[bytes], object], stream: Any) -> None:
        self._write = write
        self._stream = stream
        self._number = 0
        self._inbox: SimpleQueue[Message | None] = SimpleQueue()
        self.events: list[Message] = []
        threading.Thread(target=self._receive, daemon=True).start()

    def _receive(self) -> None:
        while (message := read_message(self._stream)) is not None:
            self._inbox.put(message)
        self._inbox.put(None)

    def send(self, command: str, **arguments: Any) -> int:
        self._number += 1
        message = {"seq": self._number, "type": "request", "command": command, "arguments": arguments}
        body = json.dumps(message).encode()
        self._write(f"Content-Length: {len(body)}\r\n\r\n".encode() + body)
        return self._number

    def request(self, command: str, **arguments: Any) -> Any:
        """The body of the response. Raises Refused."""
        number = self.send(command, **arguments)
        while True:
            message = self._next()
            if message["type"] == "event":
                self.events.append(message)
            elif message["request_seq"] == number:
                if not message["success"]:
                    raise Refused(message["message"])
                return message["body"]

    def event(self, name: str) -> Any:
        """The body of the next event of this name, those before it are kept."""
        for i, message in enumerate(self.events):
            if message["event"] == name:
                return self.events.pop(i)["body"]
        while True:
            message = self._next()
            if message["type"] == "event" and message["event"] == name:
                return message["body"]
            self.events.append(message)

    def _next(self) -> Message:
        try:
            message = self._inbox.get(timeout=PATIENCE)
        except Empty:
            raise AssertionError("the adapter is silent") from None
        assert message is not None, "the adapter has ended"
        return message

    def stopped(self, *places: tuple[str, int]) -> list[tuple[str, int]]:
        """Waits until the program is halted, and returns its calls."""
        thread = self.event("stopped")["threadId"]
        frames = self.request("stackTrace", threadId=thread)["stackFrames"]
        return [(frame["name"], frame["line"]) for frame in frames]

    def scope(self, name: str, frame: int = 1) -> dict[str, str]:
        """The variables of a scope by name."""
        scopes = self.request("scopes", frameId=frame)["scopes"]
        reference = next(s["variablesReference"] for s in scopes if s["name"] == name)
        return {v["name"]: v["value"] for v in self.request("variables", variablesReference=reference)["variables"]}

    def begin(self, kind: str, breakpoints: dict[str, list[Message]], **arguments: Any) -> list[Message]:
        """What an editor does first. Returns what became of the breakpoints."""
        self.request("initialize", adapterID="plctool", linesStartAt1=True)
        self.request(kind, **arguments)
        self.event("initialized")
        found = []
        for path, lines in breakpoints.items():
            found += self.request("setBreakpoints", source={"path": path}, breakpoints=lines)["breakpoints"]
        self.request("configurationDone")
        return found


class InProcess(Editor):
    """An editor of an adapter in this process."""

    def __init__(self) -> None:
        to_adapter, from_editor = os.pipe()
        to_editor, from_adapter = os.pipe()
        self._requests = os.fdopen(from_editor, "wb", buffering=0)
        self._thread = threading.Thread(target=self._serve, args=(to_adapter, from_adapter))
        self._thread.start()
        super().__init__(self._requests.write, os.fdopen(to_editor, "rb"))

    @staticmethod
    def _serve(read: int, write: int) -> None:
        with os.fdopen(read, "rb") as stream, os.fdopen(write, "wb", buffering=0) as out:
            serve(stream, out.write)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._requests.close()
        self._thread.join(PATIENCE)
        self._stream.close()
