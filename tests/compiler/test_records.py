"""Records behave as dataclasses of the standard library."""

from __future__ import annotations

import dataclasses
import pickle
from collections.abc import Callable
from typing import Any

import pytest

from plctool import records


def classes(dataclass: Callable[..., Any]) -> dict[str, Any]:
    @dataclass
    class Plain:
        a: int
        b: list[int] = dataclasses.field(default_factory=list)
        c: str = dataclasses.field(default="c", repr=False, compare=False)
        d: int = dataclasses.field(default=4, init=False)
        e: int = dataclasses.field(default=5, kw_only=True)

        def __post_init__(self) -> None:
            self.d += self.a

    @dataclass(frozen=True)
    class Frozen:
        a: int
        b: str = dataclasses.field(default="b", compare=False)

    @dataclass(frozen=True)
    class Derived(Frozen):
        c: tuple[int, ...] = ()

    @dataclass(slots=True, eq=False)
    class Slotted:
        a: int
        b: int = 2

    @dataclass(frozen=True, order=True)
    class Ordered:
        a: int

    found = (Plain, Frozen, Derived, Slotted, Ordered)
    for each in found:
        each.__qualname__ = each.__name__
    return {each.__name__: each for each in found}


CALLS: tuple[Callable[[dict[str, Any]], object], ...] = (
    lambda of: repr(of["Plain"](1)),
    lambda of: vars(of["Plain"](1, [2], "x", e=7)),
    lambda of: of["Plain"](1).b is of["Plain"](1).b,
    lambda of: of["Plain"](1, c="x") == of["Plain"](1, c="y"),
    lambda of: of["Plain"](1) == of["Plain"](2),
    lambda of: of["Plain"](1) == 1,
    lambda of: of["Plain"](),
    lambda of: of["Plain"](1, d=3),
    lambda of: hash(of["Plain"](1)),
    lambda of: hash(of["Frozen"](1, "x")) == hash(of["Frozen"](1, "y")),
    lambda of: of["Frozen"](1) == of["Derived"](1),
    lambda of: repr(of["Derived"](1, c=(2,))),
    lambda of: {of["Derived"](1), of["Derived"](1)} == {of["Derived"](1)},
    lambda of: setattr(of["Frozen"](1), "a", 2),
    lambda of: setattr(of["Derived"](1), "new", 2),
    lambda of: delattr(of["Frozen"](1), "a"),
    lambda of: repr(dataclasses.replace(of["Derived"](1), b="x")),
    lambda of: dataclasses.asdict(of["Plain"](1)),
    lambda of: [(f.name, f.compare) for f in dataclasses.fields(of["Plain"])],
    lambda of: repr(of["Slotted"](1)),
    lambda of: of["Slotted"](1) == of["Slotted"](1),
    lambda of: setattr(of["Slotted"](1), "new", 2),
    lambda of: of["Slotted"].__match_args__,
    lambda of: of["Ordered"](1) < of["Ordered"](2),
)


def outcome(call: Callable[[dict[str, Any]], object], of: dict[str, Any]) -> object:
    try:
        return call(of)
    except (TypeError, AttributeError) as error:
        return type(error)


@pytest.mark.parametrize("call", CALLS)
def test_record_gives_what_a_dataclass_gives(call: Callable[[dict[str, Any]], object]) -> None:
    expected = outcome(call, classes(dataclasses.dataclass))
    of = classes(records.dataclass)
    assert outcome(call, of) == expected
    assert outcome(call, of) == expected  # when the methods are made


def test_first_comparison_of_a_derived_class_makes_the_method_of_its_base() -> None:
    @records.dataclass
    class Base:
        a: int

    class Derived(Base):
        pass

    assert Derived(1) == Derived(1) and Derived(1) != Base(1)
    assert "__eq__" not in vars(Derived)


def test_syntax_trees_can_be_pickled() -> None:
    from plctool.compiler.syntax.ast import Name

    assert repr(pickle.loads(pickle.dumps(Name(1, "x")))) == repr(Name(1, "x"))
