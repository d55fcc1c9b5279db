"""PDOs of a node: their identifiers and mappings, read from the device or from its EDS, and the values in a frame."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass

from plctool.canopen.bus import Frame
from plctool.canopen.sdo import SdoAbort, SdoClient
from plctool.errors import DeviceError
from plctool.io.canopen.data_types import DataType, Value
from plctool.io.canopen.eds import LAST_PDO, MAX_PDO_BITS, Eds, Mapped, mapped_of, mapping_of, setting_of

TPDO, RPDO = 0x1800, 0x1400
_TO_MAPPING = 0x200  # from the object of the parameters
_INVALID, _EXTENDED, _IDENTIFIER = 1 << 31, 1 << 29, 0x7FF
_DEFAULT_PDOS = 4  # that CiA 301 gives identifiers to
_DEFAULT_STEP = 0x100
_FIRST_IDENTIFIER = {TPDO: 0x180, RPDO: 0x200}
_MAX_ENTRIES = 64
_LAST_GAP = 4  # PDOs in a row that are missing: there are no more


@dataclass(frozen=True)
class Pdo:
    """A PDO that is in use. `name`: TPDO1, RPDO2."""

    name: str
    identifier: int
    mapping: tuple[Mapped, ...]

    @property
    def bits(self) -> int:
        """The length of its data."""
        return sum(mapped.bits for mapped in self.mapping)


def pdo_name(base: int, number: int) -> str:
    """`TPDO1` of number 0."""
    return f"{'TPDO' if base == TPDO else 'RPDO'}{number + 1}"


def pdos_of_device(client: SdoClient, base: int) -> Iterator[Pdo]:
    """The PDOs of a device, as it is set up now. Raises LinkError if it does not reply."""
    missing = 0
    for number in range(LAST_PDO + 1):
        try:
            identifier = _read(client, base + number, 1)
        except SdoAbort:
            missing += 1
            if missing == _LAST_GAP:
                return
            continue
        missing = 0
        if identifier & (_INVALID | _EXTENDED):
            continue
        mapping = base + number + _TO_MAPPING
        count = _read(client, mapping, 0)
        if count > _MAX_ENTRIES:
            continue  # of other kinds of PDOs (multiplexed)
        mapped = (mapped_of(_read(client, mapping, sub), sub) for sub in range(1, count + 1))
        yield _checked(client.node, Pdo(pdo_name(base, number), identifier & _IDENTIFIER, tuple(mapped)))


def _checked(node: int, pdo: Pdo) -> Pdo:
    if pdo.bits > MAX_PDO_BITS:
        raise DeviceError(f"{pdo.name} of node {node} maps {pdo.bits} bits; a PDO has {MAX_PDO_BITS}.", "pdo-mapping")
    return pdo


def _read(client: SdoClient, index: int, sub: int) -> int:
    data = client.read(index, sub)
    if len(data) > 4:
        raise DeviceError(f"{index:04X}:{sub:02X} of node {client.node} is not a number.", "pdo-mapping")
    return int.from_bytes(data, "little")


def pdos_of_eds(eds: Eds, node: int, base: int) -> Iterator[Pdo]:
    """The PDOs that an EDS or DCF describes for a node."""
    for number in eds.pdos(base):
        identifier = setting_of(eds.entry(base + number, 1), node)
        if identifier is None and number < _DEFAULT_PDOS:
            identifier = _FIRST_IDENTIFIER[base] + number * _DEFAULT_STEP + node
        if not isinstance(identifier, int) or identifier & (_INVALID | _EXTENDED):
            continue
        mapping = tuple(mapping_of(eds, base + number + _TO_MAPPING, node))
        with suppress(DeviceError):
            yield _checked(node, Pdo(pdo_name(base, number), identifier & _IDENTIFIER, mapping))


@dataclass(frozen=True)
class Part:
    """A value in a PDO; `name` is the place of its object or what the EDS calls it."""

    name: str
    value: Value
    text: str


Naming = Callable[[Mapped], tuple[str, DataType | None]]
"""Name and type of a mapped object; None: its bits are a number without sign."""


def values_in(pdo: Pdo, frame: Frame, naming: Naming) -> list[Part] | None:
    """The values in a frame, None if the frame is shorter than the mapping."""
    if len(frame.data) * 8 < pdo.bits:
        return None
    all_bits = int.from_bytes(frame.data, "little")
    parts = []
    at = 0
    for mapped in pdo.mapping:
        bits = all_bits >> at & (1 << mapped.bits) - 1
        at += mapped.bits
        name, t = naming(mapped)
        parts.append(_part(name, bits, mapped.bits, t))
    return parts


def _part(name: str, bits: int, count: int, t: DataType | None) -> Part:
    if t is not None and t.bits == count:
        value = t.decode(bits.to_bytes(t.size, "little"))
        return Part(name, value, t.text(value))
    return Part(name, bits, f"0x{bits:0{max(1, (count + 3) // 4)}X}")


def naming_by(eds: Eds | None) -> Naming:
    """Names and types of an EDS; without one the places of objects."""

    def naming(mapped: Mapped) -> tuple[str, DataType | None]:
        entry = None if eds is None else eds.entry(mapped.index, mapped.sub)
        return (mapped.place, None) if entry is None else (f"{mapped.place} {entry.name}", entry.type)

    return naming
