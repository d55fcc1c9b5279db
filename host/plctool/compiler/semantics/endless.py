"""Loops that cannot end as they are written.

A loop is looked at when all bodies are checked, as what it calls may change its condition.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterable

from plctool.compiler.analysis import Effects
from plctool.compiler.diagnostics import Diagnostics
from plctool.compiler.typed import (
    AddressOf,
    Assign,
    Call,
    Case,
    Const,
    DerefPlace,
    Direction,
    Exit,
    Expr,
    FbCall,
    For,
    If,
    Intrinsic,
    IntrinsicCall,
    Pou,
    Repeat,
    Return,
    SelfPlace,
    Statement,
    Storage,
    Variable,
    VarPlace,
    While,
)
from plctool.compiler.typed_nodes import root_of, walk, written_places
from plctool.iec.areas import Area

Loop = While | Repeat | For
_CLOCKS = (Intrinsic.TIME, Intrinsic.LTIME)


def report_endless(loops: Iterable[tuple[Pou, Loop]], diagnostics: Diagnostics) -> None:
    """Warns of the loops that never end once they run. Each comes with the unit it stands in."""
    effects = Effects()
    for pou, loop in loops:
        if has_exit(loop.body) or any(isinstance(node, Return) for node in walk(loop.body)):
            continue
        why = _never_passed(loop) if isinstance(loop, For) else _never_met(loop, pou, effects)
        if why:
            diagnostics.warning(loop.pos, "endless", f"this loop never ends: {why}")


def has_exit(statements: list[Statement]) -> bool:
    """Whether an EXIT leaves the loop whose body this is."""
    for statement in statements:
        bodies: list[list[Statement]] = []
        if isinstance(statement, If | Case):
            bodies = [*(body for _, body in statement.branches), statement.otherwise]
        if isinstance(statement, Exit) or any(map(has_exit, bodies)):
            return True
    return False


def _never_passed(loop: For) -> str:
    """A FOR whose body sets its variable back."""
    if not isinstance(loop.var, VarPlace) or not isinstance(loop.stop, Const) or not isinstance(loop.step, Const):
        return ""
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


def _never_met(loop: While | Repeat, pou: Pou, effects: Effects) -> str:
    condition = loop.condition if isinstance(loop, While) else loop.until
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


def _may_change(loop: While | Repeat, variable: Variable, pou: Pou, effects: Effects) -> bool:
    if effects.has_address_taken(variable, pou):
        return True
    condition = loop.condition if isinstance(loop, While) else loop.until
    for node in walk([loop.body, condition]):
        for place in written_places(node):
            root = root_of(place)
            if root is variable or (root is None and variable.storage is not Storage.LOCAL):
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
