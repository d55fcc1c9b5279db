"""What the language allows and is hardly ever meant, for warnings: loops without an end, comparisons that always give
the same, fractions that are lost, pointers to another type.

A loop is looked at when all bodies are checked, as what it calls may change its condition.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import takewhile

from plctool.compiler.semantics import constants
from plctool.compiler.semantics.conversions import elementary, is_untyped
from plctool.compiler.semantics.symbols import ERROR
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import Diagnostics
from plctool.compiler.typed.analysis import Effects
from plctool.compiler.typed.nodes import (
    AddressOf,
    Assign,
    Binary,
    BinaryOp,
    Call,
    Case,
    Const,
    Continue,
    Convert,
    DerefPlace,
    Direction,
    Exit,
    Expr,
    FbCall,
    For,
    If,
    Intrinsic,
    IntrinsicCall,
    Jump,
    Label,
    Pos,
    Pou,
    Repeat,
    Return,
    SelfPlace,
    Statement,
    Storage,
    Try,
    Unary,
    Variable,
    VarPlace,
    While,
)
from plctool.compiler.typed.ranges import Range, may_wrap, type_range
from plctool.compiler.typed.typed_nodes import walk, written_places
from plctool.iec.areas import Area
from plctool.iec.common_types import NUMBERS, SIGNED
from plctool.iec.types import (
    BOOL,
    ArrayType,
    Elementary,
    EnumType,
    Kind,
    PointerType,
    StringType,
    StructType,
    SubrangeType,
    Type,
    base_of,
)

# ---- loops that cannot end as they are written ----


@dataclass
class JumpLoop:
    """What a JMP back repeats, from its label on. `condition`: of the IF that ends with it; None without one."""

    condition: Expr | None
    body: list[Statement]
    pos: Pos


Loop = While | Repeat | For | JumpLoop
_CLOCKS = (Intrinsic.TIME, Intrinsic.LTIME)


def report_endless(loops: Iterable[tuple[Pou, Loop]], diagnostics: Diagnostics) -> None:
    """Warns of the loops that never end once they run. Each comes with the unit it stands in."""
    effects = Effects()
    for pou, loop in loops:
        if _is_left(loop) or _is_always(loop, diagnostics):
            continue
        why = _never_passed(loop) if isinstance(loop, For) else _never_met(loop, pou, effects)
        if why:
            diagnostics.warning(loop.pos, "endless", f"this loop never ends: {why}")


def _is_always(loop: Loop, diagnostics: Diagnostics) -> bool:
    """True if it was reported that a comparison in the condition is always TRUE or FALSE."""
    condition = None if isinstance(loop, For) else loop.until if isinstance(loop, Repeat) else loop.condition
    nodes = () if condition is None else walk(condition)
    return any(isinstance(node, Binary) and diagnostics.has("always", node.pos) for node in nodes)


def _is_left(loop: Loop) -> bool:
    """Whether a statement in its body leaves a loop. A CONTINUE in one made of a JMP is of a loop around it."""
    leaving = (Exit, Continue) if isinstance(loop, JumpLoop) else (Exit,)
    nodes = list(walk(loop.body))
    labels = {node.name for node in nodes if isinstance(node, Label)}
    jumps_out = any(isinstance(node, Jump) and node.name not in labels for node in nodes)
    return jumps_out or has_exit(loop.body, leaving) or any(isinstance(node, Return) for node in nodes)


def has_exit(statements: list[Statement], leaving: tuple[type[Statement], ...] = (Exit,)) -> bool:
    """Whether an EXIT leaves the loop whose body this is; `leaving`: one of these."""
    for statement in statements:
        bodies: list[list[Statement]] = []
        if isinstance(statement, If | Case):
            bodies = [*(body for _, body in statement.branches), statement.otherwise]
        elif isinstance(statement, Try):
            bodies = [statement.body, statement.caught]
        if isinstance(statement, leaving) or any(has_exit(body, leaving) for body in bodies):
            return True
    return False


def _never_passed(loop: For) -> str:
    """A FOR whose body sets its variable back."""
    if not isinstance(loop.var, VarPlace) or not isinstance(loop.stop, Const) or not isinstance(loop.step, Const):
        return ""
    if has_exit(loop.body, (Continue,)) or any(isinstance(node, Jump) for node in walk(loop.body)):
        return ""  # perhaps around what sets it back
    for statement in loop.body:
        if not isinstance(statement, Assign) or not isinstance(statement.value, Const):
            continue
        if isinstance(statement.target, VarPlace) and statement.target.var is loop.var.var:
            last, step, value = loop.stop.value, loop.step.value, statement.value.value
            if isinstance(last, int) and isinstance(step, int) and isinstance(value, int):
                goes_on = value + step <= last if step > 0 else value + step >= last
                name = _name(loop.var.var)
                return f"its body sets {name} to {value} each time; leave that to the FOR" if goes_on else ""
    return ""


def _never_met(loop: While | Repeat | JumpLoop, pou: Pou, effects: Effects) -> str:
    condition = loop.until if isinstance(loop, Repeat) else loop.condition
    if condition is None:
        return "nothing leads around this JMP; put it into an IF"
    if isinstance(condition, Const):
        ends = bool(condition.value) is isinstance(loop, Repeat)
        value = "FALSE" if isinstance(loop, Repeat) else "TRUE"
        return "" if ends else f"its condition is always {value}; write what ends it, or EXIT in its body"
    variables = _decided_by(condition, pou, effects)
    if variables is None or any(_may_change(loop, variable, pou, effects) for variable in variables):
        return ""
    names = list(dict.fromkeys(_name(variable) for variable in variables))
    if any(isinstance(node, IntrinsicCall) and node.intrinsic in _CLOCKS for node in walk(condition)):
        names.append("TIME(), which is the time of the cycle")
    if not names:
        return ""  # a function of constants, which may well be FALSE
    listed = f"{', '.join(names[:-1])} or {names[-1]}" if len(names) > 1 else names[0]
    return f"nothing in it changes {listed}; change it in the body, or write IF to test once in each cycle"


def _decided_by(condition: Expr, pou: Pou, effects: Effects) -> list[Variable] | None:
    """The variables a condition depends on, all of this unit's own; None when it depends on something else as well."""
    found: list[VarPlace] = []
    for node in walk(condition):
        if isinstance(node, DerefPlace | SelfPlace | AddressOf):
            return None
        if isinstance(node, Call) and not (_only_reads(node) and effects.is_local(node.function)):
            return None
        if isinstance(node, VarPlace):
            if not _is_own(node.var, pou):
                return None
            found.append(node)
    return [place.var for place in sorted(found, key=lambda place: (place.pos.line, place.pos.column))]


