"""Which addresses a Modbus device has, and where a variable lies in its registers."""

from __future__ import annotations

from dataclasses import dataclass

from plctool.core import lib
from plctool.iec.types import BOOL, ArrayType, Elementary, Kind, StringType, StructType, Type, base_of
from plctool.io.model import Channel, bits_of, holds_bools

COILS, DISCRETE = int(lib.MODBUS_COILS), int(lib.MODBUS_DISCRETE_INPUTS)
HOLDING, INPUT = int(lib.MODBUS_HOLDING_REGISTERS), int(lib.MODBUS_INPUT_REGISTERS)
REGISTER_BITS = int(lib.MODBUS_REGISTER_BITS)
LAST_ADDRESS = 65535  # on the wire
TABLE_NAMES = {COILS: "coils", DISCRETE: "discrete inputs", INPUT: "input registers", HOLDING: "holding registers"}
_PREFIX = {COILS: 0, DISCRETE: 1, INPUT: 3, HOLDING: 4}


# ---- addresses -------------------------------------------------------------------------------------------------------


def wire_address(reference: int, table: int) -> int | None:
    """The address on the wire of a reference such as 40001; None if it is not one of this table."""
    prefix = _PREFIX[table]
    if prefix == 0:
        return reference - 1 if 1 <= reference <= LAST_ADDRESS + 1 else None
    for base, last in ((prefix * 10000, 9999), (prefix * 100000, LAST_ADDRESS + 1)):
        if base < reference <= base + last:
            return reference - base - 1
    return None


def place_of_reference(reference: int) -> tuple[int, int] | None:
    """The table and the address on the wire of a reference, whose first digit says which table it is of; None if there
    is none. Coils are those up to 9999."""
    tables = (table for table in (INPUT, HOLDING, DISCRETE, COILS) if table != COILS or reference <= 9999)
    return next(((table, at) for table in tables if (at := wire_address(reference, table)) is not None), None)


def reference_of(address: int, table: int) -> int:
    """The reference of an address on the wire, in its short form if there is one."""
    prefix = _PREFIX[table]
    return prefix * (10000 if address < 9999 else 100000) + address + 1


def first_reference(table: int) -> int:
    """The reference of the first one of a table, in its short form."""
    return reference_of(0, table)


def wrong_reference(text: str, table: int) -> str:
    """What to say about a reference that is not one of this table."""
    first = first_reference(table)
    last = LAST_ADDRESS + 1 if first == 1 else first + 9998
    return (
        f"{text} is not the address of {TABLE_NAMES[table]}: they are {first} to {last}, and wire = 0 is the first one"
    )


# ---- variables -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Order:
    """In which order the bytes of a number ABCD come: A is its highest."""

    high_register_first: bool
    high_byte_first: bool


ORDERS = {
    "ABCD": Order(True, True),
    "CDAB": Order(False, True),
    "BADC": Order(True, False),
    "DCBA": Order(False, False),
}


def element_size(t: Type) -> int:
    """The bytes of one number of a type: 2, 4 or 8; 1 for BOOL and numbers of a byte, which have a register of their
    own; 0 for strings and arrays of bytes, whose bytes follow each other, and -1 for what registers cannot have."""
    t = base_of(t)
    if isinstance(t, ArrayType):
        inner = element_size(t.element)
        return {1: -1 if base_of(t.element) is BOOL else 0, 0: -1}.get(inner, inner)
    if isinstance(t, StringType):
        return 2 if t.wide else 0
    if isinstance(t, StructType):
        return -1
    return 1 if bits_of(t) == 1 else t.size


def registers_of(t: Type) -> int:
    """How many registers a variable takes."""
    return 1 if element_size(t) == 1 else -(-t.size // 2)


def registers_of_number(t: Type) -> int:
    """How many registers are one number, of which none may be written alone; DWORD and LWORD are words of bits."""
    inner = base_of(t)
    while isinstance(inner, ArrayType):
        inner = base_of(inner.element)
    is_number = isinstance(inner, Elementary) and inner.kind is not Kind.BIT
    return max(1, element_size(t) // 2) if is_number else 1


def fits_coils(t: Type) -> bool:
    """Whether coils can have a variable: all its bits in memory are its value. An array of BOOL has a byte for each
    element, a structure and a string have bytes that mean nothing."""
    inner = base_of(t)
    while isinstance(inner, ArrayType):
        inner = base_of(inner.element)
    return isinstance(inner, Elementary) and not holds_bools(t)


def cannot_have(channel: Channel, what: str) -> str:
    """What to say about a variable that coils or registers cannot have."""
    t = channel.variable_type
    hint = "use registers" if isinstance(t, StringType) else "name its elements"
    return f"{channel.target} is {t}, which {what} cannot have: {hint}"


def reverse_for(t: Type, order: Order) -> int | None:
    """The group of bytes in reverse order (Modbus.h) with which a variable needs no more; None: there is none."""
    size = element_size(t)
    if size == 0 or (not order.high_byte_first and not order.high_register_first):
        return 1
    if not order.high_byte_first:
        return 1 if size <= 2 else None
    return max(2, size) if order.high_register_first else 2


def place(t: Type, register: int, reverse: int, order: Order, bit: int = 0) -> int:
    """The bit in the driver's memory of a variable at a register; of a BOOL bit `bit` of the register."""
    if element_size(t) != 1:
        return register * REGISTER_BITS
    byte = 2 * register + (bit // 8 if not order.high_byte_first else 1 - bit // 8)
    return 8 * (byte ^ (reverse - 1)) + bit % 8
