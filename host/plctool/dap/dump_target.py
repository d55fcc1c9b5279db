"""A core dump as a debugger sees it: a program that is halted where it stopped, and does not go on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NoReturn

from plctool.debug.call_frames import StackFrame
from plctool.debug.forced import ForcedPlace
from plctool.debug.halted import BpStatus, Halted
from plctool.debug.symbols import SymbolTable
from plctool.debug.target import DeviceCondition, Target
from plctool.debug.variables import Change, Symbol
from plctool.dump_file import Dump
from plctool.errors import DeviceError, UsageError

_ANY_ROOM = 1 << 30  # what is refused is refused because it is a dump


class HaltedDump(Halted):
    """The calls are those of the dump. It has no variables of the stack: they are shown as "?"."""

    def __init__(self, status: BpStatus, table: SymbolTable, memory: DumpTarget) -> None:
        self._dump = memory.dump
        super().__init__(status, table, memory)

    def frames(self) -> list[StackFrame]:
        e = self._dump.exception
        if e is None:
            return []
        return self._table.debug_info.frames(e.code_offset, e.trace.words, e.trace.link)

    def _stack_bytes(self, symbol: Symbol) -> bytes | None:
        return None


class DumpTarget(Target):
    """What a dump does for a debugger: it shows."""

    def __init__(self, dump: Dump) -> None:
        self.dump = dump

    def attach(self, keep: bool) -> None:
        pass

    def detach(self) -> None:
        pass

    def status(self) -> BpStatus:
        e = self.dump.exception
        addresses = {area.area: area.address for area in self.dump.areas}
        areas = tuple(addresses.get(area, 0) for area in range(1 + max(addresses, default=0)))
        code, task, offset = (e.code, e.task, e.code_offset) if e else (0, 0, None)
        return BpStatus(True, True, True, 1, code, task, offset, 0, 0, areas, 0, 0, _ANY_ROOM, None)

    def halted(self, status: BpStatus, table: SymbolTable) -> Halted:
        return HaltedDump(status, table, self)

    def _refuse(self) -> NoReturn:
        raise UsageError("A dump shows a program at one moment; it does not run and cannot be changed.", "dump")

    def set(self, offset: int, skip: int, condition: DeviceCondition | None) -> None:
        self._refuse()

    def clear(self, offset: int) -> None:
        self._refuse()

    def hits(self) -> dict[int, int]:
        return {}

    def watch(self, places: Sequence[ForcedPlace], offsets: Sequence[int]) -> None:
        self._refuse()

    def temporary(self, offsets: Sequence[int]) -> None:
        self._refuse()

    def go(self, how: int, serial: int) -> None:
        self._refuse()

    def pause(self) -> None:
        pass

    def pass_time(self, seconds: float) -> float:
        return seconds

    def table(self) -> SymbolTable:
        return self.dump.symbols

    def task_names(self) -> list[str]:
        return [task.name for task in self.dump.tasks]

    def read_areas(self, symbols: Sequence[Symbol]) -> list[bytes | None]:
        return [self._read(symbol) for symbol in symbols]

    def _read(self, symbol: Symbol) -> bytes | None:
        try:
            return self.dump.content(symbol)
        except DeviceError:
            return None

    def write_area(self, symbol: Symbol, change: Change) -> None:
        self._refuse()

    def read_stack(self, distance: int, size: int) -> bytes:
        return b""

    def write_stack(self, distance: int, data: bytes) -> None:
        self._refuse()
