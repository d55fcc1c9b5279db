"""Messages of the Debug Adapter Protocol: JSON after a head that says how long it is."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from typing import Any, BinaryIO

from plctool.errors import UsageError

Message = dict[str, Any]
_MOST_HEAD = 8192  # bytes of a line of the head
_MOST_BODY = 16 << 20


class BadMessage(UsageError):
    """What came is no message; what follows cannot be read either."""


def read_message(stream: BinaryIO) -> Message | None:
    """The next message; None at the end. Raises BadMessage."""
    size = None
    while True:
        line = stream.readline(_MOST_HEAD)
        if not line:
            return None
        if not line.strip():
            if size is None:
                raise BadMessage("A message begins with Content-Length.", "dap")
            break
        name, _, value = line.decode("latin-1").partition(":")
        if name.strip().lower() == "content-length":
            size = _size(value)
    body = stream.read(size)
    if len(body) < size:
        return None
    try:
        message = json.loads(body)
    except (ValueError, RecursionError):
        raise BadMessage("A message is not JSON.", "dap") from None
    if not isinstance(message, dict):
        raise BadMessage("A message is a JSON object.", "dap")
    return message


def _size(text: str) -> int:
    digits = text.strip()
    if not digits.isascii() or not digits.isdigit() or len(digits) > 9 or int(digits) > _MOST_BODY:
        raise BadMessage(f"Content-Length: {digits[:20]} is not a size that is taken.", "dap")
    return int(digits)


class Sender:
    """Writes responses and events, numbered, from any thread."""

    def __init__(self, write: Callable[[bytes], object]) -> None:
        self._write = write
        self._lock = threading.Lock()
        self._number = 0

    def _send(self, message: Message) -> None:
        with self._lock:
            self._number += 1
            body = json.dumps({"seq": self._number, **message}).encode()
            self._write(f"Content-Length: {len(body)}\r\n\r\n".encode() + body)

    def event(self, name: str, body: Message | None = None) -> None:
        self._send({"type": "event", "event": name, "body": body or {}})

    def response(self, request: Message, body: Message | None = None) -> None:
        head = {"type": "response", "request_seq": request.get("seq", 0), "command": request.get("command", "")}
        self._send({**head, "success": True, "body": body or {}})

    def refusal(self, request: Message, message: str) -> None:
        head = {"type": "response", "request_seq": request.get("seq", 0), "command": request.get("command", "")}
        error = {"id": 1, "format": "{text}", "variables": {"text": message}, "showUser": True}
        self._send({**head, "success": False, "message": message, "body": {"error": error}})
