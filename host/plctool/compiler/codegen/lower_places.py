"""Places: the addresses of variables and of their parts."""

from __future__ import annotations

from dataclasses import replace

from plctool.compiler.codegen.ir import FALSE, Value
from plctool.compiler.codegen.lower_arith import bits_of, is_signed, known_integer, resize
from plctool.compiler.codegen.lower_frame import (
    ACCESS_VIOLATION,
    ARRAY_BOUNDS,
    REFS,
    Body,
    Frame,
    Ref,
    rule,
    string_capacity,
)
from plctool.compiler.codegen.lower_unit import Check
from plctool.compiler.codegen.signatures import SELF
from plctool.compiler.typed.nodes import (
    BitPlace,
    DerefPlace,
    Expr,
    IndexPlace,
    MemberPlace,
    Pos,
    Pou,
    PouKind,
    SelfPlace,
    Storage,
    ValuePlace,
    Variable,
    VarPlace,
)
from plctool.compiler.typed.ranges import value_range
from plctool.compiler.typed.typed_nodes import root_of
from plctool.iec.areas import EXCLUSIVE_AREAS
from plctool.iec.types import BYTE, DINT, UDINT, ArrayType, PointerType, StringType, StructType, Type, is_scalar


@rule(REFS, VarPlace)
def variable(frame: Frame, place: VarPlace) -> Ref:
    """A variable, wherever it lives."""
    var, t = place.var, place.var.type
    if var.storage is Storage.AREA:
        assert var.bit is None or place.type is BYTE, "a bit is written as a bit of its byte"
        tag = ""
        if var.area in EXCLUSIVE_AREAS:
            tag = frame.unit.tag("globals" if is_scalar(t) else (var.area, var.offset))
        return Ref(frame.area_base(var.area), var.offset, t, tag, True, string_capacity(t))
    if var.storage is Storage.SELF and var not in frame.locals:
        assert frame.pou is not None and frame.pou.instance is not None
        tag = frame.unit.member_tag(frame.pou.instance, var.offset)
        return Ref(SELF, var.offset, t, tag, True, string_capacity(t))
    if var.storage is Storage.REFERENCE and var not in frame.locals:
        if frame.pou is not None and (frame.pou.kind is PouKind.METHOD or _may_change(frame, frame.pou)):
            return _unsure_reference(frame, var, place.pos)
        frame.locals[var] = _stored_reference(frame, var)
    return frame.locals[var]


def _may_change(frame: Frame, pou: Pou) -> bool:
    """Whether a VAR_IN_OUT may be another variable later in the body of a block."""
    return isinstance(frame, Body) and frame.effects.renews_in_outs(pou)


def _stored_reference(frame: Frame, var: Variable) -> Ref:
    """A VAR_IN_OUT of a function block: the pointer its caller stored in the instance, loaded once."""
    assert frame.pou is not None and frame.pou.instance is not None
    tag = frame.unit.member_tag(frame.pou.instance, var.offset)
    slot = frame.fn.prologue(f"getelementptr inbounds i8, ptr {SELF}, {frame.pointer_int} {var.offset}")
    pointer = frame.fn.prologue(f"load ptr, ptr {slot}{tag}")
    return Ref(pointer, 0, var.type, capacity=string_capacity(var.type))


def _unsure_reference(frame: Frame, var: Variable, pos: Pos) -> Ref:
    """A VAR_IN_OUT of the block in a method, which may run before the block was called for the first time."""
    assert frame.pou is not None and frame.pou.instance is not None
    tag = frame.unit.member_tag(frame.pou.instance, var.offset)
    pointer = frame.load(Ref(SELF, var.offset, PointerType(var.type), tag))
    return _pointed_to(frame, pointer, var.type, pos)


@rule(REFS, MemberPlace)
def member(frame: Frame, place: MemberPlace) -> Ref:
    """A member of a struct or instance."""
    base = frame.ref(place.base)
    tag = ""
    if isinstance(base.type, StructType) and base.type.union:  # its members overlap, and so do their parts
        return replace(base.member(place.offset, place.type), direct=False)
    if base.direct and isinstance(base.type, StructType) and (base.tag or base.pointer == SELF):
        tag = frame.unit.member_tag(base.type, place.offset)
    return base.member(place.offset, place.type, tag)


@rule(REFS, DerefPlace)
def dereferenced(frame: Frame, place: DerefPlace) -> Ref:
    """What a pointer points to."""
    pointer = frame.value(place.pointer)
    return _pointed_to(frame, pointer, place.type, place.pos)


def _pointed_to(frame: Frame, pointer: Value, t: Type, pos: Pos) -> Ref:
    """What a pointer that may be NULL points to."""
    if Check.NULL in frame.checks:
        frame.require(frame.fn.value(f"icmp ne ptr {pointer}, null"), ACCESS_VIOLATION, pos)
    return Ref(pointer, 0, t, capacity=string_capacity(t))


@rule(REFS, BitPlace)
def bit(frame: Frame, place: BitPlace) -> Ref:
    """A bit of a number."""
    return replace(frame.ref(place.base), bit=place.bit)


@rule(REFS, SelfPlace)
def own_instance(frame: Frame, place: SelfPlace) -> Ref:
    """The instance that a body or method is about."""
    return Ref(SELF, 0, place.type, direct=True)


@rule(REFS, ValuePlace)
def temporary(frame: Frame, place: ValuePlace) -> Ref:
    """Where a value is that is no variable."""
    return materialised(frame, place.value)