def _only_reads(call: Call) -> bool:
    inputs = all(p.direction is Direction.INPUT for p in call.function.parameters)
    return inputs and call.instance is None and call.dispatch is None


def _is_own(variable: Variable, pou: Pou) -> bool:
    """Whether it belongs to the POU, so that no other code changes it while the POU runs."""
    if variable.storage is Storage.AREA:
        owner = variable.name.rpartition(".")[0]
        inside = owner == pou.name or pou.name.startswith(f"{owner}.")
        return bool(owner) and inside and variable.area in (Area.DATA, Area.RETAIN)
    return variable.storage in (Storage.LOCAL, Storage.SELF)


def _may_change(loop: While | Repeat | JumpLoop, variable: Variable, pou: Pou, effects: Effects) -> bool:
    if effects.has_address_taken(variable, pou):
        return True
    condition = loop.until if isinstance(loop, Repeat) else loop.condition
    for node in walk([loop.body, condition]):
        if any(effects.may_share(place, variable, pou) for place in written_places(node)):
            return True
        if variable.storage is not Storage.LOCAL and _may_reach(node, effects):
            return True
    return False


def _may_reach(node: object, effects: Effects) -> bool:
    """Whether a call may write more than what it is passed."""
    if isinstance(node, Call):
        return node.dispatch is not None or not effects.is_local(node.function)
    return isinstance(node, FbCall)


def _name(variable: Variable) -> str:
    return variable.name.rpartition(".")[2]


# ---- integer divisions whose result becomes a REAL: the fraction is lost before ----


def lost_fraction(e: Expr, target: Elementary, *, explicit: bool = False) -> str:
    """What to say when the integer `e` becomes `target`; "" when it is no division. `explicit`: by INT_TO_REAL and the
    like; then whole days, seconds ... of a date or duration are meant as they are, and so are bits."""
    division = _division(e)
    if division is None or (explicit and _is_of_time(division.left)):
        return ""
    source = elementary(division.type)
    if source is None or (explicit and source.kind is not Kind.INT):
        return ""
    drops = f"this division of {source} drops its fraction and only then becomes {target}"
    return f"{drops}; convert an operand: {source}_TO_{target}(...) / ..."


def lost_in_constants(left: Expr, right: Expr, result: Expr, target: Type | None) -> str:
    """What to say when `left / right`, both constant, is an integer with a rest and becomes the REAL `target`."""
    to, source = elementary(target) if target is not None else None, elementary(result.type)
    if to is None or to.kind is not Kind.REAL or source is None or source.kind is not Kind.INT:
        return ""
    if not isinstance(left, Const) or not isinstance(right, Const) or not isinstance(result, Const):
        return ""
    a, b = left.value, right.value
    if not isinstance(a, int) or not isinstance(b, int) or b == 0 or a % b == 0:
        return ""
    written = f"write {a}.0 / {b}" if is_untyped(result) else f"convert an operand: {source}_TO_{to}(...) / ..."
    return f"this division of integers drops its fraction and gives {result.value}; {written}"


