"""Faults of simulated devices, as `run --fault`, tests and Python name them."""

from __future__ import annotations

from dataclasses import dataclass

from plctool.core import lib
from plctool.errors import UsageError
from plctool.iec.value_texts import parse_milliseconds

FAULTS = {
    "absent": int(lib.IO_SIM_ABSENT),
    "late": int(lib.IO_SIM_LATE),
    "type": int(lib.IO_SIM_TYPE),
    "answers": int(lib.IO_SIM_ANSWERS),
    "cut": int(lib.IO_SIM_CUT),
}
"""absent: 1, it is not there; late: its data is as old as this [ms], on Modbus it replies so much later; type: 1, it is
another device than the description says; answers: so many next replies are bad, on Modbus with a wrong CRC, on TCP
without their end; cut: of so many next replies only the first half arrives; of a CANopen
network: so many next frames of this controller are destroyed on the bus, which drives it into bus off."""
_MOST = 0xFFFF_FFFF  # of a value


@dataclass(frozen=True)
class Fault:
    """What happens to a simulated device, or to a line; `at_ms`: when, in virtual time. A value of 0 ends it."""

    device: str
    fault: str
    value: int
    at_ms: float


def parse_fault(text: str) -> Fault:
    """DEVICE=FAULT[:VALUE][@TIME]. Raises UsageError."""
    rest, at, time = text.partition("@")
    device, equals, what = rest.partition("=")
    fault, colon, value = what.partition(":")
    is_number = value.isascii() and value.isdecimal()
    if not (device and equals and fault) or (colon and not is_number) or (at and not time):
        raise UsageError(f"'{text}' is not DEVICE=FAULT; write for example Tank=absent or Tank=late:150@T#5s.", "usage")
    check_name(fault)
    if colon and int(value) > _MOST:
        raise UsageError(f"The value of a fault is at most {_MOST}, not {value}.", "bad-value")
    at_ms = parse_milliseconds(time) if at else 0
    if at_ms < 0:
        raise UsageError(f"The time of a fault is counted from the beginning, so it is not negative ({time}).", "time")
    return Fault(device, fault, int(value) if colon else 1, at_ms)


def check_name(fault: str) -> None:
    """Raises UsageError if there is no such fault."""
    if fault not in FAULTS:
        raise UsageError(f"There is no fault '{fault}'; choose one of {', '.join(FAULTS)}.", "bad-fault")
