"""Names with dots: what is in a namespace, in a list of globals, in an instance; which method, action or property is
meant, and who may use it.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from dataclasses import dataclass

from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.conversions import error_value, load, place_of, whole
from plctool.compiler.semantics.symbols import (
    ERROR,
    BlockInfo,
    ClassInfo,
    GlobalSymbol,
    Member,
    MemberSymbol,
    Namespace,
    PouSymbol,
    ProgramInfo,
    Role,
    TypeSymbol,
    VarSymbol,
)
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import did_you_mean
from plctool.compiler.typed.nodes import AddressOf, Const, DerefPlace, Expr, Place, Pos, SelfPlace, VarPlace
from plctool.iec.types import InterfaceType, StructType, Type

# ---- namespaces, lists of globals, instances of programs ----

_LONGEST = 16  # parts of a name after its first; more are members of members


def variable_value(symbol: VarSymbol, pos: Pos) -> Expr:
    """A variable as a value: of constants their value."""
    symbol.used = True
    if symbol.value is not None:
        return Const(symbol.value.value, symbol.type, pos)
    variable = symbol.variable
    if variable is None:
        return error_value(pos)
    return load(whole(variable, pos) if variable.bit is not None else VarPlace(variable, symbol.type, pos))


def namespace_member(c: Checker, namespace: Namespace, node: ast.Member) -> Expr:
    """`list.name`, `program.name`"""
    symbol = namespace.members.get(node.name.casefold())
    if symbol is None:
        hint = did_you_mean(node.name, (m.name for m in namespace.members.values()))
        return c.error(node.name_pos, "unknown", f"{namespace.what} {namespace.name} has no {node.name}{hint}")
    if isinstance(symbol, GlobalSymbol):
        symbol = c.world.declared.variable(symbol)
    return variable_value(symbol, c.pos(node.pos))


def qualified(c: Checker, node: ast.Member) -> Expr | None:
    """A global, or the value of an enumeration, in a namespace; None when `node` names none."""
    name = dotted_name(c, node)
    if name is None:
        return None
    program = space_of(c, node.base)
    if program is not None:
        return namespace_member(c, program, node)
    symbol = c.scope.lookup(name)
    if isinstance(symbol, GlobalSymbol):
        if not c.scope.may_use(symbol, name, node.name_pos):
            return error_value(c.pos(node.pos))
        return variable_value(c.world.declared.variable(symbol), c.pos(node.pos))
    if symbol is not None:
        return c.error(node.pos, "name", f"{name} is {describe(symbol)}, not a value{instance_hint(symbol)}")
    space, _, value = name.rpartition(".")
    owner = c.scope.lookup(space)
    if isinstance(owner, TypeSymbol):
        return c.expr(ast.EnumValue(node.pos, space, value))
    if (
        owner is None
        and space.casefold() in c.world.names.namespaces
        and name.casefold() not in c.world.names.namespaces
    ):
        hint = did_you_mean(value, c.world.names.names_in(space))
        return c.error(node.name_pos, "unknown", f"the namespace {space} has no {value}{hint}")
    return None


def space_of(c: Checker, node: ast.Expr) -> Namespace | None:
    """The list of globals or the program instance an expression names, perhaps in a namespace."""
    name = node.name if isinstance(node, ast.Name) else dotted_name(c, node)
    symbol = None if name is None else c.scope.lookup(name)
    return symbol if isinstance(symbol, Namespace) else None


def called_program(c: Checker, callee: ast.Expr) -> ProgramInfo | None:
    """The instance of a PROGRAM that a call is about."""
    space = space_of(c, callee)
    return None if space is None else space.program


def is_namespace(c: Checker, name: str) -> bool:
    """Whether a name stands for a namespace here."""
    return name.casefold() in c.world.names.namespaces and c.scope.lookup(name) is None


def dotted_name(c: Checker, node: ast.Expr) -> str | None:
    """`a.b.c` as a name when `a` may be a namespace or a library."""
    parts = list[str]()
    while isinstance(node, ast.Member) and len(parts) < _LONGEST:
        parts.append(node.name)
        node = node.base
    if not isinstance(node, ast.Name) or not parts or isinstance(c.scope.lookup(node.name), VarSymbol):
        return None
    return ".".join([node.name, *reversed(parts)])


def instance_hint(symbol: object) -> str:
    """What to do with a name that stands for a type with instances, or for a function."""
    if isinstance(symbol, PouSymbol) and symbol.keyword is ast.Unit.FUNCTION:
        return f"; a call of it is written {symbol.decl.name}()"
    is_block = isinstance(symbol, PouSymbol) and symbol.keyword is ast.Unit.FUNCTION_BLOCK
    return "; declare an instance of it" if is_block else ""


def describe(symbol: object) -> str:
    """What a name that is not a variable stands for."""
    if isinstance(symbol, PouSymbol):
        article = {
            ast.Unit.FUNCTION: "a function",
            ast.Unit.FUNCTION_BLOCK: "a function block type",
            ast.Unit.INTERFACE: "an interface",
        }
        return article.get(symbol.keyword, "a program")
    if isinstance(symbol, MemberSymbol):
        return "a method"
    if isinstance(symbol, Namespace):
        return f"a {symbol.what}"
    return "a type"


# ---- PUBLIC, PRIVATE, PROTECTED, INTERNAL ----


def may_see(c: Checker, symbol: VarSymbol, t: Type, node: ast.Member) -> bool:
    """Whether a variable of an instance may be used here; reports it when not. A VAR is for its own block, but
    existing programs read it from outside, so that is a warning only; writing it is an error anyway."""
    plain = not symbol.access
    if plain and (symbol.role is not Role.LOCAL or symbol.constant or c.scope.sees_inside):
        return True
    cls = c.world.class_of(t)
    cls = None if cls is None else declaring_class(symbol, cls)
    here = c.scope.cls
    if plain and cls is not None and (here is None or not here.derives(cls)):
        message = f"{symbol.name} is a VAR of {cls.name} for its own use; make it VAR_OUTPUT to read it outside"
        message = f"{message}, VAR_INPUT to write it"
        c.warning(node.name_pos, "access", message)
    return (
        cls is None
        or symbol.access is None
        or _permitted(c, {symbol.access}, cls, f"{cls.name}.{symbol.name}", node.name_pos)
    )


def declaring_class(symbol: VarSymbol, cls: ClassInfo) -> ClassInfo:
    """The class or base of it that declares a variable of its instances."""
    key = symbol.name.casefold()
    while cls.base is not None and cls.base.block is not None and cls.base.block.members.get(key) is symbol:
        cls = cls.base
    return cls


def is_inside(c: Checker, symbol: VarSymbol, block: BlockInfo) -> bool:
    """Whether this is part of the block that declares a variable, or of one derived from it: then the variables of
    other instances may be written as its own."""
    here = c.scope.cls
    return here is not None and block.cls is not None and here.derives(declaring_class(symbol, block.cls))


def accessible(c: Checker, member: Member, offset: int) -> bool:
    """Whether a method, action or property may be used here; reports it when not."""
    return _permitted(c, member.decl.modifiers, member.owner, member.name, offset)


def _permitted(c: Checker, modifiers: set[ast.Modifier], owner: ClassInfo, name: str, offset: int) -> bool:
    here = c.scope.cls
    if ast.Modifier.PRIVATE in modifiers and here is not owner:
        c.error(offset, "access", f"{name} is PRIVATE: only {owner.name} itself may use it")
        return False
    if ast.Modifier.PROTECTED in modifiers and (here is None or not here.derives(owner)):
        message = f"{name} is PROTECTED: only {owner.name} and what extends it may use it"
        c.error(offset, "access", message)
        return False
    space = owner.symbol.decl.namespace
    if ast.Modifier.INTERNAL in modifiers and space is not None and not c.scope.is_within(space.name):
        c.error(offset, "access", f"{name} is INTERNAL: only the namespace {space.name} may use it")
        return False
    return True


# ---- methods, actions and properties ----


@dataclass
class Bound:
    """A member and the instance it is called on; None for a member of a program."""

    cls: ClassInfo
    key: str  # without .get and .set
    place: Place | None

    @property
    def callable(self) -> Member | None:
        """The method or action; None for a property."""
        return self.cls.find(self.key)

    @property
    def getter(self) -> Member | None:
        """The GET of the property."""
        return self.cls.find(f"{self.key}.get")

    @property
    def setter(self) -> Member | None:
        """The SET of the property."""
        return self.cls.find(f"{self.key}.set")

    @property
    def exists(self) -> bool:
        """Whether the class has any of them."""
        return self.callable is not None or self.getter is not None or self.setter is not None


def bound_member(c: Checker, node: ast.Expr, *, called: bool = False) -> Bound | None:
    """What `m`, `fb.m` or `prog.m` stands for when it is a method, action or property. `called`: the name of the
    method around is not its result."""
    if not c.world.names.has_members:
        return None
    if isinstance(node, ast.Name):
        symbol = c.scope.lookup(node.name)
        if called and isinstance(symbol, VarSymbol) and symbol.role is Role.RESULT:
            symbol = c.scope.outer.get(node.name.casefold())
        return own_member(c, node.name) if isinstance(symbol, MemberSymbol) else None
    if not isinstance(node, ast.Member):
        return None
    space = space_of(c, node.base)
    if space is not None:
        return None if space.cls is None else _existing(Bound(space.cls, node.name.casefold(), None))
    if isinstance(node.base, ast.Name) and isinstance(c.scope.lookup(node.base.name), TypeSymbol | PouSymbol):
        return None
    dotted = dotted_name(c, node)
    if dotted is not None and (c.scope.lookup(dotted) is not None or dotted.casefold() in c.world.names.namespaces):
        return None
    if isinstance(node.base, ast.Name) and is_namespace(c, node.base.name):
        return None
    if isinstance(node.base, ast.Member) and _dotted_type(c, node.base):
        return None
    base = c.expr(node.base)
    return None if base.type is ERROR else instance_member(c, base, node)


def own_member(c: Checker, name: str) -> Bound | None:
    """The member of the unit around; None outside of a class."""
    cls = c.scope.cls
    if cls is None:
        return None
    place = None if cls.type is None else SelfPlace(cls.type, c.pos(0))
    return Bound(cls, name.casefold(), place)


def instance_member(c: Checker, base: Expr, node: ast.Member) -> Bound | None:
    """The member `name` of an instance; None when it is not one but may be a variable."""
    t = base.type
    if isinstance(t, InterfaceType):
        place: Place = DerefPlace(base, t.target, c.pos(node.pos))
    elif isinstance(base, AddressOf) and isinstance(base.place, SelfPlace):  # THIS.x
        place = base.place
    elif isinstance(t, StructType):
        place = place_of(base)
    else:
        return None
    cls = c.world.class_of(place.type)
    if cls is None:
        return None
    bound = Bound(cls, node.name.casefold(), place)
    return bound if cls.is_interface else _existing(bound)


def _existing(bound: Bound) -> Bound | None:
    return bound if bound.exists else None


def _dotted_type(c: Checker, node: ast.Member) -> bool:
    name = dotted_name(c, node)
    return name is not None and isinstance(c.scope.lookup(name), TypeSymbol)


def usable(c: Checker, bound: Bound, member: Member | None, offset: int) -> Member | None:
    """The member of those that `bound` may be, if it exists and may be used here; None after an error."""
    if member is not None:
        return member if accessible(c, member, offset) else None
    if c.scope.inherits_unknown(bound.cls):
        return None
    hint = did_you_mean(bound.key, bound.cls.member_names())
    c.error(offset, "unknown", f"{bound.cls.name} has no method {bound.key}{hint}")
    return None


def is_called_by_name(c: Checker, node: ast.Expr) -> bool:
    """Whether a name alone is a call: of an action or a program, as older programs write it."""
    if called_program(c, node) is not None:
        return True
    bound = bound_member(c, node)
    member = None if bound is None else bound.callable
    return member is not None and member.decl.keyword is ast.Unit.ACTION
