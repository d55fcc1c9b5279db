"""What depends on the class of an instance, which is only known when the program runs: calls of methods, and
__QUERYINTERFACE and __QUERYPOINTER.

Each pair of types gets a small function `(source, target by reference) : BOOL`. It asks the instance, through a
dispatch over the class numbers like any method, whether it conforms: two methods that all classes share give the
answers.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from plctool.compiler.semantics.call_graph import CallGraph
from plctool.compiler.semantics.symbols import ClassInfo, FunctionInfo, Member
from plctool.compiler.typed.nodes import (
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
)
from plctool.iec.types import BOOL, PointerType, StructType

# ---- __QUERYINTERFACE and __QUERYPOINTER: what else the instance of an interface is ----


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


# ---- calls whose target depends on the class of the instance ----


class Dispatches:
    """The dispatches of a program, and who calls through them."""

    def __init__(self) -> None:
        self.queries = Queries()
        self._dispatches: dict[tuple[ClassInfo, str], Dispatch] = {}
        self._own_calls: list[tuple[Pou, Dispatch, Pos]] = []
        self._other_calls: list[tuple[Pou, Pou, Dispatch | None, Pos]] = []

    @property
    def count(self) -> int:
        """How many there are, with what asks for interfaces."""
        return len(self._dispatches) + sum(1 for _ in self.queries.pous())

    def dispatch(self, cls: ClassInfo, key: str, function: Pou) -> Dispatch | None:
        """For a call of the member `key`, or of the body for "", of an instance of `cls` or of a class that conforms;
        None when there is only `cls`."""
        if not cls.is_interface and not cls.number:
            return None
        return self._dispatches.setdefault((cls, key), Dispatch(function))

    def calls_of(self, caller: Pou) -> int:
        """Returns how many calls of a unit depend on classes."""
        return sum(call[0] is caller for call in (*self._own_calls, *self._other_calls))

    def note_own_call(self, caller: Pou | None, dispatch: Dispatch, pos: Pos) -> None:
        """A call on the own instance, which counts as recursion when it leads back."""
        if caller is not None:
            self._own_calls.append((caller, dispatch, pos))

    def note_other_call(self, caller: Pou | None, function: Pou, dispatch: Dispatch | None, pos: Pos) -> None:
        """A call on an instance through a pointer, which may be the own one or not."""
        if caller is not None:
            self._other_calls.append((caller, function, dispatch, pos))

    def find_targets(self, classes: Iterable[ClassInfo], signature: Callable[[Member], FunctionInfo]) -> None:
        """Finds the targets of all dispatches among the classes that have instances."""
        present = list(classes)
        self.queries.finish(cls for cls in present if cls.number)
        for (cls, key), dispatch in self._dispatches.items():
            for other in present:
                if cls.type is None or other.type is None or not other.type.conforms(cls.type):
                    continue
                assert other.block is not None
                member = other.find(key) if key else None
                if not key:
                    dispatch.targets[other.number] = other.block.pou
                elif member is not None and not member.abstract:
                    dispatch.targets[other.number] = signature(member).pou

    def note_calls(self, calls: CallGraph) -> None:
        """Notes who calls whom, now that the targets are known."""
        for caller, dispatch, pos in self._own_calls:
            for target in dispatch.targets.values():
                calls.add(caller, target, pos)
        for caller, function, dispatch_of, pos in self._other_calls:
            calls.add_possible(caller, [function] if dispatch_of is None else dispatch_of.targets.values(), pos)
