"""The values of variables are on the wire where docs/modbus.md says, whatever their types and the order of bytes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain

import pytest
from hypothesis import given
from hypothesis import strategies as st
from shares import examples

from plctool.core import ffi, lib
from plctool.files import Pos
from plctool.iec.types import BOOL, ELEMENTARY, ArrayType, Field, StringType, StructType, Type
from plctool.io.mistakes import Mistakes
from plctool.io.modbus import registers
from plctool.io.modbus.client import FUNCTIONS, Job, ModbusDevice, ModbusLine, Part
from plctool.io.modbus.server import ModbusServer, Object
from plctool.io.model import Channel

POS = Pos("main.io.toml", 1, 1)
INT, REAL, BYTE = ELEMENTARY["INT"], ELEMENTARY["REAL"], ELEMENTARY["BYTE"]
NUMBERS = [ELEMENTARY[n] for n in ("BYTE", "SINT", "INT", "WORD", "DWORD", "REAL", "LREAL", "LINT", "TIME")]
TYPES = [
    BOOL,
    *NUMBERS,
    *(ArrayType(t, ((0, 2),)) for t in (BOOL, BYTE, INT, REAL, ELEMENTARY["LINT"])),
    ArrayType(ArrayType(INT, ((0, 1),)), ((0, 1),)),
    StringType(4),
    StringType(3, wide=True),
    StructType("S", [Field("a", INT, 0), Field("b", BOOL, 2)], _size=4, _align=2),
]


@dataclass(frozen=True)
class Variable:
    """A variable with its bytes in memory."""

    type: Type
    data: bytes


@st.composite
def variables(draw: st.DrawFn) -> Variable:
    t = draw(st.sampled_from(TYPES))
    data = draw(st.binary(min_size=t.size, max_size=t.size))
    if bools(t):
        data = bytes(b & 1 for b in data)
    return Variable(t, data)


def bools(t: Type) -> bool:
    return t is BOOL or (isinstance(t, ArrayType) and bools(t.element))


# ---- what the documentation says -----------------------------------------------------------------------------------


def elements(v: Variable) -> list[Variable]:
    if isinstance(v.type, ArrayType):
        size = v.type.element.size
        parts = (Variable(v.type.element, v.data[i : i + size]) for i in range(0, len(v.data), size))
        return list(chain.from_iterable(map(elements, parts)))
    return [v]


def in_coils(v: Variable) -> list[int]:
    """The bits: one of a BOOL, of a number all, the lowest first."""
    bits = [b >> n & 1 for b in v.data for n in range(8)]
    return bits[:1] if v.type is BOOL else bits


def in_registers(v: Variable, order: str) -> bytes:
    """The bytes as they are sent."""
    if isinstance(v.type, StringType) and not v.type.wide:
        return v.data + bytes(len(v.data) % 2)
    if isinstance(v.type, ArrayType) and v.type.element is BYTE:
        return v.data + bytes(len(v.data) % 2)
    if isinstance(v.type, StringType):
        return b"".join(number_in_registers(v.data[i : i + 2], order) for i in range(0, len(v.data), 2))
    if isinstance(v.type, ArrayType):
        return b"".join(in_registers(e, order) for e in elements(v))
    return number_in_registers(v.data.ljust(2, b"\0"), order)


def number_in_registers(little: bytes, order: str) -> bytes:
    registers = [little[i : i + 2][::-1] for i in range(0, len(little), 2)]  # the lowest first, each as ABCD has it
    if order in ("ABCD", "BADC"):
        registers.reverse()
    return b"".join(r if order in ("ABCD", "CDAB") else r[::-1] for r in registers)


# ---- what the driver and the manager do ----------------------------------------------------------------------------


def bits_of_data(data: bytes) -> list[int]:
    return [b >> n & 1 for b in data for n in range(8)]


def copied(channels: Sequence[Channel], found: Sequence[Variable], bits: int) -> bytearray:
    """The memory of the driver after all outputs were copied there."""
    memory = bytearray(-(-bits // 8))
    for channel, variable in zip(channels, found, strict=True):
        data = variable.data[::-1] if channel.big_endian else variable.data
        for n, bit in enumerate(bits_of_data(data)[: channel.size_bits]):
            memory[(channel.parameter_bit + n) // 8] |= bit << (channel.parameter_bit + n) % 8
    return memory


def sent(memory: bytes, reverse: int) -> bytes:
    """Registers in the order of the wire."""
    return bytes(memory[i ^ (reverse - 1)] for i in range(len(memory)))


def job(found: Sequence[Variable], function: int, order: str) -> tuple[object | None, list[Channel], Mistakes]:
    """The structure that the driver gets, None after a mistake."""
    mistakes, line = Mistakes(), ModbusLine("line", "IoDrvModbus", POS)
    channels = [Channel(f"v{i}", f"Main.v{i}", POS, True, variable_type=v.type) for i, v in enumerate(found)]
    device = ModbusDevice("device", "IoDrvModbus", POS, parent=line, order=registers.ORDERS[order])
    device.jobs = [Job(FUNCTIONS[function], 100_000, False, False, POS, write=Part(0, channels, POS))]
    device.complete(mistakes)
    if mistakes.found:
        return None, channels, mistakes
    made = ffi.new("MODBUS_JOB *")
    ffi.buffer(made)[:] = device.parameters[0].value
    return made, channels, mistakes


ORDERS = st.sampled_from(["ABCD", "CDAB", "BADC", "DCBA"])


@examples(200)
@given(st.lists(variables(), min_size=1, max_size=4))
def test_coils_have_the_bits_of_the_variables_one_after_the_other(found: list[Variable]) -> None:
    made, channels, mistakes = job(found, 15, "ABCD")
    if made is None:
        assert mistakes.found
        return
    wanted = [bit for v in found for e in elements(v) for bit in in_coils(e)]
    assert made.write_count == len(wanted)  # type: ignore[attr-defined]
    assert bits_of_data(copied(channels, found, len(wanted)))[: len(wanted)] == wanted


@examples(400)
@given(st.lists(variables(), min_size=1, max_size=4), ORDERS)
def test_registers_have_the_bytes_of_the_variables_in_their_order(found: list[Variable], order: str) -> None:
    made, channels, mistakes = job(found, 16, order)
    if made is None:
        assert mistakes.found
        return
    wanted = b"".join(in_registers(v, order) for v in found)
    assert 2 * made.write_count == len(wanted)  # type: ignore[attr-defined]
    reverse = max(1, made.flags >> lib.MODBUS_JOB_REVERSE_SHIFT & 14)  # type: ignore[attr-defined]
    assert sent(copied(channels, found, 8 * len(wanted)), reverse) == wanted


@examples(100)
@given(variables().filter(lambda v: v.type.size <= 2), ORDERS, st.binary(min_size=2, max_size=2))
def test_mask_write_changes_the_bits_of_the_variable_only(variable: Variable, order: str, before: bytes) -> None:
    made, channels, mistakes = job([variable], 22, order)
    assert made is not None, mistakes.found
    reverse = max(1, made.flags >> lib.MODBUS_JOB_REVERSE_SHIFT & 14)  # type: ignore[attr-defined]
    data = sent(copied(channels, [variable], 16), reverse)
    mask = made.mask.to_bytes(2, "big")  # type: ignore[attr-defined]
    after = bytes((b & ~m & 0xFF) | (d & m) for b, d, m in zip(before, data, mask, strict=True))
    ones = Variable(variable.type, b"\1" if variable.type is BOOL else b"\xff" * variable.type.size)
    own = in_registers(ones, order)
    wanted = in_registers(variable, order)
    assert after == bytes((b & ~o & 0xFF) | w for b, o, w in zip(before, own, wanted, strict=True))


def server_range(variable: Variable, table: int, order: str, bit: int | None = None) -> tuple[object | None, Channel]:
    """The structure that the driver gets for a server with one object; None after a mistake."""
    mistakes = Mistakes()
    channel = Channel("1", "Main.v", POS, True, variable_type=variable.type)
    server = ModbusServer("server", "IoDrvModbus", POS, order=registers.ORDERS[order])
    server.objects = [Object(table, 0, bit, False, channel, POS)]
    server.complete(mistakes)
    if mistakes.found:
        return None, channel
    made = ffi.new("MODBUS_RANGE *")
    ffi.buffer(made)[:] = server.parameters[0].value
    return made, channel


@examples(200)
@given(variables(), ORDERS)
def test_registers_of_a_server_have_the_bytes_of_a_variable(variable: Variable, order: str) -> None:
    made, channel = server_range(variable, int(lib.MODBUS_INPUT_REGISTERS), order)
    if made is None:
        return
    wanted = in_registers(variable, order)
    assert made.bits == 8 * len(wanted)  # type: ignore[attr-defined]
    assert sent(copied([channel], [variable], made.bits), made.reverse) == wanted  # type: ignore[attr-defined]


@examples(100)
@given(variables())
def test_coils_of_a_server_have_the_bits_of_a_variable(variable: Variable) -> None:
    made, channel = server_range(variable, int(lib.MODBUS_DISCRETE_INPUTS), "ABCD")
    if made is None:
        return
    wanted = [bit for e in elements(variable) for bit in in_coils(e)]
    assert made.bits == len(wanted)  # type: ignore[attr-defined]
    assert bits_of_data(copied([channel], [variable], len(wanted)))[: len(wanted)] == wanted


@given(st.integers(0, 15), ORDERS)
def test_bit_of_a_register_of_a_server_is_that_bit(bit: int, order: str) -> None:
    variable = Variable(BOOL, b"\1")
    made, channel = server_range(variable, int(lib.MODBUS_INPUT_REGISTERS), order, bit)
    assert made is not None
    number = Variable(ELEMENTARY["WORD"], (1 << bit).to_bytes(2, "little"))
    assert sent(copied([channel], [variable], 16), made.reverse) == in_registers(number, order)  # type: ignore[attr-defined]


@pytest.mark.parametrize("t", TYPES, ids=str)
def test_what_coils_cannot_have_is_said(t: Type) -> None:
    variable = Variable(t, bytes(t.size))
    (made, _, mistakes), (in_server, _) = job([variable], 15, "ABCD"), server_range(variable, 1, "ABCD")
    can_have = t is BOOL or t in NUMBERS or (isinstance(t, ArrayType) and not bools(t))
    assert (made is not None, in_server is not None) == (can_have, can_have)
    assert can_have or "which coils cannot have" in mistakes.found[0].message
