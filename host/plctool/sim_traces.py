"""Traces of a runtime in this process."""

from __future__ import annotations

from collections.abc import Sequence

from plctool.core import Core, lib
from plctool.link import l7, traces
from plctool.link.traces import TraceState

_TRACE_MESSAGE = 64 * 1024  # bytes of samples at a time


def create_trace(core: Core, config: bytes) -> int:
    """Begins a trace, which stays until it is ended: virtual time is no reason to forget it."""
    kept = bytearray(config)
    kept[core.ffi.offsetof("TRACE_CONFIG", "flags")] |= lib.TRACE_KEEP
    packet, bad, error = core.ffi.new("RTS_UI32 *"), core.ffi.new("RTS_UI32 *"), core.ffi.new("MON_RESULT *")
    result = core.lib.TraceCreate(bytes(kept), len(kept), packet, bad, error)
    if result == lib.ERR_INVALID_REFERENCE:
        raise traces.bad_place(error[0])
    _check(result)
    return int(packet[0])


def delete_trace(core: Core, packet: int) -> None:
    """Ends a trace."""
    _check(core.lib.TraceDelete(packet))


def next_trace(core: Core, packet: int) -> tuple[int, bytes] | None:
    """Returns the number of the trace after `packet` and its configuration."""
    following, size = core.ffi.new("RTS_UI32 *", packet), core.ffi.new("RTS_UI32 *")
    config = core.lib.TraceGetNext(following, size)
    return None if config == core.ffi.NULL else (int(following[0]), bytes(core.ffi.buffer(config, size[0])))


def read_trace(core: Core, packet: int, first: int, sizes: Sequence[int]) -> TraceState:
    """Reads samples from `first` on."""
    data, size = core.ffi.new("RTS_UI8[]", _TRACE_MESSAGE), core.ffi.new("RTS_UI32 *", _TRACE_MESSAGE)
    state = core.ffi.new("TRACE_STATE *")
    _check(core.lib.TraceRead(packet, first, data, size, state))
    packed = bytes(core.ffi.buffer(data, size[0]))
    return traces.decode_state(bytes(core.ffi.buffer(state)), packed, sizes)


def _check(result: int) -> None:
    with traces.explained():
        l7.check_result(result, "trace")
