"""Where the keys and values of a TOML text are.

`tomllib` reads the values and refuses what is not TOML, but keeps no positions. A text that it has taken is valid, so
its keys are found by looking at brackets, quotes and equals signs alone.
"""

from __future__ import annotations

import re
import tomllib
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from plctool.files import Pos

Token = tuple[str, int, int]
"""Its kind, or the sign itself; the offsets of its first character and the one after its last."""

Path = tuple[str | int, ...]
"""Keys, and indices of elements, that lead to a value."""

_TOKEN = re.compile(
    r"(?P<space>[ \t\r]+|\#[^\n]*)|(?P<line>\n)|(?P<sign>[\[\]{}=,.])|"
    r"(?P<text>\"\"\"(?:[^\\]|\\.)*?\"{3,5}|'''.*?'{3,5}|\"(?:[^\"\\\n]|\\.)*\"|'[^'\n]*'|[^\s\[\]{}=,.\#\"']+)",
    re.DOTALL,
)
_TOO_LARGE = "a number has at most 64 bits"
_MAX_DEPTH = 100  # brackets within each other, tables that a key names: what reads them calls itself
_LEAST, _LARGEST = -(1 << 63), (1 << 64) - 1
_HINTS = {
    "Invalid value": '; write true, false, a number, or a text in quotes, such as "Main.start" or "main.st"',
    "Cannot overwrite": ": there is one of this name already",
    "Cannot declare": "; of several tables each has two brackets: [[sim]]",
}  # by what tomllib says
_PLACE = re.compile(r" \(at (?:line (\d+), column (\d+)|end of document)\)$")


@dataclass(frozen=True)
class Place:
    """Offsets of a key and of its value; an element of an array has no key but itself."""

    key: int
    value: int


class TomlText:
    """A text with its values and where they are. Raises `BadToml` for what is not TOML."""

    def __init__(self, path: str, text: str) -> None:
        self.path = path
        self.text = text
        self._starts = [0, *(m.end() for m in re.finditer("\n", text))]
        tokens = _tokens(text)
        self._check_depth(tokens)
        try:
            self.values: dict[str, Any] = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            raise BadToml(*self._where(str(error))) from None
        except ValueError:  # Python converts no more digits than these
            longest = max(tokens, key=lambda t: 0 if text[t[1]] in "\"'" else t[2] - t[1])
            raise BadToml(self.pos(longest[1]), _TOO_LARGE) from None
        self._places = _Scanner(text, tokens).places
        self._check_numbers()

    def _check_depth(self, tokens: list[Token]) -> None:
        depth = dots = 0
        for kind, start, _ in tokens:
            depth += (kind in ("[", "{")) - (kind in ("]", "}"))
            dots = dots + (kind == ".") if kind in ("text", ".") else 0
            if dots > _MAX_DEPTH:
                raise BadToml(self.pos(start), f"there are more than {_MAX_DEPTH} dots in a key")
            if depth > _MAX_DEPTH:
                raise BadToml(self.pos(start), f"there are more than {_MAX_DEPTH} brackets within each other")

    def _check_numbers(self) -> None:
        left: list[tuple[Path, Any]] = [((), self.values)]
        while left:
            path, value = left.pop()
            if isinstance(value, dict):
                left += [((*path, key), inner) for key, inner in value.items()]
            elif isinstance(value, list):
                left += [((*path, number), inner) for number, inner in enumerate(value)]
            elif isinstance(value, int) and not _LEAST <= value <= _LARGEST:
                raise BadToml(self.value_pos(path), _TOO_LARGE)

    def _where(self, message: str) -> tuple[Pos, str]:
        match = _PLACE.search(message)
        if match is None or match[1] is None:
            return self.pos(len(self.text.rstrip())), _PLACE.sub("", message)
        return Pos(self.path, int(match[1]), int(match[2])), message[: match.start()]

    def pos(self, offset: int) -> Pos:
        """Line and column of a character."""
        line = bisect_right(self._starts, offset)
        return Pos(self.path, line, offset - self._starts[line - 1] + 1)

    def key_pos(self, path: Path) -> Pos:
        """Where the key of a value is, or the head of a table."""
        return self.pos(self._places[path].key) if path in self._places else Pos(self.path, 1, 1)

    def value_pos(self, path: Path) -> Pos:
        """Where a value is."""
        return self.pos(self._places[path].value) if path in self._places else Pos(self.path, 1, 1)


