"""The comment about a declaration is the same in an editor as on the pages of `plctool doc`."""

from __future__ import annotations

import pytest

from plctool.doc.comments import comments_in


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("// above\nx : INT;", "above"),
        ("x : INT; // beside", "beside"),
        ("x : INT; (* beside *) y : INT;", "beside"),
        ("(* above *)\nx : INT; // beside", "above"),
        ("(* nested (* inner *) outer *)\n{attribute 'a'}\nx : INT;", "nested (* inner *) outer"),
        ("(* far *)\n\nx : INT;", ""),
        ("y : INT; // of y\nx : INT;", ""),
        ("// fmt: skip\nx : INT;", ""),
        ("(* about *)\nTYPE\nx : INT;", "about"),
        ("s : STRING := '// none'; x : INT;", ""),
        ("x : INT; (* open", "open"),
    ],
)
def test_a_comment_stands_above_or_at_the_end_of_the_line(text: str, said: str) -> None:
    assert comments_in(text).of_line(text.index("x : ")) == said
