"""Calls as statements, with EN and ENO.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable, Container

from plctool.compiler.semantics.checker import Checker, checks_statement
from plctool.compiler.semantics.rules.arguments import parameter_names, split_enable
from plctool.compiler.semantics.rules.block_calls import block_call, called_instance, program_call
from plctool.compiler.semantics.rules.calls import call
from plctool.compiler.semantics.rules.members import is_called_by_name
from plctool.compiler.semantics.rules.places import changeable_place
from plctool.compiler.semantics.rules.qualified_names import called_program
from plctool.compiler.semantics.symbols import ERROR
from plctool.compiler.syntax import ast
from plctool.compiler.typed import Assign, Call, CallStatement, Const, If, Statement
from plctool.iec.types import BOOL, StructType


@checks_statement(ast.ExprStmt)
def call_statement(c: Checker, statement: ast.ExprStmt) -> list[Statement]:
    """A call, or an action or program that is called by its name alone."""
    node = statement.value
    if isinstance(node, ast.Call) and isinstance(node.callee, ast.Name):
        special = c.special_calls.get(node.callee.name.upper())
        if special is not None:
            return special(node)
    if not isinstance(node, ast.Call) and is_called_by_name(c, node):
        node = ast.Call(node.pos, node, [])
    if isinstance(node, ast.Call):
        return _called(c, node)
    e = c.expr(node)
    if e.type is not ERROR:
        c.error(statement.pos, "statement", "this is a value, not a statement; write an assignment or a call")
    return []


def _called(c: Checker, node: ast.Call) -> list[Statement]:
    """A call of a program, of an instance or of a function."""
    program = called_program(c, node.callee)
    if program is not None:
        names = {symbol.name.casefold() for symbol, _ in program.parameters}
        return enabled(c, node, names, lambda plain: program_call(c, plain, program))
    instance = called_instance(c, node)
    if instance is not None:
        block = c.world.blocks.get(instance.type) if isinstance(instance.type, StructType) else None
        members = block.members if block is not None else ()
        return enabled(c, node, members, lambda plain: block_call(c, plain, instance))
    return enabled(c, node, parameter_names(c, node.callee), lambda plain: _function_statement(c, plain))


def _function_statement(c: Checker, node: ast.Call) -> list[Statement]:
    e = call(c, node, None)
    if isinstance(e, Call):
        return [CallStatement(e, e.pos)]
    if e.type is not ERROR:
        c.warning(node.pos, "unused", "the result of this call is not used")
    return []


def enabled(
    c: Checker, node: ast.Call, declared: Container[str], make: Callable[[ast.Call], list[Statement]]
) -> list[Statement]:
    """A call with EN and ENO: not executed unless EN is TRUE; ENO tells. Where the callee declares them itself they
    are variables like others."""
    if not has_enable(node, declared):
        return make(node)
    args, enable = split_enable(node, declared)
    statements = make(ast.Call(node.pos, node.callee, args, had_enable=True))
    pos = c.pos(node.pos)
    done: list[Statement] = []
    skipped: list[Statement] = []
    if enable.eno is not None:
        target = changeable_place(c, enable.eno, "ENO", "take ENO")
        if target is None:
            return []
        if target.type is not BOOL:
            c.error(enable.eno.pos, "type", f"ENO needs a BOOL variable, not {target.type}")
            return []
        done = [Assign(target, Const(1, BOOL, pos), pos)]
        skipped = [Assign(target, Const(0, BOOL, pos), pos)]
    if enable.en is None:
        return statements + done
    condition = c.condition(enable.en)
    return [] if condition.type is ERROR else [If([(condition, statements + done)], skipped, pos)]


def has_enable(node: ast.Call, declared: Container[str]) -> bool:
    """Whether a call has EN or ENO that the callee does not declare itself."""
    keys = ((a.name or "").casefold() for a in node.args)
    return any(key in ("en", "eno") and key not in declared for key in keys)
