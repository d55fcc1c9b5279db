"""The typed program says of each of its nodes which fields hold others, so that no walk misses one."""

from __future__ import annotations

import re
from dataclasses import fields
from typing import get_args

import pytest

from plctool.compiler.typed.nodes import (
    Binary,
    BinaryOp,
    Call,
    Const,
    Convert,
    Expr,
    IndexPlace,
    Load,
    Node,
    Place,
    Pos,
    Pou,
    PouKind,
    Statement,
    Storage,
    Variable,
    VarPlace,
)
from plctool.compiler.typed.typed_nodes import rewrite, walk
from plctool.iec.types import DINT, ArrayType

POS = Pos("main.st", 1, 1)
KINDS = get_args(Place) + get_args(Expr) + get_args(Statement)
A_NODE = re.compile(r"\b(Place|Expr|Statement|Assign|Call)\b")
ARRAY = ArrayType(DINT, ((0, 3),))


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_every_field_that_may_hold_a_node_is_a_child(kind: type[Node]) -> None:
    holding = tuple(field.name for field in fields(kind) if A_NODE.search(str(field.type)))  # type: ignore[arg-type]
    assert kind.children == holding


def test_only_places_expressions_and_statements_are_nodes() -> None:
    assert set(Node.__subclasses__()) == set(KINDS)


def variable(name: str) -> VarPlace:
    return VarPlace(Variable(name, DINT, Storage.LOCAL, POS), DINT, POS)


def test_rewriting_reaches_the_nodes_in_lists_and_tuples() -> None:
    old, new = variable("old"), variable("new")
    one = Const(1, DINT, POS)
    array = VarPlace(Variable("a", ARRAY, Storage.LOCAL, POS), ARRAY, POS)
    bounds: list[tuple[Expr, Expr]] = [(one, Load(old, DINT, POS))]
    element = IndexPlace(array, [Load(old, DINT, POS)], DINT, POS, bounds)
    function = Pou("f", PouKind.FUNCTION, POS)
    before = Call(function, [Convert(Load(element, DINT, POS), DINT, POS, check=(0, 1)), None, one], DINT, POS)
    after = rewrite(before, lambda node: new if node is old else None)
    assert sum(node is old for node in walk(before)) == 2
    assert [sum(node is place for node in walk(after)) for place in (old, new)] == [0, 2]
    assert after.function is function and after.args[1:] == [None, one]


def test_rewriting_leaves_what_it_was_given_alone() -> None:
    sum_of_two = Binary(BinaryOp.ADD, Const(1, DINT, POS), Const(2, DINT, POS), DINT, POS)
    three = Const(3, DINT, POS)
    after = rewrite(sum_of_two, lambda node: three if isinstance(node, Const) else None)
    assert isinstance(sum_of_two.left, Const) and sum_of_two.left.value == 1
    assert (after.left, after.right) == (three, three)
