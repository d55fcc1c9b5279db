"""Which index or value was outside when a program stopped with ARRAYBOUNDS: its variables are as they were.

A check in the code tells the runtime only where it is, so that it takes no more room. What it compared is in the symbol
file, as far as it is a sum of variables that outlive the call.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple
from typing import Any

from plctool.debug.variables import Symbol
from plctool.iec.types import ELEMENTARY, ArrayType, StructType, Type
from plctool.records import dataclass

Read = Callable[[Sequence[Symbol]], Sequence[bytes | None]]


@dataclass(frozen=True)
class Term:
    """`factor` times the variable of the elementary type `type` at `offset`: in an area, or in the instance of the
    block (`area` None)."""

    factor: int
    area: int | None
    offset: int
    type: str


@dataclass(frozen=True)
class BoundsCheck:
    """A check in a line. `block`: the type of the instance that terms and names are in, "" for none; `what`: the array,
    "" for a value that is assigned. The value is the sum of `constant` and the terms in the type `type`; `terms` None:
    it is not known afterwards."""

    file: str
    line: int
    block: str
    what: str
    low: int
    high: int
    type: str
    constant: int
    terms: tuple[Term, ...] | None

    def to_list(self) -> list[Any]:
        """For the symbol file."""
        return [*astuple(self)]

    @staticmethod
    def from_list(entry: list[Any]) -> BoundsCheck:
        file, line, block, what, low, high, of_type, constant, terms = entry
        known = None if terms is None else tuple(Term(*term) for term in terms)
        return BoundsCheck(file, line, block, what, low, high, of_type, constant, known)

    @property
    def needs_instance(self) -> bool:
        return any(term.area is None for term in self.terms or ())

    def symbols(self, instance: Symbol | None) -> list[Symbol]:
        """The variables of the terms, those of the block in this instance."""
        symbols = []
        for term in self.terms or ():
            area, offset = term.area, term.offset
            if area is None:
                assert instance is not None
                area, offset = instance.area, instance.offset + offset
            symbols.append(Symbol("", area, offset, ELEMENTARY[term.type]))
        return symbols

    def value(self, numbers: Sequence[int]) -> int:
        """What was compared, by the values of the terms."""
        assert self.terms is not None
        total = self.constant + sum(t.factor * number for t, number in zip(self.terms, numbers, strict=True))
        t = ELEMENTARY[self.type]
        total &= (1 << t.bits) - 1
        return total - (1 << t.bits) if t.signed and total >> (t.bits - 1) else total

    def text(self, value: int | None = None, instance: Symbol | None = None) -> str:
        """What was outside, and the value if it is known."""
        name = f"{instance.name}.{self.what}" if instance else self.what
        whose = f"the index of {name}" if self.what else "the value"
        return f"{whose} is {'' if value is None else f'{value}, '}outside {self.low}..{self.high}"


def what_was_outside(checks: Sequence[BoundsCheck], variables: Sequence[Symbol], read: Read) -> str:
    """In words, by the checks of the line where the program stopped; "" when nothing can be said."""
    found = [text for check in checks if check.terms is not None and (text := _outside(check, variables, read))]
    if not found and len(checks) == 1:
        return checks[0].text()
    return ", or ".join(found)


def _outside(check: BoundsCheck, variables: Sequence[Symbol], read: Read) -> str:
    """What the check found, if its value is outside. Of several instances it is not known which one ran."""
    cases = [(instance, check.symbols(instance)) for instance in _instances(check, variables)]
    contents = iter(read([symbol for _, symbols in cases for symbol in symbols]))
    found = []
    for instance, symbols in cases:
        data = [(symbol, next(contents)) for symbol in symbols]
        value = check.value([symbol.decode(content) for symbol, content in data if content is not None])
        if not check.low <= value <= check.high:
            found.append(check.text(value, instance))
    return found[0] if len(found) == 1 else check.text() if found else ""


def _instances(check: BoundsCheck, variables: Sequence[Symbol]) -> Iterator[Symbol | None]:
    """Those that the check may have stopped in; None when it does not matter."""
    if not check.needs_instance:
        yield None
        return
    todo = [*reversed(variables)]
    while todo:
        symbol = todo.pop()
        if symbol.type.name == check.block:
            yield symbol
        if isinstance(_element(symbol.type), StructType):
            todo += reversed([*symbol.parts()])


def _element(t: Type) -> Type:
    while isinstance(t, ArrayType):
        t = t.element
    return t
