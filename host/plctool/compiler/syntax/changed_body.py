"""Which statements differ in two versions of a file that are alike otherwise, and what statements ask others for.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

from plctool.compiler.base.source import Source
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.lexer import Lexer, Token

_SAID = frozenset((
    "OP", "EQ", "SIGN", "NUMBER", "STRING", "$END", "IF", "CASE", "FOR", "WHILE", "REPEAT", "EXIT", "CONTINUE",
    "RETURN", "TRUE", "FALSE", "NOT", "_ASSIGN", "_SEMI", "_COMMA", "_COLON", "_DOTDOT", "_LPAR", "_RPAR", "_LSQB",
    "_RSQB", "_CARET", "_DOT", "_ARROW", "_THEN", "_ELSIF", "_ELSE", "_END_IF", "_OF", "_END_CASE", "_TO", "_BY", "_DO",
    "_END_FOR", "_END_WHILE", "_UNTIL", "_END_REPEAT",
))  # fmt: skip
"""Terminals that ask for nothing that is declared."""

_ENDS_OF_PLACES = ("_RSQB", "_RPAR", "_CARET")


def changed_body(
    before: Source, old: Sequence[ast.Declaration], after: Source, new: Sequence[ast.Declaration]
) -> tuple[ast.PouDecl, ast.PouDecl] | None:
    """Returns the old and the new declaration of the only unit or member whose statements differ; None if there may be
    another difference, or if something is declared after these statements, whose line would change."""
    if not (_is_plain(before) and _is_plain(after)):
        return None
    at = _first_difference(before.text, after.text)
    if any(sign in text[at:] for sign in "{}" for text in (before.text, after.text)):
        return None
    one, other = _last_with_body(old, at), _last_with_body(new, at)
    if one is None or other is None or _outline(old) != _outline(new):
        return None
    return one, other


def _first_difference(one: str, other: str) -> int:
    """The offset up to which two versions are the same."""
    return next((at for at, (a, b) in enumerate(zip(one, other, strict=False)) if a != b), min(len(one), len(other)))


def _is_plain(source: Source) -> bool:
    return not (source.pieces or source.findings or source.lists or source.elements or source.absent) and (
        source.original is None
    )


def _last_with_body(decls: Sequence[ast.Declaration], at: int) -> ast.PouDecl | None:
    """The unit or member whose statements are the last of a text and begin at or before an offset; None if something
    is declared after their beginning."""
    unit = decls[-1] if decls else None
    if not isinstance(unit, ast.PouDecl):
        return None
    if not all(isinstance(decl, ast.PouDecl | ast.TypeDecl) for decl in decls):
        return None
    parts = [unit, *unit.members]
    last = max((part for part in parts if part.body), key=lambda part: part.body[0].pos, default=None)
    if last is None or last.body[0].pos > at or any(part.chart is not None for part in parts):
        return None
    start = last.body[0].pos
    declared = [*_starts(decls), *(place for part in parts for place in _places(part))]
    stated = [statement.pos for part in parts if part is not last for statement in part.body]
    return last if all(pos < start for pos in (*declared, *stated)) else None


def _starts(decls: Sequence[ast.Declaration]) -> list[int]:
    return [decl.pos for decl in decls if isinstance(decl, ast.PouDecl | ast.TypeDecl)]


def _places(part: ast.PouDecl) -> Iterator[int]:
    """Where a unit or member declares something."""
    yield part.pos
    for block in part.blocks:
        yield block.pos
        yield from (offset for line in block.decls for offset, _ in line.names)
    yield from (line.pos for line in part.accesses)


def _outline(decls: Sequence[ast.Declaration]) -> list[object]:
    """What is declared, as far as a change of statements could have added or removed it."""
    found: list[object] = [*_starts(decls)]
    for decl in decls:
        if isinstance(decl, ast.PouDecl):
            for part in (decl, *decl.members):
                found.append((part.keyword, part.member_key, part.attributes, bool(part.body), *_places(part)))
    return found


def words_asked_for(source: Source, decl: ast.PouDecl, local: Collection[str]) -> list[str] | None:
    """Returns the words after the beginning of the last statements of a text that may stand for something declared
    elsewhere than in the unit, each once. A member comes with what is before it. `local`: the names of the variables
    of the unit, case-folded. None if the text cannot be read."""
    errors: list[int] = []
    lexer = Lexer(source.text[decl.body[0].pos :], lambda offset, code, message: errors.append(offset))
    tokens = list(lexer)
    found: dict[str, None] = {}
    chain, begin = "", 0
    for number, token in enumerate(tokens):
        if token.type == "_SEMI":
            begin = number + 1
        if token.type in _SAID:
            continue
        word = _without_number(token.text.casefold()) if token.type == "TYPED" else token.text.casefold()
        if number and tokens[number - 1].type == "_DOT":
            if number > 1 and tokens[number - 2].type in _ENDS_OF_PLACES:
                chain = _text(tokens[begin:number])
            chain = f"{chain}.{word}"
            found[chain] = None
        else:
            chain = word
            if word not in local:
                found[word] = None
    return None if errors else list(found)


def _without_number(literal: str) -> str:
    """The type of a number; of others, such as the value of an enumeration, all of the text."""
    name, sign, value = literal.partition("#")
    return name + sign if value[:1].isdigit() or value[:1] in ("+", "-") else literal


def _text(tokens: Sequence[Token]) -> str:
    return " ".join(token.text.casefold() for token in tokens)
