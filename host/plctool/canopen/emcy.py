"""Emergency messages: a code, the error register and five bytes of the manufacturer."""

from __future__ import annotations

from dataclasses import dataclass

from plctool.canopen.bus import EMCY, FRAME_BYTES, Frame
from plctool.canopen.words import LAST_NODE


@dataclass(frozen=True)
class Emergency:
    """An emergency message; code 0: the errors are gone."""

    node: int
    code: int
    register: int
    data: bytes


def emergency_of(frame: Frame) -> Emergency | None:
    """The message in a frame with one of the default identifiers, None for other frames."""
    node = frame.identifier - EMCY
    if not 1 <= node <= LAST_NODE or len(frame.data) != FRAME_BYTES:
        return None
    return Emergency(node, int.from_bytes(frame.data[:2], "little"), frame.data[2], frame.data[3:])