def _division(e: Expr) -> Binary | None:
    """The integer division that an expression is, or that is added to something in it."""
    if isinstance(e, Unary):
        return _division(e.operand)
    if isinstance(e, Convert):
        source = elementary(e.operand.type)
        return _division(e.operand) if source is not None and source.kind in NUMBERS else None
    if not isinstance(e, Binary):
        return None
    if e.op in (BinaryOp.ADD, BinaryOp.SUB, BinaryOp.MUL):
        found = _division(e.left) or _division(e.right)
        return None if found is not None and _rounds(e, found) else found
    return e if e.op is BinaryOp.DIV else None


def _rounds(e: Binary, division: Binary) -> bool:
    """Whether a number is rounded to a multiple, as in `i / 10 * 10`."""
    divisor = division.right.value if isinstance(division.right, Const) else None
    factors = [side.value for side in (e.left, e.right) if isinstance(side, Const)]
    return e.op is BinaryOp.MUL and factors == [divisor]


# ---- sums and products that wrap below 32 bits before something looks at them ----

_LONGEST_STEP = 16  # of an index in a ring
_GROWING = {BinaryOp.ADD: "sum", BinaryOp.SUB: "difference", BinaryOp.MUL: "product"}


def wrapping(e: Expr) -> str:
    """What to call the `+`, `-` or `*` below 32 bits that an expression is, if its result may be outside of the type it
    is computed in; "" for others."""
    if isinstance(e, Unary):
        return wrapping(e.operand)
    base = elementary(e.type)
    if not isinstance(e, Binary) or e.op not in _GROWING or base is None:
        return ""
    narrow = base.kind in NUMBERS and base.bits < SIGNED[32].bits
    return _GROWING[e.op] if narrow and may_wrap(e) else ""


def is_next_index(e: Expr) -> bool:
    """True for `x + 1` and the like, which before a MOD is nearly always the next index of a ring and far from the
    limits of its type. The previous index, `x - 1`, does wrap at 0 in an unsigned type."""
    base = elementary(e.type)
    if not isinstance(e, Binary) or base is None or e.op not in (BinaryOp.ADD, BinaryOp.SUB):
        return False
    steps = [side.value for side in (e.left, e.right) if isinstance(side, Const) and isinstance(side.value, int)]
    return len(steps) == 1 and 0 <= steps[0] <= _LONGEST_STEP and (base.signed or e.op is BinaryOp.ADD)


# ---- NOT of a number that is then compared, as in `NOT s = 5` ----


def negated_number(node: ast.Binary, left: Expr, text: str) -> str:
    """What to say of `NOT a = b` about integers, where NOT inverts the bits of a; "" when it is something else or
    `(NOT a) = b`. That of a BYTE is meant. `text`: of the source."""
    base = elementary(left.type)
    negated = isinstance(node.left, ast.Unary) and node.left.op is ast.Operator.NOT
    if not negated or node.op not in ast.COMPARISONS or base is None or base.kind is not Kind.INT:
        return ""
    negation = text[node.left.pos : node.pos]
    if negation.count(")") > negation.count("("):
        return ""
    operand = " ".join(negation[len("NOT") :].split())
    return f"NOT comes before {node.op} and inverts the bits of {operand}; write NOT ({operand} {node.op} ...)"


# ---- constants that are converted to a type that has no such value ----

_INTEGER_TEXT = re.compile(r"[ \t]*([+-]?)(?:(?P<base>0*(?:2|8|16))#)?(?P<digits>[0-9A-Fa-f]*)(?P<rest>.*)", re.DOTALL)
_REAL_TEXT = re.compile(r"[ \t]*[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?[ \t]*|[ \t]*[+-]?(?:inf\w*|nan)[ \t]*", re.I)


