"""From tokens to the syntax tree: an LALR(1) parser that recovers from errors.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from threading import get_ident
from typing import Any

from plctool.compiler.base.source import Source
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.attributes import Attributes
from plctool.compiler.syntax.automaton import Parser, Reducer, picking, shortened
from plctool.compiler.syntax.builder import Builder
from plctool.compiler.syntax.lexer import (
    KEYWORDS,
    OPENING,
    SOFT,
    Lexer,
    Report,
    Token,
    begins_unit,
    has_parts,
    is_followed_by_name,
    is_operator_function,
    meant,
    modified,
)
from plctool.compiler.syntax.plain_text import plain_text
from plctool.compiler.syntax.syntax_errors import Recovery
from plctool.compiler.syntax.tables import Rule, load_tables


def _reducer(rule: Rule, builder: Builder) -> Reducer | None:
    """How the value of a rule is made from its children; None when the only child is the value."""
    parts = rule.parts
    if rule.is_list:
        return _list_reducer(rule)
    plain = not any(spliced or index < 0 for index, spliced in parts)
    indices = [index for index, _ in parts]
    if rule.transparent and plain and len(parts) == 1:
        return None if rule.size == 1 else Reducer(lambda child: child, picking(indices))
    callback = getattr(builder, rule.callback)
    if not plain:
        return Reducer(lambda *children: callback(*_gather(children, parts)))
    return Reducer(callback, None if len(parts) == rule.size else picking(indices))


def _list_reducer(rule: Rule) -> Reducer:
    """A helper rule makes a list; one that continues a list adds to it."""
    parts = rule.parts
    if parts and parts[0] == (0, True):
        more = parts[1:]
        if len(more) == 1 and not more[0][1]:
            return Reducer(_with_one_more, picking([0, more[0][0]]))
        return Reducer(lambda *children: _extended(children[0], _gather(children, more)))
    return Reducer(lambda *children: _gather(children, parts))


def _with_one_more(found: list[Any], child: Any) -> list[Any]:
    found.append(child)
    return found


def _extended(found: list[Any], more: list[Any]) -> list[Any]:
    found += more
    return found


def _gather(children: Sequence[Any], parts: tuple[tuple[int, bool], ...]) -> list[Any]:
    found: list[Any] = []
    for index, spliced in parts:
        if spliced:
            found += children[index]
        else:
            found.append(children[index] if index >= 0 else None)
    return found


@cache
def _machine(thread: int) -> tuple[Builder, Callable[[], Parser]]:
    """The builder of a thread, which has a state, and what makes a parser for it."""
    tables, builder = load_tables(), Builder()
    reducers = [_reducer(rule, builder) for rule in tables.rules]
    gotos = shortened(tables, reducers)
    return builder, lambda: Parser(tables, reducers, gotos)


_OF_NEW = re.compile(r"\b__NEW\s*\(\s*\Z", re.IGNORECASE)
_NEAR = 100  # characters before a word that may hold __NEW and blanks
_AMBIGUOUS = SOFT | {"OP", "NOT", "NULL"}


def _decide(token: Token, parser: Parser, recovery: Recovery, text: str) -> None:
    """Gives a word that the language may have a use for the type it has where it stands."""
    kind = token.type
    if kind in ("MODIFIER", "REFUSED") and (unit := modified(token, text)) is not None:
        recovery.report_in_front(token, *unit)
        return
    if kind == "MISSPELT":
        right = meant(token, text)
        is_name = not right or parser.tables.after(parser.states, right) is None
        if not is_name:
            recovery.report_misspelt(token, right)
    elif kind == "REFUSED":
        is_name = recovery.skipping or not (token.text.startswith("_") or is_followed_by_name(token, text))
        if not is_name:
            recovery.refuse(token)
    elif kind == "NULL":
        is_name = has_parts(token, text)
    elif kind == "NOT":
        is_name = is_operator_function(token, text)
    elif kind == "OP":
        is_name = kind not in parser.tables.actions[parser.states[-1]] and is_operator_function(token, text)
    elif kind == "TEXT" and parser.tables.after(parser.states, "NUMBER") is not None:
        is_name = not _OF_NEW.search(
            text, max(0, token.pos - _NEAR), token.pos
        )  # a variable `string`, but for __NEW(STRING(80))
    elif parser.tables.after(parser.states, kind) is None:
        is_name = not begins_unit(token, text)
    else:
        is_name = kind in OPENING and not is_followed_by_name(token, text)
        is_name = is_name and parser.tables.after(parser.states, "IDENT") is not None
    if is_name:
        token.type = "IDENT"


_NAMES_ELSEWHERE = frozenset(("NULL", "CONFIGURATION"))  # variables of existing programs have these names


def _is_name_after_all(token: Token, parser: Parser, text: str) -> bool:
    """Makes a keyword that does not fit a name, after a point and where such a variable is declared or used."""
    last = parser.values[-1] if parser.values else None
    behind_point = isinstance(last, Token) and last.type == "_DOT" and KEYWORDS.get(token.text.upper()) == token.type
    if not behind_point and (token.type not in _NAMES_ELSEWHERE or is_followed_by_name(token, text)):
        return False
    token.type = "IDENT"
    return True


@dataclass
class ParsedText:
    """A text: its declarations, the attributes in it and what is declared after them, its other pragmas."""

    declarations: list[ast.Declaration]
    attributes: Attributes
    places: dict[int, str]
    pragmas: list[tuple[int, str]]


def parse(source: Source, report: Report, start: int = 0, end: int | None = None) -> list[ast.Declaration]:
    """The declarations of a text (of the part from offset `start` to `end`). Errors go to `report`."""
    return parse_all(source, report, start, end).declarations


def parse_all(
    source: Source,
    report: Report,
    start: int = 0,
    end: int | None = None,
    declared: frozenset[str] = frozenset(),
    tokens: list[Token] | None = None,
) -> ParsedText:
    """All that a text holds. `declared`: what {IF defined(pou: NAME)} finds; `tokens` takes those that have a place in
    the grammar, with the types that they have there."""
    builder, new_parser = _machine(get_ident())
    parser, taken = new_parser(), [] if tokens is None else tokens
    recovery = Recovery(parser, taken, source, report)
    lexer = Lexer(source.text, recovery.report_token, start, end, declared, made=bool(source.pieces))
    places: dict[int, str] = {}
    builder.source, builder.attributes, builder.places, builder.report = source, lexer.attributes, places, report
    builder.repeated = lexer.repeated
    coming, text = iter(lexer), plain_text(source.text, strings=True)
    while (token := next(coming, None) if recovery.skipping else parser.run(coming, taken, _AMBIGUOUS)) is not None:
        if token.type in _AMBIGUOUS:
            _decide(token, parser, recovery, text)
            if token.type == "LEFT_OUT":
                continue
        if recovery.skipping and not recovery.resume(token):
            continue
        if parser.feed(token) or (_is_name_after_all(token, parser, text) and parser.feed(token)):
            taken.append(token)
        else:
            recovery.handle(token)
    result = parser.values[0] if len(parser.values) == 1 else []
    return ParsedText(result if isinstance(result, list) else [], lexer.attributes, places, lexer.pragmas)
