"""Which object is in which PDO of a CANopen node, and what is written into the node for that."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import Enum

from plctool.io.canopen.eds import MAX_PDO_BITS, WRITABLE, Eds, Entry
from plctool.io.model import Channel

_MAPPING = 0x200  # from the parameters of a PDO to its mapping
_INVALID = 0x8000_0000
_DEFAULT_PDOS = 4  # that have an identifier of their own by the number of the node
FREE_COBS = range(0x6DF, 0x67F, -1)  # identifiers of CiA 301 that belong to no node, in the order of their use
_COB, _KIND, _EVENT = 1, 2, 5  # sub-indices of the parameters


class Direction(Enum):
    """A direction with the first object of its parameters in the node, and its first identifier."""

    TO_NODE = (0x1400, 0x200)
    FROM_NODE = (0x1800, 0x180)


@dataclass
class Item:
    """An object that is mapped. `channels`: each with its first bit in the object."""

    entry: Entry
    channels: list[tuple[Channel, int]] = field(default_factory=list)

    @property
    def bits(self) -> int:
        """Its size in the PDO."""
        assert self.entry.type is not None
        return self.entry.type.bits


@dataclass
class Pdo:
    """A PDO. `number`: in the node, from 0."""

    number: int
    cob: int
    items: list[Item] = field(default_factory=list)

    @property
    def bits(self) -> int:
        """Those that are in use."""
        return sum(item.bits for item in self.items)

    @property
    def size(self) -> int:
        """Bytes of the frame."""
        return -(-self.bits // 8)

    def places(self) -> Iterator[tuple[Item, int]]:
        """Each object with its first bit."""
        bit = 0
        for item in self.items:
            yield item, bit
            bit += item.bits


@dataclass
class Layout:
    """The PDOs of one direction. `available`: numbers of those that the node has; `missing`: what found no room."""

    direction: Direction
    pdos: list[Pdo]
    available: list[int]
    missing: list[Item]

    def writes(self, kind: int, event_ms: int, eds: Eds) -> Iterator[tuple[int, int, bytes]]:
        """What a manager writes, in the order that devices insist on; a PDO that is not used is switched off."""
        used = {pdo.number: pdo for pdo in self.pdos}
        for number in self.available:
            parameters = self.direction.value[0] + number
            pdo = used.get(number)
            if pdo is not None:
                yield from _mapping(parameters, pdo, kind, event_ms, eds)
            elif _is_writable(eds, parameters, _COB):
                cob = _default_cob(eds, parameters)
                if number < _DEFAULT_PDOS or not cob & _INVALID:
                    yield parameters, _COB, _u32(_INVALID | cob)


def _default_cob(eds: Eds, parameters: int) -> int:
    default = eds.entry(parameters, _COB)
    cob = default.default.at(0) if default is not None and default.default is not None else 0
    return cob if isinstance(cob, int) else 0


def lay_out(items: list[Item], direction: Direction, node: int, eds: Eds, free: list[int]) -> Layout:
    """Puts objects into the PDOs that a node has, the largest first, so that all but bits begin at a byte. `free`:
    identifiers for PDOs beyond the first four, of which those that are used are taken out."""
    first, cob = direction.value
    available = [n for n in eds.pdos(first) if n < _DEFAULT_PDOS or _is_writable(eds, first + n, _COB)]
    layout = Layout(direction, [], available, [])
    for item in sorted(items, key=lambda item: -item.bits):
        pdo = next((p for p in layout.pdos if p.bits + item.bits <= MAX_PDO_BITS), None)
        if pdo is None and len(layout.pdos) < len(available):
            number = available[len(layout.pdos)]
            if number < _DEFAULT_PDOS:
                pdo = Pdo(number, cob + 0x100 * number + node)
            elif free:
                pdo = Pdo(number, free.pop(0))
            layout.pdos += [] if pdo is None else [pdo]
        if pdo is None:
            layout.missing.append(item)
        else:
            pdo.items.append(item)
    return layout


def _mapping(parameters: int, pdo: Pdo, kind: int, event_ms: int, eds: Eds) -> Iterator[tuple[int, int, bytes]]:
    mapping = parameters + _MAPPING
    yield parameters, _COB, _u32(_INVALID | pdo.cob)
    yield mapping, 0, b"\0"
    for number, item in enumerate(pdo.items, 1):
        yield mapping, number, _u32(item.entry.index << 16 | item.entry.sub << 8 | item.bits)
    yield mapping, 0, bytes([len(pdo.items)])
    yield parameters, _KIND, bytes([kind])
    if _is_writable(eds, parameters, _EVENT):
        yield parameters, _EVENT, event_ms.to_bytes(2, "little")
    yield parameters, _COB, _u32(pdo.cob)


def _is_writable(eds: Eds, index: int, sub: int) -> bool:
    entry = eds.entry(index, sub)
    return entry is not None and entry.access in WRITABLE


def _u32(value: int) -> bytes:
    return value.to_bytes(4, "little")
