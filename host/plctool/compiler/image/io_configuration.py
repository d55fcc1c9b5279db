"""The I/O configuration of a program: which task reads and writes which channels, and how old data may be."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import groupby
from typing import Any

from plctool.compiler.image.task_images import task_ranges
from plctool.compiler.typed.nodes import Task, TaskKind, TypedProgram
from plctool.core import lib
from plctool.iec.areas import Area
from plctool.iec.types import Elementary, Type, base_of
from plctool.iec.values import encode
from plctool.image.file import ApplicationInfo
from plctool.io.canopen.profile import EVENT, FREEWHEELING, PERIODIC, ProgramFacts, TaskFacts
from plctool.io.configuration import (
    ChannelEntry,
    Configuration,
    ConnectorEntry,
    ConnectorMap,
    ParameterEntry,
    TaskMap,
)
from plctool.io.model import VALUE, Channel, Connector, Description, Parameter

_INPUTS, _OUTPUTS = int(lib.IO_MAP_INPUTS), int(lib.IO_MAP_OUTPUTS)
_TYPE_STRING, _TYPE_ARRAY = 16, 26  # TYPE_CLASS of what is not elementary


def assign_tasks(program: TypedProgram, description: Description) -> None:
    """Notes in each channel the tasks in whose cycles it is read or written: those that use it, else that of the bus
    cycle. What starts a task is read by that of the bus cycle, too."""
    uses = task_ranges(program)
    events = [t.event for t in program.tasks if t.event is not None]
    event_bytes = {e.variable.offset + e.offset for e in events if e.variable.area is Area.INPUT}
    for connector, channel in description.channels:
        area = Area.OUTPUT if channel.output else Area.INPUT
        first, end = channel.area_bit // 8, -(-(channel.area_bit + channel.size_bits) // 8)
        using = [
            number
            for number, use in enumerate(uses)
            if any(start < end and first < stop for start, stop in use.get(area, ()))
        ]
        waited_for = not channel.output and any(first <= byte < end for byte in event_bytes)
        bus = bus_task(connector, program.tasks)
        if bus is not None and (not using or (waited_for and bus not in using)):
            using = sorted({*using, bus})
        channel.tasks = using


_KINDS = {TaskKind.CYCLIC: PERIODIC, TaskKind.FREEWHEELING: FREEWHEELING}


def describe_program(program: TypedProgram, info: ApplicationInfo, description: Description) -> None:
    """Tells the connectors what the program is, for those whose parameters describe it."""
    tasks = tuple(
        TaskFacts(
            task.name, _KINDS.get(task.kind, EVENT), task.priority,
            task.interval_us if task.kind is TaskKind.CYCLIC else 0,
        )
        for task in program.tasks
    )  # fmt: skip
    for connector in description.connectors:
        connector.describe(ProgramFacts(info.project, info.version, tasks))


def bus_task(connector: Connector, tasks: list[Task]) -> int | None:
    """The task in whose cycle the bus cycle of a connector is: the one it names, its parent's, or the fastest. None
    if there is no task. Unit tests do not have the one that it names."""
    at: Connector | None = connector
    while at is not None:
        number = next((i for i, t in enumerate(tasks) if at.task and at.task.casefold() == t.name.casefold()), None)
        if number is not None:
            return number
        at = at.parent
    cyclic = [i for i, t in enumerate(tasks) if t.kind is TaskKind.CYCLIC]
    return min(cyclic, key=lambda i: tasks[i].interval_us) if cyclic else 0 if tasks else None


def worst_age_us(channel: Channel, tasks: list[Task]) -> int | None:
    """How old an input may be at the end of a cycle that uses it, or how long an output may take to its device: what
    the driver says and the interval of the slowest task. None if a task that has no interval uses it."""
    intervals = [tasks[i].interval_us if tasks[i].kind is TaskKind.CYCLIC else None for i in channel.tasks]
    known = [i for i in intervals if i is not None]
    return channel.age_us + max(known) if known and len(known) == len(intervals) else None


def configuration_of(program: TypedProgram, description: Description) -> Configuration:
    """The tables of the image."""
    indices = {id(c): i for i, c in enumerate(description.connectors)}
    connectors = tuple(_connector(c, indices, program.tasks) for c in description.connectors)
    maps = []
    for number in range(len(program.tasks)):
        for kind in (_INPUTS, _OUTPUTS):
            parts = tuple(_connector_maps(description.connectors, number, kind))
            if parts:
                maps.append(TaskMap(number, kind, parts))
    return Configuration(connectors, tuple(maps), description.board)


def _connector_maps(connectors: list[Connector], task: int, kind: int) -> Iterator[ConnectorMap]:
    """Those of one driver next to each other."""
    used = []
    for index, connector in enumerate(connectors):
        chosen = [c for c in connector.channels if task in c.tasks and c.output is (kind == _OUTPUTS)]
        if chosen:
            used.append((connector.driver, index, chosen))
    drivers = list(dict.fromkeys(driver for driver, _, _ in used))
    for _, group in groupby(sorted(used, key=lambda u: drivers.index(u[0])), key=lambda u: u[0]):
        for _, index, chosen in group:
            yield ConnectorMap(index, tuple(_joined(map(_channel, chosen))))


def _connector(c: Connector, indices: dict[int, int], tasks: list[Task]) -> ConnectorEntry:
    flags = int(lib.CF_ENABLE) * c.enabled | int(lib.CF_OPTIONAL) * c.optional
    parent = None if c.parent is None else indices[id(c.parent)]
    task = bus_task(c, tasks) if c.task is not None or c.parent is None else None
    parameters = tuple(map(_parameter, sorted(c.parameters, key=lambda p: p.id)))
    return ConnectorEntry(c.name, c.driver, c.type, flags, parent, task, c.state_offset, parameters)


def _parameter(p: Parameter) -> ParameterEntry:
    if isinstance(p.value, bytes):
        return ParameterEntry(p.id, _TYPE_ARRAY, 8 * len(p.value), p.value, True)
    base, data = base_of(p.type), encode(p.type, p.value)
    if isinstance(base, Elementary):
        return ParameterEntry(p.id, base.type_class, 8 * len(data), data, len(data) > 4)
    return ParameterEntry(p.id, _TYPE_STRING, 8 * len(data), data, True)


def _channel(c: Channel) -> ChannelEntry:
    flags = c.substitute.what | int(lib.IO_CHANNEL_BIG_ENDIAN) * c.big_endian
    value = substitute_value(c.variable_type, c.substitute.value) if c.substitute.what == VALUE else 0
    return ChannelEntry(c.parameter, c.parameter_bit, c.area_bit, c.size_bits, flags, value)


def _joined(channels: Iterable[ChannelEntry]) -> list[ChannelEntry]:
    """Single bits that lie side by side within a byte, in the device and in the inputs or outputs, are one channel of
    the image: eight lines are copied as fast as one."""
    made: list[ChannelEntry] = []
    for channel in sorted(channels, key=lambda c: (c.parameter, c.parameter_bit)):
        if made and _follows(made[-1], channel):
            last = made.pop()
            value = last.value | channel.value << last.bits
            channel = replace(last, bits=last.bits + channel.bits, value=value)
        made.append(channel)
    return made


def _follows(first: ChannelEntry, second: ChannelEntry) -> bool:
    """Whether two channels can be one."""
    return (
        first.bits < 8
        and second.bits == 1
        and (first.parameter, first.flags) == (second.parameter, second.flags)
        and first.parameter_bit + first.bits == second.parameter_bit
        and first.area_bit + first.bits == second.area_bit
        and second.parameter_bit % 8 != 0
        and second.area_bit % 8 != 0
    )


def substitute_value(t: Type | None, value: object) -> int:
    """The bits of a value in a variable of a type. Raises UsageError if it does not fit."""
    assert t is not None
    return int.from_bytes(encode(t, value), "little")


def io_document(program: TypedProgram, description: Description) -> dict[str, Any]:
    """What the symbol file says of inputs and outputs. `age_us`: see `worst_age_us`, None of a device that is
    not enabled; `address`: of the variable."""
    devices = [
        {
            "name": connector.name,
            "driver": connector.driver,
            "enabled": connector.enabled,
            "load": connector.load,
            "parameters": [
                *({"name": p.name, "id": p.id, "type": _type_name(p)} for p in connector.parameters if p.name),
                *({"name": name, "id": number, "type": "UDINT"} for name, number in connector.counters.items()),
            ],
        }
        for connector in description.connectors
    ]
    channels = [
        {
            "device": connector.name,
            "channel": c.name,
            "output": c.output,
            "variable": c.variable or c.target,
            "type": str(c.variable_type),
            "address": _address(c),
            "tasks": [program.tasks[i].name for i in c.tasks],
            "age_us": worst_age_us(c, program.tasks) if connector.enabled else None,
            "parameter": c.parameter,
            "parameter_bit": c.parameter_bit,
            "bits": c.size_bits,
            "big_endian": c.big_endian,
            **({"event": c.event, "rising": c.rising, "falling": c.falling} if c.event else {}),
        }
        for connector, c in description.channels
    ]
    return {"devices": devices, "channels": channels}


def _type_name(p: Parameter) -> str:
    return f"ARRAY[0..{len(p.value) - 1}] OF BYTE" if isinstance(p.value, bytes) else p.type.name


def _address(c: Channel) -> str:
    letter, offset = "Q" if c.output else "I", c.area_bit // 8
    if c.size_bits == 1:
        return f"%{letter}X{offset}.{c.area_bit % 8}"
    size = c.size_bits // 8
    width = {1: "B", 2: "W", 4: "D", 8: "L"}.get(size, "B")
    unit = {"W": 2, "D": 4, "L": 8}.get(width, 1)
    return f"%{letter}{width}{offset // unit}" if offset % unit == 0 else f"%{letter}B{offset}"
