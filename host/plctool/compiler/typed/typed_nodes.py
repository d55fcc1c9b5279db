"""Going through the typed program: its nodes, the variables of places, what is written, who is called."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from operator import attrgetter
from typing import Any, TypeVar

from plctool.compiler.typed.nodes import (
    AddressOf,
    Assign,
    BitPlace,
    Call,
    Const,
    Continue,
    DerefPlace,
    Direction,
    Exit,
    FbCall,
    For,
    IndexPlace,
    Initialise,
    MemberPlace,
    Node,
    Place,
    Pou,
    SelfPlace,
    Storage,
    Try,
    ValuePlace,
    Variable,
    VarPlace,
)
from plctool.iec.types import alignment_at

T = TypeVar("T")
_WALKED = frozenset(Node.__subclasses__()) - {Const, Exit, Continue}  # without those no question is about
_ONE_CHILD = {kind: attrgetter(*kind.children) for kind in _WALKED if len(kind.children) == 1}
_CHILDREN = {kind: attrgetter(*kind.children) for kind in _WALKED if len(kind.children) > 1}


def walk(root: object) -> Iterator[Node]:
    """Every node of statements or expressions below `root` (a node, or lists and tuples of them), but constants, EXIT
    and CONTINUE."""
    stack: list[Any] = [root]
    while stack:
        node = stack.pop()
        kind = type(node)
        if kind is list or kind is tuple:
            stack += node
        elif kind in _ONE_CHILD:
            yield node
            stack.append(_ONE_CHILD[kind](node))
        elif kind in _CHILDREN:
            yield node
            stack += _CHILDREN[kind](node)
        elif kind in _WALKED:
            yield node


def rewrite(root: T, change: Callable[[Node], Node | None]) -> T:
    """A copy of `root` (a node, or lists and tuples of them) in which `change` says what stands in place of each node;
    where it gives None, that node stays, with its own parts rewritten."""
    return _rewritten(root, change)  # type: ignore[return-value]


def _rewritten(root: object, change: Callable[[Node], Node | None]) -> object:
    if isinstance(root, list | tuple):
        return type(root)(_rewritten(part, change) for part in root)
    if not isinstance(root, Node):
        return root
    changed = change(root)
    if changed is not None:
        return changed
    return replace(root, **{name: _rewritten(getattr(root, name), change) for name in root.children})  # type: ignore[type-var]


def root_of(place: Place) -> Variable | None:
    """The variable a place is part of; None when it is reached through a pointer or is a value."""
    while not isinstance(place, VarPlace):
        if isinstance(place, DerefPlace | ValuePlace | SelfPlace):
            return None
        place = place.base
    return None if place.var.storage is Storage.REFERENCE else place.var


def alignment(place: Place) -> int:
    """What the address of a place is a multiple of [bytes]: less than its type wants in a packed structure."""
    if isinstance(place, MemberPlace):
        return alignment_at(place.offset, alignment(place.base))
    if isinstance(place, IndexPlace | BitPlace):
        return min(alignment(place.base), place.type.align)
    return place.type.align


def is_unaligned(place: Place) -> bool:
    """Whether only statements that know where it is can use a place: it is in a packed structure."""
    return alignment(place) < place.type.align


def written_places(node: object) -> Iterator[Place]:
    """Places that `node` itself writes, or hands out by reference so that others may."""
    if isinstance(node, Assign):
        yield node.target
    elif isinstance(node, For):
        yield node.var
    elif isinstance(node, Initialise):
        yield node.place
    elif isinstance(node, Try) and node.exception is not None:
        yield node.exception
    elif isinstance(node, AddressOf):
        yield node.place
    elif isinstance(node, FbCall):
        yield node.instance
        for _, place in node.in_outs + node.outputs:
            yield place
    elif isinstance(node, Call):
        if node.instance is not None:
            yield node.instance
        for parameter, argument in zip(node.function.parameters, node.args, strict=True):
            if parameter.direction is not Direction.INPUT and argument is not None:
                yield argument  # type: ignore[misc]


def referenced_places(node: object) -> Iterator[Place]:
    """Places whose address `node` takes so that it may be kept: by ADR, REF=, or as VAR_IN_OUT."""
    if isinstance(node, AddressOf):
        yield node.place
    elif isinstance(node, FbCall):
        for _, place in node.in_outs:
            yield place
    elif isinstance(node, Call):
        for parameter, argument in zip(node.function.parameters, node.args, strict=True):
            if parameter.direction is Direction.IN_OUT and argument is not None:
                yield argument  # type: ignore[misc]


def callees(node: object) -> Iterable[Pou]:
    """What `node` may call."""
    if not isinstance(node, Call | FbCall):
        return ()
    if node.dispatch is not None:
        return node.dispatch.targets.values()
    return (node.function,) if isinstance(node, Call) else (node.block,)
