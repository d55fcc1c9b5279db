"""GetTitle(), GetTextProperty('key') and others: information of the project, as constants (manual 3.3.10).

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.base.information import PropertyKind
from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.conversions import error_value
from plctool.compiler.semantics.symbols import UNTYPED_INT, UNTYPED_REAL
from plctool.compiler.syntax import ast
from plctool.compiler.typed.nodes import Const, Expr, Pos
from plctool.errors import did_you_mean, listed, with_article
from plctool.iec.types import BOOL, StringType

_TEXTS = {
    "GetTitle": "title", "GetCompany": "company", "GetVersion": "version", "GetAuthor": "author",
    "GetDescription": "description", "F_getProjectName": "name",
}  # fmt: skip
_PROPERTIES = {
    "GetTextProperty": PropertyKind.TEXT, "GetNumberProperty": PropertyKind.NUMBER,
    "GetBooleanProperty": PropertyKind.BOOL, "GetVersionProperty": PropertyKind.VERSION,
}  # fmt: skip
INFORMATION_FUNCTIONS = {name.upper(): name for name in (*_TEXTS, *_PROPERTIES)}
"""Their names as the manual has them, by those in capitals."""

_EXAMPLES = {
    PropertyKind.TEXT: '"..."', PropertyKind.NUMBER: "1", PropertyKind.BOOL: "true",
    PropertyKind.VERSION: '{ version = "1.0.0.0" }',
}  # fmt: skip


def information(c: Checker, key: str, node: ast.Call) -> Expr:
    """The constant that a call of one of INFORMATION_FUNCTIONS stands for."""
    name, known = INFORMATION_FUNCTIONS[key], c.world.information
    if not known.file:
        message = f"{name} reads [information] of plc.toml, and this program is built without one: name the project"
        return c.error(node.pos, "information", message)
    return _text(c, name, node) if name in _TEXTS else _property(c, name, node)


def _text(c: Checker, name: str, node: ast.Call) -> Expr:
    key = _TEXTS[name]
    if node.args:
        return c.error(node.pos, "arguments", f"{name} takes no arguments")
    value = c.world.information.strings.get(key)
    if value is None:
        message = f'[information] of plc.toml has no {key}; write for example {key} = "..."'
        return c.error(node.pos, "information", message)
    return _constant(value, c.pos(node.pos))


def _property(c: Checker, name: str, node: ast.Call) -> Expr:
    given = node.args[0].value if len(node.args) == 1 else None
    if given is None:
        return c.error(node.pos, "arguments", f"{name} takes 1 argument: the key of a property, such as 'serial'")
    key = c.expr(given)
    if not isinstance(key, Const) or not isinstance(key.value, str):
        if key.type is error_value(key.pos).type:
            return key
        return c.error(given.pos, "information", f"the key of {name} is a constant text, such as 'serial'")
    kind, known = _PROPERTIES[name], c.world.information.properties
    found = known.get(key.value)
    if found is None:
        kinds = [text for text, entry in known.items() if entry.kind is kind]
        has = f"; it has {listed(map(repr, kinds))}" if kinds else f"; write there for example key = {_EXAMPLES[kind]}"
        hint = did_you_mean(key.value, known) or has
        return c.error(given.pos, "information", f"[information.properties] has no {kind.value} '{key.value}'{hint}")
    if found.kind is not kind:
        right = next(function for function, its in _PROPERTIES.items() if its is found.kind)
        message = f"'{key.value}' is {with_article(found.kind.value)}, not {with_article(kind.value)}; call {right}"
        return c.error(given.pos, "information", message)
    return _constant(found.value, c.pos(node.pos))


def _constant(value: str | int | float | bool, pos: Pos) -> Const:
    """As the literal of the value would be: a number takes the type that its surroundings need."""
    match value:
        case bool():
            return Const(int(value), BOOL, pos)
        case int():
            return Const(value, UNTYPED_INT, pos)
        case float():
            return Const(value, UNTYPED_REAL, pos)
    return Const(value, StringType(len(value)), pos)
