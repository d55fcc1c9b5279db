"""The numbers of CiA 301 in words: abort codes, emergency codes, states and device profiles."""

from __future__ import annotations

from enum import IntEnum

LAST_NODE = 127

ABORT_TOGGLE, ABORT_TIMEOUT, ABORT_COMMAND = 0x0503_0000, 0x0504_0000, 0x0504_0001
ABORT_BLOCK_SIZE, ABORT_SEQUENCE, ABORT_CRC, ABORT_MEMORY = 0x0504_0002, 0x0504_0003, 0x0504_0004, 0x0504_0005
ABORT_LENGTH = 0x0607_0010

_ABORTS = {
    ABORT_TOGGLE: "the toggle bit did not change",
    ABORT_TIMEOUT: "the SDO transfer timed out",
    ABORT_COMMAND: "the command is unknown",
    ABORT_BLOCK_SIZE: "the block size is invalid",
    ABORT_SEQUENCE: "the sequence number is invalid",
    ABORT_CRC: "the CRC is wrong",
    ABORT_MEMORY: "out of memory",
    0x0601_0000: "access to the object is not supported",
    0x0601_0001: "the object can only be written",
    0x0601_0002: "the object can only be read",
    0x0602_0000: "the object does not exist",
    0x0604_0041: "the object cannot be mapped to a PDO",
    0x0604_0042: "the mapped objects are longer than a PDO",
    0x0604_0043: "the parameters are incompatible",
    0x0604_0047: "the device is internally incompatible",
    0x0606_0000: "a hardware error prevents the access",
    ABORT_LENGTH: "the data type or length does not match",
    0x0607_0012: "the value is too long for the data type",
    0x0607_0013: "the value is too short for the data type",
    0x0609_0011: "the sub-index does not exist",
    0x0609_0030: "the value is invalid",
    0x0609_0031: "the value is too high",
    0x0609_0032: "the value is too low",
    0x0609_0036: "the maximum is below the minimum",
    0x060A_0023: "the resource is not available",
    0x0800_0000: "general error",
    0x0800_0020: "the value cannot be transferred or stored",
    0x0800_0021: "the value cannot be stored because of local control",
    0x0800_0022: "the value cannot be stored in the present state of the device",
    0x0800_0023: "the object dictionary is missing",
    0x0800_0024: "there is no data",
}

_EMCY = {
    0x0000: "all errors are gone",
    0x1000: "generic error",
    0x2000: "current",
    0x2100: "current, device input side",
    0x2200: "current inside the device",
    0x2300: "current, device output side",
    0x3000: "voltage",
    0x3100: "mains voltage",
    0x3200: "voltage inside the device",
    0x3300: "output voltage",
    0x4000: "temperature",
    0x4100: "ambient temperature",
    0x4200: "device temperature",
    0x5000: "device hardware",
    0x6000: "device software",
    0x6100: "internal software",
    0x6200: "user software",
    0x6300: "data set",
    0x7000: "additional modules",
    0x8000: "monitoring",
    0x8100: "communication",
    0x8110: "CAN overrun, objects lost",
    0x8120: "CAN is error passive",
    0x8130: "heartbeat or guarding error",
    0x8140: "recovered from bus off",
    0x8150: "CAN identifier collision",
    0x8200: "protocol error",
    0x8210: "PDO not processed, too short",
    0x8220: "PDO is longer than its mapping",
    0x8230: "multiplexed PDO not processed, its object is not available",
    0x8240: "SYNC has an unexpected length",
    0x8250: "RPDO timed out",
    0x9000: "external error",
    0xF000: "additional functions",
    0xFF00: "device specific",
}

REGISTER_BITS = ("generic", "current", "voltage", "temperature", "communication", "profile", "reserved", "manufacturer")

_PROFILES = {
    401: "inputs and outputs", 402: "drive", 404: "measuring device", 405: "PLC", 406: "encoder",
    408: "hydraulic valve", 410: "inclinometer", 412: "medical device", 418: "battery", 419: "battery charger",
    447: "special car device",
}  # fmt: skip


class State(IntEnum):
    """The byte of a heartbeat."""

    BOOT_UP = 0x00
    STOPPED = 0x04
    OPERATIONAL = 0x05
    PRE_OPERATIONAL = 0x7F

    def __str__(self) -> str:
        return self.name.lower().replace("_", "-")


def state_text(value: int) -> str:
    """The name of a state; the number of one that CiA 301 does not have."""
    return str(State(value)) if value in set(State) else f"0x{value:02X}"


def abort_text(code: int) -> str:
    """What an abort code means."""
    return f"{_ABORTS.get(code, 'a code that CiA 301 does not define')} ({code:08X})"


def emcy_text(code: int) -> str:
    """What an emergency code means: its own words or those of its class."""
    if code >> 8 == 0xFF:
        return _EMCY[0xFF00]
    known = next((c for c in (code, code & 0xFFF0, code & 0xFF00, code & 0xF000) if c in _EMCY), None)
    return "a code that CiA 301 does not define" if known is None or (code and not known) else _EMCY[known]


def register_text(value: int) -> str:
    """The bits of the error register (1001h)."""
    return ", ".join(name for bit, name in enumerate(REGISTER_BITS) if value >> bit & 1)


def profile_text(device_type: int) -> str:
    """`401 inputs and outputs` of object 1000h."""
    profile = device_type & 0xFFFF
    return f"{profile} {_PROFILES[profile]}" if profile in _PROFILES else str(profile) if profile else ""
