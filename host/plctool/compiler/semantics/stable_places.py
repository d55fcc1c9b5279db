"""Places that stay: where the variables of a program go that is to take the place of another one while that runs.

A variable is found again by its full name and its type. What both programs have keeps its place; what a type has
besides gets its initial value there. New variables go where the previous program has none, so that until the exchange
nothing is touched that it uses.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace

from plctool.compiler.semantics.sfc import RUNNING, STATE, STEP_TYPE
from plctool.compiler.typed.nodes import Variable
from plctool.compiler.typed.online_change import Fresh, OnlineChange, Previous, PreviousVariable
from plctool.iec.areas import Area
from plctool.iec.types import (
    ArrayType,
    EnumType,
    InterfaceType,
    PointerType,
    StringType,
    StructType,
    SubrangeType,
    Type,
    align_up,
)

PLACED_AREAS = (Area.DATA, Area.RETAIN, Area.MEMORY)  # whose variables get their places from `Allocation.place`


# ---- one type against another ----


@dataclass
class Match:
    """What a variable has of the previous one. `moved`: something is at another offset within the variable; `misfit`:
    why the value of a part cannot be kept."""

    fresh: list[Fresh] = field(default_factory=list)
    moved: str = ""
    misfit: str = ""

    @property
    def same(self) -> bool:
        return not (self.fresh or self.moved or self.misfit)


class Matcher:
    """Compares types of both programs; each pair once."""

    def __init__(self, in_registers: Mapping[str, Collection[str]]) -> None:
        self._in_registers = in_registers
        self._known: dict[tuple[int, int], tuple[Type, Type, Match]] = {}

    def compare(self, old: Type, new: Type) -> Match:
        """What a variable that has the type `new` finds in place of one of the type `old`."""
        known = self._known.get((id(old), id(new)))
        if known is None:
            known = self._known[id(old), id(new)] = (old, new, self._compare(old, new))
        return known[2]

    def _compare(self, old: Type, new: Type) -> Match:
        if isinstance(new, StructType) and isinstance(old, StructType):
            return self._structs(old, new)
        if isinstance(new, ArrayType) and isinstance(old, ArrayType):
            return self._arrays(old, new)
        if isinstance(new, StringType) and isinstance(old, StringType) and new.wide == old.wide:
            if new.length == old.length:
                return Match()
            return Match(moved=f"{old} became {new}")
        return Match() if _is_same(old, new) else Match(misfit=f"was {old}, is {new}")

    def _arrays(self, old: ArrayType, new: ArrayType) -> Match:
        if old.bounds != new.bounds:
            return Match(moved=f"{old} became {new}")
        element = self.compare(old.element, new.element)
        if element.same:
            return element
        if element.misfit or element.moved or old.element.size != new.element.size:
            why = element.moved or f"{old.element} has {old.element.size} bytes, now {new.element.size}"
            return Match(misfit=element.misfit, moved="" if element.misfit else why)
        size = new.element.size
        return Match([_shifted(f, n * size) for n in range(new.count) for f in element.fresh])

    def _structs(self, old: StructType, new: StructType) -> Match:
        if old.union or new.union:
            names = [[(f.name.casefold(), str(f.type)) for f in t.fields] for t in (old, new)]
            return Match() if old.union == new.union and names[0] == names[1] else Match(misfit=f"{new} changed")
        had = {f.name.casefold(): f for f in old.fields}
        was_in_register = self._in_registers.get(old.name, ())
        result = Match()
        for f in new.fields:
            before = had.get(f.name.casefold())
            if before is None:
                result.fresh.append(Fresh(f.offset, f.type.size, (new, f.offset), f.name in was_in_register))
                if f.bit is not None:
                    result.misfit = result.misfit or f"{new}.{f.name} is a new bit"
                continue
            if (before.offset, before.bit) != (f.offset, f.bit):
                result.moved = result.moved or f"in {new}, {f.name} is at another place"
                continue
            part = self.compare(before.type, f.type)
            result.fresh += [_shifted(fresh, f.offset) for fresh in part.fresh]
            result.moved = result.moved or part.moved
            if part.misfit and not result.misfit:
                result.misfit = f"{new}.{f.name} {part.misfit}" if part.misfit.startswith("was ") else part.misfit
        if new.size > old.size:
            result.moved = result.moved or f"{new} grew by {new.size - old.size} bytes"
        chart = _chart_problem(
            _Chart.of((f.name, f.type) for f in old.fields), _Chart.of((f.name, f.type) for f in new.fields)
        )
        result.misfit = result.misfit or (f"in the chart of {new}, {chart}" if chart else "")
        return result


def _shifted(fresh: Fresh, by: int) -> Fresh:
    return replace(fresh, offset=fresh.offset + by)


def _is_same(old: Type, new: Type) -> bool:
    """True if a value of one type means the same in the other."""
    if isinstance(old, PointerType) or isinstance(new, PointerType):
        return type(old) is type(new) and _target(old) == _target(new)
    if isinstance(old, EnumType) and isinstance(new, EnumType):
        return (old.name.casefold(), old.base.name) == (new.name.casefold(), new.base.name)
    if isinstance(old, SubrangeType) and isinstance(new, SubrangeType):
        return old.base.name == new.base.name and new.low <= old.low and old.high <= new.high
    return type(old) is type(new) and old.name.casefold() == new.name.casefold()


def _parts(t: Type) -> Iterator[Type]:
    """The type, and those that it consists of."""
    yield t
    if isinstance(t, ArrayType):
        yield from _parts(t.element)
    elif isinstance(t, StructType):
        for f in t.fields:
            yield from _parts(f.type)


def _target(pointer: Type) -> str:
    assert isinstance(pointer, PointerType)
    return "" if isinstance(pointer, InterfaceType) else pointer.target.name.casefold()


# ---- charts ----


@dataclass
class _Chart:
    """The chart of a unit, or all charts of its actions: the steps in their order, and the hidden variables that say
    which step is active. Where one step is active at a time, that is its number in this order."""

    steps: list[str] = field(default_factory=list)
    states: set[str] = field(default_factory=set)

    @staticmethod
    def of(variables: Iterable[tuple[str, Type]]) -> _Chart:
        """The chart among the variables of a unit."""
        chart = _Chart()
        for name, t in variables:
            if t.name == STEP_TYPE:
                chart.steps.append(name)
            elif name.endswith((STATE, RUNNING)):
                chart.states.add(name.casefold())
        return chart

    @property
    def is_numbered(self) -> bool:
        return any(name.endswith(STATE) for name in self.states)


def _chart_problem(old: _Chart, new: _Chart) -> str:
    """Says why a chart would not continue in the step that it is in; "" if it would."""
    if not old.steps or not new.steps:
        return ""
    had, has = ([name.casefold() for name in chart.steps] for chart in (old, new))
    gone = next((name for name in old.steps if name.casefold() not in has), None)
    if gone is not None:
        return f"the step {gone} is removed, and may be the active one"
    if old.states != new.states:
        return "steps run in parallel now and did not before, or the reverse"
    if new.is_numbered and has[: len(had)] != had:
        return "steps are in another order, or new before others; write new ones after those that are there"
    return ""


def _charts(variables: Iterable[tuple[str, Type]]) -> dict[str, _Chart]:
    """The charts of instances of programs, by their names."""
    found: dict[str, list[tuple[str, Type]]] = {}
    for name, t in variables:
        unit, _, own = name.rpartition(".")
        if t.name == STEP_TYPE or own.endswith((STATE, RUNNING)):
            found.setdefault(unit, []).append((own, t))
    return {unit: _Chart.of(own) for unit, own in found.items()}


# ---- places ----


class StablePlaces:
    """Gives the variables of a program their places beside or in those of the previous program."""

    def __init__(self, previous: Previous) -> None:
        self.change = OnlineChange(previous)
        self._matcher = Matcher(previous.in_registers)
        self._taken: dict[Area, list[tuple[int, int]]] = {area: [] for area in PLACED_AREAS}

    def place(self, variables: Collection[Variable]) -> None:
        """Places the variables that have no offset yet."""
        open_ones = [v for v in variables if v.area in PLACED_AREAS]
        for variable in open_ones:
            if variable.offset >= 0:  # at an address
                self._take(variable.area, variable.offset, variable.type.size)
        had = self.change.previous.variables
        for before in had.values():
            if before.area in self._taken:
                self._take(before.area, before.offset, before.type.size)
        new = [v for v in open_ones if v.offset < 0 and not self._keep(v)]
        for variable in new:
            variable.offset = self._room(variable.area, variable.type)
            self._take(variable.area, variable.offset, variable.type.size)
        self.change.new = new
        self._check_charts(variables)
        names = {v.name.casefold() for v in variables}
        for key, before in had.items():
            if key not in names and before.area in PLACED_AREAS:
                self.change.removed.append(before.name)
                self._check_exit(before)

    def is_new(self, variable: Variable) -> bool:
        """True if the previous program does not have a variable, in any place that it gives to variables."""
        before = self._previous_of(variable)
        return variable.area in PLACED_AREAS and variable.offset < 0 and before is None

    def has_fresh_parts(self, variable: Variable) -> bool:
        """True if a variable that is kept has parts that the previous program does not have."""
        before = self._previous_of(variable)
        fresh = [] if before is None else self._matcher.compare(before.type, variable.type).fresh
        return any(not part.was_in_register for part in fresh)

    def problem(self, message: str) -> None:
        """Notes why there can be no online change."""
        self.change.problems.append(message)

    def _previous_of(self, variable: Variable) -> PreviousVariable | None:
        before = self.change.previous.variables.get(variable.name.casefold())
        return before if before is not None and before.area in PLACED_AREAS else None

    def _keep(self, variable: Variable) -> bool:
        """Gives a variable the place that it has. False if the previous program does not have it."""
        before = self._previous_of(variable)
        if before is None:
            return False
        name, change = variable.name, self.change
        match = self._matcher.compare(before.type, variable.type)
        if before.area is not variable.area:
            change.problems.append(
                f"{name} is in the {variable.area.name.lower()} area, before in the {before.area.name.lower()} area"
            )
        elif match.misfit:
            own = match.misfit.startswith("was ")
            change.problems.append(f"{name} {match.misfit}" if own else f"{name}: {match.misfit}")
        elif match.moved:
            change.problems.append(f"{name}: {match.moved}")
        if before.area is not variable.area or variable.type.size > before.type.size:
            return False
        variable.offset = before.offset
        change.kept += 1
        if variable.constant:
            change.constants.append(variable)
        else:
            change.fresh += [(variable, fresh) for fresh in match.fresh]
        return True

    def _check_charts(self, variables: Iterable[Variable]) -> None:
        """Checks the charts of programs, whose steps are variables of their own; Matcher checks those of blocks."""
        had = _charts((v.name, v.type) for v in self.change.previous.variables.values())
        for unit, chart in _charts((v.name, v.type) for v in variables).items():
            problem = _chart_problem(had.get(unit, _Chart()), chart)
            if problem:
                self.problem(f"in the chart of {unit}, {problem}")

    def _check_exit(self, before: PreviousVariable) -> None:
        if any(t.name.casefold() in self.change.previous.with_exit for t in _parts(before.type)):
            self.change.problems.append(f"{before.name} is removed, and its FB_Exit would not run")

    def _take(self, area: Area, offset: int, size: int) -> None:
        insort(self._taken[area], (offset, offset + size))

    def _room(self, area: Area, t: Type) -> int:
        """The smallest hole that has room for a variable, else the end."""
        best: tuple[int, int] | None = None
        at = 0
        for start, end in self._holes(area):
            at = align_up(start, t.align)
            if end is None:
                break
            if at + t.size <= end and (best is None or end - start < best[0]):
                best = (end - start, at)
        return at if best is None else best[1]

    def _holes(self, area: Area) -> Iterator[tuple[int, int | None]]:
        """Room that nothing has; the last one has no end."""
        at = 0
        for start, end in self._taken[area]:
            if start > at:
                yield at, start
            at = max(at, end)
        yield at, None
