"""Places, expressions and calls."""

from __future__ import annotations

from dataclasses import replace

from plctool.compiler.codegen.lower_arith import (
    COMPARISONS,
    LOGIC,
    bits_of,
    constant,
    is_bool,
    is_signed,
    known_integer,
)
from plctool.compiler.codegen.lower_frame import (
    ACCESS_VIOLATION,
    ARRAY_BOUNDS,
    TAGGED_AREAS,
    TIME_MS_OFFSET,
    TIME_NS_OFFSET,
    Ref,
    string_capacity,
)
from plctool.compiler.codegen.lower_string import Strings
from plctool.compiler.codegen.lower_unit import Check, value_type
from plctool.compiler.codegen.ranges import type_range, value_range
from plctool.compiler.codegen.signatures import extended, parameter_types
from plctool.compiler.typed import (
    Binary,
    BinaryOp,
    BitPlace,
    Call,
    Const,
    Convert,
    DerefPlace,
    Direction,
    Dispatch,
    Expr,
    IndexPlace,
    Intrinsic,
    IntrinsicCall,
    Load,
    MemberPlace,
    Parameter,
    Place,
    Pos,
    Pou,
    PouKind,
    SelfPlace,
    Storage,
    Unary,
    ValuePlace,
    Variable,
    VarPlace,
)
from plctool.compiler.types import DINT, UDINT, ArrayType, PointerType, StringType, StructType, Type, is_scalar

_SHORT_CIRCUIT = (BinaryOp.AND_THEN, BinaryOp.OR_ELSE)
PLACES = (VarPlace, MemberPlace, IndexPlace, DerefPlace, BitPlace, ValuePlace, SelfPlace)


