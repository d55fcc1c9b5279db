"""An online change: what the program that runs says of itself in its symbol file, and the steps that the image of
another one carries, which take its place.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

from plctool.compiler.codegen.lower_init import image_of
from plctool.compiler.typed.nodes import StructInit, Variable
from plctool.compiler.typed.online_change import OnlineChange, Previous, PreviousVariable
from plctool.core import lib
from plctool.debug.symbols import SymbolTable
from plctool.errors import UsageError
from plctool.iec.areas import Area
from plctool.iec.types import StructType
from plctool.image.file import ChangeStep, ImageTask

_ZEROS = re.compile(rb"\0{24,}")  # cost more as data than another step
_AT_ONCE = 16  # bytes that are no more as data than as steps for what is zero and what is not
_EXIT = ".fb_exit"


# ---- what a program says of itself ----


def facts_of(tasks: Sequence[ImageTask], device_id: int, io_crc: int) -> dict[str, Any]:
    """What has to be alike in both programs. `io_crc`: of the I/O configuration; 0: there is none."""
    return {"device": device_id, "io": io_crc, "tasks": [_task_facts(task) for task in tasks]}


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
        change.problems.append("the I/O configuration is another one")
    elif before["io"]:
        change.problems.append("the program has an I/O configuration")
    had = {task["name"]: task for task in before["tasks"]}
    has = {task["name"]: task for task in facts["tasks"]}
    change.problems += [f"task {name} is new" for name in has if name not in had]
    change.problems += [f"task {name} is removed" for name in had if name not in has]
    for name, task in has.items():
        for key, value in task.items():
            if name in had and had[name][key] != value:
                change.problems.append(f"task {name} has another {key}: {_text(had[name][key])}, now {_text(value)}")
    if list(had) != list(has) and set(had) == set(has):
        change.problems.append("the tasks are declared in another order")


def _text(value: object) -> str:
    return " x ".join(map(str, value)) if isinstance(value, list) else str(value) or "none"


# ---- steps ----


def steps_of(
    change: OnlineChange, defaults: dict[str, StructInit], transient: Collection[tuple[StructType, int]]
) -> list[ChangeStep]:
    """What the device does between two cycles. `transient`: members that are not in memory."""
    steps: list[ChangeStep] = []
    for variable in (*change.new, *change.constants):
        steps += _initialise(variable, 0, image_of(defaults, variable.type, variable.initial))
    for variable, fresh in change.fresh:
        if fresh.owner is None or fresh.owner not in transient:
            content = image_of(defaults, variable.type, variable.initial)[fresh.offset : fresh.offset + fresh.size]
            steps += _initialise(variable, fresh.offset, content)
    return steps


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
