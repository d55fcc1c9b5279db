"""Tasks and program instances: what a CONFIGURATION says, or what is meant when there is none.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from dataclasses import dataclass, field

from plctool.compiler import ast
from plctool.compiler.declarations import Allocation
from plctool.compiler.diagnostics import did_you_mean
from plctool.compiler.scope import Scope
from plctool.compiler.statements import Statements
from plctool.compiler.symbols import ERROR, PouSymbol
from plctool.compiler.typed import (
    Assign,
    Direction,
    Load,
    Parameter,
    Pou,
    PouKind,
    Statement,
    Task,
    TaskKind,
    Variable,
    VarPlace,
)
from plctool.compiler.types import BOOL, LTIME, TIME
from plctool.compiler.world import World

DEFAULT_INTERVAL_US = 10_000
DEFAULT_TASK = "Main"
DEFAULT_PROGRAM = "PLC_PRG"
LOWEST_PRIORITY = 31
MAX_INTERVAL_US = 0x7FFF_FFFF


@dataclass
class Application:
    """The tasks, and the program instances by name."""

    tasks: list[Task] = field(default_factory=list)
    programs: dict[str, Pou] = field(default_factory=dict)


def configure(world: World) -> Application:
    """Instantiates the programs. Programs that no task runs are checked all the same."""
    application = Application()
    builder = _Builder(world, application)
    if world.configurations:
        for decl in world.configurations:
            builder.configuration(decl)
    else:
        builder.default()
    builder.check_others()
    return application


class _Builder:
    def __init__(self, world: World, application: Application) -> None:
        self._world = world
        self._application = application
        self._used: set[PouSymbol] = set()
        self._connections: list[tuple[ast.ProgramInstance, Pou, Task]] = []

    # ---- without CONFIGURATION ----

    def default(self) -> None:
        programs = self._world.program_symbols()
        chosen = [p for p in programs if p.decl.name.upper() == DEFAULT_PROGRAM] or programs
        if not chosen:
            return
        if len(chosen) > 1:
            decl = chosen[1].decl
            self._world.diagnostics.error(
                decl.source.pos(decl.pos), "configuration",
                f"several programs: name one {DEFAULT_PROGRAM}, or write a CONFIGURATION that says what runs",
            )  # fmt: skip
            return
        pou = self._instance(chosen[0], chosen[0].decl.name, set())
        self._application.tasks.append(Task(DEFAULT_TASK, TaskKind.CYCLIC, 1, DEFAULT_INTERVAL_US, [pou]))

    def check_others(self) -> None:
        """Programs without an instance: their variables go nowhere."""
        for symbol in self._world.program_symbols():
            if symbol not in self._used:
                self._world.units.program(symbol, symbol.decl.name, Allocation(), set())

    def _instance(self, symbol: PouSymbol, name: str, qualifiers: set[str]) -> Pou:
        self._used.add(symbol)
        pou, scope = self._world.units.program(symbol, name, self._world.allocation, qualifiers)
        self._application.programs[name] = pou
        self._world.add_instance(name, scope)
        return pou

    # ---- with CONFIGURATION ----

    def configuration(self, decl: ast.ConfigurationDecl) -> None:
        scope = self._world.scope(decl.source)
        tasks: dict[str, Task] = {}
        for task_decl in decl.tasks:
            if task_decl.name.casefold() in tasks:
                scope.error(task_decl.pos, "duplicate", f"there is a task {task_decl.name} already")
                continue
            tasks[task_decl.name.casefold()] = self._task(task_decl, scope)
        self._application.tasks += tasks.values()
        background: Task | None = None
        for instance in decl.programs:
            task = self._task_of(instance, tasks, scope)
            if task is None:
                continue
            if task is _BACKGROUND:
                if background is None:
                    background = Task("Background", TaskKind.FREEWHEELING, LOWEST_PRIORITY, 0, [])
                    self._application.tasks.append(background)
                task = background
            self._program(instance, task, scope)
        for instance, pou, task in self._connections:
            self._connect(instance, pou, task, scope)
        self._connections.clear()

    def _task_of(self, instance: ast.ProgramInstance, tasks: dict[str, Task], scope: Scope) -> Task | None:
        if instance.task is None:
            return _BACKGROUND
        offset, name = instance.task
        task = tasks.get(name.casefold())
        if task is None:
            hint = did_you_mean(name, (t.name for t in tasks.values()))
            scope.error(offset, "unknown", f"there is no task {name}{hint}")
        return task

    def _program(self, instance: ast.ProgramInstance, task: Task, scope: Scope) -> None:
        symbol = self._world.lookup_program(instance.type_name)
        if symbol is None:
            hint = did_you_mean(instance.type_name, (p.decl.name for p in self._world.program_symbols()))
            scope.error(instance.type_pos, "unknown", f"there is no program {instance.type_name}{hint}")
            return
        if instance.name.casefold() in (n.casefold() for n in self._application.programs):
            scope.error(instance.pos, "duplicate", f"there is a program instance {instance.name} already")
            return
        pou = self._instance(symbol, instance.name, instance.qualifiers)
        task.programs.append(pou)
        if instance.args:
            self._connections.append((instance, pou, task))

    def _connect(self, instance: ast.ProgramInstance, pou: Pou, task: Task, scope: Scope) -> None:
        """`PROGRAM p WITH t : Type(input := x, output => y)`: small programs before and behind do the assignments."""
        checker = Statements(scope)
        before: list[Statement] = []
        behind: list[Statement] = []
        for argument in instance.args:
            parameter = self._parameter(argument, pou, instance, scope)
            if parameter is None or argument.value is None:
                continue
            variable, pos = parameter.variable, scope.pos(argument.pos)
            place = VarPlace(variable, variable.type, pos)
            if not argument.output:
                value = checker.value(argument.value, variable.type)
                before.append(Assign(place, value, pos))
                continue
            target = checker.target(argument.value, "an output", "take an output")
            if target is not None:
                value = checker.coerce(Load(place, variable.type, pos), target.type)
                behind.append(Assign(target, value, pos))
        at = task.programs.index(pou)
        task.programs[at : at + 1] = [
            *([Pou(f"{pou.name}.inputs", PouKind.PROGRAM, pou.pos, body=before)] if before else []),
            pou,
            *([Pou(f"{pou.name}.outputs", PouKind.PROGRAM, pou.pos, body=behind)] if behind else []),
        ]
        self._world.pous += [p for p in task.programs[at : at + 3] if p.name.startswith(f"{pou.name}.")]

    def _parameter(
        self, argument: ast.Argument, pou: Pou, instance: ast.ProgramInstance, scope: Scope
    ) -> Parameter | None:
        if argument.name is None:
            scope.error(argument.pos, "arguments", "write name := value or name => variable")
            return None
        direction = Direction.OUTPUT if argument.output else Direction.INPUT
        names = {p.variable.name.rpartition(".")[2]: p for p in pou.parameters if p.direction is direction}
        found = next((p for n, p in names.items() if n.casefold() == argument.name.casefold()), None)
        if found is None:
            what = "output" if argument.output else "input"
            hint = did_you_mean(argument.name, names)
            scope.error(argument.pos, "unknown", f"{instance.type_name} has no {what} {argument.name}{hint}")
        return found

    # ---- tasks ----

    def _task(self, decl: ast.TaskDecl, scope: Scope) -> Task:
        task = Task(decl.name, TaskKind.FREEWHEELING, LOWEST_PRIORITY, 0, [])
        checker = Statements(scope)
        for offset, name, value in decl.properties:
            key = name.upper()
            if isinstance(value, ast.ArrayInit | ast.StructInit) or key not in ("INTERVAL", "PRIORITY", "SINGLE"):
                scope.error(offset, "unknown", f"a TASK has INTERVAL, PRIORITY and SINGLE, not {name}")
            elif key == "INTERVAL":
                interval = self._interval(checker, value)
                if interval:
                    task.interval_us, task.kind = interval, TaskKind.CYCLIC
            elif key == "PRIORITY":
                task.priority = self._priority(checker, value)
            else:
                event = self._event(checker, value)
                if event is not None:
                    task.event, task.kind = event, TaskKind.EVENT
        return task

    def _interval(self, checker: Statements, node: ast.Expr) -> int:
        e = checker.constant(node)
        if e is None:
            return 0
        if e.type not in (TIME, LTIME) or not isinstance(e.value, int):
            checker.error(node.pos, "type", f"INTERVAL is a duration such as T#10ms, not {e.type}")
            return 0
        interval = e.value * 1000 if e.type is TIME else e.value // 1000
        if not 0 <= interval <= MAX_INTERVAL_US:
            checker.error(node.pos, "range", "INTERVAL has to lie between 0 and 35 minutes")
            return 0
        return interval

    def _priority(self, checker: Statements, node: ast.Expr) -> int:
        priority = checker.integer(node)
        if priority is None or 0 <= priority <= LOWEST_PRIORITY:
            return LOWEST_PRIORITY if priority is None else priority
        checker.error(node.pos, "range", f"PRIORITY is 0 (highest) to {LOWEST_PRIORITY}, not {priority}")
        return LOWEST_PRIORITY

    def _event(self, checker: Statements, node: ast.Expr) -> Variable | None:
        e = checker.expr(node)
        if e.type is ERROR:
            return None
        if e.type is BOOL and isinstance(e, Load) and isinstance(e.place, VarPlace):
            return e.place.var
        checker.error(node.pos, "type", "SINGLE is a global BOOL variable")
        return None


_BACKGROUND = Task("", TaskKind.FREEWHEELING, LOWEST_PRIORITY, 0, [])
