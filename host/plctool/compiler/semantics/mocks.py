"""Mocks of unit tests: what MOCK and MOCK_FUNCTION name gets a switch before its body.

All of it happens in the syntax tree, before anything is checked, and only for the program that runs the tests:

- a function block, one of the library too, gets the members `__mocked` and `__calls`; while it is mocked, its body only
  counts, and its methods, actions and properties do nothing;
- a method or property named in a test has members of its own, so that it can return a value and count its calls;
- a function gets the global variables `__mock_f` and `__value_f`; while it is mocked, it returns the value;
- a function or block that is implemented in C, and not in this process, raises an exception unless it is mocked.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from plctool.compiler.base.source import Source
from plctool.compiler.semantics.instances import INITIALISERS
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import Diagnostics
from plctool.core import lib

MOCKED, CALLS = "__mocked", "__calls"
IN_C = "__in_c"  # attribute of a block whose body in C is elsewhere, and uses its variables
_RAISE = "__raise"


def switch_of(name: str) -> str:
    """The variable that says whether a function, or the method `block.method`, is mocked."""
    return f"__mock_{_plain(name)}"


def value_of(name: str) -> str:
    """The variable that holds what a mocked function or method returns."""
    return f"__value_{_plain(name)}"


def calls_of(name: str) -> str:
    """The variable that counts the calls of a mocked method."""
    return f"__calls_{_plain(name)}"


def _plain(name: str) -> str:
    return name.casefold().replace(".", "_")


def raising() -> ast.PouDecl:
    """The function that raises an exception by its number."""
    code = ast.VarDecl(0, [(0, "code")], None, ast.NamedType(0, "UDINT"), None)
    block = ast.VarBlock(0, ast.Section.VAR_INPUT, set(), [code])
    return ast.PouDecl(0, ast.Unit.FUNCTION, _RAISE, None, [block], [], {"external": "iecraise"}, Source("", ""))


class Mocks:
    """What the tests of a program want to replace, and the declarations that allow it."""

    def __init__(self, tests: Iterable[ast.TestDecl], diagnostics: Diagnostics) -> None:
        self._diagnostics = diagnostics
        self._blocks = False  # whether any instance is mocked
        self._functions: set[str] = set()
        self._members: set[str] = set()  # names of methods and properties, and perhaps of other members
        for call in ast.every(ast.Call, [test.body for test in tests]):
            name = call.callee.name.upper() if isinstance(call.callee, ast.Name) else ""
            target = call.args[0].value if call.args else None
            if name == "MOCK_FUNCTION" and isinstance(target, ast.Name):
                self._functions.add(target.name.casefold())
            elif name.startswith("MOCK"):
                self._blocks = True
                if isinstance(target, ast.Member):
                    self._members.add(target.name.casefold())

    def rewritten(self, declarations: Sequence[ast.Declaration]) -> list[ast.Declaration]:
        """The declarations with what the tests need to replace parts of them."""
        result: list[ast.Declaration] = []
        for decl in declarations:
            if isinstance(decl, ast.PouDecl) and decl.keyword is ast.Unit.FUNCTION_BLOCK:
                block = _raising_block(decl) if _is_elsewhere(decl, "__main") else decl
                # The layout of a block in C stays as it is.
                result.append(self._block(block) if self._blocks and "external" not in block.attributes else block)
            elif isinstance(decl, ast.PouDecl) and decl.keyword is ast.Unit.FUNCTION:
                result += self._function(decl)
            else:
                result.append(decl)
        return result

    # ---- function blocks ----

    def _block(self, decl: ast.PouDecl) -> ast.PouDecl:
        """The hidden members of a derived block come from its base."""
        pos = decl.pos
        lines = [] if decl.bases else [_variable(pos, MOCKED, "BOOL"), _variable(pos, CALLS, "UDINT")]
        members: list[ast.PouDecl] = []
        for member in decl.members:
            name = f"{decl.full_name}.{member.name}"
            chosen = member.name.casefold() in self._members
            if chosen and member.keyword in (ast.Unit.METHOD, ast.Unit.GET):
                lines += [_variable(pos, switch_of(name), "BOOL"), _variable(pos, calls_of(name), "UDINT")]
                if member.result is not None:
                    lines.append(ast.VarDecl(pos, [(pos, value_of(name))], None, member.result, None))
            members.append(_member(member, name, chosen=chosen and member.keyword in (ast.Unit.METHOD, ast.Unit.GET)))
        blocks = [*decl.blocks, ast.VarBlock(pos, ast.Section.VAR, set(), lines)] if lines else decl.blocks
        skip = ast.If(pos, [(ast.Name(pos, MOCKED), [_counted(pos, CALLS), ast.Return(pos)])], [])
        body = decl.body if ast.Modifier.CLASS in decl.modifiers else [skip, *decl.body]
        return replace(decl, blocks=blocks, body=body, members=members)

    # ---- functions ----

    def _function(self, decl: ast.PouDecl) -> list[ast.Declaration]:
        mocked = decl.name.casefold() in self._functions
        if mocked and decl.result is None:
            message = f"{decl.name} returns nothing, so MOCK_FUNCTION cannot give it a value"
            self._diagnostics.error(decl.source.pos(decl.pos), "mock", message)
            mocked = False
        pos, body, attributes = decl.pos, decl.body, decl.attributes
        if _is_elsewhere(decl):
            attributes = _without_external(attributes)
            body = _raising_body(decl)
        if not mocked or decl.result is None:
            return [replace(decl, body=body, attributes=attributes)]
        value = ast.VarDecl(pos, [(pos, value_of(decl.name))], None, decl.result, None)
        lines = [_variable(pos, switch_of(decl.name), "BOOL"), value]
        give: list[ast.Stmt] = [_assign(pos, decl.name, ast.Name(pos, value_of(decl.name))), ast.Return(pos)]
        body = [ast.If(pos, [(ast.Name(pos, switch_of(decl.name)), give)], []), *body]
        block = ast.GlobalBlock(ast.VarBlock(pos, ast.Section.VAR_GLOBAL, set(), lines), decl.source)
        return [block, replace(decl, body=body, attributes=attributes)]


def _member(decl: ast.PouDecl, name: str, *, chosen: bool) -> ast.PouDecl:
    """A method, action or property. `chosen`: it has members of its own."""
    if ast.Modifier.ABSTRACT in decl.modifiers or decl.name.casefold() in INITIALISERS:
        return decl
    pos = decl.pos
    condition: ast.Expr = ast.Name(pos, MOCKED)
    give: list[ast.Stmt] = []
    if chosen:
        condition = ast.Binary(pos, ast.Operator.OR, condition, ast.Name(pos, switch_of(name)))
        give.append(_counted(pos, calls_of(name)))
        if decl.result is not None:
            give.append(_assign(pos, decl.name, ast.Name(pos, value_of(name))))
    return replace(decl, body=[ast.If(pos, [(condition, [*give, ast.Return(pos)])], []), *decl.body])


def _is_elsewhere(decl: ast.PouDecl, suffix: str = "") -> bool:
    """Whether a unit is implemented in C, but not in the simulator. `suffix`: of the name of its C function."""
    name = decl.attributes.get("external")
    return name is not None and not lib.SimHasExternal(f"{name}{suffix}".lower().encode("latin-1", "replace"))


def _without_external(attributes: Mapping[str, str]) -> dict[str, str]:
    return {name: text for name, text in attributes.items() if name not in ("external", "version")}


def _raising_body(decl: ast.PouDecl) -> list[ast.Stmt]:
    """What takes the place of a body in C that is elsewhere."""
    pos = decl.pos
    code = ast.Literal(pos, ast.LiteralKind.INT, lib.RTSEXCPT_UNRESOLVED_EXTREFS)
    body: list[ast.Stmt] = [ast.ExprStmt(pos, ast.Call(pos, ast.Name(pos, _RAISE), [ast.Argument(pos, None, code)]))]
    if decl.result is not None:  # which is assigned in C
        body.append(_assign(pos, decl.name, ast.Name(pos, decl.name)))
    return body


def _raising_block(decl: ast.PouDecl) -> ast.PouDecl:
    """A block in C whose calls raise an exception. Its instances can be made, so that they can be mocked."""
    members = [m if m.name.casefold() in INITIALISERS else replace(m, body=_raising_body(m)) for m in decl.members]
    attributes = _without_external(decl.attributes) | {IN_C: ""}
    return replace(decl, body=_raising_body(decl), members=members, attributes=attributes)


def _variable(pos: int, name: str, type_name: str) -> ast.VarDecl:
    return ast.VarDecl(pos, [(pos, name)], None, ast.NamedType(pos, type_name), None)


def _assign(pos: int, name: str, value: ast.Expr) -> ast.Assign:
    return ast.Assign(pos, [ast.Name(pos, name)], ast.Assigning.VALUE, value)


def _counted(pos: int, name: str) -> ast.Assign:
    """`name := name + 1`"""
    return _assign(
        pos, name, ast.Binary(pos, ast.Operator.ADD, ast.Name(pos, name), ast.Literal(pos, ast.LiteralKind.INT, 1))
    )
