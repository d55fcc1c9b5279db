"""The properties of a TASK: `TASK Fast(INTERVAL := T#10ms, PRIORITY := 1, WATCHDOG := T#5ms, SENSITIVITY := 3);`, with
INTERVAL, SINGLE or EVENT saying when it runs.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

from plctool.compiler.diagnostics import did_you_mean
from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.symbols import ERROR
from plctool.compiler.semantics.world import World
from plctool.compiler.syntax import ast
from plctool.compiler.typed import BitPlace, Load, MemberPlace, Place, Storage, Task, TaskEvent, TaskKind, VarPlace
from plctool.iec.types import BOOL, LTIME, TIME, StringType

LOWEST_PRIORITY = 31
MAX_DURATION_US = 0x7FFF_FFFF
MAX_SENSITIVITY = 0xFFFF
MAX_EVENT_NAME = 63


def background(name: str) -> Task:
    """A task that runs when there is time."""
    return Task(name, TaskKind.FREEWHEELING, LOWEST_PRIORITY, 0, [])


def read_task(world: World, decl: ast.TaskDecl, scope: Scope) -> Task:
    """The task that is declared; without INTERVAL, SINGLE and EVENT it runs when there is time."""
    return _Reader(world, decl, scope).task


def _event_at(place: Place) -> TaskEvent | None:
    """Where a variable, member or bit is, when its address is known beforehand."""
    match place:
        case VarPlace(var) if var.storage is Storage.AREA:
            return TaskEvent(var)
        case MemberPlace(base, offset):
            event = _event_at(base)
            return event and TaskEvent(event.variable, event.offset + offset)
        case BitPlace(base, bit):
            event = _event_at(base)
            return event and TaskEvent(event.variable, event.offset + bit // 8, bit % 8)
    return None


class _Reader:
    def __init__(self, world: World, decl: ast.TaskDecl, scope: Scope) -> None:
        self.task = background(decl.name)
        self._checker = Checker(world, scope)
        self._runs_by = ""
        given: set[str] = set()
        for offset, name, value in decl.properties:
            read = self._properties.get(name.upper())
            if read is None or isinstance(value, ast.ArrayInit | ast.StructInit):
                *most, last = self._properties
                hint = did_you_mean(name, self._properties)
                scope.error(offset, "unknown", f"a TASK has {', '.join(most)} and {last}, not {name}{hint}")
            elif name.upper() in given:
                scope.error(offset, "duplicate", f"{name.upper()} of the task {decl.name} is given twice")
            else:
                given.add(name.upper())
                read(self, value)
        sensitivity = next((offset for offset, name, _ in decl.properties if name.upper() == "SENSITIVITY"), None)
        if sensitivity is not None and not any(name.upper() == "WATCHDOG" for _, name, _ in decl.properties):
            message = "SENSITIVITY says how often in a row a cycle may be longer than WATCHDOG, which is missing"
            scope.error(sensitivity, "configuration", message)

    def _interval(self, node: ast.Expr) -> None:
        interval = self._duration(node, "INTERVAL")
        if interval and self._run_by("INTERVAL", TaskKind.CYCLIC, node):
            self.task.interval_us = interval

    def _run_by(self, name: str, kind: TaskKind, node: ast.Expr) -> bool:
        """A task runs by one thing; False after an error."""
        if self._runs_by:
            message = f"a TASK runs by {self._runs_by} or by {name}, not by both: write another task"
            self._checker.error(node.pos, "configuration", message)
            return False
        self._runs_by, self.task.kind = name, kind
        return True

    def _watchdog(self, node: ast.Expr) -> None:
        self.task.watchdog_us = self._duration(node, "WATCHDOG")

    def _duration(self, node: ast.Expr, name: str) -> int:
        """In microseconds; 0 for none, and after an error."""
        e = self._checker.constant(node)
        if e is None:
            return 0
        if e.type not in (TIME, LTIME) or not isinstance(e.value, int):
            self._checker.error(node.pos, "type", f"{name} is a duration such as T#10ms, not {e.type}")
            return 0
        duration = e.value * 1000 if e.type is TIME else e.value // 1000
        if not 0 <= duration <= MAX_DURATION_US:
            self._checker.error(node.pos, "range", f"{name} must be between 0 and 35 minutes")
            return 0
        return duration

    def _priority(self, node: ast.Expr) -> None:
        priority = self._checker.integer(node)
        if priority is not None and 0 <= priority <= LOWEST_PRIORITY:
            self.task.priority = priority
        elif priority is not None:
            message = f"PRIORITY is 0 (highest) to {LOWEST_PRIORITY}, not {priority}"
            self._checker.error(node.pos, "range", message)

    def _sensitivity(self, node: ast.Expr) -> None:
        number = self._checker.integer(node)
        if number is not None and 1 <= number <= MAX_SENSITIVITY:
            self.task.watchdog_sensitivity = number
        elif number is not None:
            self._checker.error(node.pos, "range", f"SENSITIVITY is 1 to {MAX_SENSITIVITY}, not {number}")

    def _single(self, node: ast.Expr) -> None:
        e = self._checker.expr(node)
        event = _event_at(e.place) if e.type is BOOL and isinstance(e, Load) else None
        if event is None and e.type is not ERROR:
            self._checker.error(node.pos, "type", "SINGLE is a global BOOL variable or a bit such as %IX0.3")
        elif event is not None and self._run_by("SINGLE", TaskKind.EVENT, node):
            self.task.event = event

    def _event(self, node: ast.Expr) -> None:
        e = self._checker.constant(node)
        if e is None:
            return
        if not isinstance(e.type, StringType) or not isinstance(e.value, str):
            message = f"EVENT is the name of an external event such as 'door', not {e.type}"
            self._checker.error(node.pos, "type", message)
        elif not 0 < len(e.value) <= MAX_EVENT_NAME or not e.value.isascii() or not e.value.isprintable():
            message = f"the name of an EVENT has 1 to {MAX_EVENT_NAME} ASCII characters"
            self._checker.error(node.pos, "range", message)
        elif self._run_by("EVENT", TaskKind.EXTERNAL, node):
            self.task.external = e.value

    _properties: ClassVar[dict[str, Callable[[Any, ast.Expr], None]]] = {
        "INTERVAL": _interval,
        "PRIORITY": _priority,
        "SINGLE": _single,
        "EVENT": _event,
        "WATCHDOG": _watchdog,
        "SENSITIVITY": _sensitivity,
    }
