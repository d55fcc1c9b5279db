"""Variables in the memory of a runtime in this process: where they are, and what is forced."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from plctool.core import Core, lib
from plctool.debug.forced import ForcedPlace, ForceList
from plctool.debug.variables import Symbol, unreachable
from plctool.errors import DeviceError
from plctool.iec.areas import Area
from plctool.link import l7


class SimVariables:
    """The variables of the program in a runtime."""

    def __init__(self, core: Core) -> None:
        self._ffi, self._lib = core.ffi, core.lib

    def area(self, area: Area, offset: int, size: int) -> memoryview:
        """Bytes of an area, to read and to write, until the runtime is given back."""
        return memoryview(self._ffi.buffer(self._lib.AppGetAreaAddress(area.value, offset, size), size))

    def c_place(self, place: ForcedPlace) -> Any:
        """Returns the place as an APP_PLACE of this runtime."""
        c = self._ffi.new("APP_PLACE *")
        c.area, c.pointers, c.size, c.mask = place.area, len(place.hops), place.size, place.mask
        c.offset[0 : 1 + len(place.hops)] = [place.offset, *place.hops]
        return c

    def writable(self, symbol: Symbol) -> Any:
        """Its memory. Raises DeviceError if a pointer leads to none, UsageError if it is a constant."""
        place = self.place(symbol)
        symbol.check_writable(symbol.area if place is None else place[0])
        memory = self.memory(symbol)
        if memory is None:
            raise unreachable(symbol, self.content)
        return memory

    def content(self, symbol: Symbol) -> bytes | None:
        """Returns its bytes, None if a pointer to it leads to no variable."""
        if symbol.fixed is not None:
            return symbol.fixed
        memory = self.memory(symbol)
        return None if memory is None else bytes(memory)

    def memory(self, symbol: Symbol) -> Any:
        """A variable as a writable buffer; None when a pointer to it leads to none."""
        place = self.place(symbol)
        address = self._ffi.NULL if place is None else self._lib.AppGetAreaAddress(*place, symbol.size)
        if address != self._ffi.NULL:
            return self._ffi.buffer(address, symbol.size)
        if symbol.pointer is not None:
            return None
        if symbol.name.startswith("%"):
            raise DeviceError(f"The program has no memory at {symbol.name}.", "no-memory")
        raise DeviceError(
            f"{symbol.name} is not in the memory of the program; the symbols do not belong to it.", "wrong-symbols"
        )

    def place(self, symbol: Symbol) -> tuple[int, int] | None:
        """Area and offset."""
        if symbol.pointer is None:
            return symbol.area, symbol.offset
        held = self.memory(symbol.pointer)
        area, offset = self._ffi.new("RTS_UI32 *"), self._ffi.new("RTS_UI32 *")
        if held is None or not self._lib.AppFindArea(int.from_bytes(held[:], "little"), area, offset):
            return None
        return area[0], offset[0] + symbol.offset

    # ---- forced ----

    def force(self, changes: Sequence[tuple[Symbol, ForcedPlace]]) -> None:
        """Forces all, or none. Raises DeviceError if one cannot be forced."""
        listed = self.forces()
        new = [p for _, p in changes if not any(p.same_place(old) for old in listed.places)]
        if len(listed.places) + len(new) > listed.room:
            _check_monitoring(lib.MONITORING_ERR_FORCE_FAILED)
        for symbol, place in changes:
            self.writable(symbol)
            if len(place.hops) > lib.PLACE_POINTERS:
                _check_monitoring(lib.MONITORING_ERR_NESTING_DEPTH)
            _check_monitoring(self._lib.ForceCheck(self.c_place(place), self._ffi.new("RTS_UI32 *")))
        for _, place in changes:
            value = self._ffi.from_buffer("RTS_UI32[2]", place.value.ljust(8, b"\0"))
            _check_monitoring(self._lib.ForceSet(self._ffi.new("FORCED_VALUE *", [self.c_place(place)[0], value])))

    def unforce(self, places: Sequence[ForcedPlace]) -> None:
        """Ends the force of these places."""
        for place in places:
            self._lib.ForceEnd(self.c_place(place))

    def forces(self) -> ForceList:
        """Returns what is forced."""
        forced = (self._lib.ForceGet(index) for index in range(self._lib.ForceGetCount()))
        return ForceList(self._lib.ForceGetSerial(), self._lib.ForceGetRoom(), [_forced_place(f) for f in forced])


def _forced_place(forced: Any) -> ForcedPlace:
    p = forced.place
    offset, *hops = p.offset[0 : 1 + p.pointers]
    value = (forced.value[0] | forced.value[1] << 32).to_bytes(8, "little")[: p.size]
    return ForcedPlace(p.area, offset, tuple(hops), p.size, p.mask, value)


def _check_monitoring(result: int) -> None:
    if result != lib.MONITORING_ERR_OK:
        name = l7.monitoring_error_name(result)
        raise DeviceError(f"The simulator refused the force: {name}.", l7.slug(name), result)
