"""What a trace has recorded: columns of values over time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from plctool.debug.variables import Symbol
from plctool.iec.types import BOOL, ELEMENTARY, Elementary, Kind, Type, base_of
from plctool.iec.value_texts import literal
from plctool.iec.values import decode

_UNITS = {"TIME": "ms", "LTIME": "ns"}


@dataclass(frozen=True)
class Column:
    """A variable, or a value of the system such as `@cycle`; its numbers in `unit`, "" if they have none."""

    name: str
    type: Type
    unit: str = ""
    symbol: Symbol | None = None

    @staticmethod
    def of(name: str, symbol: Symbol) -> Column:
        t = BOOL if symbol.bit is not None else symbol.type
        base = base_of(t)
        return Column(name, t, _UNITS.get(base.name, ""), symbol)

    @property
    def is_bool(self) -> bool:
        return base_of(self.type) is BOOL

    def text(self, number: int | float) -> str:
        """The value as a cell of a table: a number if it is one, else as ST writes it."""
        base = base_of(self.type)
        if not isinstance(base, Elementary) or base.kind in (Kind.BOOL, Kind.BIT, Kind.INT):
            return str(int(number))
        if base.kind is Kind.REAL:
            return literal(self.type, float(number)) if self.symbol else f"{number:.10g}"
        return literal(self.type, decode(base, int(number).to_bytes(base.size, "little", signed=base.signed)))


@dataclass
class Recording:
    """Samples of `columns`, one after the other. `times_ns`: the beginning of the cycle of each, from the start of the
    program. `trigger`: the index of the first sample from the trigger on, None without one. `lost`: how many samples
    between those that are here did not arrive in time. `complete`: all samples that were wanted are here."""

    task: str
    interval_us: int
    columns: list[Column]
    times_ns: list[int] = field(default_factory=list)
    values: list[list[int | float]] = field(default_factory=list)
    trigger: int | None = None
    lost: int = 0
    complete: bool = False

    def __len__(self) -> int:
        return len(self.times_ns)

    @property
    def names(self) -> list[str]:
        return [column.name for column in self.columns]

    @property
    def times_ms(self) -> list[float]:
        """From the trigger on, or from the first sample."""
        if not self.times_ns:
            return []
        begin = self.times_ns[self.trigger if self.trigger is not None and self.trigger < len(self) else 0]
        return [(time - begin) / 1e6 for time in self.times_ns]

    def column(self, name: str) -> list[Any]:
        """The values of one column; BOOL as False and True."""
        index = next((i for i, n in enumerate(self.names) if n.casefold() == name.casefold()), None)
        if index is None:
            raise KeyError(name)
        found = self.values[index]
        return [bool(value) for value in found] if self.columns[index].is_bool else list(found)

    def __getitem__(self, name: str) -> list[Any]:
        return self.column(name)

    def rows(self) -> list[list[str]]:
        """The cells of each sample, the time [ms] first."""
        return self.rows_from(0)

    def rows_from(self, first: int) -> list[list[str]]:
        """The same from a sample on."""
        columns = zip(self.columns, self.values, strict=True)
        texts = [[column.text(v) for v in values[first:]] for column, values in columns]
        times = [f"{time:.10g}" for time in self.times_ms[first:]]
        return [list(row) for row in zip(times, *texts, strict=True)]

    def newest(self, count: int) -> Recording:
        """The last samples."""
        values = [v[-count:] for v in self.values]
        trigger = None if self.trigger is None else self.trigger - max(0, len(self) - count)
        kept = trigger if trigger is not None and trigger >= 0 else None
        return Recording(self.task, self.interval_us, self.columns, self.times_ns[-count:], values, kept, self.lost)

    def document(self) -> dict[str, Any]:
        """For machines."""
        return {
            "task": self.task,
            "interval_us": self.interval_us,
            "trigger": self.trigger,
            "lost": self.lost,
            "complete": self.complete,
            "columns": [{"name": c.name, "type": c.type.name, "unit": c.unit} for c in self.columns],
            "time_ms": self.times_ms,
            "values": {c.name: self.column(c.name) for c in self.columns},
        }


def number_reader(column: Column) -> Callable[[bytes], int | float]:
    """Makes a number of the bytes of a value."""
    symbol = column.symbol
    bit = None if symbol is None or symbol.bit is None else symbol.bit % 8
    if bit is not None:
        return lambda data: data[0] >> bit & 1
    base = base_of(column.type)
    if not isinstance(base, Elementary):
        base = ELEMENTARY[{1: "BYTE", 2: "WORD", 4: "DWORD", 8: "LWORD"}[column.type.size]]
    if base.kind is Kind.REAL:
        return lambda data: float(decode(base, data))
    signed = base.signed
    return lambda data: int.from_bytes(data, "little", signed=signed)
