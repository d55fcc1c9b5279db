"""Which name leads to which page."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence

from plctool.doc.model import Item

_NAME = re.compile(r"[^\W\d]\w*(?:\.[^\W\d]\w*)*")
_UNSAFE = re.compile(r"[^\w.-]")


class Links:
    """Pages and members by their names, in any case of their letters."""

    def __init__(self, items: Sequence[Item], suffix: str) -> None:
        self._suffix = suffix
        self._stems = dict(_stems(items))
        self._found: dict[str, str] = {}
        for item in reversed(items):
            self._add(item)

    def _add(self, item: Item) -> None:
        page = self.page(item)
        for member in item.members:
            self._found[f"{item.name}.{member.name}".casefold()] = f"{page}#{anchor(member.name)}"
        self._found[item.name.rpartition(".")[2].casefold()] = page
        self._found[item.name.casefold()] = page

    def stem(self, item: Item) -> str:
        """The name of its files, without a suffix."""
        return self._stems[id(item)]

    def page(self, item: Item) -> str:
        """The file of its page."""
        return self.stem(item) + self._suffix

    def to(self, name: str) -> str | None:
        """Where a name leads; None if it is not one of these pages."""
        return self._found.get(name.strip().removesuffix("()").casefold())

    def targets(self, text: str) -> list[str]:
        """Where the names in a type lead."""
        return [target for match in _NAME.finditer(text) if (target := self.to(match[0])) is not None]

    def linked(self, text: str, plain: Callable[[str], str], link: Callable[[str, str], str]) -> str:
        """A type or an expression, with links for the names in it that have pages."""
        made: list[str] = []
        at = 0
        for match in _NAME.finditer(text):
            if (target := self.to(match[0])) is not None:
                made += [plain(text[at : match.start()]), link(match[0], target)]
                at = match.end()
        return "".join([*made, plain(text[at:])])


def anchor(name: str) -> str:
    """The fragment of a member."""
    return _UNSAFE.sub("-", name)


def _stems(items: Iterable[Item]) -> Iterator[tuple[int, str]]:
    """A file name for each item: file systems may not tell cases apart, and index is the first page."""
    taken = {"index"}
    for item in items:
        wanted = _UNSAFE.sub("-", item.name) or "page"
        stem, number = wanted, 2
        while stem.casefold() in taken:
            stem, number = f"{wanted}-{number}", number + 1
        taken.add(stem.casefold())
        yield id(item), stem
