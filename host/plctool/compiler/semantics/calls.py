"""Calls that have a value: of functions, and of what is built in.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics.arguments import parameter_lines
from plctool.compiler.semantics.conversions import error_value
from plctool.compiler.semantics.library_calls import LibraryCalls
from plctool.compiler.semantics.symbols import ERROR, GlobalSymbol, Namespace, PouSymbol, VarSymbol
from plctool.compiler.semantics.typed_functions import overloaded_form
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.slips import REFUSED_CALLS
from plctool.compiler.typed import (
    AddressOf,
    BitPlace,
    Expr,
)  # fmt: skip
from plctool.compiler.types import (
    OpenArrayType,
    PointerType,
    StructType,
    Type,
)  # fmt: skip


class Calls(LibraryCalls):
    """Checks calls that have a value."""

    def call(self, node: ast.Call, expected: Type | None) -> Expr:
        """A call as a value, or as a statement when it is one of a function."""
        callee = node.callee
        if not isinstance(callee, ast.Name):
            return self._call_of_place(node)
        name = callee.name
        symbol = self.scope.lookup(name)
        shadow: VarSymbol | None = None  # a variable of this name, which cannot be called
        if isinstance(symbol, GlobalSymbol):
            symbol = self.world.declarations.global_variable(symbol)
        if isinstance(symbol, VarSymbol):
            if symbol.type in self.world.blocks or symbol.type is ERROR:
                return self._call_of_place(node)
            shadow, symbol = symbol, self.world.unit(name.casefold(), library=self.scope.library)
        is_function = isinstance(symbol, PouSymbol) and symbol.keyword == "FUNCTION"
        if isinstance(symbol, PouSymbol) and is_function and (not symbol.library or self.scope.library):
            return self._call_function(symbol, node, expected)
        if self._plain_arguments(node) is None:
            return error_value(self.pos(node.pos))
        if symbol is None or isinstance(symbol, PouSymbol):
            built_in = self.built_in(name.upper(), node, expected)
            if built_in is not None:
                return built_in
        if isinstance(symbol, PouSymbol) and is_function:
            if self.world.library.overloads(name.casefold()):
                return self._call_text_function(symbol, node)
            return self._call_function(symbol, node, expected)
        overload = self._overload(name, node, expected)
        if overload is not None:
            return overload
        if symbol is not None or shadow is not None:
            return self.error(callee.pos, "call", self._not_callable(symbol or shadow, name))
        if name.upper() in REFUSED_CALLS:
            return self.error(callee.pos, "unsupported", REFUSED_CALLS[name.upper()])
        overloaded = overloaded_form(node)
        if overloaded is not None:
            return self.call(overloaded, expected)
        return self.error(callee.pos, "unknown", f"unknown function {name}{self.function_hint(name)}")

    def _not_callable(self, symbol: object, name: str) -> str:
        if isinstance(symbol, PouSymbol) and symbol.keyword == "FUNCTION_BLOCK":
            return f"{name} is a function block type; declare an instance of it and call that"
        if isinstance(symbol, Namespace) and symbol.program is not None:
            return f"a call of the program {name} is a statement and has no value"
        if isinstance(symbol, PouSymbol) and symbol.keyword == "PROGRAM":
            listed = " or ".join(f"{instance}()" for instance in self.world.programs.instances(symbol))
            return f"the program {name} has several instances; call {listed}"
        return f"{name} is not a function"

    def _call_of_place(self, node: ast.Call) -> Expr:
        e = self.expr(node.callee)
        if e.type is ERROR:
            return e
        if isinstance(e.type, StructType) and e.type in self.world.blocks:
            return self.error(
                node.pos, "call", f"a call of the function block {e.type} is a statement and has no value"
            )
        return self.error(node.pos, "call", f"{e.type} cannot be called")

    def _call_function(self, symbol: PouSymbol, node: ast.Call, expected: Type | None) -> Expr:
        if not self.scope.may_use(symbol, symbol.decl.name, node.callee.pos):
            return error_value(self.pos(node.pos))
        args = self._plain_arguments(node, {name.casefold() for name, _, _ in parameter_lines(symbol.decl)})
        return error_value(self.pos(node.pos)) if args is None else self.call_symbol(symbol, args, node.pos, expected)

    def address_of(self, node: ast.Expr, kind: type[PointerType]) -> Expr:
        """ADR(x), REF(x)"""
        place = self.place(node, "an address")
        if place is None:
            return error_value(self.pos(node.pos))
        if isinstance(place, BitPlace):
            return self.error(node.pos, "type", "a single bit has no address")
        t = place.type.element if isinstance(place.type, OpenArrayType) else place.type
        return AddressOf(place, kind(t), self.pos(node.pos))
