"""The messages of a browser: JSON objects, of which nothing is believed.

`{"do": ..., "id": ...}` with what the verb needs. Each gets a reply with its `id`.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from plctool.errors import UsageError

MAX_MESSAGE = 64 << 10  # bytes
MAX_NAMES = 400  # variables that a browser shows at once
MAX_TEXT = 1000  # characters of a name, a value or a search
VIEWS = ("tasks", "log", "alarms", "io")
_LAST_START = 1 << 31

_FIELDS: dict[str, tuple[str, ...]] = {
    "show": ("names", "views"),
    "children": ("path", "start"),
    "search": ("text",),
    "write": ("name", "text"),
    "force": ("name", "text"),
    "unforce": ("name",),
    "unforce_all": (),
    "start": (),
    "stop": (),
    "reset": (),
    "acknowledge": ("name",),
    "diagrams": (),
    "diagram": ("name",),
    "operate": ("element", "text"),
}


@dataclass(frozen=True)
class Request:
    """What a browser asks for; `fields` are checked."""

    verb: str
    id: int | None
    fields: dict[str, Any]


def id_of(text: str) -> int | None:
    """The number of a message, also of one that is refused."""
    try:
        return _number(json.loads(text), "id")
    except (ValueError, RecursionError, UsageError):
        return None


def parse(text: str) -> Request:
    """Raises UsageError for what is not a request."""
    try:
        message = json.loads(text)
    except (ValueError, RecursionError):
        raise UsageError("The message is not JSON.", "bad-message") from None
    if not isinstance(message, dict):
        raise UsageError("A message is a JSON object.", "bad-message")
    verb = message.get("do")
    if not isinstance(verb, str) or verb not in _FIELDS:
        raise UsageError(f"A message has one of these as 'do': {', '.join(_FIELDS)}.", "bad-message")
    return Request(verb, _number(message, "id"), {name: _CHECKS[name](message, name) for name in _FIELDS[verb]})


def _number(message: Any, name: str) -> int | None:
    value = message.get(name) if isinstance(message, dict) else None
    if value is None:
        return None
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < _LAST_START:
        raise UsageError(f"'{name}' is not a number from 0 to {_LAST_START - 1}.", "bad-message")
    return value


def _start(message: Any, name: str) -> int:
    return _number(message, name) or 0


def _text(message: Any, name: str) -> str:
    value = message.get(name)
    if not isinstance(value, str) or len(value) > MAX_TEXT:
        raise UsageError(f"'{name}' is not a text of at most {MAX_TEXT} characters.", "bad-message")
    return value


def _texts(message: Any, name: str) -> list[str]:
    values = message.get(name, [])
    if not isinstance(values, list) or len(values) > MAX_NAMES:
        raise UsageError(f"'{name}' is not a list of at most {MAX_NAMES} names.", "bad-message")
    return [_text({name: value}, name) for value in values]


def _views(message: Any, name: str) -> list[str]:
    values = _texts(message, name)
    if unknown := [value for value in values if value not in VIEWS]:
        raise UsageError(f"There is no view {unknown[0]}; there are {', '.join(VIEWS)}.", "bad-message")
    return values


_CHECKS = {
    "names": _texts,
    "views": _views,
    "path": _text,
    "start": _start,
    "text": _text,
    "name": _text,
    "element": _start,
}
