"""The CAN bus of the simulator: frames between a test and the program (CAN_SEND, CAN_RECEIVE)."""

from __future__ import annotations

from dataclasses import dataclass, field

from plctool.core import Core, lib
from plctool.errors import DeviceError, UsageError

_STANDARD, _EXTENDED = 0x7FF, 0x1FFF_FFFF
_LENGTH = 8


@dataclass(frozen=True)
class CanFrame:
    """A classic CAN frame. `extended`: `id` has 29 bits, not 11; `remote`: asks for data. `time_ns`: virtual time of
    its last bit."""

    id: int
    data: bytes = b""
    extended: bool = False
    remote: bool = False
    time_ns: int = field(default=0, compare=False)


def send_frame(core: Core, frame: CanFrame) -> None:
    """Puts a frame on the simulated bus. Raises UsageError for an identifier or length that no frame has."""
    limit = _EXTENDED if frame.extended else _STANDARD
    if not 0 <= frame.id <= limit:
        hint = "" if frame.extended or frame.id > _EXTENDED else "; give extended=True for one of 29 bits"
        raise UsageError(f"The identifier {frame.id:#x} is not 0 to {limit:#x}{hint}.", "can-frame")
    if len(frame.data) > _LENGTH:
        raise UsageError(f"A CAN frame has at most {_LENGTH} bytes, not {len(frame.data)}.", "can-frame")
    flags = frame.extended * lib.SIM_CAN_EXTENDED | frame.remote * lib.SIM_CAN_REMOTE
    c = core.ffi.new("SIM_CAN_FRAME *", (frame.id, 0, flags, len(frame.data), frame.data))
    if core.lib.SimCanPut(c) != lib.ERR_OK:
        raise DeviceError("Too many frames wait for the bus; let time pass before more are sent.", "can-full")


def take_frames(core: Core) -> list[CanFrame]:
    """The frames that were on the bus since the last call, sent by the device, oldest first."""
    found = []
    c = core.ffi.new("SIM_CAN_FRAME *")
    while core.lib.SimCanGet(c) == lib.ERR_OK:
        extended, remote = (bool(c.flags & flag) for flag in (lib.SIM_CAN_EXTENDED, lib.SIM_CAN_REMOTE))
        found.append(CanFrame(c.id, bytes(c.data[0 : c.size]), extended, remote, 1000 * c.time_us))
    return found
