"""Tasks and program instances: what a CONFIGURATION says, or what is meant when there is none.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar

from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.declarations.instance_config import InstanceConfig
from plctool.compiler.semantics.rules.call_statements import program_arguments
from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.symbols import ERROR, PouSymbol, ProgramInfo
from plctool.compiler.semantics.world import World
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import did_you_mean
from plctool.compiler.typed.nodes import (
    BitPlace,
    Direction,
    EventFunction,
    Export,
    Load,
    MemberPlace,
    Place,
    Pos,
    Pou,
    PouKind,
    Storage,
    Task,
    TaskEvent,
    TaskKind,
    VarPlace,
)
from plctool.errors import listed
from plctool.iec.tasks import LOWEST_PRIORITY
from plctool.iec.types import BOOL, LTIME, TIME, StringType

# ---- the properties of a TASK ----

_LOWEST_ELSEWHERE = 65_535  # of OpenPLC and Beremiz, where it is a UINT
MAX_DURATION_US = 0x7FFF_FFFF
MAX_SENSITIVITY = 0xFFFF
MAX_EVENT_NAME = 63


def background(name: str) -> Task:
    """A task that runs when there is time."""
    return Task(name, TaskKind.FREEWHEELING, LOWEST_PRIORITY, 0, [])


def read_task(world: World, decl: ast.TaskDecl, scope: Scope) -> Task:
    """The task that is declared; without INTERVAL, SINGLE, LEVEL and EVENT it runs when there is time."""
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
                hint = did_you_mean(name, self._properties)
                scope.error(offset, "unknown", f"a TASK has {listed(self._properties)}, not {name}{hint}")
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
        if priority is None:
            return
        self.task.priority = min(priority, LOWEST_PRIORITY)
        message = f"PRIORITY is 0 (highest) to {LOWEST_PRIORITY}, not {priority}"
        if not 0 <= priority <= _LOWEST_ELSEWHERE:
            self._checker.error(node.pos, "range", message)
        elif priority > LOWEST_PRIORITY:
            self._checker.scope.warning(node.pos, "configuration", f"{message}; {LOWEST_PRIORITY} is taken")

    def _sensitivity(self, node: ast.Expr) -> None:
        number = self._checker.integer(node)
        if number is not None and 1 <= number <= MAX_SENSITIVITY:
            self.task.watchdog_sensitivity = number
        elif number is not None:
            self._checker.error(node.pos, "range", f"SENSITIVITY is 1 to {MAX_SENSITIVITY}, not {number}")

    def _single(self, node: ast.Expr) -> None:
        self._variable(node, "SINGLE", TaskKind.EVENT)

    def _level(self, node: ast.Expr) -> None:
        self._variable(node, "LEVEL", TaskKind.LEVEL)

    def _variable(self, node: ast.Expr, name: str, kind: TaskKind) -> None:
        e = self._checker.expr(node)
        event = _event_at(e.place) if e.type is BOOL and isinstance(e, Load) else None
        if event is None and e.type is not ERROR:
            self._checker.error(node.pos, "type", f"{name} is a global BOOL variable or a bit such as %IX0.3")
        elif event is not None and self._run_by(name, kind, node):
            self.task.event = event

    def _event(self, node: ast.Expr) -> None:
        if isinstance(node, ast.Name) and self._checker.scope.lookup(node.name) is None:
            message = f"EVENT is the name of an external event, in quotes: '{node.name}'"
            self._checker.error(node.pos, "unknown", message)
            return
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
        "LEVEL": _level,
        "EVENT": _event,
        "WATCHDOG": _watchdog,
        "SENSITIVITY": _sensitivity,
    }


# ---- tasks and instances of programs ----

DEFAULT_INTERVAL_US = 10_000
DEFAULT_TASK = "Main"
DEFAULT_PROGRAMS = ("PLC_PRG", "MAIN")


@dataclass
class Application:
    """The tasks, and the functions that events call. `of_tests`: they are those of unit tests, not of a device."""

    tasks: list[Task] = field(default_factory=list)
    events: list[EventFunction] = field(default_factory=list)
    exports: list[Export] = field(default_factory=list)
    of_tests: bool = False


def configure(world: World, config: InstanceConfig) -> Application:
    """Instantiates the programs that tasks run."""
    application = Application()
    builder = _Builder(world, application)
    if world.names.configurations:
        for decl in world.names.configurations:
            builder.configuration(decl)
    else:
        builder.default()
    config.apply(application.tasks)
    return application


def default_programs(world: World) -> list[PouSymbol]:
    """What runs without a CONFIGURATION when it is just one: that with a usual name, else all there are."""
    programs = world.names.program_symbols()
    for name in DEFAULT_PROGRAMS:
        for symbol in programs:
            if symbol.decl.name.upper() == name:
                return [symbol]
    return programs


class _Builder:
    def __init__(self, world: World, application: Application) -> None:
        self._world = world
        self._application = application
        self._names: set[str] = set()
        self._connections: list[tuple[ast.ProgramInstance, ProgramInfo, Task]] = []

    # ---- without CONFIGURATION ----

    def default(self) -> None:
        chosen = default_programs(self._world)
        if not chosen:
            return
        if len(chosen) > 1:
            self._report_several(chosen[1].decl)
            return
        program = self._instance(chosen[0].decl.full_name)
        self._check_in_outs(program, [], chosen[0].decl.source.pos(chosen[0].decl.pos))
        self._application.tasks.append(Task(DEFAULT_TASK, TaskKind.CYCLIC, 1, DEFAULT_INTERVAL_US, [program.pou]))

    def _report_several(self, decl: ast.PouDecl) -> None:
        """A project of another system without a task may be a library, which runs nothing."""
        pos, advice = decl.source.pos(decl.pos), "write a CONFIGURATION that says what runs"
        if decl.source.original is None:
            message = f"several programs: name one {DEFAULT_PROGRAMS[0]}, or {advice}"
            self._world.diagnostics.error(pos, "configuration", message)
            return
        message = "several programs and no task, so nothing would run"
        self._world.diagnostics.warning(pos, "no-program", f"{message}; {advice}, unless this is a library")

    def _instance(self, name: str) -> ProgramInfo:
        instance = self._world.names.instance(name.casefold())
        assert instance is not None and instance.program is not None
        return instance.program

    # ---- with CONFIGURATION ----

    def configuration(self, decl: ast.ConfigurationDecl) -> None:
        scope = self._world.scope(decl.source)
        tasks: dict[str, Task] = {}
        for task_decl in decl.tasks:
            if task_decl.name.casefold() in tasks:
                scope.error(task_decl.pos, "duplicate", f"there is a task {task_decl.name} already")
                continue
            tasks[task_decl.name.casefold()] = read_task(self._world, task_decl, scope)
        self._application.tasks += tasks.values()
        freewheeling: Task | None = None
        for instance in decl.programs:
            task = self._task_of(instance, tasks, scope)
            if task is None:
                continue
            if task is _BACKGROUND:
                if freewheeling is None:
                    freewheeling = background("Background")
                    self._application.tasks.append(freewheeling)
                task = freewheeling
            self._program(instance, task, scope)
        if not self._world.diagnostics.errors:
            self._report_gaps(decl, list(tasks.values()), freewheeling, scope)
        for instance, program, task in self._connections:
            self._connect(instance, program, task, scope)
        self._connections.clear()

    def _report_gaps(
        self, decl: ast.ConfigurationDecl, tasks: list[Task], freewheeling: Task | None, scope: Scope
    ) -> None:
        """Warns of what was probably forgotten."""
        for task, written in zip(tasks, decl.tasks, strict=False):
            if not any(name.upper() in ("INTERVAL", "SINGLE", "LEVEL", "EVENT") for _, name, _ in written.properties):
                message = (
                    f"the task {task.name} has no INTERVAL, SINGLE, LEVEL or EVENT, so it runs whenever there is time"
                )
                advice = "write INTERVAL := T#10ms, or T#0s if that is meant"
                scope.warning(written.pos, "configuration", f"{message}; {advice}")
            if not task.programs:
                message = f"the task {task.name} runs no program; write PROGRAM Name WITH {task.name} : Type;"
                scope.warning(written.pos, "configuration", message)
        if freewheeling is not None and tasks:
            for instance in decl.programs:
                if instance.task is None:
                    message = f"the program {instance.name} has no task, so it runs whenever there is time"
                    advice = f"write PROGRAM {instance.name} WITH {tasks[0].name} : {instance.type_name};"
                    scope.warning(instance.pos, "configuration", f"{message}; {advice}")

    def _task_of(self, instance: ast.ProgramInstance, tasks: dict[str, Task], scope: Scope) -> Task | None:
        if instance.task is None:
            return _BACKGROUND
        offset, name = instance.task
        task = tasks.get(name.casefold())
        if task is None:
            names = [t.name for t in tasks.values()]
            hint = did_you_mean(name, names) or (f"; there is {', '.join(names)}" if names else "")
            scope.error(offset, "unknown", f"there is no task {name}{hint}")
        return task

    def _program(self, instance: ast.ProgramInstance, task: Task, scope: Scope) -> None:
        symbol = self._world.names.lookup_program(instance.type_name)
        if symbol is None:
            hint = did_you_mean(instance.type_name, (p.decl.name for p in self._world.names.program_symbols()))
            scope.error(instance.type_pos, "unknown", f"there is no program {instance.type_name}{hint}")
            return
        if instance.name.casefold() in self._names:
            scope.error(instance.pos, "duplicate", f"there is a program instance {instance.name} already")
            return
        self._names.add(instance.name.casefold())
        program = self._instance(instance.name)
        task.programs.append(program.pou)
        self._check_in_outs(program, instance.args, scope.pos(instance.pos))
        if instance.args:
            self._connections.append((instance, program, task))

    def _check_in_outs(self, program: ProgramInfo, args: list[ast.Argument], pos: Pos) -> None:
        """A task gives a program no variables; only a call, or the line of the CONFIGURATION, does."""
        given = {(a.name or "").casefold() for a in args}
        for symbol, direction in program.parameters:
            if direction is Direction.IN_OUT and symbol.name.casefold() not in given:
                message = f"{program.name} has the VAR_IN_OUT {symbol.name}, so no task runs it; call it in a program"
                self._world.diagnostics.error(pos, "configuration", message)
                return

    def _connect(self, instance: ast.ProgramInstance, program: ProgramInfo, task: Task, scope: Scope) -> None:
        """`PROGRAM p WITH t : Type(input := x, output => y)`: small programs before and after do the assignments."""
        handed = program_arguments(Checker(self._world, scope), instance.args, program, instance.pos)
        if handed is None:
            return
        (before, behind), pou = handed, program.pou
        at = task.programs.index(pou)
        inputs, outputs = (
            [Pou(f"{pou.name}.{name}", PouKind.PROGRAM, pou.pos, body=body, connects=pou)] if body else []
            for name, body in (("inputs", before), ("outputs", behind))
        )
        task.programs[at : at + 1] = [*inputs, pou, *outputs]
        self._world.pous += [p for p in task.programs[at : at + 3] if p.name.startswith(f"{pou.name}.")]


_BACKGROUND = background("")
