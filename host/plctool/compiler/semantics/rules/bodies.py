"""Bodies: statements in sequence, and which of them are never reached.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.nesting import NestingError
from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.endless import has_exit
from plctool.compiler.semantics.instances import INITIALISERS
from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.symbols import Role, VarSymbol
from plctool.compiler.syntax import ast
from plctool.compiler.typed import Case, Const, Continue, Exit, Expr, If, Repeat, Return, Statement, While


def check_body(c: Checker, nodes: list[ast.Stmt]) -> list[Statement]:
    """The typed statements; what cannot be reached is reported once."""
    result: list[Statement] = []
    ended = reported = False
    for node in nodes:
        if ended:
            report_unreachable(c, node.pos)
        found = c.statement(node)
        reported = reported or ended
        ended = not reported and _ends(found)
        result += found
    return result


def write_body(c: Checker, nodes: list[ast.Stmt]) -> None:
    """Checks the statements into the unit of the scope."""
    pou = c.scope.pou
    assert pou is not None
    try:
        pou.body = [*c.scope.prologue, *check_body(c, nodes)]
    except NestingError as error:
        c.world.nested_too_deeply(error)
    c.world.pous.append(pou)


def report_unreachable(c: Checker, offset: int, why: str = "") -> None:
    """Warns of a statement that is never executed."""
    c.warning(offset, "unreachable", f"this statement is never reached{why}")


def report_unused(scope: Scope) -> None:
    """Warns of variables that are not used, and of results that are not assigned."""
    for symbol in scope.names.values():
        if not isinstance(symbol, VarSymbol) or symbol.used or symbol.name.startswith("%"):
            continue
        if symbol.role in (Role.LOCAL, Role.TEMP):
            scope.globals.diagnostics.warning(symbol.pos, "unused", f"{symbol.name} is never used")
        elif symbol.role is Role.RESULT and symbol.name.casefold() not in INITIALISERS:
            message = f"{symbol.name} never assigns its result; write {symbol.name} := ..."
            scope.globals.diagnostics.warning(symbol.pos, "result", message)


def _ends(statements: list[Statement]) -> bool:
    """Whether what follows some statements is never reached."""
    if not statements:
        return False
    last = statements[-1]
    if isinstance(last, If | Case):
        return _ends(last.otherwise) and all(_ends(body) for _, body in last.branches)
    if isinstance(last, While):
        return _is_constant(last.condition, 1) and not has_exit(last.body)
    if isinstance(last, Repeat):
        return _is_constant(last.until, 0) and not has_exit(last.body)
    return isinstance(last, Return | Exit | Continue)


def _is_constant(e: Expr, value: int) -> bool:
    return isinstance(e, Const) and e.value == value
