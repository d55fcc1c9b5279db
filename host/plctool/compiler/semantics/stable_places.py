"""Places that stay: where the variables of a program go that is to take the place of another one while that runs.

A variable is found again by its full name. If all that both programs have of it is at the same offsets, it keeps its
place, and what its type has besides gets its initial value there. Otherwise it moves: it gets room that the previous
program does not use, and what both have of it is copied there. New variables get such room too, so that until the
exchange nothing is touched that the previous program uses.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from bisect import bisect_left, insort
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import field, replace

from plctool.compiler.semantics.sfc import RUNNING, STATE, STEP_TYPE
from plctool.compiler.typed.nodes import Variable
from plctool.compiler.typed.online_change import (
    Fill,
    Fresh,
    Gone,
    Kept,
    OnlineChange,
    PointerPart,
    Previous,
    PreviousVariable,
    Run,
)
from plctool.iec.areas import Area
from plctool.iec.types import (
    ArrayType,
    Elementary,
    EnumType,
    InterfaceType,
    Kind,
    PointerType,
    StringType,
    StructType,
    SubrangeType,
    Type,
    align_up,
)
from plctool.records import dataclass

PLACED_AREAS = (Area.DATA, Area.RETAIN, Area.MEMORY)  # whose variables get their places from `Allocation.place`


# ---- one type against another ----


@dataclass
class Match:
    """What a variable has of the previous one. `runs`: bytes that both have; `fills`: what numbers that became wider
    have besides; `objects`: where instances and structures were, and are; `retyped`: values that cannot be kept, in
    words; `misfit`: why there can be no change at all."""

    runs: list[Run] = field(default_factory=list)
    fresh: list[Fresh] = field(default_factory=list)
    gone: list[Gone] = field(default_factory=list)
    fills: list[Fill] = field(default_factory=list)
    pointers: list[PointerPart] = field(default_factory=list)
    objects: list[tuple[int, int]] = field(default_factory=list)
    retyped: list[str] = field(default_factory=list)
    misfit: str = ""

    @property
    def same(self) -> bool:
        """True if nothing of a variable of this type changes."""
        return not (self.fresh or self.gone or self.fills or self.retyped or self.misfit) and self.stays

    @property
    def stays(self) -> bool:
        """True if all that is kept is at the same offset, and as wide."""
        return not self.fills and all(run.source == run.to for run in self.runs)

    def add(self, part: Match, source: int, to: int) -> None:
        """Adds what a member or an element has, which was at offset `source`, and is at `to`."""
        self.runs += [Run(r.source + source, r.to + to, r.size) for r in part.runs]
        self.fresh += [replace(f, offset=f.offset + to) for f in part.fresh]
        self.gone += [replace(g, offset=g.offset + source) for g in part.gone]
        self.fills += [replace(f, offset=f.offset + to) for f in part.fills]
        self.pointers += [replace(p, offset=p.offset + source) for p in part.pointers]
        self.objects += [(before + source, now + to) for before, now in part.objects]
        self.retyped += part.retyped
        self.misfit = self.misfit or part.misfit

    def joined(self) -> Match:
        """The same with runs as long as possible: over room where the old type has nothing, and the new one has nothing
        that is kept."""
        gone = sorted(self.gone, key=lambda g: g.offset)
        starts = sorted(run.to for run in self.runs)
        runs: list[Run] = []
        at = 0
        for run in sorted(set(self.runs)):
            while at < len(gone) and gone[at].offset < (runs[-1].source + runs[-1].size if runs else 0):
                at += 1
            last = runs[-1] if runs else run
            between = at < len(gone) and gone[at].offset < run.source
            between = between or bisect_left(starts, last.to + last.size) < bisect_left(starts, run.to)
            if runs and run.source - last.source == run.to - last.to and not between:
                runs[-1] = Run(last.source, last.to, max(last.size, run.source + run.size - last.source))
            else:
                runs.append(run)
        return replace(self, runs=runs)


class Matcher:
    """Compares types of both programs; each pair once."""

    def __init__(self, in_registers: Mapping[str, Collection[str]]) -> None:
        self._in_registers = in_registers
        self._known: dict[tuple[int, int], tuple[Type, Type, Match]] = {}

    def compare(self, old: Type, new: Type) -> Match:
        """What a variable that has the type `new` finds of one of the type `old`."""
        known = self._known.get((id(old), id(new)))
        if known is None:
            known = self._known[id(old), id(new)] = (old, new, self._compare(old, new).joined())
        return known[2]

    def _compare(self, old: Type, new: Type) -> Match:
        if isinstance(new, StructType) and isinstance(old, StructType):
            if old.union or new.union:
                return self._unions(old, new)
            return self._structs(old, new)
        if isinstance(new, ArrayType) and isinstance(old, ArrayType) and len(old.bounds) == len(new.bounds):
            return self._arrays(old, new)
        if isinstance(new, StringType) and isinstance(old, StringType) and new.wide == old.wide:
            if new.length < old.length:
                return _retyped(old, new)
            return Match([Run(0, 0, old.size)], fills=_fills(old, new))
        if _is_same(old, new):
            return Match([Run(0, 0, new.size)], pointers=_pointer(new, None))
        if _is_wider(old, new):
            return Match([Run(0, 0, old.size)], fills=_fills(old, new))
        return _retyped(old, new)

    def _arrays(self, old: ArrayType, new: ArrayType) -> Match:
        element = self.compare(old.element, new.element)
        if old.bounds == new.bounds and element.same and not element.pointers and not element.objects:
            return Match([Run(0, 0, new.size)])
        if element.retyped and not element.runs:
            return _retyped(old, new)
        result = Match()
        _add_rows(result, element, old, new, (0, 0))
        result.retyped = element.retyped
        return result

    @staticmethod
    def _unions(old: StructType, new: StructType) -> Match:
        names = [[(f.name.casefold(), str(f.type)) for f in t.fields] for t in (old, new)]
        if not (old.union and new.union and names[0] == names[1] and old.size == new.size):
            return _retyped(old, new)
        return Match([Run(0, 0, new.size)], objects=[(0, 0)])

    def _structs(self, old: StructType, new: StructType) -> Match:
        had = {f.name.casefold(): f for f in old.fields}
        has = {f.name.casefold() for f in new.fields}
        was_in_register = self._in_registers.get(old.name, ())
        result = Match(objects=[(0, 0)])
        for f in new.fields:
            before = had.get(f.name.casefold())
            if before is None:
                result.fresh.append(Fresh(f.offset, f.type.size, (new, f.offset), f.name in was_in_register))
                if f.bit is not None:
                    result.misfit = result.misfit or f"{new}.{f.name} is a new bit"
                continue
            if before.bit != f.bit:
                result.misfit = result.misfit or f"in {new}, the bit {f.name} is at another place"
            part = self.compare(before.type, f.type)
            if part.pointers and isinstance(f.type, PointerType):
                part = replace(part, pointers=_pointer(f.type, (new, f.offset)))
            fresh = [replace(p, owner=p.owner or (new, f.offset)) for p in part.fresh]
            part = replace(part, fresh=fresh, retyped=[_in(f"{new}.{f.name}", why) for why in part.retyped])
            result.add(part, before.offset, f.offset)
        result.gone += [
            Gone(f.offset, f.type.size, f.type) for key, f in had.items() if key not in has and f.bit is None
        ]
        chart = _chart_problem(
            _Chart.of((f.name, f.type) for f in old.fields), _Chart.of((f.name, f.type) for f in new.fields)
        )
        result.misfit = result.misfit or (f"in the chart of {new}, {chart}" if chart else "")
        return result


def _add_rows(result: Match, element: Match, old: ArrayType, new: ArrayType, at: tuple[int, int]) -> None:
    """Adds the elements that both arrays have; `at`: the offsets of both. The other indices are done as arrays of
    their own."""
    (low, high), (had_low, had_high) = new.bounds[0], old.bounds[0]
    old_row, new_row = (replace(a, bounds=a.bounds[1:]) for a in (old, new))
    old_size, new_size = old_row.size, new_row.size
    source, to = at
    for index in range(had_low, had_high + 1):
        if not low <= index <= high:
            result.gone.append(Gone(source + (index - had_low) * old_size, old_size, old.element))
    for index in range(low, high + 1):
        here = to + (index - low) * new_size
        there = source + (index - had_low) * old_size
        if not had_low <= index <= had_high:
            result.fresh.append(Fresh(here, new_size))
        elif new_row.bounds:
            _add_rows(result, element, old_row, new_row, (there, here))
        else:
            result.add(element, there, here)


def _retyped(old: Type, new: Type) -> Match:
    return Match(fresh=[Fresh(0, new.size)], gone=[Gone(0, old.size, old)], retyped=[f"was {old}, is {new}"])


def _pointer(t: Type, owner: tuple[StructType, int] | None) -> list[PointerPart]:
    if not isinstance(t, PointerType):
        return []
    target = t.target
    while isinstance(target, ArrayType):
        target = target.element
    return [PointerPart(0, isinstance(target, StructType), owner)]


def _in(name: str, why: str) -> str:
    return f"{name} {why}" if why.startswith("was ") else why


def _fills(old: Type, new: Type) -> list[Fill]:
    signed = isinstance(new, Elementary) and new.signed and _elementary(old).signed
    return [Fill(old.size, new.size - old.size, signed)] if new.size > old.size else []


def _elementary(t: Type) -> Elementary:
    t = t.base if isinstance(t, SubrangeType) else t
    assert isinstance(t, Elementary)
    return t


def _is_wider(old: Type, new: Type) -> bool:
    """True if a number of one type is the same number in the other one, which has more bits."""
    old = old.base if isinstance(old, SubrangeType) else old
    if not (isinstance(old, Elementary) and isinstance(new, Elementary)) or new.bits <= old.bits or old.bits < 8:
        return False
    if (old.kind, new.kind) not in ((Kind.INT, Kind.INT), (Kind.BIT, Kind.BIT), (Kind.BIT, Kind.INT)):
        return False
    return new.signed or not old.signed


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
                self._keep_pointers(variable)
        had = self.change.previous.variables
        for before in had.values():
            if before.area in self._taken:
                self._take(before.area, before.offset, before.type.size)
        new = [v for v in open_ones if v.offset < 0 and not self._keep(v)]
        for variable in new:
            self._place(variable)
        self.change.new = new
        self._check_charts(variables)
        names = {v.name.casefold() for v in variables}
        for key, before in had.items():
            if key not in names and before.area in PLACED_AREAS:
                self.change.removed.append(before.name)
                self._drop(before, [Gone(0, before.type.size, before.type)])

    def is_new(self, variable: Variable) -> bool:
        """True if the previous program does not have a variable, in any place that it gives to variables."""
        before = self._previous_of(variable)
        if variable.area not in PLACED_AREAS or variable.offset >= 0:
            return False
        return before is None or not self._matcher.compare(before.type, variable.type).runs

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
        """Places a variable that the previous program has, too. False if that does not have it, or another value."""
        before = self._previous_of(variable)
        if before is None:
            return False
        name, change = variable.name, self.change
        match = self._matcher.compare(before.type, variable.type)
        if match.misfit:
            change.problems.append(f"{name}: {match.misfit}")
        change.retyped += [_in(name, why) if why.startswith("was ") else f"{name}: {why}" for why in match.retyped]
        self._drop(before, match.gone)
        if not match.runs:
            return False
        if self._stays(before, variable, match):
            variable.offset = before.offset
        else:
            self._place(variable)
            change.moved.append(name)
        change.parts.append(Kept(variable, before, match.runs, match.pointers, match.fills, match.objects))
        change.kept += 1
        if variable.constant:
            change.constants.append(variable)
        else:
            change.fresh += [(variable, fresh) for fresh in match.fresh]
        return True

    def _keep_pointers(self, variable: Variable) -> None:
        """Notes the pointers in a variable at an address."""
        before = self._previous_of(variable)
        if before is not None and (before.area, before.offset) == (variable.area, variable.offset):
            pointers = self._matcher.compare(before.type, variable.type).pointers
            self.change.parts.append(Kept(variable, before, [], pointers, [], []))

    @staticmethod
    def _stays(before: PreviousVariable, variable: Variable, match: Match) -> bool:
        fits = variable.type.size <= before.type.size and before.offset % variable.type.align == 0
        return match.stays and fits and before.area is variable.area

    def _place(self, variable: Variable) -> None:
        variable.offset = self._room(variable.area, variable.type)
        self._take(variable.area, variable.offset, variable.type.size)

    def _drop(self, before: PreviousVariable, gone: Iterable[Gone]) -> None:
        """Notes parts of a variable that the new program does not have."""
        for part in gone:
            self.change.gone.append((before, part))
            if any(t.name.casefold() in self.change.previous.with_exit for t in _parts(part.type)):
                whole = part.size == before.type.size
                what = f"{before.name} is removed" if whole else f"a part of {before.name} is removed"
                self.problem(f"{what}, and its FB_Exit would not run")

    def _check_charts(self, variables: Iterable[Variable]) -> None:
        """Checks the charts of programs, whose steps are variables of their own; Matcher checks those of blocks."""
        had = _charts((v.name, v.type) for v in self.change.previous.variables.values())
        for unit, chart in _charts((v.name, v.type) for v in variables).items():
            problem = _chart_problem(had.get(unit, _Chart()), chart)
            if problem:
                self.problem(f"in the chart of {unit}, {problem}")

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
