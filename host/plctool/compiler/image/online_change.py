"""An online change: what the program that runs says of itself in its symbol file, and the steps that the image of
another one carries, which take its place.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from itertools import product
from typing import Any
from zlib import crc32

from plctool.compiler.codegen.lower_init import image_of
from plctool.compiler.typed.nodes import StructInit, Variable
from plctool.compiler.typed.online_change import Kept, OnlineChange, Previous, PreviousVariable
from plctool.core import lib
from plctool.debug.symbols import SymbolTable
from plctool.errors import UsageError
from plctool.iec.areas import Area
from plctool.iec.types import StructType
from plctool.image.file import ChangeStep, ImageTask
from plctool.io.configuration import Configuration

_ZEROS = re.compile(rb"\0{24,}")  # cost more as data than another step
_AT_ONCE = 16  # bytes that are no more as data than as steps for what is zero and what is not
_EXIT = ".fb_exit"


# ---- what a program says of itself ----


def facts_of(tasks: Sequence[ImageTask], device_id: int, devices: list[list[Any]]) -> dict[str, Any]:
    """What has to be alike in both programs. `devices`: of the I/O configuration (`device_facts`)."""
    return {"device": device_id, "io": devices, "tasks": [_task_facts(task) for task in tasks]}


def device_facts(configuration: Configuration) -> list[list[Any]]:
    """The devices and buses of an I/O configuration, each with a CRC of its parameters and channels. Which task uses
    which channels does not count, nor where the variable is that follows the device."""
    channels = {
        (tasks.type, part.connector, channel)
        for tasks in configuration.task_maps
        for part in tasks.connectors
        for channel in part.channels
        for channel in channel.single_bits()
    }
    facts = []
    for index, connector in enumerate(configuration.connectors):
        own = sorted((kind, astuple(channel)) for kind, of, channel in channels if of == index)
        alike = astuple(replace(connector, state=None, bus_task=None))
        facts.append([connector.name, crc32(repr((configuration.board, alike, own)).encode())])
    return facts


def _task_facts(task: ImageTask) -> dict[str, Any]:
    event = f"area {task.event[0]}, byte {task.event[1]}, {task.ignored}" if task.event else task.external
    return {
        "name": task.name,
        "kind": task.kind,
        "priority": task.priority,
        "interval": task.interval_us,
        "watchdog": [task.watchdog_us, task.watchdog_sensitivity],
        "event": event,
    }


def previous_of(symbols: SymbolTable) -> Previous:
    """The program that has these symbols. Raises UsageError if they do not say enough."""
    if not symbols.online:
        raise UsageError(
            "The program that runs was built by a plctool without online change; build it again and download it once.",
            "no-base",
        )
    variables = {
        s.name.casefold(): PreviousVariable(s.name, s.type, Area(s.area), s.offset)
        for s in symbols.variables.values()
        if s.pointer is None and s.bit is None
    }
    names = (unit.name.casefold() for unit in symbols.pous)
    with_exit = frozenset(name.removesuffix(_EXIT) for name in names if name.endswith(_EXIT))
    return Previous(symbols.image_crc, variables, symbols.classes, with_exit, symbols.unkept, symbols.online)


def check_facts(change: OnlineChange, facts: Mapping[str, Any], device: str) -> None:
    """Adds to the problems of a change what is not about variables."""
    before: Mapping[str, Any] = change.previous.facts
    if before["device"] != facts["device"]:
        change.problems.append(f"the program that runs was built for another target than {device}")
    if before["io"] != facts["io"]:
        change.problems.append(f"the I/O configuration has changed{_changed_devices(before['io'], facts['io'])}")


def _changed_devices(before: object, now: list[list[Any]]) -> str:
    """The devices that differ, in brackets. Before: a number, of a program that an older plctool built."""
    if not isinstance(before, list):
        return ""
    names = [name for name, _ in (d for d in (*before, *now) if d not in before or d not in now)]
    return f" ({', '.join(dict.fromkeys(names))})" if names else " (the order of devices)"


def tasks_of(change: OnlineChange, facts: Mapping[str, Any]) -> list[str]:
    """What becomes of tasks, in words."""
    had: list[dict[str, Any]] = change.previous.facts["tasks"]  # type: ignore[assignment]
    names = [task["name"] for task in had]
    found = []
    for number, task in enumerate(facts["tasks"]):
        if task["name"] not in names:
            found.append(f"{task['name']} is new")
            continue
        place = names.index(task["name"])
        before = had[place]
        changed = [
            f"{key} {_text(before[key])}, now {_text(value)}" for key, value in task.items() if before[key] != value
        ]
        if changed:
            found.append(f"{task['name']}: {'; '.join(changed)}")
        elif place != number:
            found.append(f"{task['name']} begins again, since its place among the tasks changes")
    return found + [f"{name} is removed" for name in names if name not in {t["name"] for t in facts["tasks"]}]


def _text(value: object) -> str:
    return " x ".join(map(str, value)) if isinstance(value, list) else str(value) or "none"


# ---- steps ----


Members = Collection[tuple[StructType, int]]


@dataclass
class Steps:
    """Makes the steps that the device does between two cycles. `transient`: members that are not in memory; `passed`:
    those that are VAR_IN_OUT, which have to lead somewhere only until the next call. `room`: the sizes of the areas,
    which grow by what saves old constants."""

    change: OnlineChange
    defaults: dict[str, StructInit]
    transient: Members
    passed: Members
    room: dict[int, int]

    def all(self) -> list[ChangeStep]:
        """All, in the order that the device wants."""
        moves = sorted(self._led(), key=lambda step: (step.source_area, step.source))
        pointers = self._pointers() if moves else []
        return [*moves, *pointers, *self._fills(), *self._contents()]

    def _led(self) -> Iterator[ChangeStep]:
        for kept in self.change.parts:
            if kept.moved:
                kind = lib.CDL_CHANGE_FOLLOW if kept.variable.constant else lib.CDL_CHANGE_MOVE
                for run in kept.runs:
                    yield _from(kind, kept.before, run.source, run.size, kept.variable.area.value,
                                kept.variable.offset + run.to)  # fmt: skip
            yield from self._objects(kept)
        for before, part in self.change.gone:
            if before.area is not Area.MEMORY:  # an address may have more than one variable
                yield _from(lib.CDL_CHANGE_GONE, before, part.offset, part.size)

    @staticmethod
    def _objects(kept: Kept) -> Iterator[ChangeStep]:
        """The instances and structures whose beginning is not what is kept of their first member."""
        starts = [run.source for run in kept.runs]
        for source, to in kept.objects:
            run = kept.runs[bisect_right(starts, source) - 1] if starts and starts[0] <= source else None
            if run is not None and source < run.source + run.size and source - run.source == to - run.to:
                continue
            area, at = kept.variable.area.value, kept.variable.offset + to
            step = _from(lib.CDL_CHANGE_FOLLOW, kept.before, source, 1, area, at)
            yield replace(step, source_area=step.source_area | int(lib.CDL_CHANGE_OBJECTS))

    def _pointers(self) -> Iterator[ChangeStep]:
        for kept in self.change.parts:
            in_memory = [p for p in kept.pointers if p.owner is None or p.owner not in self.transient]
            for is_passed, to_object in product((False, True), repeat=2):
                alike = [p for p in in_memory if (p.owner in self.passed, p.to_object) == (is_passed, to_object)]
                kind = lib.CDL_CHANGE_FORGET if is_passed else lib.CDL_CHANGE_LEAD
                for first, stride, count in _rows(sorted(p.offset for p in alike)):
                    size = stride * (count - 1) + int(lib.APP_POINTER_SIZE)
                    yield _from(kind, kept.before, first, size, lib.CDL_CHANGE_OBJECTS * to_object, stride)

    def _fills(self) -> Iterator[ChangeStep]:
        for kept in self.change.parts:
            for fill in kept.fills:
                kind = lib.CDL_CHANGE_SIGN if fill.signed else lib.CDL_CHANGE_CLEAR
                to = kept.variable.offset + fill.offset
                yield ChangeStep(int(kind), kept.variable.area.value, to, fill.size)

    def _contents(self) -> Iterator[ChangeStep]:
        moved = {kept.variable for kept in self.change.parts if kept.moved}
        before: Any = self.change.previous.facts.get("constants", {})
        for variable in self.change.constants:
            content = self._content(variable)
            if variable not in moved:
                if before.get(variable.name) == crc32(content):
                    continue
                yield self._saved(variable)
            yield from _initialise(variable, 0, content)
        for variable in self.change.new:
            yield from _initialise(variable, 0, self._content(variable))
        contents: dict[Variable, bytes] = {}
        for variable, fresh in self.change.fresh:
            if fresh.owner is None or fresh.owner not in self.transient:
                content = contents.get(variable) or contents.setdefault(variable, self._content(variable))
                yield from _initialise(variable, fresh.offset, content[fresh.offset : fresh.offset + fresh.size])

    def _content(self, variable: Variable) -> bytes:
        return image_of(self.defaults, variable.type, variable.initial)

    def _saved(self, variable: Variable) -> ChangeStep:
        """Saves the old content of a constant, which the device needs if it goes back."""
        area, size = variable.area.value, variable.type.size
        to = self.room[area]
        self.room[area] += size
        return ChangeStep(int(lib.CDL_CHANGE_COPY), area, to, size, area, variable.offset)


def constants_of(variables: Iterable[Variable], defaults: dict[str, StructInit]) -> dict[str, int]:
    """The CRCs of the contents of constants that are in memory."""
    return {v.name: crc32(image_of(defaults, v.type, v.initial)) for v in variables if v.constant}


def _from(kind: int, before: PreviousVariable, offset: int, size: int, area: int = 0, to: int = 0) -> ChangeStep:
    """A step about a part of a variable of the previous program."""
    return ChangeStep(int(kind), int(area), to, size, before.area.value, before.offset + offset)


def _rows(offsets: Sequence[int]) -> Iterator[tuple[int, int, int]]:
    """Rows of equal distances: the first offset, the distance, how many there are."""
    at = 0
    while at < len(offsets):
        end = at + 1
        stride = offsets[end] - offsets[at] if end < len(offsets) else int(lib.APP_POINTER_SIZE)
        while end < len(offsets) and offsets[end] - offsets[end - 1] == stride:
            end += 1
        yield offsets[at], stride, end - at
        at = end


def _initialise(variable: Variable, offset: int, content: bytes) -> Iterator[ChangeStep]:
    """The steps that give memory its content."""
    to, area = variable.offset + offset, variable.area.value
    runs = list(_runs(content)) if len(content) > _AT_ONCE or not any(content) else [(0, content)]
    if sum(len(run) for _, run in runs) < len(content):
        yield ChangeStep(int(lib.CDL_CHANGE_CLEAR), area, to, len(content))
    for start, run in runs:
        yield ChangeStep(int(lib.CDL_CHANGE_PUT), area, to + start, len(run), data=run)


def _runs(content: bytes) -> Iterator[tuple[int, bytes]]:
    """What is not zero, each with its offset."""
    start = 0
    for zeros in [*_ZEROS.finditer(content), None]:
        end = len(content) if zeros is None else zeros.start()
        part = content[start:end]
        left = part.lstrip(b"\0")
        if kept := left.rstrip(b"\0"):
            yield start + len(part) - len(left), kept
        start = end if zeros is None else zeros.end()
