"""Programs that INDEXOF names: values go from one to another at the edges of their cycles (docs/tasks.md).

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Sequence

from plctool.compiler.semantics.event_functions import indexed_names, number_of
from plctool.compiler.semantics.symbols import PouSymbol
from plctool.compiler.semantics.world import World
from plctool.compiler.typed.nodes import Call, CallStatement, Const, Pou, PouKind, Task
from plctool.iec.types import BOOL, INT


def number_of_program(name: str) -> int:
    """The number that INDEXOF gives for a program: an INT below 0, since those of functions are above it."""
    return -number_of(name)


def link_programs(world: World, tasks: Sequence[Task]) -> None:
    """Calls TASK_LINKS__ of the library before and after each program that INDEXOF names."""
    run = {pou.name.casefold(): task for task in tasks for pou in task.programs if pou.connects is None}
    world.programs_run = set(run)
    for name in sorted(indexed_names(world) & run.keys()):
        _link(world, run[name], name)


def _link(world: World, task: Task, name: str) -> None:
    program = next(pou for pou in task.programs if pou.name.casefold() == name)
    first = next(n for n, pou in enumerate(task.programs) if program in (pou, pou.connects))
    parts = [pou for pou in task.programs if program in (pou, pou.connects)]
    before, behind = (_caller(world, program, after=after) for after in (False, True))
    task.programs[first : first + len(parts)] = [before, *parts, behind]
    world.pous += [before, behind]


def _caller(world: World, program: Pou, *, after: bool) -> Pou:
    symbol = world.names.unit("task_links__", library=True)
    assert isinstance(symbol, PouSymbol)
    function = world.declared.function(symbol, {})
    assert function is not None
    pos = program.pos
    arguments = [Const(number_of_program(program.name), INT, pos), Const(after, BOOL, pos)]
    body = [CallStatement(Call(function.pou, [*arguments], BOOL, pos), pos)]
    name = f"{program.name}.{'links_after' if after else 'links_before'}"
    return Pou(name, PouKind.PROGRAM, pos, body=[*body], connects=program)
