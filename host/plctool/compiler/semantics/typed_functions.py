"""Standard functions with a type after their names: `ADD_INT(a, b)` is ADD for arguments that are INT.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from dataclasses import replace

from plctool.compiler.syntax import ast
from plctool.iec.types import ELEMENTARY

_OF_ONE_TYPE = (
    "ABS", "SQRT", "LN", "LOG", "EXP", "SIN", "COS", "TAN", "ASIN", "ACOS", "ATAN", "ATAN2", "ADD", "SUB", "MUL", "DIV",
    "MOD", "MOVE", "AND", "OR", "XOR", "NOT", "MIN", "MAX", "LIMIT", "GT", "GE", "EQ", "LE", "LT", "NE", "LEN",
    "CONCAT", "FIND",
)  # fmt: skip
_OTHER_ARGUMENTS: dict[str, tuple[int | str, ...]] = {
    **dict.fromkeys(_OF_ONE_TYPE, ()),
    **dict.fromkeys(("SHL", "SHR", "ROL", "ROR"), (1, "N")),
    "SEL": (0, "G"), "MUX": (0, "K"), "EXPT": (1, "IN2"),
    "LEFT": (1, "L"), "RIGHT": (1, "L"), "MID": (1, 2, "L", "P"), "DELETE": (1, 2, "L", "P"), "INSERT": (2, "P"),
    "REPLACE": (2, 3, "L", "P"),
}  # fmt: skip
"""The overloaded functions, and which of their arguments have a type of their own: by place and by name."""


def overloaded_form(node: ast.Call) -> ast.Call | None:
    """`ADD(INT_TO_INT(a), INT_TO_INT(b))` for `ADD_INT(a, b)`; None when the name is none of these."""
    if not isinstance(node.callee, ast.Name):
        return None
    name, _, type_name = node.callee.name.upper().partition("_")
    if name not in _OTHER_ARGUMENTS or type_name not in (*ELEMENTARY, "STRING", "WSTRING"):
        return None
    others = _OTHER_ARGUMENTS[name]
    args = [
        argument if i in others or (argument.name or "").upper() in others else _of_type(argument, type_name)
        for i, argument in enumerate(node.args)
    ]
    return replace(node, callee=replace(node.callee, name=name), args=args)


def _of_type(argument: ast.Argument, type_name: str) -> ast.Argument:
    """The argument, converted as an assignment to a variable of the type would."""
    value = argument.value
    if value is None or argument.output:
        return argument
    conversion = ast.Name(value.pos, f"{type_name}_TO_{type_name}")
    return replace(argument, value=ast.Call(value.pos, conversion, [ast.Argument(value.pos, None, value)]))
