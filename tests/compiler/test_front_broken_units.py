"""After a syntax error in one unit the others are checked; what may follow from it is not said."""

from __future__ import annotations

import pytest
from front_support import messages

BROKEN = "FUNCTION_BLOCK Broken\nVAR_OUTPUT level INT; END_VAR\nlevel := 1;\nEND_FUNCTION_BLOCK\n"
OTHER = "PROGRAM Main\nVAR n : INT; b : Broken; END_VAR\nn := wrong;\nn := TRUE;\n{more}END_PROGRAM\n"
SAID = ["2:17: expected :", "7:6: unknown name wrong", "8:6: BOOL does not fit INT; write BOOL_TO_INT(...)"]


def test_errors_of_other_units_are_said_with_it() -> None:
    assert messages(BROKEN + OTHER.format(more="")) == SAID


@pytest.mark.parametrize(
    "line", ["b();", "n := b.level;", "n := b.level + wrong2;", "n := level;", "b.level := TRUE;", "b(level => n);"]
)
def test_what_may_follow_from_it_is_not(line: str) -> None:
    found = messages(BROKEN + OTHER.format(more=line + "\n"))
    assert [m for m in found if "wrong2" not in m] == SAID


def test_globals_and_types_that_were_not_read_are_not_missing() -> None:
    text = "VAR_GLOBAL\ng-h : INT;\nEND_VAR\nTYPE Color : (red, green;\nEND_TYPE\n"
    main = "PROGRAM Main VAR c : Color; d : Colour; END_VAR\nc := red;\ng := 1;\nx := 2;\nEND_PROGRAM\n"
    found = messages(text + main)
    assert [m for m in found[2:] if "red" in m or ": g" in m] == []
    assert any("Colour" in m for m in found) and any("unknown name x" in m for m in found)


def test_the_unit_before_the_place_of_the_error_may_be_the_broken_one() -> None:
    text = "FUNCTION_BLOCK A\nVAR_OUTPUT q : INT; END_VAR\nq := 0;\n"
    main = (
        "PROGRAM Main VAR a : A; n : INT; END_VAR\nn := a.q;\nEND_PROGRAM\nPROGRAM P VAR m : INT; END_VAR\nm := 'x';\n"
    )
    found = messages(text + main + "END_PROGRAM\n")
    assert found[0] == "4:1: END_FUNCTION_BLOCK missing for the FUNCTION_BLOCK in line 1"
    assert [m.partition(":")[0] for m in found[1:]] == ["8"]
