"""Declarations: types, the variables of all kinds, and their initial values.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import TYPE_CHECKING

from plctool.compiler import ast, constants
from plctool.compiler.conversions import elementary
from plctool.compiler.diagnostics import did_you_mean
from plctool.compiler.expressions import Expressions, NestingError, is_untyped
from plctool.compiler.generics import GENERIC
from plctool.compiler.scope import Scope
from plctool.compiler.symbols import ERROR, GlobalSymbol, PouSymbol, Role, TypeSymbol, Unit, VarSymbol
from plctool.compiler.typed import (
    Area,
    ArrayInit,
    Assign,
    ComputedInit,
    Const,
    Expr,
    Initial,
    ScalarInit,
    Storage,
    StructInit,
    Variable,
    VarPlace,
)  # fmt: skip
from plctool.compiler.types import (
    BOOL,
    DEFAULT_STRING_LENGTH,
    ELEMENTARY,
    INT,
    ArrayType,
    Elementary,
    EnumType,
    Field,
    Kind,
    OpenArrayType,
    PointerType,
    RawPointerType,
    ReferenceType,
    StringType,
    StructType,
    SubrangeType,
    Type,
    align_up,
    base_of,
    is_scalar,
)  # fmt: skip

if TYPE_CHECKING:
    from plctool.compiler.world import World

MAX_SIZE = 0x7FFF_FFFF  # of an area; offsets are signed 32-bit numbers on the targets
MAX_STRING = 0xFFFF
MAX_TYPE_DEPTH = 50  # levels of arrays of structs of arrays ...
MAX_ADDRESS = 0xFFFF  # the last byte an address such as %IB65535 reaches
_ADDRESS = re.compile(r"%([IQM])([XBWDL]?)(\d+)(?:\.(\d+))?")
_AREAS = {"I": Area.INPUT, "Q": Area.OUTPUT, "M": Area.MEMORY}
_STRINGS = ("STRING", "WSTRING")
_WIDTHS = {"X": 0, "": 0, "B": 8, "W": 16, "D": 32, "L": 64}


class Allocation:
    """Gives variables their place in the areas."""

    def __init__(self) -> None:
        self.sizes: dict[Area, int] = {area: 0 for area in Area if area is not Area.CODE}
        self.variables: list[Variable] = []

    def add(self, variable: Variable) -> None:
        """Places a variable at the end of its area, or notes one that has an address."""
        t, area = variable.type, variable.area
        if variable.offset < 0:
            variable.offset = align_up(self.sizes[area], t.align)
        self.sizes[area] = max(self.sizes[area], variable.offset + t.size)
        self.variables.append(variable)


class Declarations:
    """Turns declarations into types and variables."""

    def __init__(self, world: World) -> None:
        self.world = world
        self._depth = 0
        self.open_allowed = False  # whether the type being read may be ARRAY[*]
        self._direct: dict[str, VarSymbol] = {}
        self._structs: dict[str, StructType] = {}

    # ---- types ----

    def type_of(self, spec: ast.TypeSpec, scope: Scope, name: str | None = None) -> tuple[Type, Initial | None]:
        """The type, and what variables of it start with. `name`: of the declared type, if it is one."""
        self._depth += 1
        if self._depth > MAX_TYPE_DEPTH:
            raise NestingError(scope.pos(spec.pos))
        try:
            return self._type_of(spec, scope, name)
        finally:
            self._depth -= 1

    def _type_of(self, spec: ast.TypeSpec, scope: Scope, name: str | None) -> tuple[Type, Initial | None]:
        if isinstance(spec, ast.NamedType):
            return self._named(spec, scope)
        if isinstance(spec, ast.ArraySpec):
            return self._array(spec, scope)
        if isinstance(spec, ast.EnumSpec):
            base = (spec.base or "").upper()
            if base in _STRINGS and len(spec.values) == 1:  # STRING(LENGTH)
                offset, length, _ = spec.values[0]
                return self._string(ast.Name(offset, length), scope, wide=base == "WSTRING"), None
            return self._enum(spec, scope, name)
        if isinstance(spec, ast.SubrangeSpec):
            return self._subrange(spec, scope, name)
        if isinstance(spec, ast.PointerSpec):
            return self._pointer(spec, scope), None
        if name is None:
            scope.error(spec.pos, "type", "a STRUCT is declared in a TYPE block")
            return ERROR, None
        return self._struct(spec, scope, name)

    def named_type(self, offset: int, name: str, scope: Scope) -> Type:
        """The type of that name; ERROR after a diagnosis when there is none."""
        return self._named(ast.NamedType(offset, name), scope)[0]

    def _named(self, spec: ast.NamedType, scope: Scope) -> tuple[Type, Initial | None]:
        upper = spec.name.upper()
        if upper in _STRINGS:
            wide = upper == "WSTRING"
            if spec.length is None:
                return StringType(DEFAULT_STRING_LENGTH, wide), None
            return self._string(spec.length, scope, wide=wide), None
        if spec.length is not None:
            scope.error(spec.pos, "type", f"only a STRING has a length, not {spec.name}")
            return ERROR, None
        known = ELEMENTARY.get(upper) or scope.bindings.get(upper)
        if known is not None:
            return known, None
        return self._declared(spec, scope)

    def _declared(self, spec: ast.NamedType, scope: Scope) -> tuple[Type, Initial | None]:
        symbol = scope.unit(spec.name)
        if symbol is not None and is_internal(symbol) and not scope.is_within(symbol.decl.namespace):
            scope.error(spec.pos, "access", f"{spec.name} is INTERNAL: only its own namespace may use it")
            return ERROR, None
        if isinstance(symbol, TypeSymbol):
            if symbol.busy:
                scope.error(spec.pos, "recursion", f"the type {symbol.decl.name} contains itself")
                return ERROR, None
            return self.resolve_symbol(symbol), symbol.default
        if isinstance(symbol, PouSymbol) and symbol.keyword == "FUNCTION_BLOCK":
            info = self.world.units.block(symbol)
            if info is None:
                scope.error(spec.pos, "recursion", f"the function block {spec.name} contains itself")
            return (ERROR, None) if info is None else (info.type, self.struct_default(info.type))
        if isinstance(symbol, PouSymbol) and symbol.keyword == "INTERFACE":
            return self.world.classes.interface(symbol), None
        if spec.name.upper() in GENERIC:
            scope.error(spec.pos, "type", f"{spec.name} is for parameters of functions only")
        elif symbol is None and scope.lookup(spec.name) is None:
            hint = did_you_mean(spec.name, [*ELEMENTARY, *_STRINGS, *self.world.type_names()])
            scope.error(spec.pos, "unknown", f"unknown type {spec.name}{hint}")
        else:
            scope.error(spec.pos, "type", f"{spec.name} is not a type")
        return ERROR, None

    def resolve_symbol(self, symbol: TypeSymbol) -> Type:
        """The type of a TYPE declaration."""
        if symbol.type is not None:
            return symbol.type
        decl = symbol.decl
        scope = self.world.scope(decl.source, library=symbol.library)
        scope.enter(decl.namespace)
        if symbol.busy:
            return ERROR
        symbol.busy = True
        t, default = self.type_of(decl.spec, scope, decl.name)
        if decl.init is not None and t is not ERROR:
            default = self.initial(decl.init, t, scope) or default
        if symbol.type is None:
            symbol.type, symbol.default = t, default
        symbol.busy = False
        return symbol.type

    def _string(self, length: ast.Expr, scope: Scope, *, wide: bool) -> Type:
        n = self.checker(scope).integer(length)
        if n is None:
            return ERROR
        if not 1 <= n <= MAX_STRING:
            scope.error(length.pos, "range", f"the length of a STRING is 1..{MAX_STRING}, not {n}")
            return ERROR
        return StringType(n, wide)

    def checker(self, scope: Scope) -> Expressions:
        """Checks expressions in a scope."""
        return self.world.expressions(scope)

    def _array(self, spec: ast.ArraySpec, scope: Scope) -> tuple[Type, Initial | None]:
        open_allowed, self.open_allowed = self.open_allowed, False
        element, default = self.type_of(spec.element, scope)
        self.open_allowed = open_allowed
        checker, bounds = self.checker(scope), list[tuple[int, int]]()
        if None in spec.bounds:
            return self._open_array(spec, element, scope), None
        for low_node, high_node in (b for b in spec.bounds if b is not None):
            low, high = checker.integer(low_node), checker.integer(high_node)
            if low is None or high is None:
                return ERROR, None
            if low > high:
                scope.error(low_node.pos, "range", f"the lower bound {low} is above the upper bound {high}")
                return ERROR, None
            if not (constants.fits(low, ELEMENTARY["DINT"]) and constants.fits(high, ELEMENTARY["DINT"])):
                scope.error(low_node.pos, "range", "array bounds have to fit DINT")
                return ERROR, None
            bounds.append((low, high))
        if element is ERROR:
            return ERROR, None
        t = ArrayType(element, tuple(bounds))
        if t.size > MAX_SIZE:
            scope.error(spec.pos, "size", f"an array of {t.size} bytes is too large")
            return ERROR, None
        return t, None if default is None else ArrayInit([(t.count, default)])

    def _open_array(self, spec: ast.ArraySpec, element: Type, scope: Scope) -> Type:
        if any(b is not None for b in spec.bounds):
            scope.error(spec.pos, "type", "an array has either bounds in all dimensions or * in all")
            return ERROR
        if not self.open_allowed:
            scope.error(spec.pos, "type", "ARRAY[*] is not supported yet; give the array its bounds")
            return ERROR
        return ERROR if element is ERROR else OpenArrayType(element, ((0, -1),) * len(spec.bounds))

    def _enum(self, spec: ast.EnumSpec, scope: Scope, name: str | None) -> tuple[Type, Initial | None]:
        base: Type = INT
        if spec.base is not None:
            base = self.named_type(spec.pos, spec.base, scope)
            if base is ERROR:
                return ERROR, None
        if not isinstance(base, Elementary) or base.kind not in (Kind.INT, Kind.BIT):
            scope.error(spec.pos, "type", f"an enumeration is based on an integer type, not on {base}")
            return ERROR, None
        t = EnumType(name or "(" + ", ".join(n for _, n, _ in spec.values) + ")", base, {})
        inner = Scope(self.world, scope.source, scope.library, dict(scope.names), scope.bindings)
        checker, value, seen = self.checker(inner), -1, set[str]()
        for offset, value_name, node in spec.values:
            key = value_name.casefold()
            if key in seen:
                scope.error(offset, "duplicate", f"{value_name} is in this enumeration already")
                continue
            seen.add(key)
            given = None if node is None or isinstance(node, ast.ArrayInit | ast.StructInit) else checker.integer(node)
            value = value + 1 if given is None else given
            if not constants.fits(value, base):
                scope.error(offset, "range", f"{value} does not fit {base}")
                value = 0
            t.values[value_name] = value
            constant = Const(value, t, scope.pos(offset))
            inner.names[key] = VarSymbol(
                value_name, constant.pos, t, Role.LOCAL, value=constant, constant=True, used=True
            )
            if name is None:
                scope.names.setdefault(key, inner.names[key])
        first = next(iter(t.values.values()), 0)
        return t, ScalarInit(first) if first else None

    def _subrange(self, spec: ast.SubrangeSpec, scope: Scope, name: str | None) -> tuple[Type, Initial | None]:
        base = self.named_type(spec.pos, spec.base, scope)
        checker = self.checker(scope)
        low, high = checker.integer(spec.low), checker.integer(spec.high)
        if base is ERROR or low is None or high is None:
            return ERROR, None
        if not isinstance(base, Elementary) or base.kind not in (Kind.INT, Kind.BIT):
            scope.error(spec.pos, "type", f"a subrange is one of an integer type, not of {base}")
            return ERROR, None
        if low > high or not constants.fits(low, base) or not constants.fits(high, base):
            scope.error(spec.low.pos, "range", f"{low}..{high} is not a range of {base}")
            return ERROR, None
        t = SubrangeType(name or f"{base}({low}..{high})", base, low, high)
        return t, ScalarInit(low) if low else None

    def _pointer(self, spec: ast.PointerSpec, scope: Scope) -> Type:
        symbol = scope.unit(spec.target.name) if isinstance(spec.target, ast.NamedType) else None
        if isinstance(symbol, PouSymbol) and symbol.keyword == "FUNCTION_BLOCK":
            target: Type = self.world.units.layout(symbol) or ERROR  # the block itself may hold the pointer
        elif isinstance(symbol, TypeSymbol) and symbol.busy and symbol.decl.name in self._structs:
            target = self._structs[symbol.decl.name]  # and so may a struct
        else:
            target, _ = self.type_of(spec.target, scope)
        if target is ERROR:
            return ERROR
        kinds = {"REFERENCE": ReferenceType, "POINTER": RawPointerType}
        return kinds.get(spec.keyword, PointerType)(target)

    def _struct(self, spec: ast.StructSpec, scope: Scope, name: str) -> tuple[Type, Initial | None]:
        t, defaults, seen = StructType(name, union=spec.union), dict[str, Initial](), set[str]()
        self._structs[name] = t
        for decl in spec.fields:
            field_type, default = self.declared_type(decl, scope)
            self.world.classes.require_instances(field_type, scope, decl.pos)
            if decl.location is not None:
                scope.error(decl.location.pos, "location", "a member of a STRUCT has no address")
            for offset, field_name in decl.names:
                if field_name.casefold() in seen:
                    scope.error(offset, "duplicate", f"{name} has a member {field_name} already")
                    continue
                seen.add(field_name.casefold())
                t.fields.append(Field(field_name, field_type))
                if default is not None and not (spec.union and defaults):  # of a union the first one counts
                    defaults[field_name] = default
        if any(f.type is ERROR for f in t.fields):
            return ERROR, None
        t.lay_out()
        if t.size > MAX_SIZE:
            scope.error(spec.pos, "size", f"a struct of {t.size} bytes is too large")
            return ERROR, None
        if defaults:
            self.world.defaults[name] = StructInit(defaults)
        return t, self.struct_default(t)

    def struct_default(self, t: StructType) -> Initial | None:
        """What a struct or instance starts with: None for all zero."""
        return StructInit({}) if t.name in self.world.defaults else None

    # ---- declarations of variables ----

    def declared_type(self, decl: ast.VarDecl, scope: Scope) -> tuple[Type, Initial | None]:
        """Type and initial value of a declaration line; None for all zero."""
        spec, init = decl.type, decl.init
        if isinstance(spec, ast.EnumSpec) and spec.base is not None:
            base = spec.base
            symbol = scope.unit(base)
            if isinstance(symbol, PouSymbol | TypeSymbol) and init is None:  # t : TON(PT := T#1s)
                members = [(offset, name, value) for offset, name, value in spec.values if value is not None]
                init, spec = ast.StructInit(spec.pos, members), ast.NamedType(spec.pos, base)
        t, default = self.type_of(spec, scope)
        if init is None or t is ERROR:
            return t, default
        given = self.initial(init, t, scope)
        if given is None or (default is None and given == ScalarInit(0) and str(given.value) != "-0.0"):
            return t, default if given is None else None
        return t, given

    def initial(self, node: ast.Init, t: Type, scope: Scope) -> Initial | None:
        """A constant initial value; None after a diagnosis."""
        if isinstance(node, ast.ArrayInit):
            return self._array_initial(node, t, scope)
        if isinstance(node, ast.StructInit):
            return self._struct_initial(node, t, scope)
        e = self.checker(scope).value(node, t)
        if e.type is ERROR:
            return None
        if not isinstance(e, Const):
            if isinstance(t, PointerType) and not isinstance(t, ReferenceType):
                return ComputedInit(e)
            scope.error(node.pos, "constant", "an initial value has to be constant")
            return None
        return ScalarInit(e.value)

    def _array_initial(self, node: ast.ArrayInit, t: Type, scope: Scope) -> Initial | None:
        if not isinstance(t, ArrayType):
            scope.error(node.pos, "type", f"[...] does not initialise {t}")
            return None
        counts = [high - low + 1 for low, high in t.bounds]
        runs = self._runs(node.items, counts, t.element, scope)
        if runs is None:
            return None
        total = sum(count for count, _ in runs)
        if total > t.count:
            scope.error(node.pos, "range", f"{total} initial values for the {t.count} elements of {t}")
            return None
        return ArrayInit(runs)

    def _runs(
        self, items: Iterable[ast.Init | ast.Repeat], counts: list[int], element: Type, scope: Scope
    ) -> list[tuple[int, Initial | None]] | None:
        """Runs of values in element order. A nested [...] fills one step of the first index."""
        runs: list[tuple[int, Initial | None]] = []
        inner = 1
        for count in counts[1:]:
            inner *= count
        for item in items:
            if isinstance(item, ast.Call) and isinstance(item.callee, ast.Name) and self._is_repeat(item, scope):
                item = ast.Repeat(item.pos, item.callee, [a.value for a in item.args if a.value is not None])
            if isinstance(item, ast.Repeat):
                more = self._repeated(item, counts, element, scope)
            elif isinstance(item, ast.ArrayInit) and len(counts) > 1:
                more = self._runs(item.items, counts[1:], element, scope)
                if more is not None and (given := sum(c for c, _ in more)) < inner:
                    more.append((inner - given, None))
            else:
                value = self.initial(item, element, scope)
                more = None if value is None else [(1, value)]
            if more is None:
                return None
            runs += more
        return runs

    def _is_repeat(self, item: ast.Call, scope: Scope) -> bool:
        assert isinstance(item.callee, ast.Name)
        symbol = scope.lookup(item.callee.name)
        return isinstance(symbol, VarSymbol | GlobalSymbol)

    def _repeated(
        self, item: ast.Repeat, counts: list[int], element: Type, scope: Scope
    ) -> list[tuple[int, Initial | None]] | None:
        count = self.checker(scope).integer(item.count)
        if count is None:
            return None
        if not 0 <= count <= MAX_SIZE:
            scope.error(item.pos, "range", f"{count} is not a number of elements")
            return None
        if not item.values:
            return [(count, None)]
        runs = self._runs(item.values, counts, element, scope)
        if runs is None or len(runs) == 1:
            return runs and [(runs[0][0] * count, runs[0][1])]
        if count * len(runs) > 1_000_000:
            scope.error(item.pos, "size", "this initial value is too large")
            return None
        return runs * count

    def _struct_initial(self, node: ast.StructInit, t: Type, scope: Scope) -> Initial | None:
        if not isinstance(t, StructType):
            scope.error(node.pos, "type", f"(name := value) does not initialise {t}")
            return None
        block = self.world.blocks.get(t)
        members: dict[str, Initial] = {}
        arguments: dict[str, Expr] = {}
        for offset, name, value in node.members:
            field = t.member(name)
            if field is None and self._initialiser_argument(name, value, t, arguments, scope):
                continue
            if field is None or (block is not None and block.members[name.casefold()].role is Role.IN_OUT):
                hint = did_you_mean(name, (f.name for f in t.fields))
                scope.error(offset, "unknown", f"{t} has no member {name} to initialise{hint}")
                continue
            if field.name in members:
                scope.error(offset, "duplicate", f"{name} is initialised twice")
            given = self.initial(value, field.type, scope)
            if given is not None:
                members[field.name] = given
        return StructInit(members, arguments)

    def _initialiser_argument(
        self, name: str, node: ast.Init, t: StructType, arguments: dict[str, Expr], scope: Scope
    ) -> bool:
        """`fb : MyFB(id := 3)` for an input of FB_Init; False when there is no such input."""
        if isinstance(node, ast.ArrayInit | ast.StructInit):
            return False
        for member in reversed(self.world.classes.initialisers(t)):
            for symbol, _ in self.world.classes.signature(member).parameters:
                if symbol.name.casefold() == name.casefold():
                    arguments[name.casefold()] = self.checker(scope).input(node, symbol.type, name)
                    return True
        return False

    # ---- variables ----

    def add(self, scope: Scope, symbol: VarSymbol, offset: int) -> bool:
        """Makes a name known in a scope; False when it is taken."""
        key = symbol.name.casefold()
        other = scope.names.get(key)
        if isinstance(other, VarSymbol):
            if other.role is Role.RESULT:
                scope.error(offset, "duplicate", f"{symbol.name} is the name of this function")
            else:
                scope.error(
                    offset, "duplicate", f"{symbol.name} is declared already: {other.name} in line {other.pos.line}"
                )
            return False
        scope.names[key] = symbol
        return True

    def constant_symbol(
        self, offset: int, name: str, t: Type, init: Initial | None, scope: Scope, owner: str, role: Role
    ) -> VarSymbol:
        """A constant: scalars and strings are folded, arrays and structs get memory once, however many instances there
        are."""
        pos = scope.pos(offset)
        if isinstance(init, ComputedInit):
            scope.error(offset, "constant", f"the value of the constant {name} is not known before the program runs")
        symbol = VarSymbol(name, pos, t, role, constant=True, default=init)
        if is_scalar(t) or isinstance(t, StringType):
            zero: int | float | str = "" if isinstance(t, StringType) else 0.0 if _is_real(t) else 0
            symbol.value = Const(init.value if isinstance(init, ScalarInit) else zero, t, pos)
        elif t is not ERROR:
            full_name = f"{owner}.{name}" if owner else name
            symbol.variable = self.shared_variable(full_name, t, init, scope, offset, constant=True)
        return symbol

    def shared_variable(
        self, full_name: str, t: Type, init: Initial | None, scope: Scope, offset: int, *, constant: bool = False
    ) -> Variable:
        """A variable that exists once for all instances of its POU."""
        key = (scope.source.path, offset)
        variable = self.world.shared.get(key)
        if variable is None:
            variable = Variable(full_name, t, Storage.AREA, scope.pos(offset), initial=init, constant=constant)
            self.world.shared[key] = variable
            self.world.allocation.add(variable)
        return variable

    def global_variable(self, symbol: GlobalSymbol) -> VarSymbol:
        """Declares a global when it is first used, so that the order of declarations does not matter."""
        if symbol.symbol is not None:
            return symbol.symbol
        scope = self.world.scope(symbol.source)
        scope.enter(symbol.namespace)
        if symbol.busy:
            scope.error(symbol.pos, "recursion", f"the value of {symbol.name} depends on itself")
            return VarSymbol(symbol.name, scope.pos(symbol.pos), ERROR, Role.GLOBAL)
        symbol.busy = True
        t, init = self.declared_type(symbol.decl, scope)
        self.world.classes.require_instances(t, scope, symbol.pos)
        owner = symbol.full_name.rpartition(".")[0]
        if "CONSTANT" in symbol.qualifiers:
            result = self.constant_symbol(symbol.pos, symbol.name, t, init, scope, owner, Role.GLOBAL)
        else:
            result = VarSymbol(symbol.name, scope.pos(symbol.pos), t, Role.GLOBAL, default=init)
            if t is not ERROR:
                result.variable = self.area_variable(
                    symbol.full_name, t, init, symbol.decl.location, symbol.qualifiers, scope, symbol.pos
                )
                if result.variable is not None:
                    self.world.allocation.add(result.variable)
        symbol.busy = False
        symbol.symbol = result
        return result

    def area_variable(
        self,
        name: str,
        t: Type,
        init: Initial | None,
        location: ast.DirectAddress | None,
        qualifiers: set[str],
        scope: Scope,
        offset: int,
    ) -> Variable | None:
        """A variable of a program or a global one; not allocated yet."""
        pos = scope.pos(offset)
        if location is not None:
            return self._located(name, t, init, location, scope, offset)
        retain = bool(qualifiers & {"RETAIN", "PERSISTENT"}) or self.is_retain(t)
        return Variable(name, t, Storage.AREA, pos, Area.RETAIN if retain else Area.DATA, initial=init)

    def is_retain(self, t: Type) -> bool:
        """Whether instances of the type live in the retain area as a whole."""
        while isinstance(t, ArrayType):
            t = t.element
        block = self.world.blocks.get(t) if isinstance(t, StructType) else None
        if block is not None:
            return block.retain
        return isinstance(t, StructType) and any(self.is_retain(f.type) for f in t.fields)

    def _located(
        self, name: str, t: Type, init: Initial | None, location: ast.DirectAddress, scope: Scope, offset: int
    ) -> Variable | None:
        """A variable with AT. Words, double words ... are numbered, as CODESYS does it: %IW1 is bytes 2 and 3."""
        address = self._address(location, scope)
        if address is None:
            return None
        area, width, at, bit = address
        pos = scope.pos(offset)
        if width == 0 and base_of(t) is not BOOL:
            scope.error(location.pos, "location", f"{location.text} is a bit, {t} is not")
            return None
        base = elementary(t)
        if width and base is not None and base.bits != width:
            scope.error(location.pos, "location", f"{t} has {base.bits} bits, {location.text} {width}")
            return None
        if at % t.align:
            scope.error(location.pos, "location", f"{t} needs an address that is a multiple of {t.align} bytes")
            return None
        if at + t.size > MAX_ADDRESS + 1:
            scope.error(location.pos, "location", f"{location.text} is too far; addresses end at byte {MAX_ADDRESS}")
            return None
        return Variable(name, t, Storage.AREA, pos, area, at, init, bit=bit if width == 0 else None)

    def _address(self, node: ast.DirectAddress, scope: Scope) -> tuple[Area, int, int, int] | None:
        """Area, width in bits (0: one bit), byte offset and bit of an address."""
        text = node.text.upper()
        match = _ADDRESS.fullmatch(text)
        if match is None:
            what = (
                "has no number yet, which is not supported"
                if text.endswith("*")
                else "is not an address such as %IX0.3 or %QW2"
            )
            scope.error(node.pos, "location", f"{node.text} {what}")
            return None
        letter, size, first, second = match.groups()
        width = _WIDTHS[size]
        if len(first) > 6 or len(second or "") > 3 or (second is not None and (width or int(second) > 7)):
            scope.error(node.pos, "location", f"{node.text} is not an address such as %IX0.3 or %QW2")
            return None
        number = int(first)
        if width:
            return _AREAS[letter], width, number * width // 8, 0
        return (
            (_AREAS[letter], 0, number, int(second))
            if second is not None
            else (_AREAS[letter], 0, number // 8, number % 8)
        )

    def direct_variable(self, node: ast.DirectAddress, scope: Scope) -> VarSymbol | None:
        """The variable behind an address used in a statement."""
        key = node.text.upper()
        symbol = self._direct.get(key)
        if symbol is None:
            address = self._address(node, scope)
            if address is None:
                return None
            t = _DIRECT_TYPES[address[1]]
            variable = self._located(key, t, None, node, scope, node.pos)
            if variable is None:
                return None
            self.world.allocation.add(variable)
            symbol = VarSymbol(key, variable.pos, t, Role.GLOBAL, variable)
            self._direct[key] = symbol
        return symbol

    def runtime_initial(self, decl: ast.VarDecl, variable: Variable, scope: Scope) -> bool:
        """An initial value that is calculated at each call (variables on the stack). False when it is a constant."""
        node = decl.init
        if node is None or isinstance(node, ast.ArrayInit | ast.StructInit | ast.Literal):
            return False
        checker = self.checker(scope)
        e = checker.value(node, variable.type)
        if isinstance(e, Const) or e.type is ERROR or is_untyped(e):
            return False
        scope.prologue.append(Assign(VarPlace(variable, variable.type, variable.pos), e, e.pos))
        return True


def is_internal(symbol: Unit) -> bool:
    """Whether only its own namespace may use a unit."""
    decl = symbol.decl
    marked = isinstance(decl, ast.PouDecl) and "INTERNAL" in decl.modifiers
    return marked or (decl.namespace is not None and decl.namespace.internal)


_DIRECT_TYPES: dict[int, Elementary] = {
    0: BOOL, 8: ELEMENTARY["BYTE"], 16: ELEMENTARY["WORD"], 32: ELEMENTARY["DWORD"], 64: ELEMENTARY["LWORD"],
}  # fmt: skip


def _is_real(t: Type) -> bool:
    base = base_of(t)
    return isinstance(base, Elementary) and base.kind is Kind.REAL
