"""The words that say more about a declaration, and those that begin a section, are the same for the lexer and for the
syntax tree."""

from __future__ import annotations

from plctool.compiler.syntax.ast import Edge, Modifier, Operator, Section
from plctool.compiler.syntax.lexer import KEYWORDS


def words(*tokens: str) -> set[str]:
    return {word for word, token in KEYWORDS.items() if token in tokens}


def test_every_modifier_and_qualifier_of_the_grammar_is_known() -> None:
    assert words("MODIFIER", "QUALIFIER") == {word.value for word in Modifier} - {Modifier.CLASS}


def test_every_section_of_the_grammar_is_known() -> None:
    assert words("VAR", "GLOBAL") == {word.value for word in Section} - {Section.STEP}


def test_every_operator_and_edge_of_the_grammar_is_known() -> None:
    assert words("EDGE") == {word.value for word in Edge}
    assert words("OP", "NOT") == {word.value for word in Operator if word.value.isidentifier()}
