"""The program of a node by 1F50h to 1F57h (CiA 302-3)."""

from __future__ import annotations

import time
from contextlib import suppress

from plctool.canopen.sdo import SdoAbort, SdoClient
from plctool.errors import DeviceError, PlcError
from plctool.io.canopen.device import REASON

DATA, CONTROL, IDENTIFICATION, STATUS = 0x1F50, 0x1F51, 0x1F56, 0x1F57
STOP, START, CLEAR = 0, 1, 3
_BUSY = 1
_POLL_S = 0.05
_STATUS = {
    1: "it has no valid program",
    2: "the format is unknown",
    3: "the image is damaged or not for this device",
    4: "the flash was not cleared",
    5: "the flash cannot be written",
    6: "the image does not fit",
    7: "the device is protected",
}


def download(client: SdoClient, image: bytes, number: int, *, stops: bool, patience: float) -> None:
    """Replaces the program `number` of a node. `stops`: stops and clears the present one first. Raises DeviceError with
    the reason of the device, LinkError."""
    try:
        if stops:
            _control(client, number, STOP)
            _control(client, number, CLEAR)
        client.write(DATA, number, image)
        _wait(client, number, patience)
        _control(client, number, START)
    except SdoAbort as refused:
        raise _explained(client, number, refused) from None


def identification(client: SdoClient, number: int) -> int | None:
    """The identification of the program, a CRC on controllers of this project; None if the node has none."""
    with suppress(SdoAbort):
        return int.from_bytes(client.read(IDENTIFICATION, number), "little")
    return None


def _control(client: SdoClient, number: int, command: int) -> None:
    client.write(CONTROL, number, bytes([command]))


def _status(client: SdoClient, number: int) -> int | None:
    with suppress(SdoAbort):
        return int.from_bytes(client.read(STATUS, number), "little")
    return None


def _wait(client: SdoClient, number: int, patience: float) -> None:
    """Waits until the flash is written."""
    end = time.monotonic() + patience
    while (status := _status(client, number)) is not None and status & _BUSY:
        if time.monotonic() > end:
            raise DeviceError(
                f"Node {client.node} still writes its flash after {patience:g} s. Give it more with --timeout.",
                "flash-busy",
            )
        time.sleep(_POLL_S)
    error = 0 if status is None else status >> 1 & 0x7F
    if error:
        raise DeviceError(f"Node {client.node} refuses the program: {_words(error)}.", "refused", error)


def _words(error: int) -> str:
    return _STATUS.get(error, f"error {error} of its flash (1F57)")


def _explained(client: SdoClient, number: int, refused: SdoAbort) -> DeviceError:
    """The abort with what the node says of it."""
    reason, error = "", 0
    with suppress(PlcError):
        error = (_status(client, number) or 0) >> 1 & 0x7F
        reason = client.read(REASON, 1).rstrip(b"\0").decode("latin-1")
    if not reason and not error:
        return refused
    if error == 7:
        reason = "it has a password, or its program forbids downloads; use 'plctool flash'"
    return DeviceError(
        f"Node {client.node} refuses the program: {(reason or _words(error)).rstrip('.')}.", "refused", refused.result
    )