class BadToml(Exception):
    """A text is not TOML; `message` says so, and why."""

    def __init__(self, pos: Pos, reason: str) -> None:
        self.pos = pos
        hint = next((hint for words, hint in _HINTS.items() if reason.startswith(words)), "")
        self.message = f"this is not TOML: {reason[:1].lower()}{reason[1:]}{hint}"
        super().__init__(self.message)


def _tokens(text: str) -> list[Token]:
    return [
        (m.group() if m.lastgroup == "sign" else str(m.lastgroup), m.start(), m.end())
        for m in _TOKEN.finditer(text)
        if m.lastgroup != "space"
    ]


class _Scanner:
    def __init__(self, text: str, tokens: list[Token]) -> None:
        self._text = text
        self._tokens = tokens
        self._at = 0
        self._counts: dict[Path, int] = {}  # of arrays of tables
        self.places: dict[Path, Place] = {}
        self._document()

    # ---- tokens ----

    @property
    def _kind(self) -> str:
        return self._tokens[self._at][0] if self._at < len(self._tokens) else "end"

    @property
    def _offset(self) -> int:
        return self._tokens[self._at][1] if self._at < len(self._tokens) else len(self._text)

    def _skip_lines(self) -> None:
        while self._kind == "line":
            self._at += 1

    def _keys(self, end: str) -> Iterator[tuple[str, int]]:
        """The parts of a dotted key, each with its offset, up to the sign after it."""
        while self._kind not in (end, "end"):
            if self._kind == "text":
                _, start, stop = self._tokens[self._at]
                (name,) = tomllib.loads(f"{self._text[start:stop]} = 0")
                yield name, start
            self._at += 1

    # ---- the text ----

    def _document(self) -> None:
        table: Path = ()
        while True:
            self._skip_lines()
            if self._kind == "end":
                return
            if self._kind == "[":
                table = self._head()
            else:
                self._pair(table)

    def _head(self) -> Path:
        start = self._offset
        self._at += 1
        is_array = self._kind == "[" and self._offset == start + 1
        self._at += is_array
        names = list(self._keys("]"))
        self._at += 1 + is_array
        path: Path = ()
        for number, (name, offset) in enumerate(names):
            path = (*path, name)
            last = number == len(names) - 1
            self.places.setdefault(path, Place(offset, start if last else offset))
            if last and is_array:
                index = self._counts[path] = self._counts.get(path, -1) + 1
                path = (*path, index)
                self.places[path] = Place(offset, start)
            elif path in self._counts:
                path = (*path, self._counts[path])
            elif last:
                self.places[path] = Place(offset, start)
        return path

    def _pair(self, table: Path) -> None:
        path = table
        names = list(self._keys("="))
        self._at += 1
        for name, offset in names:
            path = (*path, name)
            self.places.setdefault(path, Place(offset, self._offset))
        self._value(path)

    def _value(self, path: Path) -> None:
        kind = self._kind
        if kind == "[":
            self._array(path)
        elif kind == "{":
            self._inline_table(path)
        else:
            while self._kind not in (",", "]", "}", "line", "end"):
                self._at += 1

    def _array(self, path: Path) -> None:
        self._at += 1
        index = 0
        while True:
            self._skip_lines()
            if self._kind in ("]", "end"):
                break
            if self._kind == ",":
                self._at += 1
                continue
            self.places[*path, index] = Place(self._offset, self._offset)
            self._value((*path, index))
            index += 1
        self._at += 1

    def _inline_table(self, path: Path) -> None:
        self._at += 1
        while self._kind not in ("}", "end"):
            if self._kind in (",", "line"):
                self._at += 1
            else:
                self._pair(path)
        self._at += 1
