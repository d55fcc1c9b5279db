"""The words that say more about a declaration are the same for the lexer and for the syntax tree."""

from __future__ import annotations

from plctool.compiler.syntax.ast import Modifier
from plctool.compiler.syntax.lexer import KEYWORDS


def test_every_modifier_and_qualifier_of_the_grammar_is_known() -> None:
    written = {word for word, token in KEYWORDS.items() if token in ("MODIFIER", "QUALIFIER")}
    assert written == {word.value for word in Modifier} - {Modifier.CLASS}
