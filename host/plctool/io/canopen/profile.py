"""CiA 405: the areas of network variables (A000h to A8FFh), and the objects that describe a program (9501h to 9800h).

Inputs are what other nodes read, outputs what they write. Each of 18 types has 64 indices in a direction, and an index
has the sub-indices 1 to 254.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from zlib import crc32

from plctool.io.canopen.data_types import DATA_TYPES, UNSIGNED8, UNSIGNED32, VISIBLE_STRING, DataType

FIRST_AREA, END_AREAS, END_RESERVED = 0xA000, 0xA900, 0xB000
MAX_SUB = 254
NAME_SIZE = 32  # characters of the names of a program
CONFIGURATION, RESOURCE, TASK, PROJECT, LAST_TASK = 0x9501, 0x9600, 0x9700, 0x9800, 0x97FF
FREEWHEELING, EVENT, PERIODIC = 0, 1, 2
_INDICES = 64  # of a type and direction
_PLACES = _INDICES * MAX_SUB
_FIRST_OUTPUT = 0xA480
# The order of the areas, and that of [DynamicChannels] in the standard.
_TYPES = (0x02, 0x05, 0x01, 0x03, 0x06, 0x10, 0x16, 0x04, 0x07, 0x08, 0x18, 0x12, 0x19, 0x13, 0x1A, 0x14, 0x15, 0x1B)
_LISTED = (0x01, 0x02, 0x05, 0x03, 0x06, 0x10, 0x16, 0x04, 0x07, 0x12, 0x18, 0x13, 0x19, 0x14, 0x1A, 0x15, 0x1B, 0x08)


@dataclass(frozen=True)
class Segment:
    """The area of a type in a direction: indices from `first` to `last`."""

    type: DataType
    is_output: bool
    first: int

    @property
    def last(self) -> int:
        return self.first + _INDICES - 1


_SEGMENTS = {
    (code, is_output): Segment(DATA_TYPES[code], is_output, (_FIRST_OUTPUT if is_output else FIRST_AREA) + _INDICES * k)
    for is_output in (False, True)
    for k, code in enumerate(_TYPES)
}
_ORDERED = list(_SEGMENTS.values())


def segment_at(index: int) -> Segment | None:
    """The area with an index; None if the standard assigns it none."""
    return _ORDERED[(index - FIRST_AREA) // _INDICES] if FIRST_AREA <= index < END_AREAS else None


def segment_of(kind: DataType, *, is_output: bool) -> Segment | None:
    """The area of a type; None for a type that has none, such as VISIBLE_STRING."""
    return _SEGMENTS.get((kind.code, is_output))


def memory_bytes(kind: DataType) -> int:
    """Bytes of a variable with a value of the type: integers of 24 to 56 bits are in the next larger one."""
    return next(size for size in (1, 2, 4, 8) if kind.size <= size)


def place(name: str, segment: Segment, count: int, taken: Collection[tuple[int, int]]) -> tuple[int, int] | None:
    """A free place for `count` values of one index, which follows from the name, so that other variables do not move
    it; None if the area is full."""
    first = crc32(name.casefold().encode()) % _PLACES
    for step in range(_PLACES):
        index, sub = divmod((first + step) % _PLACES, MAX_SUB)
        index, sub = segment.first + index, sub + 1
        if sub + count - 1 <= MAX_SUB and all((index, sub + n) not in taken for n in range(count)):
            return index, sub
    return None


def dynamic_channels() -> list[str]:
    """The lines of [DynamicChannels], which tools without knowledge of the profile need."""
    lines = ["NrOfSeg=36"]
    segments = [_SEGMENTS[code, is_output] for is_output in (False, True) for code in _LISTED]
    for number, segment in enumerate(segments, 1):
        lines += [
            f"Type{number}=0x{segment.type.code:02X}",
            f"Dir{number}={'rww' if segment.is_output else 'ro'}",
            f"Range{number}=0x{segment.first:04X}-0x{segment.last:04X}",
            f"PPOffset{number}={'0,1' if segment.type.kind == 'bool' else '0'}",
        ]
    return lines


# ---- the objects of a program ----


@dataclass(frozen=True)
class TaskFacts:
    """A task as its object has it. `kind`: FREEWHEELING, EVENT or PERIODIC."""

    name: str
    kind: int
    priority: int
    interval_us: int


@dataclass(frozen=True)
class ProgramFacts:
    """A program as its objects have it. `version`: that of the project, such as 1.2.0.0."""

    project: str
    version: str
    tasks: tuple[TaskFacts, ...]


@dataclass(frozen=True)
class Constant:
    """A value that describes a program; a text has NAME_SIZE characters."""

    index: int
    sub: int
    type: DataType
    value: int | str


def program_objects(facts: ProgramFacts) -> Iterator[Constant]:
    """The objects 9501h, 9600h, 9700h and those that follow, 9800h."""
    version = _bcd(facts.version)
    tasks = facts.tasks[: LAST_TASK - TASK + 1]
    handle = TASK if tasks else 0
    yield from _record(CONFIGURATION, [facts.project, version, (UNSIGNED8, 1)])
    yield from _record(RESOURCE, [facts.project, version, (UNSIGNED8, min(len(tasks), 255)), handle])
    for number, task in enumerate(tasks):
        yield from _record(TASK + number, [task.name, number, task.kind, task.priority, task.interval_us])
    yield Constant(PROJECT, 0, VISIBLE_STRING, _name(facts.project))


def _record(index: int, values: Iterable[str | int | tuple[DataType, int]]) -> Iterator[Constant]:
    entries = list(values)
    yield Constant(index, 0, UNSIGNED8, len(entries))
    for sub, value in enumerate(entries, 1):
        if isinstance(value, str):
            yield Constant(index, sub, VISIBLE_STRING, _name(value))
        else:
            kind, number = value if isinstance(value, tuple) else (UNSIGNED32, value)
            yield Constant(index, sub, kind, number)


def _name(text: str) -> str:
    return text.encode("ascii", "replace").decode("ascii")[:NAME_SIZE].ljust(NAME_SIZE, "\0")


def _bcd(version: str) -> int:
    """A version in BCD: major in the high word, minor in the low one."""
    parts = [part[:4] for part in [*version.split("."), "0", "0"][:2]]
    return int("".join(f"{part:0>4}" for part in parts), 16) if all(p.isdecimal() for p in parts) else 0


ROW_NAMES = {
    CONFIGURATION: ("Configuration_Name", "Configuration_Version", "Number_Of_Resources"),
    RESOURCE: ("Resource_Name", "Resource_Version", "Number_Of_Tasks", "Task_Handle"),
    TASK: ("Task_Name", "Task_Identifier", "Task_Type", "Task_Priority", "Time_Interval"),
}


def names_of(index: int) -> tuple[str, tuple[str, ...]] | None:
    """The name of an object that describes a program and those of its entries from 1 on; None for other objects."""
    if index == PROJECT:
        return "Project_Name", ()
    if index == CONFIGURATION:
        return "Configuration", ROW_NAMES[CONFIGURATION]
    if RESOURCE <= index < TASK:
        return f"Resource {index - RESOURCE + 1}", ROW_NAMES[RESOURCE]
    return (f"Task {index - TASK + 1}", ROW_NAMES[TASK]) if TASK <= index <= LAST_TASK else None
