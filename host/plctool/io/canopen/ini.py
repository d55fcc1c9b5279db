"""Sections, keys and values of an EDS or DCF with their locations. Doubts become findings; reading goes on."""

from __future__ import annotations

import codecs
from dataclasses import dataclass, field

from plctool.files import Pos
from plctool.io.mistakes import Mistakes

_BOMS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))
_SHOWN = 40  # characters of a name or value in a message


class NotText(ValueError):
    """The bytes are not a text file."""


@dataclass(frozen=True)
class Item:
    """The value after a key."""

    name: str
    value: str
    pos: Pos


@dataclass
class Section:
    """A section; the names of items are case-folded."""

    name: str
    pos: Pos
    items: dict[str, Item] = field(default_factory=dict)

    def get(self, name: str) -> Item | None:
        """An item with a value, None if it is absent or empty."""
        item = self.items.get(name.casefold())
        return item if item is not None and item.value else None


def text_of(data: bytes) -> str:
    """The text of a file: UTF-8, UTF-16 with its mark, or else Windows' Latin-1. Raises NotText."""
    encoding = next((name for mark, name in _BOMS if data.startswith(mark)), "utf-8")
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError:
        text = data.decode("cp1252", "replace") if encoding == "utf-8" else data.decode(encoding, "replace")
    if "\0" in text:
        raise NotText
    return text.replace("\r\n", "\n").replace("\r", "\n")


def shown(text: str) -> str:
    """A part of a file as a message quotes it."""
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."


def read_sections(file: str, text: str, found: Mistakes) -> dict[str, Section]:
    """The sections by case-folded name, in the order of the file."""
    sections: dict[str, Section] = {}
    current: Section | None = None
    reading = True  # False: until the next section
    for number, line in enumerate(text.split("\n"), 1):
        words = line.strip()
        pos = Pos(file, number, len(line) - len(line.lstrip()) + 1)
        if not words or words[0] in ";#":
            continue
        if words[0] == "[":
            current = _section(sections, words, pos, found)
            reading = current is not None
        elif current is not None:
            _add_item(current, words, pos, line, found)
        elif reading:
            found.warning(pos, f"'{shown(words)}' is before the first section and is ignored.")
            reading = False
    return sections


def _section(sections: dict[str, Section], words: str, pos: Pos, found: Mistakes) -> Section | None:
    name, bracket, _ = words[1:].partition("]")
    name = name.strip()
    if not bracket or not name:
        found.error(pos, f"'{shown(words)}' is not a section; write [NAME]. Its lines are ignored.")
        return None
    first = sections.get(name.casefold())
    if first is not None:
        found.warning(pos, f"section [{shown(name)}] begins at line {first.pos.line}; the two are read as one.")
        return first
    return sections.setdefault(name.casefold(), Section(name, pos))


def _add_item(section: Section, words: str, pos: Pos, line: str, found: Mistakes) -> None:
    name, equals, value = words.partition("=")
    if not equals or not name.strip():
        found.warning(pos, f"'{shown(words)}' is not KEY=VALUE and is ignored.")
        return
    column = line.index("=") + 2 + len(value) - len(value.lstrip())
    item = Item(name.strip(), value.strip(), Pos(pos.file, pos.line, column))
    first = section.items.setdefault(item.name.casefold(), item)
    if first is not item and first.value != item.value:
        found.warning(pos, f"{shown(item.name)} has a value at line {first.pos.line} already; that one is used.")
