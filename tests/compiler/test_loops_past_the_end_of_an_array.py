"""A FOR that goes past the end of an array for certain is a warning, and no other is."""

from __future__ import annotations

import pytest
from front_support import check, main
from hypothesis import given
from hypothesis import strategies as st

VARIABLES = "a : ARRAY[1..10] OF INT; i, n, last : INT; s : SINT; p : POINTER TO INT;"
small = st.integers(-15, 15)


def said(body: str, variables: str = VARIABLES) -> list[str]:
    return [d.message for d in check(main(variables, body)).diagnostics if d.code == "index"]


@given(small, small, st.integers(-3, 3).filter(bool), st.integers(-3, 3), small, st.integers(0, 20))
def test_the_warning_comes_where_the_loop_would_stop(
    first: int, stop: int, step: int, more: int, low: int, size: int
) -> None:
    text = f"FOR i := {first} TO {stop} BY {step} DO n := n + a[i {'+-'[more < 0]} {abs(more)}]; END_FOR;"
    reached = [value + more for value in range(first, stop + (1 if step > 0 else -1), step)]
    outside = [index for index in reached if not low <= index <= low + size]
    found = said(text, f"a : ARRAY[{low}..{low + size}] OF INT; i, n : INT;")
    assert bool(found) is bool(outside)
    assert all(int(message.split("index ")[1].split(",")[0]) in outside for message in found)


@pytest.mark.parametrize(
    "body",
    [
        "FOR i := 0 TO 10 DO IF i > 0 THEN a[i] := 1; END_IF; END_FOR;",
        "FOR i := 0 TO 10 DO IF i = 0 THEN CONTINUE; END_IF; a[i] := 1; END_FOR;",
        "FOR i := 1 TO 99 DO IF i > 10 THEN EXIT; END_IF; a[i] := 1; END_FOR;",
        "FOR i := 1 TO 99 DO a[i] := 1; IF i = 10 THEN RETURN; END_IF; END_FOR;",
        "FOR i := 0 TO last DO a[i] := 1; END_FOR;",
        "FOR i := 0 TO 10 DO n := SEL(i > 0 AND_THEN a[i] = 2, 1, 2); END_FOR;",
        "FOR i := 0 TO 10 DO i := MAX(i, 1); a[i] := 1; END_FOR;",
        "FOR i := 0 TO 10 DO p := ADR(i); p^ := 1; a[i] := 1; END_FOR;",
        "FOR i := 0 TO 20 DO a[i MOD 10 + 1] := 1; END_FOR;",
        "FOR i := 0 TO 9 DO a[last + 1] := 1; END_FOR;",
        "FOR s := 120 TO 127 DO a[s + 127] := 1; END_FOR;",  # wraps, so it is not known here
        "__TRY FOR i := 0 TO 10 DO __TRY a[i] := 1; __CATCH __ENDTRY END_FOR; __CATCH __ENDTRY",
    ],
)
def test_what_may_stay_within_is_no_warning(body: str) -> None:
    assert said(body) == []


@pytest.mark.parametrize(
    ("body", "index"),
    [
        ("FOR i := 0 TO 10 DO IF a[i] = 5 THEN EXIT; END_IF; END_FOR;", 0),
        ("FOR i := 1 TO 11 DO n := n + ABS(a[i]); END_FOR;", 11),
        ("FOR i := 1 TO 10 DO n := n + 1; IF n > 5 THEN a[i - 1] := 0; END_IF; a[i + 1] := 0; END_FOR;", 11),
        ("FOR i := 10 TO 0 BY -1 DO a[i] := 0; END_FOR;", 0),
    ],
)
def test_what_every_iteration_does_counts(body: str, index: int) -> None:
    assert said(body) == [f"the loop comes to the index {index}, outside of 1..10"]
