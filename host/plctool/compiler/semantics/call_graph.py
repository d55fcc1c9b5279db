"""Who calls whom: recursion, and programs that several tasks reach.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterable

from plctool.compiler.diagnostics import Diagnostics
from plctool.compiler.typed import Pos, Pou, PouKind, Task


class CallGraph:
    """The calls of one program, each with the first place where it stands."""

    def __init__(self, diagnostics: Diagnostics) -> None:
        self._diagnostics = diagnostics
        self._calls: dict[Pou, dict[Pou, Pos]] = {}

    def add(self, caller: Pou | None, callee: Pou, pos: Pos) -> None:
        """Notes who calls whom."""
        if caller is not None:
            self._calls.setdefault(caller, {}).setdefault(callee, pos)

    def report_shared(self, tasks: Iterable[Task]) -> None:
        """Warns of programs that run more than once in a cycle, or in tasks that may interrupt each other."""
        runs: dict[Pou, list[Task]] = {}
        for task in tasks:
            for pou in self._reached(task.programs):
                runs.setdefault(pou, []).append(task)
        for caller, callees in self._calls.items():
            for callee, pos in callees.items():
                if callee.kind is not PouKind.PROGRAM or caller not in runs:
                    continue
                names = [task.name for task in runs[callee]]
                if len(names) > 1:
                    message = f"{callee.name} runs in the tasks {' and '.join(names)}, which may interrupt each other"
                    self._diagnostics.warning(pos, "task", message)
                elif callee in runs[callee][0].programs:
                    message = f"{callee.name} is run by the task {names[0]} as well, so it runs twice in a cycle"
                    self._diagnostics.warning(pos, "task", message)

    def _reached(self, starts: Iterable[Pou]) -> set[Pou]:
        found, todo = set[Pou](), list(starts)
        while todo:
            pou = todo.pop()
            if pou not in found:
                found.add(pou)
                todo += self._calls.get(pou, {})
        return found

    def report_recursion(self) -> None:
        """A call that leads back to its caller: the stack of a controller is bounded."""
        done: set[Pou] = set()
        for start in list(self._calls):
            path: list[Pou] = []
            stack: list[tuple[Pou, Iterable[Pou]]] = [(start, iter(self._calls.get(start, {})))]
            while stack:
                pou, callees = stack[-1]
                if pou not in path:
                    path.append(pou)
                following = next(iter(callees), None)
                if following is None:
                    done.add(pou)
                    path.pop()
                    stack.pop()
                elif following in path:
                    self._recursion(path[path.index(following) :], following, self._calls[pou][following])
                elif following not in done:
                    stack.append((following, iter(self._calls.get(following, {}))))

    def _recursion(self, cycle: list[Pou], pou: Pou, pos: Pos) -> None:
        if len(cycle) == 1:
            message = f"{pou.name} calls itself"
        else:
            message = f"{pou.name} calls itself through {' and '.join(p.name for p in cycle[1:])}"
        self._diagnostics.error(
            pos, "recursion", f"{message}, which the stack of a controller does not allow; use a loop"
        )
