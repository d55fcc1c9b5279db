"""What a call is about: `resolve_callee` says it before any argument is looked at, and the rules of calls do it.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.rules.arguments import named_function
from plctool.compiler.semantics.rules.builtin import QUERIES, find_built_in, function_hint, query
from plctool.compiler.semantics.rules.intrinsics import overloaded_form
from plctool.compiler.semantics.rules.members import Bound, bound_member, called_program, dotted_name
from plctool.compiler.semantics.rules.pools import DELETE, NEW, new
from plctool.compiler.semantics.rules.varinfo import VARINFO, varinfo
from plctool.compiler.semantics.symbols import ERROR, GlobalSymbol, Namespace, PouSymbol, ProgramInfo, Role, VarSymbol
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.library import without_library
from plctool.compiler.syntax.slips import FUNCTIONS, REFUSED_CALLS
from plctool.compiler.typed.nodes import Expr
from plctool.iec.types import ELEMENTARY, ArrayType, StructType, Type
from plctool.records import dataclass

Rule = Callable[[ast.Call, Type | None], Expr]


@dataclass(frozen=True)
class Special:
    """What is not called as a function is, such as __NEW: the rule takes the whole call."""

    rule: Rule


@dataclass(frozen=True)
class Member:
    """A method, an action or a property."""

    bound: Bound


@dataclass(frozen=True)
class Function:
    """A function of the program or of a library."""

    symbol: PouSymbol


@dataclass(frozen=True)
class Builtin:
    """A function that the compiler knows itself, or a conversion."""

    rule: Rule


@dataclass(frozen=True)
class TextFunction:
    """A string function of the library, which exists for STRING and for WSTRING."""

    symbol: PouSymbol


@dataclass(frozen=True)
class Overload:
    """A function of the library that exists for several types."""

    name: str


@dataclass(frozen=True)
class TypedForm:
    """An overloaded function with the type in its name, as ADD_INT."""


@dataclass(frozen=True)
class Called:
    """A variable or another value: an instance, whose call is a statement, or what cannot be called."""


@dataclass(frozen=True)
class ProgramCall:
    """An instance of a PROGRAM, whose call is a statement."""

    program: ProgramInfo


@dataclass(frozen=True)
class BlockCall:
    """An instance of a function block, whose call is a statement; or what has an error in it."""

    instance: Expr


@dataclass(frozen=True)
class NotCallable:
    """Something that is known and cannot be called: `message` says what to do."""

    code: str
    message: str


@dataclass(frozen=True)
class Unknown:
    """Nothing is known by the name. `hint`: what may be meant; `inherited`: a base is unknown, which may have it."""

    name: str
    hint: str = ""
    inherited: bool = False


Callee = (
    Special | Member | Function | Builtin | TextFunction | Overload | TypedForm | Called | NotCallable | Unknown
)  # fmt: skip


def resolve_callee(c: Checker, node: ast.Call) -> tuple[Callee, ast.Call]:
    """What a call in an expression is about, and the call, without the library before the name."""
    callee = node.callee
    special = _SPECIAL.get(callee.name.upper()) if isinstance(callee, ast.Name) else None
    if special is not None:
        return Special(lambda node, expected: special(c, node)), node
    bound = bound_member(c, callee, called=True)
    if bound is not None:
        return Member(bound), node
    dotted = dotted_name(c, callee)
    if dotted is not None and (bare := _of_library(c, dotted)) is not None:
        name = ast.Name(callee.pos, bare)
        return _by_bare_name(c, name, node), replace(node, callee=name)
    symbol = c.scope.unit(dotted) if dotted is not None else None
    if isinstance(symbol, PouSymbol) and symbol.keyword is ast.Unit.FUNCTION:
        return Function(symbol), node
    if isinstance(symbol, PouSymbol):
        return NotCallable("call", _not_callable(c, symbol, symbol.decl.full_name)), node
    return (_by_bare_name(c, callee, node) if isinstance(callee, ast.Name) else Called()), node


def resolve_statement(c: Checker, callee: ast.Expr) -> ProgramCall | BlockCall | None:
    """The program or instance that a call statement is about; None when it calls a function or a method."""
    program = called_program(c, callee)
    if program is not None:
        return ProgramCall(program)
    if bound_member(c, callee, called=True) is not None or named_function(c, callee) is not None:
        return None
    if isinstance(callee, ast.Name):
        symbol = c.scope.lookup(callee.name)
        if symbol is None and callee.name.upper() == "SUPER" and c.scope.cls is not None:
            return BlockCall(c.expr(ast.Deref(callee.pos, callee)))
        if not isinstance(symbol, VarSymbol | GlobalSymbol):
            return None
        if isinstance(symbol, VarSymbol) and symbol.role is Role.RESULT:
            return None
    e = c.expr(callee)
    is_instance = isinstance(e.type, StructType) and e.type in c.world.blocks
    return BlockCall(e) if is_instance or e.type is ERROR else None


def _deleted(c: Checker, node: ast.Call) -> Expr:
    return c.error(node.pos, "statement", "__DELETE is a statement and has no value")


_SPECIAL: dict[str, Callable[[Checker, ast.Call], Expr]] = {
    **dict.fromkeys(QUERIES, query), NEW: new, VARINFO: varinfo, DELETE: _deleted,
}  # fmt: skip


def _of_library(c: Checker, dotted: str) -> str | None:
    """`LEN` of `Standard.LEN`; None when the program has a LEN of its own, or the name has no library in front."""
    bare = without_library(dotted)
    known = bare == dotted or c.world.names.is_user_name(bare) or c.world.names.is_user_name(dotted)
    return None if known else bare


def _by_bare_name(c: Checker, callee: ast.Name, node: ast.Call) -> Callee:
    """What a name stands for: what the program declares, then what is built in, then what the library has."""
    name = callee.name
    symbol = c.scope.lookup(name)
    shadow: VarSymbol | None = None  # a variable of this name, which cannot be called
    if isinstance(symbol, GlobalSymbol):
        symbol = c.world.declared.variable(symbol)
    if isinstance(symbol, VarSymbol):
        if symbol.type in c.world.blocks or symbol.type is ERROR:
            return Called()
        shadow, symbol = symbol, c.world.names.unit(name.casefold(), library=c.scope.library)
    function = symbol if isinstance(symbol, PouSymbol) and symbol.keyword is ast.Unit.FUNCTION else None
    if function is not None and (not function.library or c.scope.library):
        return Function(function)
    built_in = find_built_in(c, name.upper()) if symbol is None or isinstance(symbol, PouSymbol) else None
    if built_in is not None:
        return Builtin(built_in)
    overloaded = bool(c.world.names.library.overloads(name.casefold()))
    if function is not None:
        return TextFunction(function) if overloaded else Function(function)
    if overloaded:
        return Overload(name)
    if symbol is not None or shadow is not None:
        return NotCallable("call", _not_callable(c, symbol or shadow, name))
    return _nothing_known(c, name, replace(node, callee=callee))


def _nothing_known(c: Checker, name: str, node: ast.Call) -> NotCallable | TypedForm | Unknown:
    key = name.upper()
    if key in REFUSED_CALLS:
        return NotCallable("unsupported", REFUSED_CALLS[key])
    if overloaded_form(node) is not None:
        return TypedForm()
    if key in ELEMENTARY:
        message = f"{name} is a type; a conversion is written TO_{key}({_written(node)})"
        return NotCallable("unknown", message)
    if c.scope.inherits_unknown(c.scope.cls):
        return Unknown(name, inherited=True)
    hint = f"; {FUNCTIONS[key]}" if key in FUNCTIONS else function_hint(c, name)
    return Unknown(name, c.scope.choices(name) or hint)


def _written(node: ast.Call) -> str:
    """The argument of a call when it is a name, else dots."""
    value = node.args[0].value if node.args else None
    return value.name if isinstance(value, ast.Name) else "..."


def _not_callable(c: Checker, symbol: object, name: str) -> str:
    if isinstance(symbol, PouSymbol) and symbol.keyword is ast.Unit.FUNCTION_BLOCK:
        return f"{name} is a function block type; declare an instance of it and call that"
    if isinstance(symbol, Namespace) and symbol.program is not None:
        return f"a call of the program {name} is a statement and has no value"
    if isinstance(symbol, PouSymbol) and symbol.keyword is ast.Unit.PROGRAM:
        listed = " or ".join(f"{instance}()" for instance in c.world.names.instances_of(symbol))
        return f"the program {name} has several instances; call {listed}"
    if isinstance(symbol, VarSymbol) and isinstance(symbol.type, ArrayType):
        return f"{name} is an array; an element is written {name}[1]"
    return f"{name} is not a function"
