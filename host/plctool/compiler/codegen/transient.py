"""Variables of function blocks that no call needs from the previous one: inputs that every call gives, and what
the body assigns in every call before it reads it. Where they need not be watched they live in registers; of a structure
that is an input these are the members that the body reads.

Outputs are kept, and so is what anything but the statements of the body names, or what they do not just read or assign.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from plctool.compiler.codegen.sections import sections
from plctool.compiler.typed.nodes import (
    Assign,
    Case,
    Continue,
    Exit,
    Expr,
    FbCall,
    For,
    If,
    Jump,
    Label,
    Load,
    MemberPlace,
    Place,
    Pou,
    PouKind,
    Raise,
    Repeat,
    Return,
    Statement,
    Storage,
    Try,
    TypedProgram,
    Variable,
    VarPlace,
    While,
)
from plctool.compiler.typed.typed_nodes import walk
from plctool.iec.types import StructType, is_scalar

TransientVariables = dict[Pou, list[Variable]]

_Member = tuple[StructType, int]  # a block and an offset in its instance
_Variables = frozenset[Variable]
_NOTHING: _Variables = frozenset()
_LEAVING = (Return, Exit, Continue, Jump, Raise)


def transient_variables(
    program: TypedProgram, pous: Iterable[Pou], given: dict[Pou, list[Variable]]
) -> TransientVariables:
    """By block. `pous`: all that the program reaches; `given`: the inputs of each block that every call gives."""
    if program.accesses or any(t.event and isinstance(t.event.variable.type, StructType) for t in program.tasks):
        return {}  # parts of instances have other names, or start tasks
    units = list(pous)
    bases = {unit.instance.base for unit in units if unit.instance is not None}
    named = {member for unit in units for member in _named_from_outside(unit)}
    found = {}
    for unit in units:
        if unit.kind is PouKind.FUNCTION_BLOCK and not unit.external and len(sections(unit)) == 1:
            instance = unit.instance
            assert instance is not None
            if instance.base is None and instance not in bases:
                inputs = frozenset(given.get(unit, ()))
                usable = {v for v in _only_read_and_assigned(unit, inputs) if (instance, v.offset) not in named}
                found[unit] = sorted(usable - _read_first(unit.body, inputs), key=lambda v: v.offset)
    return found


def _named_from_outside(unit: Pou) -> Iterator[_Member]:
    """Members that a unit names by their instance, or as a method of it."""
    for node in walk(unit.body):
        if isinstance(node, MemberPlace) and isinstance(node.base.type, StructType):
            yield node.base.type, node.offset
        elif unit.kind is PouKind.METHOD and isinstance(node, VarPlace) and node.var.storage is Storage.SELF:
            assert unit.instance is not None
            yield unit.instance, node.var.offset


def _only_read_and_assigned(block: Pou, inputs: _Variables) -> set[Variable]:
    """Scalars of the instance that are inputs of the given ones or variables of the block, and structures that are such
    inputs, with which no more is done."""
    plain = {id(place) for node in walk(block.body) for place in _plain_places(node)}
    places = [node for node in walk(block.body) if isinstance(node, VarPlace)]
    parameters = {parameter.variable for parameter in block.parameters}
    scalars = {place.var for place in places if is_scalar(place.type)} - parameters
    candidates = scalars | {v for v in inputs if is_scalar(v.type) or isinstance(v.type, StructType)}
    other = {place.var for place in places if id(place) not in plain}
    return {v for v in candidates - other if v.storage is Storage.SELF and v.bit is None}


def _plain_places(node: object) -> Iterator[Place]:
    """Scalars that a node reads or assigns as a whole, and structures of which it reads one."""
    if isinstance(node, Load) and is_scalar(node.type):
        yield _structure(node.place)
    elif isinstance(node, Assign):
        yield node.target
    elif isinstance(node, For):
        yield node.var
    elif isinstance(node, FbCall):
        yield from (place for _, place in node.outputs)


def _structure(place: Place) -> Place:
    """What a member is part of; the place itself if it is none."""
    while isinstance(place, MemberPlace):
        place = place.base
    return place


def _read_first(body: list[Statement], inputs: _Variables) -> set[Variable]:
    """What a call may read before it assigns it."""
    flow = _Flow(inputs)
    flow.run(body, inputs)
    return flow.read


class _Flow:
    """Goes through statements in the order in which they run. `read`: variables that were read where they are not
    assigned on every way."""

    def __init__(self, inputs: _Variables) -> None:
        self._inputs = inputs
        self.read: set[Variable] = set()

    def run(self, body: list[Statement], assigned: _Variables) -> _Variables | None:
        """What is assigned after statements; None if nothing follows them."""
        after: _Variables | None = assigned
        for statement in body:
            if after is None or isinstance(statement, Label):  # what leads to a label is not looked at
                after = self._inputs
            after = self._after(statement, after)
        return after

    def _after(self, statement: Statement, assigned: _Variables) -> _Variables | None:
        if isinstance(statement, _LEAVING):
            return None
        if isinstance(statement, Assign):
            self._reads(statement.value, assigned)
            return assigned | self._assigns(statement.target, assigned)
        if isinstance(statement, FbCall):
            self._reads([statement.instance, statement.inputs, statement.in_outs], assigned)
            for _, place in statement.outputs:
                assigned |= self._assigns(place, assigned)
            return assigned
        if isinstance(statement, If):
            return self._after_if(statement, assigned)
        if isinstance(statement, Case):
            self._reads(statement.selector, assigned)
            ways = [body for _, body in statement.branches]
            return _on_all_ways([self.run(way, assigned) for way in [*ways, statement.otherwise]])
        if isinstance(statement, For):
            self._reads([statement.start, statement.stop, statement.step], assigned)
            assigned |= self._assigns(statement.var, assigned)
            self.run(statement.body, assigned)
            return assigned
        if isinstance(statement, While):
            self._reads(statement.condition, assigned)
            self.run(statement.body, assigned)
            return assigned
        if isinstance(statement, Repeat):
            self.run(statement.body, assigned)
            self._reads(statement.until, assigned)
            return assigned
        if isinstance(statement, Try):
            for part in (statement.body, statement.caught, statement.last):
                self.run(part, assigned)
            return assigned
        self._reads(statement, assigned)
        return assigned

    def _after_if(self, statement: If, assigned: _Variables) -> _Variables | None:
        ways = []
        for condition, body in statement.branches:
            self._reads(condition, assigned)
            ways.append(self.run(body, assigned))
        return _on_all_ways([*ways, self.run(statement.otherwise, assigned)])

    def _assigns(self, place: Place, assigned: _Variables) -> _Variables:
        """What is assigned with a place: the variable as a whole."""
        if isinstance(place, VarPlace):
            return frozenset({place.var})
        self._reads(place, assigned)
        return _NOTHING

    def _reads(self, what: Expr | Place | Statement | list[object], assigned: _Variables) -> None:
        self.read |= {node.var for node in walk(what) if isinstance(node, VarPlace)} - assigned


def _on_all_ways(ways: list[_Variables | None]) -> _Variables | None:
    ended = [way for way in ways if way is not None]
    return frozenset.intersection(*ended) if ended else None
