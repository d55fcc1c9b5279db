"""A table of a description, read key by key: each value is checked where it is read, and what nothing has read is
reported when the table is closed.

All functions report mistakes and go on, so that an engineer sees all of them at once. What they return after a mistake
is the default, or None.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from plctool.errors import UsageError, did_you_mean, listed
from plctool.files import Pos
from plctool.iec.value_texts import parse_nanoseconds
from plctool.io.mistakes import Mistakes
from plctool.io.positions import Path, TomlText

T = TypeVar("T")
_MAX_UNKNOWN = 20  # keys of a table that are reported, each with a hint

_WORDS: dict[type, str] = {
    str: "a text in quotes", int: "a number", float: "a number", bool: "true or false", list: "a list", dict: "a table",
}  # fmt: skip


@dataclass(frozen=True)
class Entry:
    """A key with its value; a value that is a table is a `Table`."""

    key: str
    key_pos: Pos
    value: Any
    pos: Pos


class Table:
    """`name` is what users call it: `modbus.rs485`; `what` the whole file."""

    def __init__(
        self, text: TomlText, path: Path, values: dict[str, Any], mistakes: Mistakes, what: str = "a description"
    ) -> None:
        self._text = text
        self._path = path
        self._values = values
        self._read: set[str] = set()
        self._asked: list[str] = []
        self._what = what
        self.mistakes = mistakes
        self.name = ".".join(str(p) for p in path if isinstance(p, str))
        self.pos = text.value_pos(path) if path else Pos(text.path, 1, 1)

    def __contains__(self, key: str) -> bool:
        return key in self._values

    def keys_of_digits(self) -> list[str]:
        """The keys that are numbers: what TOML makes of `40001.3`."""
        return [key for key in self._values if key.isdigit()]

    # ---- reporting ----

    def error(self, message: str, key: str | None = None) -> None:
        """A mistake at the value of `key`, or at the head of the table."""
        self.mistakes.error(self.pos if key is None else self.value_pos(key), message)

    def value_pos(self, key: str) -> Pos:
        """Where the value of a key is; of one that is missing, the table."""
        return self._text.value_pos((*self._path, key)) if key in self._values else self.pos

    def only_one(self, key: str, other: str) -> bool:
        """Whether not both of two keys are there; reports it if they are."""
        if key not in self._values or other not in self._values:
            return True
        self._read |= {key, other}
        self.error(f"write {key} or {other}, not both", other)
        return False

    def belongs(self, where: str, *keys: str) -> None:
        """Reports those of the keys that are here: they are said elsewhere."""
        for key in keys:
            if key in self._values:
                self._read.add(key)
                self.mistakes.error(self._text.key_pos((*self._path, key)), f"{key} cannot be here: {where}")

    def close(self) -> None:
        """Reports the keys that nothing has asked for."""
        unknown = [key for key in self._values if key not in self._read]
        if len(unknown) > _MAX_UNKNOWN:
            self.error(f"{len(unknown)} keys of {self._title()} are unknown; the first {_MAX_UNKNOWN} are shown")
        for key in unknown[:_MAX_UNKNOWN]:
            known = f"; {self._title()} has {listed(self._asked, 'or')}" if self._asked else ""
            hint = did_you_mean(key, self._asked) or known
            self.mistakes.error(self._text.key_pos((*self._path, key)), f"there is no '{key}' here{hint}")

    def _title(self) -> str:
        return f"[{self.name}]" if self.name else self._what

    # ---- values ----

    def text(self, key: str, default: str | None = None, *, required: str = "") -> str | None:
        """A text. `required`: an example; without a value that is a mistake."""
        return self._value(key, str, default, required)

    def flag(self, key: str, default: bool = False) -> bool:
        """True or false."""
        found = self._value(key, bool, default, "")
        return default if found is None else found

    def number(
        self,
        key: str,
        low: int | None,
        high: int | None,
        default: int | None = None,
        *,
        required: int | None = None,
        unit: str = "",
    ) -> int | None:
        """An integer from `low` to `high`, if the caller does not check it itself. `required`: an example; without a
        value that is a mistake."""
        found = self._value(key, int, default, "" if required is None else str(required))
        if low is None or high is None or key not in self._values or found is None:
            return found
        if not low <= found <= high:
            unit = f" {unit}" if unit else ""
            self.error(f"{key} is {found}{unit}; it can be {low} to {high}{unit}", key)
            return default
        return found

    def duration_us(
        self, key: str, low_us: int, high_us: int, default_us: int | None = None, *, required: str = ""
    ) -> int | None:
        """A duration such as "T#200ms", in microseconds, of whole milliseconds."""
        if type(self._values.get(key)) is int:
            self._ask(key)
            self.error(f'{key} is a number; it has to be a duration: write for example {key} = "T#200ms"', key)
            return default_us
        found = self._value(key, str, None, required)
        if found is None:
            return default_us
        try:
            us, rest = divmod(parse_nanoseconds(found), 1000)
        except UsageError:
            self.error(f"'{found}' is not a duration; write for example \"T#200ms\"", key)
            return default_us
        if not low_us <= us <= high_us:
            self.error(f"{key} is {found}; it can be {_duration(low_us)} to {_duration(high_us)}", key)
            return default_us
        if us % 1000 or rest:
            self.error(f"{key} is {found}; it has to be whole milliseconds", key)
            return default_us
        return us

    def choice(
        self, key: str, choices: Mapping[str, T], default: T | None = None, *, required: bool = False
    ) -> T | None:
        """What one of several words stands for."""
        found = self._value(key, str, None, next(iter(choices)) if required else "")
        if found is None:
            return default
        if found not in choices:
            hint = did_you_mean(found, choices) or f"; it can be {listed(choices, 'or')}"
            self.error(f"{key} cannot be '{found}'{hint}", key)
            return default
        return choices[found]

    def strings(self, key: str) -> list[Entry]:
        """The strings of a list, each with its location; a single one may stand without brackets."""
        self._ask(key)
        found = self._values.get(key, [])
        if isinstance(found, str):
            return [Entry(key, self._text.key_pos((*self._path, key)), found, self.value_pos(key))]
        if not isinstance(found, list):
            self.error(f'{key} is {_word(found)}; it has to be a list such as ["a", "b"]', key)
            return []
        entries = [Entry(key, pos, v, pos) for n, v in enumerate(found) for pos in [self._element_pos(key, n)]]
        for entry in entries:
            if not isinstance(entry.value, str):
                self.mistakes.error(entry.pos, f"this is {_word(entry.value)}; it has to be {_WORDS[str]}")
        return [entry for entry in entries if isinstance(entry.value, str)]

    def _element_pos(self, key: str, number: int) -> Pos:
        return self._text.value_pos((*self._path, key, number))

    def raw(self, key: str) -> Any:
        """The value as TOML has it; None if it is missing. The caller checks it."""
        self._ask(key)
        return self._values.get(key)

    def _value(self, key: str, kind: type[T], default: T | None, required: str) -> T | None:
        self._ask(key)
        if key not in self._values:
            if required:
                example = f'"{required}"' if kind is str else required
                self.error(f"{self._title()} needs {key}: write for example {key} = {example}")
            return default
        found = self._values[key]
        if type(found) is not kind:
            self.error(f"{key} is {_word(found)}; it has to be {_WORDS[kind]}{_unquoted(key, kind, found)}", key)
            return default
        return found

    def _ask(self, key: str) -> None:
        self._read.add(key)
        if key not in self._asked:
            self._asked.append(key)

    # ---- tables in it ----

    def table(self, key: str) -> Table | None:
        """The table of a key; None if there is none."""
        found = self._value(key, dict, None, "")
        return None if found is None else self._inner((key,), found)

    def empty(self, key: str) -> Table:
        """A table without keys, in place of one that is missing."""
        return self._inner((key,), {})

    def tables(self, key: str) -> list[Table]:
        """The tables of `[[key]]`; a single one may be written `[key]`."""
        self._ask(key)
        found = self._values.get(key, [])
        if isinstance(found, dict):
            return [self._inner((key,), found)]
        if not isinstance(found, list) or not all(isinstance(t, dict) for t in found):
            self.error(f"{key} is {_word(found)}; write a table [[{self._inner((key,), {}).name}]] for each", key)
            return []
        return [self._inner((key, number), t) for number, t in enumerate(found)]

    def items(self) -> Iterator[Entry]:
        """All keys with their values, for a table whose keys are names that the engineer gives."""
        for key, value in self._values.items():
            self._read.add(key)
            inner = self._inner((key,), value) if isinstance(value, dict) else value
            path = (*self._path, key)
            yield Entry(key, self._text.key_pos(path), inner, self._text.value_pos(path))

    def channels(self) -> Iterator[tuple[Entry, bool]]:
        """The entries of the tables `in` and `out`, and whether each is an output."""
        for key in ("in", "out"):
            names = self.table(key)
            for entry in names.items() if names is not None else ():
                if entry.key:
                    yield entry, key == "out"
                else:
                    self.mistakes.error(entry.key_pos, "a channel needs a name")

    def _inner(self, path: Path, values: dict[str, Any]) -> Table:
        return Table(self._text, (*self._path, *path), values, self.mistakes, self._what)


def each(tables: Iterable[Table], read: Callable[[Table], T | None]) -> list[T]:
    """What `read` makes of each table, which is then closed; those of which it makes nothing are left out."""
    made = []
    for table in tables:
        found = read(table)
        table.close()
        if found is not None:
            made.append(found)
    return made


def _word(value: object) -> str:
    return _WORDS.get(type(value), "a date")


def _unquoted(key: str, kind: type[object], found: object) -> str:
    """What to write in place of a text that says the right thing in quotes."""
    if kind is int and isinstance(found, str) and re.fullmatch(r"[1-9]\d{0,8}|0", found, re.ASCII):
        return f": write {key} = {found}"
    return ""


def _duration(us: int) -> str:
    return f"T#{us // 1000_000}s" if us and us % 1000_000 == 0 else f"T#{us // 1000}ms"