class Expressions(Strings):
    """Expressions of the function being written."""

    # ---- places ----

    def ref(self, place: Place) -> Ref:
        """The address of a place; writes the instructions and checks that it takes."""
        if isinstance(place, VarPlace):
            return self._variable(place.var, place.pos)
        if isinstance(place, MemberPlace):
            base = self.ref(place.base)
            tag = ""
            if isinstance(base.type, StructType) and base.type.union:  # its members overlap, and so do their parts
                return replace(base.member(place.offset, place.type), direct=False)
            if base.direct and isinstance(base.type, StructType) and (base.tag or base.pointer == "%self"):
                tag = self.unit.tag((base.type.root.name, place.offset))
            return base.member(place.offset, place.type, tag)
        if isinstance(place, IndexPlace):
            return self._index(place)
        if isinstance(place, DerefPlace):
            pointer = self.value(place.pointer)
            if Check.NULL in self.checks:
                self.require(self.fn.value(f"icmp ne ptr {pointer}, null"), ACCESS_VIOLATION, place.pos)
            return Ref(pointer, 0, place.type, capacity=string_capacity(place.type))
        if isinstance(place, BitPlace):
            return replace(self.ref(place.base), bit=place.bit)
        if isinstance(place, SelfPlace):
            return Ref("%self", 0, place.type, direct=True)
        return self._materialised(place.value)

    def _variable(self, var: Variable, pos: Pos) -> Ref:
        t = var.type
        if var.storage is Storage.AREA:
            tag = ""
            if var.area in TAGGED_AREAS:
                tag = self.unit.tag("globals" if is_scalar(t) else (var.area, var.offset))
            return Ref(self.area_base(var.area), var.offset, t, tag, True, string_capacity(t))
        if var.storage is Storage.SELF:
            assert self.pou is not None and self.pou.instance is not None
            tag = self.unit.tag((self.pou.instance.root.name, var.offset))
            return Ref("%self", var.offset, t, tag, True, string_capacity(t))
        if var.storage is Storage.REFERENCE and var not in self.locals:
            if self.pou is not None and self.pou.kind is PouKind.METHOD:
                return self._unsure_reference(var, pos)
            self.locals[var] = self._stored_reference(var)
        return self.locals[var]

    def _stored_reference(self, var: Variable) -> Ref:
        """A VAR_IN_OUT of a function block: the pointer its caller stored in the instance, loaded once."""
        assert self.pou is not None and self.pou.instance is not None
        tag = self.unit.tag((self.pou.instance.root.name, var.offset))
        slot = self.fn.prologue(f"getelementptr inbounds i8, ptr %self, {self._pointer_int} {var.offset}")
        pointer = self.fn.prologue(f"load ptr, ptr {slot}{tag}")
        return Ref(pointer, 0, var.type, capacity=string_capacity(var.type))

    def _unsure_reference(self, var: Variable, pos: Pos) -> Ref:
        """A VAR_IN_OUT of the block in a method, which may run before the block was called for the first time."""
        assert self.pou is not None and self.pou.instance is not None
        tag = self.unit.tag((self.pou.instance.root.name, var.offset))
        pointer = self.load(Ref("%self", var.offset, PointerType(var.type), tag))
        if Check.NULL in self.checks:
            self.require(self.fn.value(f"icmp ne ptr {pointer}, null"), ACCESS_VIOLATION, pos)
        return Ref(pointer, 0, var.type, capacity=string_capacity(var.type))

    def _index(self, place: IndexPlace) -> Ref:
        base = self.ref(place.base)
        if isinstance(base.type, StringType):
            return self._character(base, place)
        assert isinstance(base.type, ArrayType)
        element = base.type.element
        if place.limits is not None:
            return self.element(base, self._open_index(place, place.limits), element, counted=False)
        constant_part, dynamic, counted = 0, "", True
        for expr, (low, high) in zip(place.indices, base.type.bounds, strict=True):
            count = high - low + 1
            constant_part *= count
            if dynamic:
                dynamic = self.fn.value(f"mul {self._pointer_int} {dynamic}, {count}")
            known = known_integer(expr)
            if known is not None and low <= known <= high:
                constant_part += known - low
                continue
            part, within = self._subscript(expr, low, high, place.pos)
            counted = counted and within
            dynamic = part if not dynamic else self.fn.value(f"add {self._pointer_int} {dynamic}, {part}")
        base = base.member(constant_part * element.size, element, base.tag)
        return self.element(base, dynamic, element, counted=counted) if dynamic else base

    def _open_index(self, place: IndexPlace, limits: list[tuple[Expr, Expr]]) -> str:
        """The number of an element of an ARRAY[*] as a pointer-sized integer. It is worked out in 64 bits, where
        nothing wraps."""
        fn, number = self.fn, "0"
        for expr, (low_bound, high_bound) in zip(place.indices, limits, strict=True):
            low, high = (self._resize(self.value(e), DINT, 64) for e in (low_bound, high_bound))
            relative = fn.value(f"sub i64 {self._resize(self.value(expr), expr.type, 64)}, {low}")
            last = fn.value(f"sub i64 {high}, {low}")
            if Check.BOUNDS in self.checks:
                self.require(fn.value(f"icmp ule i64 {relative}, {last}"), ARRAY_BOUNDS, place.pos)
            if number != "0":
                number = fn.value(f"mul i64 {number}, {fn.value(f'add i64 {last}, 1')}")
            number = relative if number == "0" else fn.value(f"add i64 {number}, {relative}")
        return number if self._pointer_int == "i64" else fn.value(f"trunc i64 {number} to {self._pointer_int}")

    def _subscript(self, expr: Expr, low: int, high: int, pos: Pos) -> tuple[str, bool]:
        """An index counted from 0 as a pointer-sized integer, and whether it is known to be within the bounds."""
        index = self.value(expr)
        limits = value_range(expr, self.ranges)
        within = limits is not None and low <= limits[0] and limits[1] <= high
        width = 8 * self.unit.target.pointer_size
        checked = not within and Check.BOUNDS in self.checks
        work = max(32, bits_of(expr.type)) if checked else width
        wide = self._resize(index, expr.type, work)
        relative = self.fn.value(f"sub i{work} {wide}, {low}") if low else wide
        if not checked:
            return relative, within
        tested, last = relative, high - low
        if low < 0 and not is_signed(expr.type):  # what is below `low` when read as signed is far above `high`
            tested, last = wide, high
        ok = self.fn.value(f"icmp ule i{work} {tested}, {last}") if last >= 0 else "false"
        self.require(ok, ARRAY_BOUNDS, pos)
        return self.widen(relative, work), True

    def _character(self, base: Ref, place: IndexPlace) -> Ref:
        """A byte of a string; index `capacity` is the place of the last NUL."""
        expr = place.indices[0]
        index = self.value(expr)
        limits = value_range(expr, self.ranges)
        inside = base.capacity.isdigit() and limits is not None and limits[0] >= 0 and limits[1] <= int(base.capacity)
        if not inside and Check.BOUNDS in self.checks:
            work = max(32, bits_of(expr.type))
            index = self._resize(index, expr.type, work)
            capacity = self._resize(base.capacity, UDINT, work)
            self.require(self.fn.value(f"icmp ule i{work} {index}, {capacity}"), ARRAY_BOUNDS, place.pos)
            index, inside = self.widen(index, work), True
        else:
            index = self._resize(index, expr.type, 8 * self.unit.target.pointer_size)
        trusted = self.pou is not None and self.pou.no_init
        return replace(self.element(base, index, place.type, counted=inside), loose=not trusted)

    def widen(self, value: str, bits: int) -> str:
        """A non-negative integer as a pointer-sized one."""
        width = 8 * self.unit.target.pointer_size
        if bits == width:
            return value
        return self.fn.value(
            f"zext i{bits} {value} to i{width}" if bits < width else f"trunc i{bits} {value} to i{width}"
        )

    def _materialised(self, value: Expr) -> Ref:
        """The address of a value: of a temporary for scalars."""
        if not is_scalar(value.type):
            return self.aggregate(value)
        ref = self.temporary(value.type)
        self.store(ref, self.value(value))
        return ref

    # ---- scalar expressions ----

    def value(self, e: Expr) -> str:
        """The operand that holds the value of a scalar expression."""
        if isinstance(e, Const):
            return constant(e.value, e.type)
        if isinstance(e, Load):
            return self._load(e)
        if isinstance(e, Binary):
            if e.op in COMPARISONS or e.op in _SHORT_CIRCUIT:
                return self.fn.value(f"zext i1 {self.condition(e)} to i8")
            return self._binary(e)
        if isinstance(e, Convert):
            return self._convert(e)
        if isinstance(e, Unary):
            return self.unary(e.op, self.value(e.operand), e.type)
        if isinstance(e, Call):
            return self.call(e, None)
        if isinstance(e, IntrinsicCall):
            return self._intrinsic(e)
        return self.address(self.ref(e.place))

    def _load(self, e: Load) -> str:
        if isinstance(e.place, VarPlace):
            shadow = self.shadows.get(e.place.var)
            if shadow is not None:
                return self.fn.value(f"load {value_type(e.type)}, ptr {shadow}")
        return self.load(self.ref(e.place))

    def condition(self, e: Expr) -> str:
        """The i1 that holds the value of a BOOL expression."""
        if isinstance(e, Binary):
            if e.op in _SHORT_CIRCUIT:
                return self._short_circuit(e)
            if e.op not in COMPARISONS:
                left, right = self.condition(e.left), self.condition(e.right)
                return self.fn.value(f"{LOGIC[e.op]} i1 {left}, {right}")
            if isinstance(e.left.type, StringType):
                return self._compare_strings(e)
            return self.compare(e.op, self.value(e.left), self.value(e.right), e.left.type)
        if isinstance(e, Unary):
            return self.fn.value(f"xor i1 {self.condition(e.operand)}, true")
        if isinstance(e, Convert) and not is_bool(e.operand.type):
            return self.is_not_zero(self.value(e.operand), e.operand.type)
        return self.fn.value(f"trunc i8 {self.value(e)} to i1")

    def _binary(self, e: Binary) -> str:
        left, right = self.value(e.left), self.value(e.right)
        if e.op in (BinaryOp.DIV, BinaryOp.MOD) and value_type(e.type) not in ("float", "double"):
            return self.divide(e.op, left, right, e.type, e.pos, known_integer(e.right))
        return self.binary(e.op, left, right, e.type)

    def _short_circuit(self, e: Binary) -> str:
        fn = self.fn
        left = self.condition(e.left)
        more, end, first = fn.label("more"), fn.label("end"), fn.block
        if e.op is BinaryOp.AND_THEN:
            fn.branch_if(left, more, end)
        else:
            fn.branch_if(left, end, more)
        fn.begin(more)
        right = self.condition(e.right)
        last = fn.block
        fn.begin(end)
        skipped = "false" if e.op is BinaryOp.AND_THEN else "true"
        return fn.value(f"phi i1 [ {skipped}, %{first} ], [ {right}, %{last} ]")

    def _compare_strings(self, e: Binary) -> str:
        if e.op in (BinaryOp.EQ, BinaryOp.NE):
            for literal, other in ((e.right, e.left), (e.left, e.right)):
                if isinstance(literal, Const) and not isinstance(other, Const):
                    ref = self.aggregate(other)
                    equal = self.equals_literal(ref, str(literal.value))
                    if equal is None:
                        return self.compare_strings(e.op, ref, self.aggregate(literal))
                    return equal if e.op is BinaryOp.EQ else self.fn.value(f"xor i1 {equal}, true")
        left = self.aggregate(e.left)
        return self.compare_strings(e.op, left, self.aggregate(e.right))

    def _convert(self, e: Convert) -> str:
        source = e.operand.type
        value = self.value(e.operand)
        if e.check is None or Check.SUBRANGE not in self.checks:
            return self.convert(value, source, e.type, truncate=e.truncate)
        if type_range(source) is None:  # a real: the limits are tested on the integer
            value = self.convert(value, source, e.type, truncate=e.truncate)
            self._check_limits(value, e.type, type_range(e.type), e.check, e.pos)
            return value
        self._check_limits(value, source, value_range(e.operand, self.ranges), e.check, e.pos)
        return self.convert(value, source, e.type)

    def _check_limits(
        self, value: str, t: Type, known: tuple[int, int] | None, limits: tuple[int, int], pos: Pos
    ) -> None:
        assert known is not None
        low, high = max(limits[0], known[0]), min(limits[1], known[1])
        if (low, high) == known:
            return
        text = value_type(t)
        if low > high:
            self.require("false", ARRAY_BOUNDS, pos)
            return
        relative = self.fn.value(f"sub {text} {value}, {low}") if low else value
        self.require(self.fn.value(f"icmp ule {text} {relative}, {high - low}"), ARRAY_BOUNDS, pos)

    def _intrinsic(self, e: IntrinsicCall) -> str:
        op, t = e.intrinsic, e.type
        if op is Intrinsic.TIME:
            return self.context_load(TIME_MS_OFFSET, "i32")
        if op is Intrinsic.LTIME:
            return self.context_load(TIME_NS_OFFSET, "i64")
        if op is Intrinsic.STRING_SIZE:
            return self.convert(self.aggregate(e.args[0]).capacity, UDINT, t)
        first = e.args[0].type
        if op is Intrinsic.SELECT:
            choice, no, yes = self.condition(e.args[0]), self.value(e.args[1]), self.value(e.args[2])
            return self.select(choice, yes, no, t)
        values = [self.value(arg) for arg in e.args]
        if op in (Intrinsic.SHL, Intrinsic.SHR):
            return self.shift(op, values[0], t, values[1], e.args[1].type, known_integer(e.args[1]))
        if op in (Intrinsic.ROL, Intrinsic.ROR):
            return self.rotate(op, values[0], t, values[1], e.args[1].type)
        if op is Intrinsic.MUX:
            return self._choose(values[0], first, values[1:], value_type(t))
        if op in (Intrinsic.MIN, Intrinsic.MAX):
            return self.extreme(op, values[0], values[1], t)
        if op is Intrinsic.ABS:
            return self.absolute(values[0], t)
        if op is Intrinsic.SQRT:
            return self.square_root(values[0], t)
        assert op is Intrinsic.BITCAST, op
        return self.bitcast(values[0], first, t)

    def _choose(self, selector: str, selector_type: Type, values: list[str], text: str) -> str:
        """MUX: the last value for every selector that is not the index of another one."""
        result = values[-1]
        for index in reversed(range(len(values) - 1)):
            hit = self.fn.value(f"icmp eq {value_type(selector_type)} {selector}, {index}")
            result = self.fn.value(f"select i1 {hit}, {text} {values[index]}, {text} {result}")
        return result

    # ---- strings, arrays and structs ----

    def aggregate(self, e: Expr) -> Ref:
        """Where the value of a string, array or struct expression lies; valid until the end of the statement."""
        if isinstance(e, Const):
            return self.literal(str(e.value), wide=isinstance(e.type, StringType) and e.type.wide)
        if isinstance(e, Load):
            return self.ref(e.place)
        if isinstance(e, Convert):
            return self.aggregate(e.operand)
        if isinstance(e, Call):
            ref = self.temporary(e.type)
            self.call(e, ref)
            return ref
        assert isinstance(e, IntrinsicCall), e
        return self._selected(e)

    def _selected(self, e: IntrinsicCall) -> Ref:
        """SEL and MUX choose an address."""
        choice = self.condition(e.args[0]) if e.intrinsic is Intrinsic.SELECT else self.value(e.args[0])
        refs = [self.aggregate(arg) for arg in e.args[1:]]
        pointers = [self.address(ref) for ref in refs]
        capacities = [ref.capacity for ref in refs]
        pointer = self._pick(e, choice, pointers, "ptr")
        capacity = capacities[0]
        if any(c != capacity for c in capacities):
            capacity = self._pick(e, choice, capacities, "i32")
        return Ref(pointer, 0, e.type, capacity=capacity)

    def _pick(self, e: IntrinsicCall, choice: str, values: list[str], text: str) -> str:
        if e.intrinsic is Intrinsic.SELECT:
            return self.fn.value(f"select i1 {choice}, {text} {values[1]}, {text} {values[0]}")
        return self._choose(choice, e.args[0].type, values, text)

    # ---- calls ----

    def call(self, e: Call, result: Ref | None) -> str:
        """Calls a function. `result`: where a string, array or struct goes; scalars are returned."""
        pou = e.function
        write_back: list[tuple[Ref, Ref]] = []
        arguments = [] if pou.external else ["ptr %ctx"]
        if e.instance is not None:
            arguments.append(f"ptr {self.address(self.ref(e.instance))}")
        if result is not None:
            arguments.append(f"ptr {self.address(result)}")
            arguments += [f"i32 {self._result_capacity(pou, result)}"] if pou.cuts_result else []
        for parameter, argument in zip(pou.parameters, e.args, strict=True):
            operands = self._argument(pou, parameter, argument, write_back)
            types = parameter_types(pou, parameter)
            arguments += [f"{text} {operand}" for text, operand in zip(types, operands, strict=True)]
        value = self._call_instruction(pou, e.dispatch, arguments)
        for temporary, place in write_back:
            wanted = temporary.type if place.bit >= 0 else place.type
            self.store(place, self.convert(self.load(temporary), temporary.type, wanted))
        return value

    def _result_capacity(self, pou: Pou, result: Ref) -> str:
        """How much of a string result there is room for: at most what the function declares."""
        assert pou.result is not None
        declared = string_capacity(pou.result.type)
        if result.capacity.isdigit():
            return str(min(int(declared), int(result.capacity)))
        return self.fn.value(f"call i32 @llvm.umin.i32(i32 {declared}, i32 {result.capacity})")

    def _call_instruction(self, pou: Pou, dispatch: Dispatch | None, arguments: list[str]) -> str:
        unit, fn = self.unit, self.fn
        returns = pou.result is not None and is_scalar(pou.result.type)
        text, attributes = "void", ""
        if pou.external:
            target = self.import_function(unit.import_slot(pou.external))
            attributes = f" {unit.external_call}"
            convention = f"{unit.target.external_convention} " if unit.target.external_convention else ""
        else:
            target, convention = f"@{unit.target_of(pou, dispatch)}", ""
        if not returns:
            fn.do(f"call {convention}void {target}({', '.join(arguments)}){attributes}")
            return ""
        assert pou.result is not None
        t = pou.result.type
        text = value_type(t)
        if pou.external:
            words = extended(t).split()
            text = " ".join(reversed(words))
            return fn.value(f"call {convention}{text} {target}({', '.join(arguments)}){attributes}")
        return fn.value(f"call {text} {target}({', '.join(arguments)})")

    def _argument(
        self, pou: Pou, parameter: Parameter, argument: Expr | Place | None, write_back: list[tuple[Ref, Ref]]
    ) -> list[str]:
        """The operands that carry one argument."""
        t = parameter.variable.type
        if argument is None:  # an output nobody wants
            ref = self.temporary(t)
        elif not isinstance(argument, PLACES):
            if is_scalar(t) and not parameter.by_reference:
                value = self.value(argument)
                return [self.lowest_bit(value)] if pou.external and is_bool(t) else [value]
            ref = self._materialised(argument)
        else:
            ref = self.ref(argument)
            if parameter.direction is Direction.INPUT and is_scalar(t) and not parameter.by_reference:
                return [self.load(ref)]
            if ref.bit >= 0 or (is_scalar(t) and value_type(t) != value_type(ref.type)):
                temporary = self.temporary(t)  # bits have no address; outputs may become a number of another width
                if parameter.direction is not Direction.OUTPUT:
                    self.store(temporary, self.load(ref))
                write_back.append((temporary, ref))
                ref = temporary
        return [self.address(ref), ref.capacity] if isinstance(t, StringType) else [self.address(ref)]
