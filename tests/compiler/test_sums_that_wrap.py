"""A warning where a result below 32 bits may have wrapped before it is divided, compared, or becomes a wider type."""

from __future__ import annotations

from pathlib import Path

import pytest

from plctool.compiler import compile_sources

VARIABLES = "i, j : INT; u : USINT; w : WORD; d, e : DINT; l : LINT; r : REAL; lr : LREAL; b : BOOL; s : INT(0..100);"


def codes(folder: Path, statement: str, dialect: str | None = None) -> list[str]:
    (folder / "m.st").write_text(f"PROGRAM Main\nVAR {VARIABLES} END_VAR\n{statement}\nEND_PROGRAM\n")
    return [w.code for w in compile_sources([folder], dialect=dialect).warnings if w.line == 3]


@pytest.mark.parametrize(
    ("statement", "code"),
    [
        ("i := i * 100 / 27648;", "wrap"),
        ("u := (u + u) / 2;", "wrap"),
        ("i := -(i - j) MOD 7;", "wrap"),
        ("b := (w + 1) = w;", "wrap"),
        ("b := i < j - 1;", "wrap"),
        ("d := i + j;", "widening"),
        ("d := i - 1;", "widening"),
        ("d := i * j;", "widening"),
        ("w := u + u;", "widening"),
        ("l := d * e;", "widening"),
        ("r := i * 3;", "widening"),
        ("b := i + 1 > d;", "widening"),
        ("b := i + i > 40000;", "always"),
        ("i := (i + 100) MOD j;", "wrap"),
        ("i := (i + j) MOD 8;", "wrap"),
        ("i := (i * 2) MOD 8;", "wrap"),
        ("i := (i + 1) / j;", "wrap"),
        ("w := (w - 1) MOD 8;", "wrap"),
    ],
)
def test_one_cause_gets_one_warning_where_results_wrap(tmp_path: Path, statement: str, code: str) -> None:
    assert codes(tmp_path, statement) == [code]
    assert codes(tmp_path, statement, "codesys") == ([code] if statement == "l := d * e;" else [])


@pytest.mark.parametrize(
    "statement",
    [
        "i := i + 1;", "d := d + 1;", "b := d + 1 > e;", "b := s * 2 > 5;", "i := s * 100 / 3;", "d := s + s;",
        "b := (i AND 15) + 1 > j;", "d := INT_TO_DINT(i) * 100;", "i := i / 2 * 3;", "b := i MOD 10 + 1 = j;",
        "i := (i + 1) MOD 8;", "i := (1 + i) MOD j;", "i := (i - 1) MOD 8;", "u := (u + 2) MOD 10;",
        "w := (w + 1) MOD 8;",
    ],
)  # fmt: skip
def test_results_that_fit_or_wrap_on_purpose_are_silent(tmp_path: Path, statement: str) -> None:
    assert codes(tmp_path, statement) == []


@pytest.mark.parametrize(
    "statement",
    ["r := i / 27648 * 100;", "r := 100 * (i / 27648);", "lr := i / 27648 * 100.0;", "r := -(i / j * 2) + 1;"],
)
@pytest.mark.parametrize("dialect", [None, "codesys"])
def test_a_quotient_that_is_computed_further_loses_its_fraction(
    tmp_path: Path, statement: str, dialect: str | None
) -> None:
    assert codes(tmp_path, statement, dialect) == ["integer-division"]
