"""Blanks between two tokens of a line, and where a line that is too long may be broken.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Sequence

from plctool.fmt.lines import DECLARATION, LABEL
from plctool.fmt.scan import Item

_VALUES = frozenset((
    "IDENT", "NUMBER", "TYPED", "STRING", "DIRECT", "TRUE", "FALSE", "NULL", "_RPAR", "_RSQB", "_CARET",
))  # fmt: skip
"""Types of tokens that end an operand."""
_CALLED = frozenset(("IDENT", "NUMBER", "TEXT", "_RPAR", "_RSQB", "_CARET", "_CATCH"))
"""Types of tokens that a parenthesis follows without a blank."""
_INDEXED = _CALLED | {"ARRAY"}
_ATTACHED = frozenset(("_SEMI", "_COMMA", "_RPAR", "_RSQB", "_CARET", "_DOTDOT"))
_BEFORE_EMPTY = frozenset(("_COLON", "_THEN", "_DO", "_OF", "_ELSE", "REPEAT"))
"""Types of tokens after which a semicolon is an empty statement."""
_OF_DATES = "0123456789:._-"  # characters that a date would go on with
_COMPARISONS = frozenset(("=", "<>", "<", ">", "<=", ">="))


def is_unary(items: Sequence[Item], at: int) -> bool:
    """True for a sign before an operand."""
    return items[at].type == "SIGN" and items[at - 1].type not in _VALUES


def has_blank(items: Sequence[Item], at: int, first: int, kind: str) -> bool:
    """True if a blank stands before token `at` of a line of this kind whose first token is `first`."""
    previous, item = items[at - 1], items[at]
    if item.type == "_SEMI" and previous.type in _BEFORE_EMPTY:
        return True
    if item.type in _ATTACHED:
        return item.type == "_DOTDOT" and previous.type == "TYPED" and previous.text[-1] in _OF_DATES
    if previous.type in ("_LPAR", "_LSQB", "_DOT", "_DOTDOT"):
        return False
    if kind == DECLARATION and any(_is_around_constants(items, i, first) for i in (at - 1, at)):
        return items[at].type == "_ASSIGN"
    if item.type == "_DOT":
        return previous.type == "NUMBER" or previous.type not in _VALUES
    if item.type == "_LPAR":
        return previous.type not in _CALLED
    if item.type == "_LSQB":
        return previous.type not in _INDEXED
    if item.type == "_COLON":
        return kind != LABEL
    if item.type == "EQ":
        return not _is_assigning_word(items, at - 1, first)
    if previous.type == "SIGN" and is_unary(items, at - 1):
        return item.type == "SIGN"
    return True


def _is_around_constants(items: Sequence[Item], at: int, first: int) -> bool:
    """True for < and > of a type, `Fifo<10>`: no operator stands between the colon and the initial value."""
    if items[at].type != "OP" or items[at].text not in ("<", ">"):
        return False
    depth, types = 0, [item.type for item in items[first:at]]
    for kind in types:
        depth += (kind in ("_LPAR", "_LSQB")) - (kind in ("_RPAR", "_RSQB"))
    return depth == 0 and "_COLON" in types and "_ASSIGN" not in types


def _is_assigning_word(items: Sequence[Item], at: int, first: int) -> bool:
    """True for S of `a S= b` and REF of `a REF= b`: a name after an operand."""
    return at > first and items[at].type == "IDENT" and items[at - 1].type in _VALUES | {"TEXT"}


def break_weight(items: Sequence[Item], at: int) -> int | None:
    """How strongly the line holds together before token `at`; None where it is not broken. A list is broken first at
    its commas, a condition at its OR."""
    if items[at - 1].type == "_COMMA":
        return 0
    item = items[at]
    if item.type == "EQ" and items[at - 1].type in _VALUES:
        return 3
    if item.type == "SIGN" and not is_unary(items, at):
        return 4
    if item.type != "OP" or items[at - 1].type not in _VALUES:
        return None
    if item.text in ("OR", "XOR", "OR_ELSE"):
        return 1
    if item.text in ("AND", "AND_THEN", "&"):
        return 2
    return 3 if item.text in _COMPARISONS else 5
