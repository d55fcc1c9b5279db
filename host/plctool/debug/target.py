"""What a controller, a simulator or a dump does for a debugger."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from plctool.debug.forced import ForcedPlace
from plctool.debug.halted import BpStatus, Halted, Memory
from plctool.debug.symbols import SymbolTable


@dataclass(frozen=True)
class DeviceCondition:
    """What the controller compares itself: a place, with the value in it, and BP_EQUAL .."""

    place: ForcedPlace
    relation: int
    kind: int


class Target(Memory, Protocol):
    """What a controller does for a debugger."""

    def attach(self, keep: bool) -> None: ...

    def detach(self) -> None: ...

    def status(self) -> BpStatus: ...

    def set(self, offset: int, skip: int, condition: DeviceCondition | None) -> None: ...

    def clear(self, offset: int) -> None: ...

    def hits(self) -> dict[int, int]:
        """How often each breakpoint was met, by its offset."""

    def watch(self, places: Sequence[ForcedPlace], offsets: Sequence[int]) -> None:
        """A task that finds one of these changed, at one of these offsets, halts. In place of all of before."""

    def temporary(self, offsets: Sequence[int]) -> None: ...

    def go(self, how: int, serial: int) -> None: ...

    def pause(self) -> None: ...

    def pass_time(self, seconds: float) -> float:
        """Waits so long, or less, and returns how long; a simulator lets virtual time pass, until the program halts."""

    def table(self) -> SymbolTable: ...

    def halted(self, status: BpStatus, table: SymbolTable) -> Halted:
        """What a halted program shows."""
        return Halted(status, table, self)

    def task_names(self) -> list[str]: ...
