"""`run --trace`: a column for each variable, by whatever names it was asked for, and a cell for each row."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import pytest

MAIN = """
FUNCTION_BLOCK Adder
VAR_IN_OUT io : INT; END_VAR
io := io + 1;
END_FUNCTION_BLOCK
TYPE Point : STRUCT x : INT := 4; y : INT; END_STRUCT; END_TYPE
PROGRAM Main
VAR
    i : INT; a : ARRAY[1..3] OF INT := [1, 2, 3]; acc : Adder; ref : REFERENCE TO INT; p : REFERENCE TO Point;
    point : Point;
END_VAR
i := i + 1;
IF i > 1 THEN acc(io := a[1]); ref REF= a[2]; p REF= point; END_IF;
END_PROGRAM
"""


@pytest.fixture
def program(tool: Any, scratch: Path) -> Path:
    (scratch / "main.st").write_text(MAIN)
    assert tool("build", "main.st").status == 0
    return scratch


@pytest.mark.parametrize(
    ("names", "columns"),
    [
        ("Main.a[3] Main.a", "Main.a[3] Main.a[1] Main.a[2]"),
        ("Main.a Main.a[ 3 ]", "Main.a[1] Main.a[2] Main.a[3]"),
        ("Main.i main.I", "Main.i"),
        ("Main.point.x Main.POINT.X", "Main.point.x"),
        ("main.A Main.a", "Main.a[1] Main.a[2] Main.a[3]"),
        ("Main.i Main.?", "Main.i Main.a[1] Main.a[2] Main.a[3] Main.p.x Main.p.y"),
    ],
)
def test_a_variable_has_one_column_where_it_is_named_first(tool: Any, program: Path, names: str, columns: str) -> None:
    words = names.replace("[ 3 ]", "[_3_]").split()
    done = tool("run", "app.cdl", "--trace", *(word.replace("_", " ") for word in words), "-o", "-")
    header, values = csv.reader(done.out.splitlines())
    assert header == ["time_ms", *columns.split()]
    assert len(values) == len(header)


def test_a_reference_within_a_block_is_followed(tool: Any, program: Path) -> None:
    done = tool("run", "app.cdl", "--cycles", "2", "--trace", "Main.acc", "-o", "-")
    assert done.out == "time_ms,Main.acc.io\n0,\n10,2\n"


def test_what_is_not_bound_yet_is_an_empty_cell(tool: Any, program: Path) -> None:
    done = tool("run", "app.cdl", "--cycles", "3", "--trace", "Main.*", "-o", "-")
    rows = list(csv.DictReader(done.out.splitlines()))
    assert [(row["Main.acc.io"], row["Main.ref"]) for row in rows] == [("", ""), ("2", "2"), ("3", "2")]
    assert [row["Main.i"] for row in rows] == ["1", "2", "3"]


def test_a_real_that_is_no_number_is_a_word(tool: Any, scratch: Path) -> None:
    (scratch / "main.st").write_text("PROGRAM Main VAR r : REAL; list : ARRAY[1..2] OF LREAL; END_VAR END_PROGRAM")
    assert tool("build", "main.st").status == 0
    values = ("--set", "Main.r=NaN", "--set", "Main.list=[Infinity, -Infinity]")
    done = tool("run", "app.cdl", *values, "--get", "Main.*", "--json")
    assert done.json["values"] == {"Main.r": "NaN", "Main.list": ["Infinity", "-Infinity"]}
    assert tool("run", "app.cdl", *values, "--get", "Main.*").out.startswith("Main.r = NaN\nMain.list = [Infinity, -")
    traced = tool("run", "app.cdl", *values, "--trace", "Main.*", "-o", "-")
    assert traced.out.splitlines()[1] == "0,NaN,Infinity,-Infinity"


def test_members_that_are_ours_have_no_column(tool: Any, scratch: Path) -> None:
    (scratch / "main.st").write_text(
        "INTERFACE IPump METHOD Go END_METHOD END_INTERFACE\n"
        "FUNCTION_BLOCK Pump IMPLEMENTS IPump VAR n : INT; END_VAR METHOD Go n := 1; END_METHOD END_FUNCTION_BLOCK\n"
        "PROGRAM Main VAR p : ARRAY[1..2] OF Pump; m AT %MW0 : INT; END_VAR p[1].Go(); END_PROGRAM\n"
    )
    assert tool("build", "main.st").status == 0
    for names, columns in ((["Main.p"], "Main.p[1].n,Main.p[2].n"), (["Main.p[1]", "%MW0"], "Main.p[1].n,%MW0")):
        done = tool("run", "app.cdl", "--trace", *names, "-o", "-")
        assert done.out.splitlines()[0] == f"time_ms,{columns}", done.err
