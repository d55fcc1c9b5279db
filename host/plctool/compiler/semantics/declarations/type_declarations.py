"""Types: from what is written to types with a layout, and what variables of them start with.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from enum import Flag, auto

from plctool.compiler.base.internal import note_position
from plctool.compiler.base.missing_names import known_name_like
from plctool.compiler.base.nesting import NestingError
from plctool.compiler.semantics import constants
from plctool.compiler.semantics.allocation import is_open
from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.declarations.initial_values import InitialValues, combined, with_arguments
from plctool.compiler.semantics.declarations.number_types import enumeration, subrange, values_of
from plctool.compiler.semantics.generics import is_group
from plctool.compiler.semantics.instances import require_instances
from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.symbols import ERROR, PouSymbol, Role, TypeSymbol, VarSymbol
from plctool.compiler.semantics.world import World
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.slips import TYPES
from plctool.compiler.typed.nodes import ArrayInit, Initial, ScalarInit, Storage, StructInit, Variable, overlay
from plctool.iec.types import (
    BOOL,
    BYTE,
    DEFAULT_STRING_LENGTH,
    ELEMENTARY,
    INT,
    MAX_ALIGN,
    MAX_SIZE,
    ArrayType,
    EnumType,
    Field,
    OpenArrayType,
    PointerType,
    RawPointerType,
    ReferenceType,
    StringType,
    StructType,
    Type,
    alignment_at,
    base_of,
)  # fmt: skip

MAX_STRING = 0xFFFF
MAX_TYPE_DEPTH = 50  # levels of arrays of structs of arrays ...
_STRINGS = ("STRING", "WSTRING")
_PACK_MODES = {"0": 1, "1": 1, "2": 2, "4": 4, "8": 8}
_DIALECT: dict[str, Type] = {"BIT": BOOL, "PVOID": RawPointerType(BYTE)}


class May(Flag):
    """What a declaration line may have where it stands."""

    BE_PLAIN = 0
    HAVE_ADDRESS = auto()  # AT %IX0.3
    HAVE_OPEN_ADDRESS = auto()  # AT %I*
    BE_EDGE = auto()  # BOOL R_EDGE
    BE_OPEN_ARRAY = auto()  # ARRAY[*]
    BE_BIT = auto()  # BIT, which shares its byte with its neighbours


def is_packed_bit(decl: ast.VarDecl) -> bool:
    """Whether a member of a struct is a BIT without an address of its own."""
    return isinstance(decl.type, ast.NamedType) and decl.type.name.upper() == "BIT" and decl.location is None


class TypeDeclarations:
    """Turns declarations into types."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._depth = 0
        self._initials = InitialValues(world)
        self._structs: dict[int, StructType] = {}  # by the identity of their declaration
        self._postponing = 0
        self._postponed: list[TypeSymbol] = []

    # ---- declaration lines ----

    def declared_type(
        self, decl: ast.VarDecl, scope: Scope, may: May = May.BE_PLAIN, *, overrides: bool = False
    ) -> tuple[Type, Initial | None]:
        """Type and initial value of a declaration line; None for all zero, unless it says 0 where memory may hold
        something else: it is at an address, or `overrides` another initial value."""
        try:
            return self._declared_type(decl, scope, may, overrides=overrides)
        except Exception as error:
            note_position(error, scope.pos(decl.pos))
            raise

    def _declared_type(
        self, decl: ast.VarDecl, scope: Scope, may: May, *, overrides: bool
    ) -> tuple[Type, Initial | None]:
        overrides = overrides or decl.location is not None
        self._check_extras(decl, may, scope)
        spec, inits = with_arguments(decl)
        if isinstance(spec, ast.ArraySpec) and None in spec.bounds and May.BE_OPEN_ARRAY in may:
            return self._open_array(spec, scope), None
        is_bit = May.BE_BIT in may and is_packed_bit(decl)
        t, default = (BOOL, None) if is_bit else self.type_of(spec, scope)
        if decl.edge and t is not BOOL and t is not ERROR:
            scope.error(spec.pos, "type", f"{decl.edge} is for a BOOL, not for {t}")
        values = [] if t is ERROR else [self._initials.initial(init, t, scope) for init in inits]
        if not values or values[0] is None:
            return t, default
        given = values[0]
        if len(values) > 1 and values[1] is not None:
            given = combined(t, given, values[1])
        if default is None and not overrides and given == ScalarInit(0) and str(given.value) != "-0.0":
            return t, None
        return t, overlay(t, given, default)

    def _check_extras(self, decl: ast.VarDecl, may: May, scope: Scope) -> None:
        location = decl.location
        if location is not None and May.HAVE_ADDRESS not in may:
            if May.HAVE_OPEN_ADDRESS not in may:
                message = "only variables of a PROGRAM and global ones have an address"
                scope.error(location.pos, "location", message)
            elif not is_open(location):
                start = location.text[:2]
                message = f"this has one address for each instance; write AT {start}*, and the addresses in VAR_CONFIG"
                scope.error(location.pos, "location", message)
        if decl.edge and May.BE_EDGE not in may:
            message = f"{decl.edge} is for VAR_INPUT of a FUNCTION_BLOCK or PROGRAM only"
            scope.error(decl.pos, "edge", message)

    # ---- types ----

    def type_of(self, spec: ast.TypeSpec, scope: Scope, name: str | None = None) -> tuple[Type, Initial | None]:
        """The type, and what variables of it start with. `name`: of the declared type, if it is one;
        no other type has it."""
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
            if name is None and isinstance(scope.unit(spec.base or ""), PouSymbol | TypeSymbol):
                return self._instance(spec, scope)
            base = INT if spec.base is None else self.named_type(spec.pos, spec.base, scope)
            return enumeration(self._world, spec, base, scope, name)
        if isinstance(spec, ast.SubrangeSpec):
            base = self.named_type(spec.pos, spec.base, scope)
            return subrange(self._world, spec, base, scope, name)
        if isinstance(spec, ast.PointerSpec):
            return self._pointer(spec, scope), None
        if isinstance(spec, ast.TypeOf):
            t = self._type_of_value(spec.value, scope)
            self._world.inferred[scope.source.path, scope.source.name, spec.pos] = t
            return t, self.struct_default(t) if isinstance(t, StructType) else None
        if name is None:
            scope.error(spec.pos, "type", "a STRUCT is declared in a TYPE block")
            return ERROR, None
        return self._struct(spec, scope, name)

    def _type_of_value(self, value: ast.Expr, scope: Scope) -> Type:
        """The type of what the body computes as well, with hidden variables of its own and the same errors."""
        known = 0 if scope.pou is None else len(scope.pou.locals)
        t = Checker(self._world, scope).settled(value).type
        if scope.pou is not None:
            del scope.pou.locals[known:]
        return t if isinstance(t, EnumType) else base_of(t)

    def named_type(self, offset: int, name: str, scope: Scope) -> Type:
        """The type of that name; ERROR after an error, if there is none."""
        return self._named(ast.NamedType(offset, name), scope)[0]

    def _named(self, spec: ast.NamedType, scope: Scope) -> tuple[Type, Initial | None]:
        upper = spec.name.upper()
        if upper in _STRINGS:
            wide = upper == "WSTRING"
            if spec.length is None:
                return StringType(DEFAULT_STRING_LENGTH, wide), None
            return self._string(spec.length, scope, wide=wide), None
        if upper == "BIT":
            scope.warning(spec.pos, "layout", "a BIT takes a byte here, as a BOOL does")
        if spec.inits is not None:
            message = f"only a STRING has a length, not {spec.name}; an array is written ARRAY[0..9] OF {spec.name}"
            scope.error(spec.pos, "type", message)
            return ERROR, None
        known = _DIALECT.get(upper) or ELEMENTARY.get(upper) or scope.bindings.get(upper)
        found = (known, None) if known is not None else self._declared(spec, scope)
        if spec.template == spec.name and found[0] is not ERROR and spec.constants:
            message = f"{spec.name} has no VAR_GENERIC CONSTANT, so nothing follows it in < >"
            scope.error(spec.pos, "type", message)
        return found

    def _declared(self, spec: ast.NamedType, scope: Scope) -> tuple[Type, Initial | None]:
        for name in ast.every(ast.Name, spec.constants):
            constant = scope.lookup(name.name)
            if isinstance(constant, VarSymbol):
                constant.used = True
        symbol = scope.unit(spec.name)
        if symbol is not None and not scope.may_use(symbol, spec.name, spec.pos):
            return ERROR, None
        if isinstance(symbol, TypeSymbol):
            if symbol.busy:
                scope.error(spec.pos, "recursion", f"the type {symbol.decl.name} contains itself")
                return ERROR, None
            return self.type_of_symbol(symbol), symbol.default
        if isinstance(symbol, PouSymbol) and symbol.keyword is ast.Unit.FUNCTION_BLOCK:
            info = self._world.declared.block(symbol)
            if info is None:
                scope.error(spec.pos, "recursion", f"the function block {spec.name} contains itself")
            return (ERROR, None) if info is None else (info.type, self.struct_default(info.type))
        if isinstance(symbol, PouSymbol) and symbol.keyword is ast.Unit.INTERFACE:
            return self._world.declared.interface(symbol), None
        if is_group(spec.name):
            scope.error(spec.pos, "type", f"{spec.name} is for parameters of functions, methods and blocks only")
        elif symbol is None and scope.lookup(spec.name) is None:
            upper = spec.name.upper()
            hint = known_name_like(spec.name, [*ELEMENTARY, *_STRINGS, *self._world.names.type_names()])
            hint = f"; write {TYPES[upper]}" if upper in TYPES else hint
            hint = scope.choices(spec.name) or hint
            if upper == "ENUM":
                hint = "; an enumeration is written Name : (First, Second);"
            if hint:
                scope.error(spec.pos, "unknown", f"unknown type {spec.name}{hint}")
            else:
                scope.missing(spec.pos, spec.name, f"unknown type {spec.name}")
        else:
            scope.error(spec.pos, "type", f"{spec.name} is not a type")
        return ERROR, None

    def type_of_symbol(self, symbol: TypeSymbol) -> Type:
        """The type of a TYPE declaration."""
        if symbol.type is not None:
            return symbol.type
        decl = symbol.decl
        scope = self._world.scope(decl.source, library=symbol.library)
        scope.enter(decl.namespace)
        if symbol.busy:
            return ERROR
        symbol.busy = True
        t, default = self.type_of(decl.spec, scope, self._world.names.unique_name(symbol))
        if isinstance(t, EnumType) and isinstance(decl.spec, ast.EnumSpec):
            t.strict, t.named = "strict" in decl.attributes, "to_string" in decl.attributes
        if symbol.type is None:
            symbol.type, symbol.default = t, default
        if decl.init is not None and t is not ERROR:  # it may name a value of this very enumeration
            if isinstance(t, EnumType) and isinstance(decl.spec, ast.EnumSpec):
                scope.names.update(values_of(t, scope.pos(decl.pos)))
            given = self._initials.initial(decl.init, t, scope)
            symbol.default = default if given is None else overlay(t, given, default)
        symbol.busy = False
        return symbol.type

    def _string(self, length: ast.Expr, scope: Scope, *, wide: bool) -> Type:
        n = Checker(self._world, scope).integer(length)
        if n is None:
            return ERROR
        if not 1 <= n <= MAX_STRING:
            scope.error(length.pos, "range", f"the length of a STRING is 1..{MAX_STRING}, not {n}")
            return ERROR
        return StringType(n, wide)

    def _array(self, spec: ast.ArraySpec, scope: Scope) -> tuple[Type, Initial | None]:
        element, default = self.type_of(spec.element, scope)
        checker, bounds = Checker(self._world, scope), list[tuple[int, int]]()
        if None in spec.bounds:
            message = "only VAR_IN_OUT, in functions and methods VAR_INPUT and VAR_OUTPUT too, takes an ARRAY[*]"
            scope.error(spec.pos, "type", f"{message}; give this array its bounds")
            return ERROR, None
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
        return t, None if default is None else ArrayInit([], default)

    def _open_array(self, spec: ast.ArraySpec, scope: Scope) -> Type:
        """The type of a parameter that takes arrays of any size."""
        element, _ = self.type_of(spec.element, scope)
        if any(b is not None for b in spec.bounds):
            scope.error(spec.pos, "type", "an array has either bounds in all dimensions or * in all")
            return ERROR
        return ERROR if element is ERROR else OpenArrayType(element, ((0, -1),) * len(spec.bounds))

    def _instance(self, spec: ast.EnumSpec, scope: Scope) -> tuple[Type, Initial | None]:
        """`TON(PT := T#1s)`, `Pump(valve, 3)`: a type with initial values and inputs of FB_Init."""
        members = [(o, name, v) if v is not None else (o, "", ast.Name(o, name)) for o, name, v in spec.values]
        t, default = self._named(ast.NamedType(spec.pos, spec.base or ""), scope)
        if t is ERROR or not members:
            return t, default
        given = self._initials.initial(ast.StructInit(spec.pos, members, arguments=True), t, scope)
        return t, default if given is None else overlay(t, given, default)

    def _pointer(self, spec: ast.PointerSpec, scope: Scope) -> Type:
        target = self._target(spec.target, scope)
        if target is ERROR:
            return ERROR
        if spec.keyword is ast.Pointing.REFERENCE and isinstance(target, ReferenceType):
            scope.error(spec.pos, "type", f"there is no REFERENCE to a REFERENCE; write {target}")
            return ERROR
        kinds = {ast.Pointing.REFERENCE: ReferenceType, ast.Pointing.POINTER: RawPointerType}
        return kinds.get(spec.keyword, PointerType)(target)

    def _target(self, spec: ast.TypeSpec, scope: Scope) -> Type:
        """What a pointer points to. A block or struct may be unfinished, because it holds the pointer itself."""
        symbol = scope.unit(spec.name) if isinstance(spec, ast.NamedType) else None
        target: StructType | None = None
        if isinstance(symbol, PouSymbol) and symbol.keyword is ast.Unit.FUNCTION_BLOCK:
            target = self._world.declared.layout(symbol)
        elif isinstance(symbol, TypeSymbol):
            target = self._unfinished(symbol)
        if symbol is None or target is None:
            return self.type_of(spec, scope)[0]
        return target if scope.may_use(symbol, symbol.decl.name, spec.pos) else ERROR

    def _unfinished(self, symbol: TypeSymbol) -> StructType | None:
        """The struct of this name while it is being declared or has to wait."""
        spec = symbol.decl.spec
        if not isinstance(spec, ast.StructSpec) or symbol.type is not None or not (symbol.busy or self._postponing):
            return None
        if not symbol.busy:
            self._postponed.append(symbol)
        return self._layout(spec, self._world.names.unique_name(symbol))

    @contextmanager
    def postponing(self) -> Iterator[None]:
        """Around the declaration of a block: a struct that it only points to may hold the block, so it comes later."""
        self._postponing += 1
        try:
            yield
        finally:
            self._postponing -= 1
        while self._postponed and not self._postponing:
            self.type_of_symbol(self._postponed.pop())

    def _layout(self, spec: ast.StructSpec, name: str) -> StructType:
        """The struct of a declaration, perhaps without its members yet."""
        return self._structs.setdefault(id(spec), StructType(name, union=spec.union))

    def _struct(self, spec: ast.StructSpec, scope: Scope, name: str) -> tuple[Type, Initial | None]:
        t, defaults, seen = self._layout(spec, name), dict[str, Initial](), set[str]()
        if spec.base is not None and not self._extend(t, spec.base, defaults, scope):
            return ERROR, None
        seen.update(f.name.casefold() for f in t.fields)
        located: dict[str, VarSymbol] = dict(self._world.open_members.get(t.base, {})) if t.base is not None else {}
        for decl in spec.fields:
            field_type, default = self.declared_type(decl, scope, May.HAVE_OPEN_ADDRESS | May.BE_BIT)
            require_instances(self._world, field_type, scope, decl.pos)
            for offset, field_name in decl.names:
                if field_name.casefold() in seen:
                    scope.error(offset, "duplicate", f"{name} has a member {field_name} already")
                    continue
                seen.add(field_name.casefold())
                t.fields.append(Field(field_name, field_type, bit=-1 if is_packed_bit(decl) else None))
                if decl.location is not None and field_type is not ERROR:
                    symbol = VarSymbol(field_name, scope.pos(offset), field_type, Role.LOCAL, default=default)
                    symbol.variable = Variable(field_name, field_type, Storage.SELF, symbol.pos)
                    symbol.open_area = decl.location.text[1]
                    located[field_name.casefold()] = symbol
                if default is not None and not (spec.union and defaults):  # of a union the first one counts
                    defaults[field_name] = default
        if any(f.type is ERROR for f in t.fields):
            return ERROR, None
        t.pack = self._pack(spec, scope)
        t.lay_out(behind_base=True)
        self._check_alignment(t, spec, scope)
        self._place_members(t, located)
        if t.size > MAX_SIZE:
            scope.error(spec.pos, "size", f"a struct of {t.size} bytes is too large")
            return ERROR, None
        if defaults:
            self._world.defaults[name] = StructInit(defaults)
        return t, self.struct_default(t)

    @staticmethod
    def _pack(spec: ast.StructSpec, scope: Scope) -> int:
        """What {attribute 'pack_mode'} says members are multiples of [bytes] at most."""
        if spec.pack_mode is None:
            return MAX_ALIGN
        pack = _PACK_MODES.get(spec.pack_mode.strip())
        if pack is None:
            message = f"pack_mode is 1, 2, 4 or 8 (0 is 1 as well), not '{spec.pack_mode}'"
            scope.error(spec.pos, "attribute", message)
        return pack or MAX_ALIGN

    def _check_alignment(self, t: StructType, spec: ast.StructSpec, scope: Scope) -> None:
        """Reports members of which other code than this program's statements has the address: it would read them at
        addresses that some processors refuse."""
        for f in t.fields:
            if alignment_at(f.offset, t.align) >= f.type.align or not self._is_handed_out(f.type):
                continue
            pos = next((offset for d in spec.fields for offset, name in d.names if name == f.name), spec.pos)
            message = f"{f.name} is {f.type}, which pack_mode would move to an address that is no multiple"
            scope.error(
                pos, "attribute", f"{message} of {f.type.align}; give it a larger pack_mode, or declare it outside"
            )

    def _is_handed_out(self, t: Type) -> bool:
        """Whether a type holds an instance or a WSTRING."""
        if isinstance(t, ArrayType):
            return self._is_handed_out(t.element)
        if isinstance(t, StructType):
            return t in self._world.blocks or any(self._is_handed_out(f.type) for f in t.fields)
        return isinstance(t, StringType) and t.wide

    def _place_members(self, t: StructType, located: dict[str, VarSymbol]) -> None:
        """Notes the members with AT %I* and the like, now that they have their offsets."""
        for key, symbol in located.items():
            field = t.member(key)
            if field is not None and symbol.variable is not None:
                symbol.variable.offset = field.offset
        if located:
            self._world.open_members[t] = located

    def _extend(self, t: StructType, spec: ast.NamedType, defaults: dict[str, Initial], scope: Scope) -> bool:
        """Begins a struct with the members of the one it EXTENDS."""
        base = self._named(spec, scope)[0]
        if base is ERROR:
            return False
        if not isinstance(base, StructType) or base in self._world.blocks or base.union is not t.union:
            scope.error(spec.pos, "type", f"{spec.name} is not a {'UNION' if t.union else 'STRUCT'}")
            return False
        t.fields += [Field(f.name, f.type, bit=f.bit) for f in base.fields]
        t.base = base
        inherited = self._world.defaults.get(base.name)
        defaults.update(inherited.members if isinstance(inherited, StructInit) else {})
        return True

    def struct_default(self, t: StructType) -> Initial | None:
        """What a struct or instance starts with: None for all zero."""
        return StructInit({}) if t.name in self._world.defaults else None