@rule(REFS, IndexPlace)
def indexed(frame: Frame, place: IndexPlace) -> Ref:
    """An element of an array, a character of a string."""
    base = frame.ref(place.base)
    if isinstance(base.type, StringType):
        return _character(frame, base, place)
    assert isinstance(base.type, ArrayType)
    element = base.type.element
    if place.limits is not None:
        return frame.element(base, _open_index(frame, place, place.limits), element, counted=False)
    constant_part, counted = 0, True
    dynamic: Value | None = None
    for expr, (low, high) in zip(place.indices, base.type.bounds, strict=True):
        count = high - low + 1
        constant_part *= count
        if dynamic is not None:
            dynamic = frame.fn.value(f"mul {frame.pointer_int} {dynamic}, {count}")
        known = known_integer(expr)
        if known is not None and low <= known <= high:
            constant_part += known - low
            continue
        part, within = _subscript(frame, expr, low, high, place)
        counted = counted and within
        dynamic = part if dynamic is None else frame.fn.value(f"add {frame.pointer_int} {dynamic}, {part}")
    base = base.member(constant_part * element.size, element, base.tag)
    if dynamic is None:
        return base
    root = root_of(place)
    if root is not None and root.storage is Storage.AREA and root.area not in EXCLUSIVE_AREAS:
        base = replace(base, direct=False)  # it may be part of one that another variable has at such an index
    return frame.element(base, dynamic, element, counted=counted)


def _open_index(frame: Frame, place: IndexPlace, limits: list[tuple[Expr, Expr]]) -> Value:
    """The number of an element of an ARRAY[*] as a pointer-sized integer. It is computed in 64 bits, where
    nothing wraps but a huge unsigned index."""
    fn = frame.fn
    total: Value | None = None
    for expr, (low_bound, high_bound) in zip(place.indices, limits, strict=True):
        low, high = (resize(frame, frame.value(e), DINT, 64) for e in (low_bound, high_bound))
        index = resize(frame, frame.value(expr), expr.type, 64)
        relative = fn.value(f"sub i64 {index}, {low}")
        last = fn.value(f"sub i64 {high}, {low}")
        if Check.BOUNDS in frame.checks:
            ok = fn.value(f"icmp ule i64 {relative}, {last}")
            if bits_of(expr.type) == 64 and not is_signed(expr.type):  # a huge one would pass for a negative one
                ok = fn.value(f"and i1 {ok}, {fn.value(f'icmp sge i64 {index}, 0')}")
            frame.require(ok, ARRAY_BOUNDS, place.pos)
        if total is None:
            total = relative
        else:
            total = fn.value(f"mul i64 {total}, {fn.value(f'add i64 {last}, 1')}")
            total = fn.value(f"add i64 {total}, {relative}")
    assert total is not None, "an array has a dimension"
    return total if frame.pointer_int == "i64" else fn.value(f"trunc i64 {total} to {frame.pointer_int}")


def _subscript(frame: Frame, expr: Expr, low: int, high: int, place: IndexPlace) -> tuple[Value, bool]:
    """An index of an array counted from 0 as a pointer-sized integer, and whether it is known to be within the
    bounds."""
    index = frame.value(expr)
    limits = value_range(expr, frame.ranges)
    within = limits is not None and low <= limits[0] and limits[1] <= high
    width = 8 * frame.unit.target.pointer_size
    checked = not within and Check.BOUNDS in frame.checks
    work = max(32, bits_of(expr.type)) if checked else width
    wide = resize(frame, index, expr.type, work)
    relative = frame.fn.value(f"sub i{work} {wide}, {low}") if low else wide
    if not checked:
        return relative, within
    tested, last = relative, high - low
    if low < 0 and not is_signed(expr.type):  # what is below `low` when read as signed is far above `high`
        tested, last = wide, high
    ok = frame.fn.value(f"icmp ule i{work} {tested}, {last}") if last >= 0 else FALSE
    frame.note_bounds(place.base, expr, low, high, place.pos)
    frame.require(ok, ARRAY_BOUNDS, place.pos)
    return _widen(frame, relative, work), True


def _character(frame: Frame, base: Ref, place: IndexPlace) -> Ref:
    """A byte of a string; index `capacity` is the place of the last NUL."""
    expr = place.indices[0]
    index = frame.value(expr)
    limits = value_range(expr, frame.ranges)
    last = base.capacity.constant
    inside = last is not None and limits is not None and limits[0] >= 0 and limits[1] <= last
    if not inside and Check.BOUNDS in frame.checks:
        work = max(32, bits_of(expr.type))
        index = resize(frame, index, expr.type, work)
        capacity = resize(frame, base.capacity, UDINT, work)
        if last is not None:
            frame.note_bounds(place.base, expr, 0, last, place.pos)
        frame.require(frame.fn.value(f"icmp ule i{work} {index}, {capacity}"), ARRAY_BOUNDS, place.pos)
        index, inside = _widen(frame, index, work), True
    else:
        index = resize(frame, index, expr.type, 8 * frame.unit.target.pointer_size)
    trusted = frame.pou is not None and frame.pou.no_init
    return replace(frame.element(base, index, place.type, counted=inside), loose=not trusted)


def _widen(frame: Frame, value: Value, bits: int) -> Value:
    """A non-negative integer as a pointer-sized one."""
    width = 8 * frame.unit.target.pointer_size
    if bits == width:
        return value
    return frame.fn.value(f"zext i{bits} {value} to i{width}" if bits < width else f"trunc i{bits} {value} to i{width}")


def materialised(frame: Frame, value: Expr) -> Ref:
    """The address of a value: of a temporary for scalars."""
    if not is_scalar(value.type):
        return frame.aggregate(value)
    ref = frame.temporary(value.type)
    frame.store(ref, frame.value(value))
    return ref
