"""__QUERYINTERFACE and __QUERYPOINTER: what else the instance of an interface is.

Each pair of types gets a small function `(source, target by reference) : BOOL`. It asks the instance, through a
dispatch over the class numbers like any method, whether it conforms: two methods that all classes share give the
answers.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from plctool.compiler.semantics.symbols import ClassInfo
from plctool.compiler.typed import (
    AddressOf,
    Assign,
    Binary,
    BinaryOp,
    Call,
    Const,
    DerefPlace,
    Direction,
    Dispatch,
    Expr,
    If,
    Load,
    Parameter,
    Place,
    Pos,
    Pou,
    PouKind,
    SelfPlace,
    Statement,
    Storage,
    Variable,
    VarPlace,
)  # fmt: skip
from plctool.iec.types import BOOL, PointerType, StructType


class Queries:
    """The functions asked for so far."""

    def __init__(self) -> None:
        self._functions: dict[tuple[ClassInfo, PointerType], _Query] = {}

    def function(self, source: ClassInfo, t: PointerType, target: PointerType, pos: Pos) -> Pou:
        """The function that asks instances of a pointer or interface `t`, of the class `source` or of one that
        conforms, whether they are what `target` may point to."""
        known = self._functions.get((source, target))
        if known is None:
            known = self._functions[source, target] = _Query(source, t, target, pos)
        return known.function

    def pous(self) -> Iterator[Pou]:
        """All units made for them."""
        for query in self._functions.values():
            yield from (query.function, query.yes, query.no)

    def finish(self, classes: Iterable[ClassInfo]) -> None:
        """Answers for all classes that have instances."""
        for other in classes:
            for query in self._functions.values():
                query.answer(other)


class _Query:
    def __init__(self, source: ClassInfo, t: PointerType, target: PointerType, pos: Pos) -> None:
        self.source = source
        self.target = target
        self.yes = _answer(target, True, pos)
        self.no = _answer(target, False, pos)
        self.dispatch = Dispatch(self.no)
        self.function = self._function(t, pos)

    def answer(self, other: ClassInfo) -> None:
        """What instances of a class say; those that cannot be there have no say."""
        if other.type is not None and self.source.type is not None and other.type.conforms(self.source.type):
            self.dispatch.targets[other.number] = self._of(other.type)

    def _of(self, t: StructType) -> Pou:
        return self.yes if t.conforms(self.target.target) else self.no

    def _function(self, t: PointerType, pos: Pos) -> Pou:
        """`IF source <> NULL THEN result := source^.conforms(target); ELSE target := NULL; END_IF`"""
        function = Pou(f"__QUERY({t}, {self.target})", PouKind.FUNCTION, pos)
        source = VarPlace(Variable("source", t, Storage.LOCAL, pos), t, pos)
        target, result = _parameters(function, self.target, pos)
        function.parameters.insert(0, Parameter(source.var, Direction.INPUT))
        instance = DerefPlace(Load(source, t, pos), t.target, pos)
        asked = Call(self.no, [target], BOOL, pos, instance=instance, dispatch=self.dispatch)
        if not self.source.is_interface and not self.source.number:  # instances of just this class
            assert self.source.type is not None
            asked = Call(self._of(self.source.type), [target], BOOL, pos, instance=instance)
        there = Binary(BinaryOp.NE, Load(source, t, pos), Const(0, t, pos), BOOL, pos)
        nothing: list[Statement] = [Assign(target, Const(0, self.target, pos), pos)]
        function.body = [If([(there, [Assign(result, asked, pos)])], nothing, pos)]
        return function


def _parameters(pou: Pou, t: PointerType, pos: Pos) -> tuple[VarPlace, VarPlace]:
    """Declares the target by reference and the result."""
    target, result = Variable("target", t, Storage.REFERENCE, pos), Variable("result", BOOL, Storage.LOCAL, pos)
    pou.parameters.append(Parameter(target, Direction.IN_OUT, by_reference=True))
    pou.result = result
    pou.locals.append(result)
    return VarPlace(target, t, pos), VarPlace(result, BOOL, pos)


def _answer(t: PointerType, conforms: bool, pos: Pos) -> Pou:
    """`target := THIS; result := TRUE;` or `target := NULL; result := FALSE;`"""
    pou = Pou(f"__CONFORMS({t}, {conforms})", PouKind.METHOD, pos)
    target, result = _parameters(pou, t, pos)
    assert isinstance(t.target, StructType)
    this: Place = SelfPlace(t.target, pos)
    address: Expr = AddressOf(this, t, pos) if conforms else Const(0, t, pos)
    pou.body = [Assign(target, address, pos), Assign(result, Const(int(conforms), BOOL, pos), pos)]
    return pou
