"""Data breakpoints: variables whose changes halt a task.

No processor of ours watches an address for a program. The controller compares the variables at traps: before each
statement if there is room for so many traps, else where each POU begins. So the halt comes at the first statement that
starts after the change, and writing the value that a variable has already is not a change.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from plctool.debug.forced import place_of
from plctool.debug.variables import Symbol
from plctool.errors import DeviceError, UsageError
from plctool.iec.types import ArrayType, StructType

if TYPE_CHECKING:
    from plctool.debug.halted import BpStatus, Halted
    from plctool.debug.statements import Statements
    from plctool.debug.target import Target

_SIZES = (1, 2, 4, 8)
EACH_STATEMENT = "each statement"
EACH_CALL = "the first statement of each POU"


@dataclass(frozen=True)
class DataBreakpoint:
    """It halts when the variable changes for the `hits`th time, and after that, if `condition`, as typed, is true
    then."""

    number: int
    symbol: Symbol
    condition: str = ""
    hits: int = 1

    @property
    def name(self) -> str:
        return self.symbol.name


@dataclass(frozen=True)
class Changed:
    """A data breakpoint whose variable changed, and both values as ST writes them."""

    breakpoint: DataBreakpoint
    old: str
    new: str

    def __str__(self) -> str:
        return f"{self.breakpoint.name}: {self.old} -> {self.new}"


def check_watchable(symbol: Symbol) -> None:
    """Raises UsageError for a variable that is not compared."""
    if symbol.fixed is not None:
        raise UsageError(f"{symbol.name} is a constant, which does not change.", "watch")
    if isinstance(symbol.type, StructType | ArrayType) or symbol.size not in _SIZES:
        raise UsageError(
            f"{symbol.name} is a {symbol.type}; a data breakpoint compares 1, 2, 4 or 8 bytes. Name a part of it.",
            "watch",
        )


@dataclass
class Watches:
    """The data breakpoints of a debugger, by number. `granularity`: where the controller compares them."""

    listed: dict[int, DataBreakpoint] = field(default_factory=dict)
    granularity: str = EACH_STATEMENT
    traps: frozenset[int] = frozenset()
    counts: dict[int, int] = field(default_factory=dict)
    _seen: dict[int, bytes | None] = field(default_factory=dict)

    def install(self, target: Target, statements: Statements, status: BpStatus) -> None:
        """Makes the controller compare those that are listed. Raises DeviceError if it has no room."""
        room = status.traps - status.breakpoints
        every, first = statements.stops, set(statements.beginnings)
        # A step needs traps as well.
        self.granularity = EACH_STATEMENT if 2 * len(every) <= room else EACH_CALL
        self.traps = frozenset((every if self.granularity == EACH_STATEMENT else first) if self.listed else ())
        if len(self.traps) > room:
            raise DeviceError(
                f"The controller compares variables at up to {room} places, and the program has {len(self.traps)} "
                "POUs; debug it in the simulator or on plcrt.",
                "too-many-places",
            )
        target.watch([place_of(b.symbol) for b in self.listed.values()], sorted(self.traps))
        contents = target.read_areas([b.symbol for b in self.listed.values()])
        self._seen = dict(zip(self.listed, map(_bits_of, self.listed.values(), contents), strict=True))

    def changed(self, halted: Halted) -> list[Changed]:
        """Those whose variables differ from what they were at the last call, or when they were installed."""
        contents = halted.read([b.symbol for b in self.listed.values()])
        found = []
        for b, content in zip(self.listed.values(), contents, strict=True):
            old, new = self._seen.get(b.number), _bits_of(b, content)
            if new != old and new is not None:
                self._seen[b.number] = new
                found.append(Changed(b, _text(b, old), _text(b, new)))
        return found


def _bits_of(b: DataBreakpoint, content: bytes | None) -> bytes | None:
    """The content without the bits of others."""
    if content is None or b.symbol.bit is None:
        return content
    return (int.from_bytes(content, "little") & 1 << b.symbol.bit).to_bytes(len(content), "little")


def _text(b: DataBreakpoint, content: bytes | None) -> str:
    return "?" if content is None else b.symbol.literal(b.symbol.decode(content))
