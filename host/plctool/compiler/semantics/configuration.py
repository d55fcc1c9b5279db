"""Tasks and program instances: what a CONFIGURATION says, or what is meant when there is none.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from dataclasses import dataclass, field

from plctool.compiler.diagnostics import did_you_mean
from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.declarations.instance_config import InstanceConfig
from plctool.compiler.semantics.rules.block_calls import program_arguments
from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.symbols import PouSymbol, ProgramInfo
from plctool.compiler.semantics.tasks import background, read_task
from plctool.compiler.semantics.world import World
from plctool.compiler.syntax import ast
from plctool.compiler.typed import Direction, Pos, Pou, PouKind, Task, TaskKind

DEFAULT_INTERVAL_US = 10_000
DEFAULT_TASK = "Main"
DEFAULT_PROGRAMS = ("PLC_PRG", "MAIN")


@dataclass
class Application:
    """The tasks."""

    tasks: list[Task] = field(default_factory=list)


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
            decl = chosen[1].decl
            self._world.diagnostics.error(
                decl.source.pos(decl.pos), "configuration",
                f"several programs: name one {DEFAULT_PROGRAMS[0]}, or write a CONFIGURATION that says what runs",
            )  # fmt: skip
            return
        program = self._instance(chosen[0].decl.full_name)
        self._check_in_outs(program, [], chosen[0].decl.source.pos(chosen[0].decl.pos))
        self._application.tasks.append(Task(DEFAULT_TASK, TaskKind.CYCLIC, 1, DEFAULT_INTERVAL_US, [program.pou]))

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
            if not any(name.upper() in ("INTERVAL", "SINGLE", "EVENT") for _, name, _ in written.properties):
                message = f"the task {task.name} has no INTERVAL, SINGLE or EVENT, so it runs whenever there is time"
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
            hint = did_you_mean(name, (t.name for t in tasks.values()))
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
        task.programs[at : at + 1] = [
            *([Pou(f"{pou.name}.inputs", PouKind.PROGRAM, pou.pos, body=before)] if before else []),
            pou,
            *([Pou(f"{pou.name}.outputs", PouKind.PROGRAM, pou.pos, body=behind)] if behind else []),
        ]
        self._world.pous += [p for p in task.programs[at : at + 3] if p.name.startswith(f"{pou.name}.")]


_BACKGROUND = background("")
