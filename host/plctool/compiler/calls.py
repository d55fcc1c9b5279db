"""Calls: of functions, of what is built in, of generic and overloaded library functions.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from plctool.compiler import ast
from plctool.compiler.builtin import Builtins
from plctool.compiler.conversions import common_type, elementary, error_value, same_type, settle
from plctool.compiler.diagnostics import did_you_mean
from plctool.compiler.expressions import is_untyped, place_of
from plctool.compiler.generics import GENERIC
from plctool.compiler.symbols import ERROR, FunctionInfo, GlobalSymbol, Namespace, PouSymbol, Role, VarSymbol
from plctool.compiler.typed import (
    AddressOf,
    BitPlace,
    Call,
    Const,
    DerefPlace,
    Direction,
    Expr,
    Load,
    Parameter,
    Place,
    ScalarInit,
    SelfPlace,
    ValuePlace,
)  # fmt: skip
from plctool.compiler.types import (
    LREAL,
    REAL,
    WCHAR,
    PointerType,
    ReferenceType,
    StringType,
    StructType,
    SubrangeType,
    Type,
    is_scalar,
)  # fmt: skip
from plctool.compiler.units import LIBRARY_STRING, WIDE_LIBRARY_STRING

Actual = ast.Argument | Expr | None  # as written, or checked already


@dataclass
class Enable:
    """EN and ENO of a call."""

    en: ast.Expr | None = None
    eno: ast.Expr | None = None


class Calls(Builtins):
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
        names = self.world.function_names()
        return self.error(callee.pos, "unknown", f"unknown function {name}{did_you_mean(name, names)}")

    def _not_callable(self, symbol: object, name: str) -> str:
        if isinstance(symbol, PouSymbol) and symbol.keyword == "FUNCTION_BLOCK":
            return f"{name} is a function block type; declare an instance of it and call that"
        if isinstance(symbol, PouSymbol) or (isinstance(symbol, Namespace) and symbol.what == "program"):
            return f"the program {name} is run by a task and cannot be called"
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

    # ---- arguments ----

    def split_enable(self, node: ast.Call) -> tuple[list[ast.Argument], Enable]:
        """Takes EN and ENO out of the arguments."""
        enable, rest = Enable(), list[ast.Argument]()
        for argument in node.args:
            key = (argument.name or "").upper()
            if key == "EN" and not argument.output:
                enable.en = argument.value
            elif key == "ENO" and argument.output:
                enable.eno = argument.value
            else:
                rest.append(argument)
        return rest, enable

    def bind(
        self, args: list[ast.Argument], names: list[tuple[str, Direction]], what: str, offset: int
    ) -> dict[int, ast.Argument] | None:
        """Arguments by index of their parameter; None after a diagnosis."""
        if not args:
            return {}
        if all(a.name is None for a in args):
            positional = [i for i, (_, direction) in enumerate(names) if direction is not Direction.OUTPUT]
            if len(args) == len(names):
                positional = list(range(len(names)))
            if len(args) > len(positional):
                self.error(
                    args[len(positional)].pos, "arguments", f"{what} takes {_count(len(positional))}, not {len(args)}"
                )
                return None
            return dict(zip(positional, args, strict=False))
        bound: dict[int, ast.Argument] = {}
        index = {name.casefold(): i for i, (name, _) in enumerate(names)}
        inputs = [i for i, (_, direction) in enumerate(names) if direction is not Direction.OUTPUT]
        for position, argument in enumerate(args):
            if argument.name is None:  # arguments without a name come first
                if position >= len(inputs) or any(a.name is not None for a in args[:position]):
                    self.error(argument.pos, "arguments", "arguments without a name come before those with one")
                    return None
                bound[inputs[position]] = argument
                continue
            i = index.get(argument.name.casefold())
            if i is None:
                hint = did_you_mean(argument.name, (n for n, _ in names))
                self.error(argument.pos, "arguments", f"{what} has no parameter {argument.name}{hint}")
                return None
            if i in bound:
                self.error(argument.pos, "arguments", f"{argument.name} is given twice")
                return None
            is_output = names[i][1] is Direction.OUTPUT
            if argument.output is not is_output:
                arrow = "=>" if is_output else ":="
                self.error(argument.pos, "arguments", f"{argument.name} is given with {arrow}")
                return None
            bound[i] = argument
        return bound

    # ---- functions ----

    def _call_function(self, symbol: PouSymbol, node: ast.Call, expected: Type | None) -> Expr:
        args, enable = self.split_enable(node)
        if enable.en is not None or enable.eno is not None:
            return self.error(
                node.pos, "arguments", "EN and ENO need the call to be a statement or the whole right side of :="
            )
        return self.call_symbol(symbol, args, node.pos, expected)

    def _call_text_function(self, symbol: PouSymbol, node: ast.Call) -> Expr:
        """A string function of the library, which exists for STRING and for WSTRING."""
        args, _ = self.split_enable(node)
        values = [self.expr(a.value) for a in args if a.value is not None]
        if len(values) < len(args) or any(v.type is ERROR for v in values):
            return error_value(self.pos(node.pos))
        if any((isinstance(v.type, StringType) and v.type.wide) or v.type is WCHAR for v in values):
            wide = self.world.unit(f"{symbol.decl.name}__wstring".casefold(), library=True)
            assert isinstance(wide, PouSymbol)
            symbol = wide
        if "extensible" in symbol.decl.attributes and len(args) > 2 and all(a.name is None for a in args):
            result = values[0]
            for value in values[1:]:
                result = self.call_checked(symbol, [result, value], node.pos, None)
            return result
        info = self.world.units.function(symbol)
        assert info is not None
        bound = self.bind(args, [(s.name, d) for s, d in info.parameters], symbol.decl.name.split("__")[0], node.pos)
        if bound is None:
            return error_value(self.pos(node.pos))
        value_of = {id(a): v for a, v in zip(args, values, strict=True)}
        return self._typed_call(info, {i: value_of[id(a)] for i, a in bound.items()}, node.pos)

    def call_symbol(self, symbol: PouSymbol, args: list[ast.Argument], offset: int, expected: Type | None) -> Expr:
        """A call of a declared function."""
        if "extensible" in symbol.decl.attributes and len(args) > 2 and all(a.name is None for a in args):
            result = self.call_symbol(symbol, args[:2], offset, expected)
            for argument in args[2:]:
                assert argument.value is not None
                result = self.call_checked(symbol, [result, self.expr(argument.value, expected)], offset, expected)
            return result
        if self.world.units.is_generic(symbol):
            return self._call_generic(symbol, args, offset, expected)
        info = self.world.units.function(symbol)
        if info is None:
            return self.error(offset, "recursion", f"{symbol.decl.name} is used in its own declaration")
        names = [(s.name, d) for s, d in info.parameters]
        bound = self.bind(args, names, info.pou.name, offset)
        if bound is None:
            return error_value(self.pos(offset))
        return self._typed_call(info, dict(bound), offset)

    def call_checked(self, symbol: PouSymbol, values: list[Expr], offset: int, expected: Type | None) -> Expr:
        """A call with arguments that are checked already."""
        if any(v.type is ERROR for v in values):
            return error_value(self.pos(offset))
        if self.world.units.is_generic(symbol):
            return self._instantiate(symbol, dict(enumerate(values)), offset, expected)
        info = self.world.units.function(symbol)
        if info is None or len(info.parameters) != len(values):
            return self.error(offset, "arguments", f"{symbol.decl.name} does not take {_count(len(values))}")
        return self._typed_call(info, dict(enumerate(values)), offset)

    def call_by_name(self, name: str, args: list[Expr], offset: int, expected: Type | None) -> Expr:
        """A call of a library function with checked arguments."""
        symbol = self.world.unit(name.casefold(), library=True)
        if not isinstance(symbol, PouSymbol):
            symbol = self._best_overload(name, args, expected)
        if symbol is None:
            return self.error(offset, "unknown", f"the library has no function {name}")
        return self.call_checked(symbol, args, offset, expected)

    def _typed_call(self, info: FunctionInfo, actuals: dict[int, Actual], offset: int, *, noted: bool = True) -> Expr:
        """The call node: arguments in order of the parameters, defaults filled in. `noted`: a call that leads back is
        recursion."""
        pos, name, ok = self.pos(offset), info.pou.name, True
        args: list[Expr | Place | None] = []
        formal = any(isinstance(a, ast.Argument) and a.name is not None for a in actuals.values())
        for i, ((symbol, direction), parameter) in enumerate(zip(info.parameters, info.pou.parameters, strict=True)):
            actual = actuals.get(i)
            if actual is None and direction is not Direction.OUTPUT:
                if direction is Direction.IN_OUT or not (formal or symbol.given):
                    self.error(offset, "arguments", f"the argument {symbol.name} of {name} is missing")
                    ok = False
                    continue
                args.append(self._default(symbol, parameter, offset))
                continue
            argument = None if actual is None else self._argument(actual, symbol, direction, parameter)
            ok = ok and (actual is None or argument is not None)
            args.append(argument)
        if not ok or (info.result is ERROR):
            return error_value(pos)
        if noted:
            self.world.add_call(self.scope.pou, info.pou, pos)
        return Call(info.pou, args, info.result if info.result is not None else _NOTHING, pos)

    def _default(self, symbol: VarSymbol, parameter: Parameter, offset: int) -> Expr | Place:
        pos, t = self.pos(offset), symbol.type
        value: int | float | str = "" if isinstance(t, StringType) else 0
        if isinstance(symbol.default, ScalarInit):
            value = symbol.default.value
        elif not (is_scalar(t) or isinstance(t, StringType)):
            self.error(offset, "arguments", f"the argument {symbol.name} is missing")
            return error_value(pos)
        if elementary(t) in (REAL, LREAL):
            value = float(value)
        constant = Const(value, t, pos)
        return ValuePlace(constant, t, pos) if parameter.by_reference else constant

    def _argument(
        self, actual: Actual, symbol: VarSymbol, direction: Direction, parameter: Parameter
    ) -> Expr | Place | None:
        """One argument as its parameter needs it; None after a diagnosis."""
        t = symbol.type
        if isinstance(actual, ast.Argument):
            if actual.value is None:
                return None
            if direction is not Direction.INPUT:
                return self.reference(actual.value, t, symbol.name, output=direction is Direction.OUTPUT)
            e = self.input(actual.value, t, symbol.name)
        else:
            assert actual is not None
            e = self.coerce(actual, t)
        if e.type is ERROR:
            return None
        return place_of(e) if parameter.by_reference else e

    def input(self, node: ast.Expr, t: Type, name: str) -> Expr:
        """The value of an input; a REFERENCE TO gets the address."""
        if not isinstance(t, ReferenceType):
            return self.coerce(self.expr(node, t), t)
        place = self.reference(node, t.target, name, output=False)
        return error_value(self.pos(node.pos)) if place is None else self.refer(place, t)

    def refer(self, place: Place, t: ReferenceType) -> Expr:
        """What a reference to a place holds."""
        if isinstance(place, DerefPlace) and isinstance(place.pointer, Load):
            return replace(place.pointer, type=t)
        return AddressOf(place, t, place.pos)

    def reference(self, node: ast.Expr, t: Type, name: str, *, output: bool) -> Place | None:
        """A variable handed over by reference. Strings may have any length."""
        what = "the output" if output else "the VAR_IN_OUT"
        place = self.target(node, f"{what} {name}", f"be given to {what} {name}")
        if place is None:
            return None
        if isinstance(place, BitPlace):
            self.error(node.pos, "type", f"a single bit has no address, so it cannot be given to {what} {name}")
            return None
        if isinstance(place.type, StringType) and isinstance(t, StringType):
            return place
        if t is ERROR or place.type is ERROR:
            return None
        if isinstance(place.type, StructType) and not output and place.type.conforms(t):
            return place
        if not same_type(place.type, t) and not (
            isinstance(place.type, SubrangeType) and place.type.base is t and not output
        ):
            self.error(node.pos, "type", f"{what} {name} is {t} and needs a variable of this type, not {place.type}")
            return None
        return place

    # ---- generic and overloaded functions ----

    def _call_generic(self, symbol: PouSymbol, args: list[ast.Argument], offset: int, expected: Type | None) -> Expr:
        lines = _parameter_lines(symbol.decl)
        bound = self.bind(args, [(name, d) for name, d, _ in lines], symbol.decl.name, offset)
        if bound is None:
            return error_value(self.pos(offset))
        values: dict[int, Actual] = {}
        for i, argument in bound.items():
            if lines[i][1] is Direction.INPUT and argument.value is not None:
                values[i] = self.expr(argument.value, expected if lines[i][2] else None)
            else:
                values[i] = argument
        return self._instantiate(symbol, values, offset, expected)

    def _instantiate(self, symbol: PouSymbol, values: dict[int, Actual], offset: int, expected: Type | None) -> Expr:
        """Finds the types the ANY_... parameters stand for, and calls that instance."""
        groups: dict[str, list[Expr]] = {}
        name = symbol.decl.name
        for i, (parameter, _, group) in enumerate(_parameter_lines(symbol.decl)):
            actual = values.get(i)
            if group is None:
                continue
            if actual is None:
                return self.error(offset, "arguments", f"the argument {parameter} of {name} is missing")
            if isinstance(actual, ast.Argument):
                assert actual.value is not None
                actual = self.expr(actual.value)
            if actual.type is ERROR:
                return error_value(self.pos(offset))
            groups.setdefault(group, []).append(actual)
        bindings: dict[str, Type] = {}
        for group, members in groups.items():
            t = self._common(members, group, name, offset, expected)
            if t is None:
                return error_value(self.pos(offset))
            bindings[group] = t
        result = symbol.decl.result
        if isinstance(result, ast.NamedType) and result.name.upper() in GENERIC and result.name.upper() not in bindings:
            everything = [e for members in groups.values() for e in members]
            t = self._common(everything, result.name.upper(), name, offset, expected)
            if t is None:
                return error_value(self.pos(offset))
            bindings[result.name.upper()] = t
        info = self.world.units.function(symbol, bindings)
        if info is None:
            return self.error(offset, "recursion", f"{name} calls itself, which is not possible on a controller")
        return self._typed_call(info, values, offset)

    def _common(self, members: list[Expr], group: str, name: str, offset: int, expected: Type | None) -> Type | None:
        """The common type of arguments, which has to belong to the group; None after a diagnosis."""
        accepts = GENERIC[group]
        result = self.common_of(members, name, offset, expected if expected is not None and accepts(expected) else None)
        if result is ERROR:
            return None
        if isinstance(result, StringType):
            result = WIDE_LIBRARY_STRING if result.wide else LIBRARY_STRING
        if group == "ANY_REAL" and not accepts(result) and elementary(result) is not None:
            result = LREAL if is_large(result) else REAL
        if not accepts(result):
            self.error(offset, "type", f"{name} takes {group}, not {result}")
            return None
        return result

    def _overload(self, name: str, node: ast.Call, expected: Type | None) -> Expr | None:
        """`SIN` stands for SIN__REAL or SIN__LREAL, as the arguments need it. None when there is no such function."""
        if not self.world.library.overloads(name.casefold()):
            return None
        args, _ = self.split_enable(node)
        values = [self.expr(a.value, expected) for a in args if a.value is not None]
        if any(v.type is ERROR for v in values):
            return error_value(self.pos(node.pos))
        symbol = self._best_overload(name, values, expected)
        if symbol is None:
            types = ", ".join(str(settle(v).type) for v in values)
            return self.error(node.pos, "type", f"there is no {name} for {types}")
        info = self.world.units.function(symbol)
        assert info is not None
        bound = self.bind(args, [(s.name, d) for s, d in info.parameters], name.upper(), node.pos)
        if bound is None:
            return error_value(self.pos(node.pos))
        checked = {i: v for (i, _), v in zip(bound.items(), values, strict=True)}
        return self._typed_call(info, dict(checked), node.pos)

    def _best_overload(self, name: str, values: list[Expr], expected: Type | None) -> PouSymbol | None:
        """By the common type of the arguments: an exact suffix, else REAL or LREAL."""
        suffixes = {o.rpartition("__")[2].upper(): o for o in self.world.library.overloads(name.casefold())}
        typed = [v.type for v in values if not is_untyped(v)]
        wanted: Type | None = typed[0] if typed else settle(values[0], expected).type if values else None
        for t in typed[1:]:
            wanted = None if wanted is None else common_type(wanted, t)
        if wanted is None:
            return None
        candidates = [wanted.keyword if isinstance(wanted, StringType) else str(elementary(wanted) or wanted)]
        if elementary(wanted) is not None:
            prefer_real = not is_large(wanted) if typed else expected is REAL
            candidates += ["REAL", "LREAL"] if prefer_real else ["LREAL", "REAL"]
        for candidate in candidates:
            if candidate in suffixes:
                symbol = self.world.unit(suffixes[candidate].casefold(), library=True)
                return symbol if isinstance(symbol, PouSymbol) else None
        return None

    # ---- addresses ----

    def address_of(self, node: ast.Expr) -> Expr:
        """ADR(x), REF(x)"""
        place = self.place(node, "an address")
        if place is None:
            return error_value(self.pos(node.pos))
        if isinstance(place, BitPlace):
            return self.error(node.pos, "type", "a single bit has no address")
        return AddressOf(place, PointerType(place.type), self.pos(node.pos))

    def target(self, node: ast.Expr, what: str, use: str) -> Place | None:
        """The variable an expression names when it may be changed. Else reports: `what` needs one, it cannot `use`."""
        reason = self._read_only(node)
        if reason is not None:
            self.error(node.pos, "read-only", f"{reason} and cannot {use}")
            return None
        return self.place(node, what)

    def _read_only(self, node: ast.Expr) -> str | None:
        if isinstance(node, ast.Name):
            return self._symbol_read_only(self.scope.lookup(node.name))
        if isinstance(node, ast.Index | ast.BitAccess):
            return self._read_only(node.base)
        if isinstance(node, ast.Member):
            return self._member_read_only(node)
        return None

    def _symbol_read_only(self, symbol: object) -> str | None:
        if isinstance(symbol, GlobalSymbol):
            symbol = self.world.declarations.global_variable(symbol)
        if not isinstance(symbol, VarSymbol):
            return None
        if symbol.constant:
            return f"{symbol.name} is a constant"
        if symbol.by_reference and symbol.role is Role.INPUT:
            return f"{symbol.name} is an input passed by reference"
        if symbol.role is Role.STEP and self.scope.names.get(symbol.name.casefold()) is not symbol:
            return f"{symbol.name} is a step"  # only the chart itself changes it
        return None

    def _member_read_only(self, node: ast.Member) -> str | None:
        if isinstance(node.base, ast.Name):
            symbol = self.scope.lookup(node.base.name)
            members = getattr(symbol, "members", None)
            if members is not None:
                member = members.get(node.name.casefold())
                if isinstance(member, VarSymbol) and member.role is Role.OUTPUT:
                    return f"{node.name} is an output of {node.base.name}"
                return self._symbol_read_only(member)
        base = self.expr(node.base)
        own = base.place if isinstance(base, AddressOf | Load) and isinstance(base.place, SelfPlace) else None
        block = self.world.blocks.get(base.type) if isinstance(base.type, StructType) else None
        if own is not None:
            return None
        if block is not None:
            member = block.members.get(node.name.casefold())
            if member is not None and member.role is not Role.INPUT:
                return f"{node.name} is an {member.role.value} of {base.type}" if member.role is Role.OUTPUT else (
                    f"{node.name} is a {member.role.value} of {base.type}"
                )  # fmt: skip
        return self._read_only(node.base)


def is_large(t: Type) -> bool:
    """Whether a number needs LREAL."""
    base = elementary(t)
    return base is not None and base is not REAL and base.bits > 16


def _parameter_lines(decl: ast.PouDecl) -> list[tuple[str, Direction, str | None]]:
    """Name, direction and ANY_... group of each parameter."""
    found = []
    directions = {"VAR_INPUT": Direction.INPUT, "VAR_OUTPUT": Direction.OUTPUT, "VAR_IN_OUT": Direction.IN_OUT}
    for block in decl.blocks:
        if block.keyword not in directions:
            continue
        for line in block.decls:
            group = line.type.name.upper() if isinstance(line.type, ast.NamedType) else ""
            for _, name in line.names:
                found.append((name, directions[block.keyword], group if group in GENERIC else None))
    return found


def _count(n: int) -> str:
    return "no arguments" if n == 0 else "1 argument" if n == 1 else f"{n} arguments"


class _Nothing(Type):
    """The result of a function without one."""

    name = "nothing"


_NOTHING = _Nothing()
