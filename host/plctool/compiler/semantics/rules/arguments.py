"""The arguments of calls: which parameter each is for, and what the parameter needs.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass, replace

from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.conversions import (
    elementary,
    error_value,
    place_of,
    same_type,
    scaled,
    settle,
    takes_array,
)
from plctool.compiler.semantics.generics import accepts, group_name, handed, handed_bounds, is_group, total_size
from plctool.compiler.semantics.rules.members import bound_member, dotted_name
from plctool.compiler.semantics.rules.places import changeable_place, copied
from plctool.compiler.semantics.symbols import DIRECTIONS, ERROR, NOTHING, FunctionInfo, Member, PouSymbol, VarSymbol
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import did_you_mean
from plctool.compiler.syntax.library import OTHER_BLOCKS
from plctool.compiler.typed.nodes import (
    AddressOf,
    BinaryOp,
    BitPlace,
    Call,
    ComputedInit,
    Const,
    Convert,
    DerefPlace,
    Direction,
    Expr,
    Intrinsic,
    IntrinsicCall,
    Load,
    Parameter,
    Place,
    Pou,
    PouKind,
    ScalarInit,
    ValuePlace,
    Variable,
    VarPlace,
)
from plctool.compiler.typed.typed_nodes import is_unaligned
from plctool.iec.common_types import NUMBERS
from plctool.iec.types import (
    BOOL,
    DINT,
    LREAL,
    REAL,
    ArrayType,
    Kind,
    ReferenceType,
    StringType,
    StructType,
    SubrangeType,
    Type,
    base_of,
    is_scalar,
)

Actual = ast.Argument | Expr | None  # as written, or checked already


@dataclass
class Enable:
    """EN and ENO of a call."""

    en: ast.Expr | None = None
    eno: ast.Expr | None = None


def split_enable(node: ast.Call, declared: Container[str] = ()) -> tuple[list[ast.Argument], Enable]:
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


def has_enable(node: ast.Call, declared: Container[str] = ()) -> bool:
    """Whether a call has EN or ENO that the callee does not declare itself."""
    keys = ((a.name or "").casefold() for a in node.args)
    return any(key in ("en", "eno") and key not in declared for key in keys)


def parameter_names(c: Checker, node: ast.Call) -> set[str]:
    """What the function or method that is called with EN or ENO declares, folded; nothing for what is built in."""
    callee = node.callee
    if not has_enable(node):
        return set()
    bound = bound_member(c, callee, called=True)
    if bound is not None:
        return declared_names(bound.callable)
    symbol = c.scope.unit(callee.name) if isinstance(callee, ast.Name) else named_function(c, callee)
    return declared_names(symbol if isinstance(symbol, PouSymbol) else None)


def named_function(c: Checker, callee: ast.Expr) -> PouSymbol | None:
    """The FUNCTION that a name with a namespace or library in front stands for."""
    dotted = dotted_name(c, callee)
    symbol = None if dotted is None else c.scope.unit(dotted)
    return symbol if isinstance(symbol, PouSymbol) and symbol.keyword is ast.Unit.FUNCTION else None


def plain_arguments(c: Checker, node: ast.Call, declared: Container[str] = ()) -> list[ast.Argument] | None:
    """The arguments of a call that is part of an expression; None after an error. `EN := TRUE` says nothing."""
    args, enable = split_enable(node, declared)
    if enable.eno is None and (enable.en is None or _is_true(enable.en)):
        return args
    c.error(node.pos, "arguments", "EN and ENO need the call to be a statement or the whole right side of :=")
    return None


def _is_true(node: ast.Expr) -> bool:
    return isinstance(node, ast.Literal) and node.kind is ast.LiteralKind.BOOL and node.value == 1


def bind(
    c: Checker, args: list[ast.Argument], names: list[tuple[str, Direction]], what: str, offset: int
) -> dict[int, ast.Argument] | None:
    """Arguments by index of their parameter, without the empty ones (`PT := `, `Q => `); None after an error."""
    if c.scope.is_incomplete(what):
        return None
    if not args:
        return {}
    if all(a.name is None for a in args):
        positional = [i for i, (_, direction) in enumerate(names) if direction is not Direction.OUTPUT]
        if len(args) == len(names):
            positional = list(range(len(names)))
        if len(args) > len(positional):
            takes = arguments_text(len(positional))
            c.error(args[len(positional)].pos, "arguments", f"{what} takes {takes}, not {len(args)}")
            return None
        return dict(zip(positional, args, strict=False))
    bound: dict[int, ast.Argument] = {}
    index = {name.casefold(): i for i, (name, _) in enumerate(names)}
    inputs = [i for i, (_, direction) in enumerate(names) if direction is not Direction.OUTPUT]
    for position, argument in enumerate(args):
        if argument.name is None:  # it counts from the first, whether those before it have names or not
            if position >= len(inputs):
                takes = arguments_text(len(inputs))
                c.error(argument.pos, "arguments", f"{what} takes {takes} without a name; give this one its name")
                return None
            i: int | None = inputs[position]
        else:
            i = index.get(argument.name.casefold())
        if i is None:
            hint = did_you_mean(argument.name or "", (n for n, _ in names)) or _listed([n for n, _ in names])
            if what in OTHER_BLOCKS and not c.world.names.is_user_name(what):
                hint = f"; that of CODESYS' library Util is Util.{what}"
            c.error(argument.pos, "arguments", f"{what} has no parameter {argument.name}{hint}")
            return None
        if i in bound:
            c.error(argument.pos, "arguments", f"{names[i][0]} is given twice")
            return None
        is_output = names[i][1] is Direction.OUTPUT
        if argument.name is not None and argument.output is not is_output:
            arrow = "=>" if is_output else ":="
            c.error(argument.pos, "arguments", f"{argument.name} is given with {arrow}")
            return None
        bound[i] = argument
    return {i: argument for i, argument in bound.items() if argument.value is not None}


def typed_call(
    c: Checker,
    info: FunctionInfo,
    actuals: dict[int, Actual],
    offset: int,
    *,
    formal: bool = False,
    noted: bool = True,
) -> Expr:
    """The call node: arguments in order of the parameters, defaults filled in. `formal`: arguments are given by name,
    so that others may be left out. `noted`: a call that leads back is recursion."""
    pos, name, ok = c.pos(offset), info.pou.name, True
    args: list[Expr | Place | None] = []
    behind: list[Expr] = []
    parameters = list(zip(info.parameters, info.pou.parameters, strict=False))
    for i, ((symbol, direction), parameter) in enumerate(parameters):
        actual = actuals.get(i)
        if actual is None and direction is not Direction.OUTPUT:
            if direction is Direction.IN_OUT or symbol.group or not (formal or symbol.given):
                c.error(offset, "arguments", f"the argument {symbol.name} of {name} is missing")
                ok = False
                continue
            args.append(_default_value(c, info.pou, symbol, parameter, offset))
            continue
        if symbol.group and actual is not None:
            described = _described(c, actual, symbol, offset)
            ok = ok and described is not None
            if described is not None:
                args.append(described[0])
                behind += described[1]
            continue
        argument = None if actual is None else _actual_argument(c, actual, symbol, direction, parameter)
        ok = ok and (actual is None or argument is not None)
        args.append(argument)
    if not ok or (info.result is ERROR):
        return error_value(pos)
    for parameter, argument in zip(info.pou.parameters, list(args), strict=False):
        args += [bound for _, bound in handed_bounds(parameter.variable, argument, pos)]
    args += behind
    if noted:
        c.world.calls.add(c.scope.pou, info.pou, pos)
    return Call(info.pou, args, info.result if info.result is not None else NOTHING, pos)


def _described(c: Checker, actual: Actual, symbol: VarSymbol, offset: int) -> tuple[Expr, list[Expr]] | None:
    """What is passed for a parameter of type ANY_...: a variable, or a value for the time of the call."""
    if isinstance(actual, ast.Argument):
        offset = actual.pos
        e = None if actual.value is None else settle(c.expr(actual.value))
    else:
        e = actual
    if e is None or e.type is ERROR:
        return None
    if not accepts(symbol.group, e.type) and symbol.type is not e.type:
        c.error(offset, "type", f"{symbol.name} takes {group_name(symbol.group)}, not {e.type}")
        return None
    place = place_of(e)
    if isinstance(place, BitPlace):
        place = ValuePlace(e, e.type, e.pos)
    elif is_unaligned(place):
        c.warning(offset, "pointer", packed_and_pointed_to(place))
    return handed(place, symbol.type, size_of(c, place))


def _default_value(c: Checker, pou: Pou, symbol: VarSymbol, parameter: Parameter, offset: int) -> Expr | Place:
    pos, t = c.pos(offset), symbol.type
    if isinstance(symbol.default, ComputedInit):
        given = symbol.default.value
        return given.place if parameter.by_reference and isinstance(given, Load) else given
    if isinstance(t, StructType | ArrayType) and t not in c.world.blocks:
        variable = c.world.default_of(symbol, pou)
        place = VarPlace(variable, t, pos)
        return place if parameter.by_reference else Load(place, t, pos)
    value: int | float | str = "" if isinstance(t, StringType) else 0
    if isinstance(symbol.default, ScalarInit):
        value = symbol.default.value
    elif not (is_scalar(t) or isinstance(t, StringType)):
        c.error(offset, "arguments", f"the argument {symbol.name} is missing")
        return error_value(pos)
    if elementary(t) in (REAL, LREAL):
        value = float(value)
    constant = Const(value, t, pos)
    return ValuePlace(constant, t, pos) if parameter.by_reference else constant


MAX_LISTED = 6  # parameters


def _listed(names: list[str]) -> str:
    """The parameters that there are, if they are few."""
    return f"; it has {', '.join(names)}" if 0 < len(names) <= MAX_LISTED else ""


def _actual_argument(
    c: Checker, actual: Actual, symbol: VarSymbol, direction: Direction, parameter: Parameter
) -> Expr | Place | None:
    """One argument as its parameter needs it; None after an error."""
    t = symbol.type
    if isinstance(actual, ast.Argument):
        if actual.value is None:
            return None
        if direction is not Direction.INPUT:
            output = direction is Direction.OUTPUT
            return referenced_place(c, actual.value, t, symbol.name, output=output, constant=symbol.constant)
        e = input_value(c, actual.value, t, symbol.name)
    else:
        assert actual is not None
        e = c.coerce(actual, t)
    if e.type is ERROR:
        return None
    return place_of(e) if parameter.by_reference else e


def input_value(c: Checker, node: ast.Expr, t: Type, name: str) -> Expr:
    """The value of an input; a REFERENCE TO gets the address."""
    if not isinstance(t, ReferenceType):
        if _is_slip(c, node, t, name):
            return c.error(node.pos, "arguments", f"the input {name} is given with :=, not with =")
        e = c.expr(node, t)
        e = e if takes_array(t, e.type) else c.coerce(e, t)
        return copied(c, e, node.pos)
    place = referenced_place(c, node, t.target, name, output=False)
    if place is None:
        return error_value(c.pos(node.pos))
    if is_unaligned(place):
        return c.error(node.pos, "type", packed(place, "a reference"))
    short = too_short(c, place, t.target)
    return c.error(node.pos, "type", f"{t} may write so many characters: {short}") if short else refer(place, t)


def _is_slip(c: Checker, node: ast.Expr, t: Type, name: str) -> bool:
    """`f(x = 1)` for an input x that is no BOOL, or where no variable is named x."""
    if (
        not isinstance(node, ast.Binary)
        or node.op is not ast.Operator.EQ
        or not isinstance(node.left, ast.Name)
        or (base_of(t) is BOOL and c.scope.lookup(name) is not None)
    ):
        return False
    return node.left.name.casefold() == name.casefold()


def too_short(c: Checker, place: Place, t: Type) -> str:
    """Why a string cannot be written as one of the type `t` by what keeps its address; "" if it can."""
    if not isinstance(place.type, StringType) or not isinstance(t, StringType):
        return ""
    if isinstance(place, VarPlace) and _has_any_length(c.scope.pou, place.var):
        return f"how long the variable of the caller is, is not known; copy it to a variable of type {t}"
    return f"{place.type} is too short" if place.type.length < t.length else ""


def _has_any_length(pou: Pou | None, variable: Variable) -> bool:
    """Whether a string is passed to a function by its address, with its length."""
    if pou is None or pou.kind not in (PouKind.FUNCTION, PouKind.METHOD):
        return False
    return any(parameter.by_reference and parameter.variable is variable for parameter in pou.parameters)


def size_of(c: Checker, place: Place) -> Expr:
    """The bytes of a place (DINT): a string that is passed to a function has those of the variable of the caller."""
    t, pos = place.type, place.pos
    if isinstance(t, StringType) and isinstance(place, VarPlace) and _has_any_length(c.scope.pou, place.var):
        capacity = IntrinsicCall(Intrinsic.STRING_SIZE, [Load(place, t, pos)], DINT, pos)
        return scaled(scaled(capacity, BinaryOp.ADD, 1), BinaryOp.MUL, t.unit)
    return total_size(place)


def packed(place: Place, what: str) -> str:
    """Why something that keeps an address cannot have that of a place in a packed structure."""
    return (
        f"this {place.type} is packed, and {what} needs one at a multiple of {place.type.align}; copy it to a variable"
    )


def packed_and_pointed_to(place: Place) -> str:
    """What may go wrong with a pointer to a place in a packed structure."""
    message = f"this {place.type} is packed, and some processors stop when they read it through a pointer to it"
    return f"{message}; copy it with MEMCPY, or use a pointer to the structure"


def refer(place: Place, t: ReferenceType) -> Expr:
    """What a reference to a place holds."""
    if isinstance(place, DerefPlace) and isinstance(place.pointer, Load):
        return replace(place.pointer, type=t)
    return AddressOf(place, t, place.pos)


def referenced_place(
    c: Checker, node: ast.Expr, t: Type, name: str, *, output: bool, constant: bool = False
) -> Place | None:
    """A variable passed by reference; a value will do when it is `constant`. Strings may have any length."""
    what = "the output" if output else "the VAR_IN_OUT"
    if constant:
        e = c.expr(node, t)
        place: Place | None = e.place if isinstance(e, Load) else place_of(c.coerce(e, t))
    else:
        place = changeable_place(c, node, f"{what} {name}", f"be given to {what} {name}")
    if place is None:
        return None
    if isinstance(place, BitPlace) and not output:
        c.error(node.pos, "type", f"a single bit has no address, so it cannot be given to {what} {name}")
        return None
    if isinstance(place.type, StringType) and isinstance(t, StringType):
        return place
    if t is ERROR or place.type is ERROR:
        return None
    if takes_array(t, place.type):
        return place
    if isinstance(place.type, StructType) and not output and place.type.may_conform(t):
        return place
    if not same_type(place.type, t) and not (
        isinstance(place.type, SubrangeType) and place.type.base is t and not output
    ):
        if output and _becomes(c, place, t):
            return place
        c.error(node.pos, "type", f"{what} {name} is {t} and needs a variable of this type, not {place.type}")
        return None
    return place


def _becomes(c: Checker, place: Place, t: Type) -> bool:
    """Whether an output of a function can be converted when it is written back: numbers of all types."""
    source, target = elementary(t), elementary(place.type)
    kinds = (*NUMBERS, Kind.REAL)
    if source is None or target is None or source.kind not in kinds or target.kind not in kinds:
        return False
    value = c.coerce(Load(place, t, place.pos), place.type)  # warns as an assignment would
    return value.type is not ERROR and not (isinstance(value, Convert) and value.check is not None)


def parameter_lines(decl: ast.PouDecl) -> list[tuple[str, Direction, str | None]]:
    """Name, direction and ANY_... group of each parameter."""
    found = []
    for block in decl.blocks:
        if block.keyword not in DIRECTIONS:
            continue
        for line in block.decls:
            group = line.type.name.upper() if isinstance(line.type, ast.NamedType) else ""
            for _, name in line.names:
                found.append((name, DIRECTIONS[block.keyword], group if is_group(group) else None))
    return found


def declared_names(unit: PouSymbol | Member | None) -> set[str]:
    """The names of the parameters, folded."""
    return set() if unit is None else {name.casefold() for name, _, _ in parameter_lines(unit.decl)}


def arguments_text(n: int) -> str:
    """`1 argument`, `2 arguments`"""
    return "no arguments" if n == 0 else "1 argument" if n == 1 else f"{n} arguments"