def misread(text: str, target: Elementary) -> str:
    """What to say when a constant text becomes a number; "" when it is one of this type. Reads as STRING_TO_INT and
    STRING_TO_REAL of the library do."""
    if target.kind is Kind.REAL:
        return "" if _REAL_TEXT.fullmatch(text) else f"'{text}' is no number as a whole, so only its start is read"
    match = _INTEGER_TEXT.fullmatch(text)
    if match is None or target.kind not in NUMBERS:
        return ""
    base = int(match["base"] or 10)
    digits = "".join(takewhile(lambda digit: int(digit, 16) < base, match["digits"]))
    rest = match["digits"][len(digits) :] + match["rest"]
    read = int(digits or "0", base) * (-1 if match[1] == "-" else 1)
    value = constants.wrap(read, target)
    if not digits:
        return f"'{text}' is no number, so this is {value}; other systems may disagree"
    if rest.strip(" \t"):
        return f"reading '{text}' stops at '{rest}', so this is {value}; other systems give 0 or read on"
    return "" if value == read else f"'{text}' does not fit {target}, so this is {value}"


def not_a_value(real: float, result: Expr, target: Elementary) -> str:
    """What to say when a constant REAL becomes an integer or bit string; "" when systems give the same.
    Halves go to even here; to bit strings other systems round them away from zero."""
    if not isinstance(result, Const) or not isinstance(result.value, int) or target.kind not in NUMBERS:
        return ""
    distance = abs(result.value - real)
    if not distance <= 0.5:  # NaN is no value either
        return f"{real} does not fit {target}, so this is {result.value}; other systems may give another value"
    if distance == 0.5 and target.kind is Kind.BIT and abs(result.value) < abs(real):
        return f"{real} becomes {result.value}, the even one; other systems round halves away from zero"
    return ""


def _is_of_time(e: Expr) -> bool:
    """Whether a number is a duration or date that was converted."""
    while isinstance(e, Convert):
        e = e.operand
        source = elementary(e.type)
        if source is not None and source.kind in (Kind.TIME, Kind.DATE):
            return True
    return False


# ---- whether a pointer may look at a variable of another type without surprise ----

_BITS = (Kind.BIT, Kind.CHAR)


def overlays(found: Type, wanted: Type) -> bool:
    """Whether `found` is a `wanted`, begins with one or is what one begins with, or either is seen as plain bits."""
    a, b = _plain(found), _plain(wanted)
    if isinstance(a, PointerType) or isinstance(b, PointerType):
        return True
    if ERROR in (a, b) or a == b or _is_bits(a) or _is_bits(b):
        return True
    if isinstance(a, StringType) and isinstance(b, StringType):
        return a.wide is b.wide
    if isinstance(a, StructType) and isinstance(b, StructType) and (a.conforms(b) or b.conforms(a)):
        return True
    first = isinstance(a, StructType) and any(overlays(t, b) for t in _first(a))
    return first or (isinstance(b, StructType) and any(overlays(a, t) for t in _first(b)))


def _plain(t: Type) -> Type:
    """The type of the elements of an array, and of those; of an enumeration or subrange its base."""
    while isinstance(t, ArrayType):
        t = t.element
    return base_of(t)


def _is_bits(t: Type) -> bool:
    return isinstance(t, Elementary) and t.kind in _BITS


def _first(t: StructType) -> list[Type]:
    return [f.type for f in t.fields if f.offset <= 0 and not f.hidden]


# ---- comparisons with a number beyond what the other side can be ----

_SWAPPED = {BinaryOp.LT: BinaryOp.GT, BinaryOp.GT: BinaryOp.LT, BinaryOp.LE: BinaryOp.GE, BinaryOp.GE: BinaryOp.LE}


def always(op: BinaryOp, value: Expr, number: int, *, swapped: bool) -> str:
    """What to say of `value op number` (`swapped`: of `number op value`) when the type of the value decides it; ""
    when it does not."""
    limits = _limits(value.type)
    if limits is None or isinstance(value, Const):
        return ""
    op = _SWAPPED.get(op, op) if swapped else op
    least, most = (constants.binary(op, limit, number, BOOL) for limit in limits)
    within = limits[0] <= number <= limits[1]
    decided = least == most if op in _SWAPPED else not within
    return f"this is always {'TRUE' if least else 'FALSE'}: {_why(value.type, limits, number)}" if decided else ""


def _limits(t: Type) -> Range | None:
    if isinstance(t, SubrangeType):
        return t.low, t.high
    base = elementary(t)
    return type_range(t) if base is not None and base.kind in NUMBERS and not isinstance(t, EnumType) else None


def _why(t: Type, limits: Range, number: int) -> str:
    low, high = limits
    what = f"{'an' if t.name[0] in 'AEIOU' and not t.name.startswith('U') else 'a'} {t}"
    if number > low:
        return f"{what} is at most {high}; use a larger type or another number"
    base = elementary(t)
    if low == 0 and base is not None and not isinstance(t, SubrangeType):
        signed = SIGNED[min(64, 2 * base.bits)]
        return f"{what} is never negative; use a signed type such as {signed}, or leave the comparison out"
    return f"{what} is at least {low}; use another type or another number"
