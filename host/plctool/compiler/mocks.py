"""Mocks of unit tests: what MOCK and MOCK_FUNCTION name gets a switch in front of its body.

All of it happens in the syntax tree, before anything is checked, and only for the program that runs the tests:

- a function block of the program gets the members `__mocked` and `__calls`; while it is mocked, its body only counts;
- a function gets the global variables `__mock_f` and `__value_f`; while it is mocked, it returns the value;
- a function that is implemented in C, and not in this process, raises an exception unless it is mocked.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

from plctool.compiler import ast
from plctool.compiler.diagnostics import Diagnostics
from plctool.compiler.source import Source
from plctool.core import lib

MOCKED, CALLS = "__mocked", "__calls"
_RAISE = "__raise"


def switch_of(function: str) -> str:
    """The global variable that says whether a function is mocked."""
    return f"__mock_{function.casefold()}"


def value_of(function: str) -> str:
    """The global variable that holds what a mocked function returns."""
    return f"__value_{function.casefold()}"


def with_mocks(
    parsed: list[tuple[Source, list[ast.Declaration]]], diagnostics: Diagnostics
) -> list[tuple[Source, list[ast.Declaration]]]:
    """The declarations of each file with what the tests need to replace parts of them."""
    everything = [decl for _, declarations in parsed for decl in declarations]
    blocks, functions = _mocked(d for d in everything if isinstance(d, ast.TestDecl))
    own = {d.name.casefold() for d in everything if isinstance(d, ast.PouDecl) and d.keyword == "FUNCTION_BLOCK"}
    if not blocks:
        own.clear()
    return [(source, _with_mocks(declarations, own, functions, diagnostics)) for source, declarations in parsed]


def _with_mocks(
    declarations: list[ast.Declaration], blocks: set[str], functions: set[str], diagnostics: Diagnostics
) -> list[ast.Declaration]:
    result: list[ast.Declaration] = []
    for decl in declarations:
        if not isinstance(decl, ast.PouDecl):
            result.append(decl)
        elif decl.keyword == "FUNCTION_BLOCK" and blocks and "CLASS" not in decl.modifiers:
            result.append(_block(decl, derived=any(name.casefold() in blocks for _, name in decl.bases)))
        elif decl.keyword == "FUNCTION" and (decl.name.casefold() in functions or _is_elsewhere(decl)):
            mocked = decl.name.casefold() in functions
            if mocked and decl.result is None:
                message = f"{decl.name} returns nothing, so MOCK_FUNCTION cannot give it a value"
                diagnostics.error(decl.source.pos(decl.pos), "mock", message)
                mocked = False
            if mocked:
                result.append(_globals(decl))
            result.append(_function(decl, mocked=mocked))
        else:
            result.append(decl)
    return result


def raising() -> ast.PouDecl:
    """The function that raises an exception by its number."""
    code = ast.VarDecl(0, [(0, "code")], None, ast.NamedType(0, "UDINT"), None)
    block = ast.VarBlock(0, "VAR_INPUT", set(), [code])
    return ast.PouDecl(0, "FUNCTION", _RAISE, None, [block], [], {"external": "iecraise"}, Source("", ""))


def _mocked(tests: Iterable[ast.TestDecl]) -> tuple[bool, set[str]]:
    """Whether any function block is mocked, and the names of the functions that are."""
    blocks, functions = False, set[str]()
    for call in _calls([test.body for test in tests]):
        name = call.callee.name.upper() if isinstance(call.callee, ast.Name) else ""
        target = call.args[0].value if call.args else None
        if name == "MOCK_FUNCTION" and isinstance(target, ast.Name):
            functions.add(target.name.casefold())
        blocks = blocks or name.startswith("MOCK")
    return blocks, functions


def _calls(root: object) -> Iterator[ast.Call]:
    """Every call in statements."""
    stack = [root]
    while stack:
        node = stack.pop()
        if isinstance(node, list | tuple):
            stack.extend(node)
        elif hasattr(node, "__slots__"):
            if isinstance(node, ast.Call):
                yield node
            stack.extend(getattr(node, name) for name in node.__slots__)


def _is_elsewhere(decl: ast.PouDecl) -> bool:
    """Whether a function is implemented in C, but not in the simulator."""
    name = decl.attributes.get("external")
    return name is not None and not lib.SimHasExternal(name.lower().encode("latin-1", "replace"))


def _block(decl: ast.PouDecl, *, derived: bool) -> ast.PouDecl:
    """`derived`: the members come from a block of the program that it EXTENDS."""
    pos = decl.pos
    members = ast.VarBlock(pos, "VAR", set(), [_variable(pos, MOCKED, "BOOL"), _variable(pos, CALLS, "UDINT")])
    count = ast.Binary(pos, "+", ast.Name(pos, CALLS), ast.Literal(pos, ast.LiteralKind.INT, 1))
    skip = ast.If(pos, [(ast.Name(pos, MOCKED), [_assign(pos, CALLS, count), ast.Return(pos)])], [])
    blocks = decl.blocks if derived else [*decl.blocks, members]
    return replace(decl, blocks=blocks, body=[skip, *decl.body])


def _variable(pos: int, name: str, type_name: str) -> ast.VarDecl:
    return ast.VarDecl(pos, [(pos, name)], None, ast.NamedType(pos, type_name), None)


def _assign(pos: int, name: str, value: ast.Expr) -> ast.Assign:
    return ast.Assign(pos, [ast.Name(pos, name)], ":=", value)


def _globals(decl: ast.PouDecl) -> ast.GlobalBlock:
    assert decl.result is not None
    pos = decl.pos
    value = ast.VarDecl(pos, [(pos, value_of(decl.name))], None, decl.result, None)
    lines = [_variable(pos, switch_of(decl.name), "BOOL"), value]
    return ast.GlobalBlock(ast.VarBlock(pos, "VAR_GLOBAL", set(), lines), decl.source)


def _function(decl: ast.PouDecl, *, mocked: bool) -> ast.PouDecl:
    pos, body, attributes = decl.pos, decl.body, decl.attributes
    if _is_elsewhere(decl):
        code = ast.Literal(pos, ast.LiteralKind.INT, lib.RTSEXCPT_UNRESOLVED_EXTREFS)
        attributes = {name: text for name, text in attributes.items() if name != "external"}
        body = [ast.ExprStmt(pos, ast.Call(pos, ast.Name(pos, _RAISE), [ast.Argument(pos, None, code)]))]
    if mocked:
        give: list[ast.Stmt] = [_assign(pos, decl.name, ast.Name(pos, value_of(decl.name))), ast.Return(pos)]
        body = [ast.If(pos, [(ast.Name(pos, switch_of(decl.name)), give)], []), *body]
    return replace(decl, body=body, attributes=attributes)
