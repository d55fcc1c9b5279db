"""Who calls whom: recursion, programs that several tasks reach, and variables that several tasks write.

What a unit writes is computed once, for whatever calls it. What is written through a pointer is not known.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field
from graphlib import CycleError, TopologicalSorter

from plctool.compiler.semantics.generics import bounds_of
from plctool.compiler.syntax.diagnostics import Diagnostics
from plctool.compiler.typed.nodes import (
    Assign,
    BitPlace,
    Call,
    Const,
    Direction,
    FbCall,
    For,
    IndexPlace,
    MemberPlace,
    Place,
    Pos,
    Pou,
    PouKind,
    SelfPlace,
    Storage,
    Task,
    Try,
    Variable,
    VarPlace,
)
from plctool.compiler.typed.typed_nodes import callees, walk
from plctool.iec.areas import Area
from plctool.iec.types import ArrayType
from plctool.records import dataclass

# ---- recursion, and programs that several tasks reach ----


class CallGraph:
    """The calls of one program, each with the first place where it stands."""

    def __init__(self, diagnostics: Diagnostics) -> None:
        self._diagnostics = diagnostics
        self._calls: dict[Pou, dict[Pou, Pos]] = {}
        self._possible: list[tuple[Pou, list[Pou], Pos]] = []

    def add(self, caller: Pou | None, callee: Pou, pos: Pos) -> None:
        """Notes who calls whom."""
        if caller is not None:
            self._calls.setdefault(caller, {}).setdefault(callee, pos)

    def of(self, caller: Pou) -> list[Pou]:
        """Returns what a unit calls, in the order of its calls."""
        return list(self._calls.get(caller, ()))

    def forget(self, caller: Pou) -> None:
        """Forgets the calls of a unit, whose body is checked again."""
        if caller in self._calls:
            self._calls[caller].clear()

    def add_possible(self, caller: Pou, targets: Iterable[Pou], pos: Pos) -> None:
        """Notes a call through a pointer or an interface: one of `targets` runs."""
        self._possible.append((caller, list(targets), pos))

    def report_shared(self, tasks: Iterable[Task]) -> None:
        """Warns of programs that run more than once in a cycle, or in tasks that may interrupt each other."""
        runs: dict[Pou, list[Task]] = {}
        for task in tasks:
            for pou in self._reached(task.programs):
                runs.setdefault(pou, []).append(task)
        for caller, called in self._calls.items():
            for callee, pos in called.items():
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
        message = f"{pou.name} calls itself{_through(cycle[1:])}, which the stack of a controller does not allow"
        self._diagnostics.error(pos, "recursion", f"{message}; use a loop")

    def report_possible_recursion(self) -> bool:
        """Warns of calls through a pointer or an interface that may lead back to their caller, once for each circle.
        Returns whether there are any."""
        if not self._may_be_circular():
            return False
        calls = {caller: list(called) for caller, called in self._calls.items()}
        circles: dict[frozenset[Pou], tuple[Pos, str]] = {}
        for caller, targets, pos in sorted(self._possible, key=self._as_place_to_warn, reverse=True):
            ways = {target: _way(calls, target, caller) for target in targets}
            calls.setdefault(caller, []).extend(target for target, way in ways.items() if not way)
            way = min(filter(None, ways.values()), key=len, default=[])
            if way:
                circles[frozenset(way)] = pos, f"{caller.name} may call itself here{_through(way[:-1])}"
        for pos, message in circles.values():
            message += ": how much stack that needs is not known, and a controller has little"
            self._diagnostics.warning(pos, "recursion", message)
        return True

    def _as_place_to_warn(self, call: tuple[Pou, list[Pou], Pos]) -> tuple[bool, str, int, int]:
        """The order of calls: the first of a circle is where it is reported, which is not in a library."""
        pos = call[2]
        return self._diagnostics.is_quiet(pos.file), pos.file, pos.line, pos.column

    def _may_be_circular(self) -> bool:
        graph = TopologicalSorter[Pou](self._calls)
        for caller, targets, _ in self._possible:
            graph.add(caller, *targets)
        try:
            graph.prepare()
        except CycleError:
            return True
        return False


def _through(pous: Sequence[Pou]) -> str:
    return f" through {' and '.join(pou.name for pou in pous)}" if pous else ""


def _way(calls: Mapping[Pou, Iterable[Pou]], start: Pou, end: Pou) -> list[Pou]:
    """A shortest chain of calls, both ends included; empty if there is none."""
    chains = {start: [start]}
    todo = [start]
    for pou in todo:
        if pou is end:
            return chains[pou]
        for callee in calls.get(pou, ()):
            if callee not in chains:
                chains[callee] = [*chains[pou], callee]
                todo.append(callee)
    return []


# ---- variables that several tasks write: one may undo what the other wrote ----

_SHARED = (Area.DATA, Area.RETAIN, Area.MEMORY)  # of the outputs, each task has an image of its own


@dataclass(frozen=True)
class _Write:
    """Bits `start` to `end` (not included) of an area are written at `pos`, as part of `variable`."""

    variable: Variable
    start: int
    end: int
    pos: Pos


@dataclass
class _Unit:
    """What a unit does itself. `own`: it writes its instance; `parameters`: what it writes of its VAR_IN_OUT and
    outputs."""

    writes: list[_Write] = field(default_factory=list)
    parameters: set[Variable] = field(default_factory=set)
    own: bool = False
    callees: list[Pou] = field(default_factory=list)


def report_shared_writes(tasks: Sequence[Task], diagnostics: Diagnostics) -> None:
    """Warns at the write of the later task, once for each variable."""
    if len(tasks) < 2:
        return
    units = _Units()
    by_task = [units.reached(_programs(task)) for task in tasks]
    told: set[Variable] = set()
    for later in range(1, len(tasks)):
        for earlier in range(later):
            common = {pou.name for pou in by_task[later] & by_task[earlier] if pou.kind is PouKind.PROGRAM}
            mine, other = units.writes(by_task[later]), units.writes(by_task[earlier])
            for write, theirs in _overlaps(mine, other):
                shared = write.variable.name.rpartition(".")[0] in common  # `task` warns of the program
                if shared or write.variable in told or theirs.variable in told:
                    continue
                told.add(write.variable)
                message = _message(write, theirs, tasks[earlier].name, tasks[later].name)
                diagnostics.warning(write.pos, "shared", message)


def _message(write: _Write, theirs: _Write, earlier: str, later: str) -> str:
    name, where = write.variable.name, "" if theirs.pos == write.pos else f" (line {theirs.pos.line})"
    if theirs.pos.file != write.pos.file:
        where = f" ({theirs.pos.file}, line {theirs.pos.line})"
    if theirs.variable is write.variable:
        both = f"{name} is written by the tasks {earlier}{where} and {later}, and each may undo what the other wrote"
        return f"{both}; let one of them write it, or give each a variable of its own"
    both = f"{later} writes {name} in the same byte as {theirs.variable.name}, which {earlier} writes{where}"
    return f"{both}, and each may undo what the other wrote; put them into different bytes"


def _programs(task: Task) -> list[Pou]:
    """Without what VAR_CONFIG copies for the task."""
    return [pou for pou in task.programs if pou.name not in (f"{task.name}.inputs", f"{task.name}.outputs")]


def _overlaps(mine: list[_Write], other: list[_Write]) -> Iterator[tuple[_Write, _Write]]:
    """The writes that meet, in the order of the places of the first."""
    by_area: dict[Area, list[_Write]] = {}
    for write in other:
        by_area.setdefault(write.variable.area, []).append(write)
    for writes in by_area.values():
        writes.sort(key=lambda w: w.start)
    for write in sorted(mine, key=lambda w: (w.pos.file, w.pos.line, w.pos.column)):
        for theirs in by_area.get(write.variable.area, ()):
            if theirs.start >= write.end:
                break
            if theirs.end > write.start:
                yield write, theirs


class _Units:
    """What is known of the units so far."""

    def __init__(self) -> None:
        self._known: dict[Pou, _Unit] = {}

    def reached(self, starts: Iterable[Pou]) -> set[Pou]:
        """Everything that is called from `starts`."""
        found, todo = set[Pou](), list(starts)
        while todo:
            pou = todo.pop()
            if pou not in found:
                found.add(pou)
                todo += self.unit(pou).callees
        return found

    def writes(self, pous: Iterable[Pou]) -> list[_Write]:
        """What units write, all together."""
        return [write for pou in pous for write in self.unit(pou).writes]

    def unit(self, pou: Pou) -> _Unit:
        """What a unit does."""
        known = self._known.get(pou)
        if known is None:
            known = self._known[pou] = _Unit()  # the answer within a recursion
            for node in walk(pou.body):
                self._note(node, known)
        return known

    def _note(self, node: object, unit: _Unit) -> None:
        if isinstance(node, Assign):
            self._write(node.target, unit)
        elif isinstance(node, For):
            self._write(node.var, unit)
        elif isinstance(node, Try) and node.exception is not None:
            self._write(node.exception, unit)
        elif isinstance(node, FbCall):
            called = list(callees(node))
            unit.callees += called
            self._write(node.instance, unit)
            for _, place in node.outputs:
                self._write(place, unit)
            for variable, place in node.in_outs:
                if any(variable in self.unit(callee).parameters for callee in called):
                    self._write(place, unit)
        elif isinstance(node, Call):
            self._call(node, unit)

    def _call(self, node: Call, unit: _Unit) -> None:
        called = list(callees(node))
        unit.callees += called
        if node.instance is not None and any(self.unit(callee).own for callee in called):
            self._write(node.instance, unit)
        for number, (parameter, argument) in enumerate(zip(node.function.parameters, node.args, strict=True)):
            if argument is None or not isinstance(argument, Place) or parameter.direction is Direction.INPUT:
                continue
            variables = [callee.parameters[number].variable for callee in called]
            writes = any(v in self.unit(c).parameters for c, v in zip(called, variables, strict=True))
            if parameter.direction is Direction.OUTPUT or writes or node.function.external is not None:
                self._write(argument, unit)

    def _write(self, place: Place, unit: _Unit) -> None:
        root, start, size = place, 0, 8 * place.type.size
        while not isinstance(root, VarPlace):
            if isinstance(root, MemberPlace):
                start += 8 * root.offset
            elif isinstance(root, BitPlace):
                start, size = 0, 8 * root.base.type.size  # changing a bit writes the whole number
            elif isinstance(root, IndexPlace):
                start, size = _element(root, start, size)
            else:
                unit.own = unit.own or isinstance(root, SelfPlace)
                return
            root = root.base
        variable = root.var
        if variable.storage is Storage.SELF:
            unit.own = True
        elif variable.storage is Storage.REFERENCE:
            unit.parameters.add(variable)
        elif variable.storage is Storage.AREA and variable.area in _SHARED and not _is_hidden(variable):
            start += 8 * variable.offset
            unit.writes.append(_Write(variable, start, start + size, place.pos))


def _element(place: IndexPlace, start: int, size: int) -> tuple[int, int]:
    """The element with constant indices, else the whole array."""
    t, number = place.base.type, 0
    if not isinstance(t, ArrayType):
        return 0, 8 * t.size
    for index, (low, high) in zip(place.indices, bounds_of(place.base), strict=True):
        known = [e.value for e in (index, low, high) if isinstance(e, Const) and isinstance(e.value, int)]
        if len(known) < 3:
            return 0, 8 * t.size
        number = number * (known[2] - known[1] + 1) + known[0] - known[1]
    return start + 8 * number * t.element.size, size


def _is_hidden(variable: Variable) -> bool:
    """Whether it has no name in the program."""
    return "%" in variable.name[1:] or variable.name.startswith("__")
