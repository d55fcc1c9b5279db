"""What each task uses of the inputs and outputs: of which parts it needs a copy of its own, and where two tasks write
the same output.

The address of a variable leads to all of its area. Where an address may be used by another task than the one that takes
it, or is taken by the initialisation, no task gets a copy of that area: all work on the shared one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import field
from itertools import combinations

from plctool.compiler.syntax.diagnostics import Diagnostics
from plctool.compiler.typed.nodes import (
    AddressOf,
    BitPlace,
    Const,
    DerefPlace,
    IndexPlace,
    MemberPlace,
    Place,
    Pos,
    Pou,
    SelfPlace,
    Storage,
    Task,
    TaskPart,
    TypedProgram,
    ValuePlace,
    Variable,
    VarPlace,
)
from plctool.compiler.typed.typed_nodes import callees, referenced_places, root_of, walk, written_places
from plctool.core import lib
from plctool.iec.areas import Area
from plctool.iec.types import ArrayType, InterfaceType, PointerType, StructType, Type
from plctool.records import dataclass

IMAGE_AREAS = (Area.INPUT, Area.OUTPUT)
_IMAGES = frozenset(IMAGE_AREAS)
_UNIT = int(lib.CDL_IMAGE_UNIT)


@dataclass
class _Write:
    """Bits of the output area, the variable they belong to, and where the program writes them."""

    start: int
    end: int
    variable: Variable
    pos: Pos


@dataclass
class _Use:
    """What a unit, or all units of a task, does with located variables and with pointers."""

    callees: set[Pou] = field(default_factory=set)
    bytes: dict[Area, set[tuple[int, int]]] = field(default_factory=dict)
    written: set[Area] = field(default_factory=set)
    addressed: set[Area] = field(default_factory=set)
    pointers: set[Variable] = field(default_factory=set)  # variables that last and hold a pointer
    writes: list[_Write] = field(default_factory=list)

    def add(self, other: _Use) -> None:
        for area, ranges in other.bytes.items():
            self.bytes.setdefault(area, set()).update(ranges)
        self.written |= other.written
        self.addressed |= other.addressed
        self.pointers |= other.pointers
        self.writes += other.writes


def plan_images(program: TypedProgram, diagnostics: Diagnostics) -> None:
    """Says of each task what it uses, and warns of outputs that two tasks write."""
    if not any(v.area in _IMAGES for v in program.globals):
        return
    units = _Units()
    uses = [units.use(task.programs) for task in program.tasks]
    kept = _kept_addresses(uses, units.use(_outside_of_tasks(program)))
    for area in IMAGE_AREAS:
        size = program.area_sizes[area]
        parts = [TaskPart() if area in kept else _part(use, area, size) for use in uses]
        for task, part in zip(program.tasks, parts, strict=True):
            shared = any(o is not part and o.start < part.end and part.start < o.end for o in parts)
            task.parts[area] = TaskPart(part.start, part.end, part.written, shared)
    _report_shared_outputs(program.tasks, uses, diagnostics)


def _outside_of_tasks(program: TypedProgram) -> list[Pou]:
    startups = [pou for pou in (program.startup, program.startup_of_new) if pou is not None]
    callers = [export.caller for export in program.exports if export.caller is not None]
    return [*startups, *(function.pou for function in program.events), *callers]


def task_ranges(program: TypedProgram) -> list[dict[Area, set[tuple[int, int]]]]:
    """The bytes of inputs and outputs that each task names, from the first up to the one past the end; all of an area
    of which it takes an address."""
    units = _Units()
    found = []
    for task in program.tasks:
        use = units.use(task.programs)
        whole = {area: {(0, program.area_sizes[area])} for area in use.addressed}
        found.append({**use.bytes, **whole})
    return found


class _Units:
    """What units use, each looked at once."""

    def __init__(self) -> None:
        self._known: dict[Pou, _Use] = {}

    def use(self, starts: Iterable[Pou]) -> _Use:
        """Of these units and all that they may call."""
        result, done, todo = _Use(), set[Pou](), list(starts)
        while todo:
            pou = todo.pop()
            if pou in done:
                continue
            done.add(pou)
            use = self._known.get(pou)
            if use is None:
                use = self._known[pou] = _unit_use(pou)
            result.add(use)
            todo += use.callees
        return result


def _unit_use(pou: Pou) -> _Use:
    use = _Use()
    for node in walk(pou.body):
        use.callees.update(callees(node))
        if isinstance(node, VarPlace):
            _note_variable(use, node.var)
        for place in referenced_places(node):
            use.addressed |= _area_of(place)
        for place in written_places(node):
            use.written |= _area_of(place)
            use.writes += _output_bits(place) if not isinstance(node, AddressOf) else ()
    return use


def _note_variable(use: _Use, var: Variable) -> None:
    if var.storage is not Storage.AREA:
        return
    if var.area in _IMAGES:
        use.bytes.setdefault(var.area, set()).add((var.offset, var.offset + var.type.size))
    elif _holds_pointer(var.type):
        use.pointers.add(var)


def _area_of(place: Place) -> set[Area]:
    root = root_of(place)
    return {root.area} & _IMAGES if root is not None and root.storage is Storage.AREA else set()


def _holds_pointer(t: Type) -> bool:
    """Whether the address of a variable may be kept in it."""
    while isinstance(t, ArrayType):
        t = t.element
    if isinstance(t, StructType):
        return any(_holds_pointer(f.type) for f in t.fields)
    return isinstance(t, PointerType) and not isinstance(t, InterfaceType)


def _kept_addresses(uses: list[_Use], startup: _Use) -> set[Area]:
    """The areas to which an address leads that a task may get from elsewhere."""
    kept = set(startup.addressed)
    if any(one.pointers & other.pointers for one, other in combinations(uses, 2)):
        kept |= {area for use in uses for area in use.addressed}
    return kept


def _part(use: _Use, area: Area, size: int) -> TaskPart:
    ranges = {(0, size)} if area in use.addressed else use.bytes.get(area)
    if not ranges:
        return TaskPart()
    start, end = min(r[0] for r in ranges), max(r[1] for r in ranges)
    return TaskPart(start // _UNIT * _UNIT, -(-end // _UNIT) * _UNIT, area in use.written)


# ---- two tasks that write one output ----


def _report_shared_outputs(tasks: list[Task], uses: list[_Use], diagnostics: Diagnostics) -> None:
    for (one, first), (other, second) in combinations(zip(tasks, uses, strict=True), 2):
        reported = set[Variable]()
        for write, before in _overlaps(second.writes, first.writes):
            if write.variable in reported or write.variable.shared_output or before.variable.shared_output:
                continue
            reported.add(write.variable)
            diagnostics.warning(write.pos, "shared-output", _message(write, before, one, other))


def _message(write: _Write, before: _Write, one: Task, other: Task) -> str:
    where = f"line {before.pos.line}" if before.pos.file == write.pos.file else f"{before.pos.file}:{before.pos.line}"
    also = "" if before.variable is write.variable else f" as {before.variable.name}"
    if before.pos == write.pos:
        what = f"{write.variable.name} is written here by the tasks {one.name} and {other.name}"
    else:
        what = f"{write.variable.name} is written by the task {other.name}, and by {one.name} in {where}{also}"
    return f"{what}: each undoes what the other wrote; {{attribute 'shared_output'}} says that it is meant"


def _overlaps(ones: list[_Write], others: list[_Write]) -> Iterator[tuple[_Write, _Write]]:
    others = sorted(others, key=lambda w: w.start)
    longest = max((w.end - w.start for w in others), default=0)
    for one in sorted(ones, key=lambda w: (w.pos.file, w.pos.line, w.pos.column)):
        for other in others:
            if other.start >= one.end:
                break
            if other.start >= one.start - longest and other.end > one.start:
                yield one, other
                break


def _output_bits(place: Place) -> list[_Write]:
    root = root_of(place)
    if root is None or root.storage is not Storage.AREA or root.area is not Area.OUTPUT:
        return []
    start, end = _bits(place)
    return [_Write(start, end, root, place.pos)]


def _bits(place: Place) -> tuple[int, int]:
    """The bits of the area that a place covers, which has a root; all of an array when the index is not known."""
    if isinstance(place, VarPlace):
        start = place.var.offset * 8  # of a bit at an address its byte: it is a BitPlace of that
        return start, start + place.type.size * 8
    assert not isinstance(place, DerefPlace | ValuePlace | SelfPlace)
    start, end = _bits(place.base)
    if isinstance(place, BitPlace):
        return start + place.bit, start + place.bit + 1
    if isinstance(place, MemberPlace):
        return start + place.offset * 8, start + (place.offset + place.type.size) * 8
    element = _element(place)
    return (start, end) if element is None else (start + element * 8, start + (element + place.type.size) * 8)


def _element(place: IndexPlace) -> int | None:
    """The bytes before an element of an array whose indices are constants."""
    if not isinstance(place.base.type, ArrayType) or place.limits is not None:
        return None
    number = 0
    for index, (low, high) in zip(place.indices, place.base.type.bounds, strict=True):
        if not isinstance(index, Const) or not isinstance(index.value, int):
            return None
        number = number * (high - low + 1) + index.value - low
    return number * place.type.size
