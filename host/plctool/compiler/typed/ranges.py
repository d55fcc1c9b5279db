"""What is known about the value of an integer expression, to leave out checks that cannot fail."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from plctool.compiler.typed.nodes import Binary, BinaryOp, Const, Convert, Expr, Load, Variable, VarPlace
from plctool.iec.types import Elementary, Kind, SubrangeType, Type, base_of

Range = tuple[int, int]


def type_range(t: Type) -> Range | None:
    """The values an integer type can hold; None for other types."""
    base = base_of(t)
    if not isinstance(base, Elementary) or base.kind is Kind.REAL:
        return None
    if base.kind is Kind.BOOL:
        return 0, 1
    if base.signed:
        return -(1 << (base.bits - 1)), (1 << (base.bits - 1)) - 1
    return 0, (1 << base.bits) - 1


def value_range(e: Expr, variables: Mapping[Variable, Range]) -> Range | None:
    """Inclusive limits of an integer expression. `variables`: limits of variables known at this place."""
    if isinstance(e, Const) and isinstance(e.value, int):
        return e.value, e.value
    whole = type_range(e.type)
    if isinstance(e, Load) and isinstance(e.place, VarPlace):
        return variables.get(e.place.var, whole)
    if whole is None:
        return None
    if isinstance(e, Convert):
        inner = value_range(e.operand, variables)
        return inner if inner is not None and _within(inner, whole) else whole
    if isinstance(e, Binary):
        result = _binary(e, variables)
        return result if result is not None and _within(result, whole) else whole
    return whole


class _Subranges(Mapping[Variable, Range]):
    """The limits of variables that are of a subrange."""

    def __getitem__(self, variable: Variable) -> Range:
        t = variable.type
        if not isinstance(t, SubrangeType):
            raise KeyError(variable)
        return t.low, t.high

    def __iter__(self) -> Iterator[Variable]:
        return iter(())

    def __len__(self) -> int:
        return 0


_SUBRANGES = _Subranges()


def may_wrap(e: Binary) -> bool:
    """Whether a sum, difference or product of integers may be outside of its type."""
    result, whole = _binary(e, _SUBRANGES), type_range(e.type)
    return result is None or whole is None or not _within(result, whole)


def _within(inner: Range, outer: Range) -> bool:
    return outer[0] <= inner[0] and inner[1] <= outer[1]


def _binary(e: Binary, variables: Mapping[Variable, Range]) -> Range | None:
    left, right = value_range(e.left, variables), value_range(e.right, variables)
    if left is None or right is None:
        return None
    if e.op is BinaryOp.ADD:
        return left[0] + right[0], left[1] + right[1]
    if e.op is BinaryOp.SUB:
        return left[0] - right[1], left[1] - right[0]
    if e.op is BinaryOp.MUL:
        products = [a * b for a in left for b in right]
        return min(products), max(products)
    if e.op is BinaryOp.AND:
        limits = [r[1] for r in (left, right) if r[0] >= 0]
        return (0, min(limits)) if limits else None
    if e.op is BinaryOp.MOD and right[0] == right[1] != 0:
        most = abs(right[0]) - 1
        return (0 if left[0] >= 0 else -most), most
    if e.op is BinaryOp.DIV and right[0] == right[1] > 0 and left[0] >= 0:
        return left[0] // right[0], left[1] // right[0]
    return None
