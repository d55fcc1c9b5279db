"""The arguments of calls: which parameter each is for, and what the parameter needs.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass, replace

from plctool.compiler.diagnostics import did_you_mean
from plctool.compiler.semantics.builtin import Builtins
from plctool.compiler.semantics.checker import place_of
from plctool.compiler.semantics.conversions import elementary, error_value, same_type, takes_array
from plctool.compiler.semantics.generics import is_group
from plctool.compiler.semantics.open_arrays import handed_bounds
from plctool.compiler.semantics.symbols import ERROR, NOTHING, FunctionInfo, GlobalSymbol, PouSymbol, Role, VarSymbol
from plctool.compiler.syntax import ast
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
    ReferenceType,
    StringType,
    StructType,
    SubrangeType,
    Type,
    is_scalar,
)  # fmt: skip

Actual = ast.Argument | Expr | None  # as written, or checked already


@dataclass
class Enable:
    """EN and ENO of a call."""

    en: ast.Expr | None = None
    eno: ast.Expr | None = None


class Arguments(Builtins):
    """Binds and checks arguments."""

    def split_enable(self, node: ast.Call, declared: Container[str] = ()) -> tuple[list[ast.Argument], Enable]:
        """Takes EN and ENO out of the arguments, unless they are among the names that the callee declares itself."""
        enable, rest = Enable(), list[ast.Argument]()
        for argument in node.args:
            key = (argument.name or "").casefold()
            if key == "en" and key not in declared and not argument.output:
                enable.en = argument.value
            elif key == "eno" and key not in declared and argument.output:
                enable.eno = argument.value
            else:
                rest.append(argument)
        return rest, enable

    def parameter_names(self, callee: ast.Expr) -> set[str]:
        """What the function of that name declares, folded; nothing for one that is built in."""
        if not isinstance(callee, ast.Name):
            return set()
        symbol = self.world.unit(callee.name.casefold(), library=self.scope.library)
        if not isinstance(symbol, PouSymbol):
            return set()
        return {name.casefold() for name, _, _ in parameter_lines(symbol.decl)}

    def _plain_arguments(self, node: ast.Call, declared: Container[str] = ()) -> list[ast.Argument] | None:
        """The arguments of a call that is part of an expression; None after a diagnosis."""
        args, enable = self.split_enable(node, declared)
        if enable.en is None and enable.eno is None:
            return args
        self.error(node.pos, "arguments", "EN and ENO need the call to be a statement or the whole right side of :=")
        return None

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
                    args[len(positional)].pos, "arguments", f"{what} takes {count(len(positional))}, not {len(args)}"
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

    def _typed_call(self, info: FunctionInfo, actuals: dict[int, Actual], offset: int, *, noted: bool = True) -> Expr:
        """The call node: arguments in order of the parameters, defaults filled in. `noted`: a call that leads back is
        recursion."""
        pos, name, ok = self.pos(offset), info.pou.name, True
        args: list[Expr | Place | None] = []
        formal = any(isinstance(a, ast.Argument) and a.name is not None for a in actuals.values())
        parameters = list(zip(info.parameters, info.pou.parameters, strict=False))
        for i, ((symbol, direction), parameter) in enumerate(parameters):
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
        for parameter, argument in zip(info.pou.parameters, list(args), strict=False):
            args += [bound for _, bound in handed_bounds(parameter.variable, argument, pos)]
        if noted:
            self.world.calls.add(self.scope.pou, info.pou, pos)
        return Call(info.pou, args, info.result if info.result is not None else NOTHING, pos)

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
                output = direction is Direction.OUTPUT
                return self.reference(actual.value, t, symbol.name, output=output, constant=symbol.constant)
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
            e = self.expr(node, t)
            return e if takes_array(t, e.type) else self.coerce(e, t)
        place = self.reference(node, t.target, name, output=False)
        return error_value(self.pos(node.pos)) if place is None else self.refer(place, t)

    def refer(self, place: Place, t: ReferenceType) -> Expr:
        """What a reference to a place holds."""
        if isinstance(place, DerefPlace) and isinstance(place.pointer, Load):
            return replace(place.pointer, type=t)
        return AddressOf(place, t, place.pos)

    def reference(self, node: ast.Expr, t: Type, name: str, *, output: bool, constant: bool = False) -> Place | None:
        """A variable handed over by reference; a value will do when it is `constant`. Strings may have any length."""
        what = "the output" if output else "the VAR_IN_OUT"
        if constant:
            e = self.expr(node, t)
            place: Place | None = e.place if isinstance(e, Load) else place_of(self.coerce(e, t))
        else:
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
        if takes_array(t, place.type):
            return place
        if isinstance(place.type, StructType) and not output and place.type.conforms(t):
            return place
        if not same_type(place.type, t) and not (
            isinstance(place.type, SubrangeType) and place.type.base is t and not output
        ):
            self.error(node.pos, "type", f"{what} {name} is {t} and needs a variable of this type, not {place.type}")
            return None
        return place

    # ---- what may be changed ----

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
            return f"{symbol.name} is a {'VAR_IN_OUT CONSTANT' if symbol.role is Role.IN_OUT else 'constant'}"
        if symbol.by_reference and symbol.role is Role.INPUT:
            return f"{symbol.name} is an input passed by reference"
        if symbol.role is Role.STEP and self.scope.names.get(symbol.name.casefold()) is not symbol:
            return f"{symbol.name} is a step"  # only the chart itself changes it
        return None

    def _member_read_only(self, node: ast.Member) -> str | None:
        space = self.space_of(node.base)
        if space is not None:
            variable = space.members.get(node.name.casefold())
            if isinstance(variable, VarSymbol) and variable.role is Role.OUTPUT:
                return f"{node.name} is an output of {space.name}"
            return self._symbol_read_only(variable)
        base = self.expr(node.base)
        own = base.place if isinstance(base, AddressOf | Load) and isinstance(base.place, SelfPlace) else None
        block = self.world.blocks.get(base.type) if isinstance(base.type, StructType) else None
        if own is not None:
            return None
        if block is not None:
            member = block.members.get(node.name.casefold())
            if member is not None and member.role is not Role.INPUT and member.access != "PUBLIC":
                return f"{node.name} is an {member.role.value} of {base.type}" if member.role is Role.OUTPUT else (
                    f"{node.name} is a {member.role.value} of {base.type}"
                )  # fmt: skip
        return self._read_only(node.base)


def parameter_lines(decl: ast.PouDecl) -> list[tuple[str, Direction, str | None]]:
    """Name, direction and ANY_... group of each parameter."""
    found = []
    directions = {"VAR_INPUT": Direction.INPUT, "VAR_OUTPUT": Direction.OUTPUT, "VAR_IN_OUT": Direction.IN_OUT}
    for block in decl.blocks:
        if block.keyword not in directions:
            continue
        for line in block.decls:
            group = line.type.name.upper() if isinstance(line.type, ast.NamedType) else ""
            for _, name in line.names:
                found.append((name, directions[block.keyword], group if is_group(group) else None))
    return found


def count(n: int) -> str:
    """`1 argument`, `2 arguments`"""
    return "no arguments" if n == 0 else "1 argument" if n == 1 else f"{n} arguments"
