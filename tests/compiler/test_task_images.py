"""What the compiler finds out about the inputs and outputs that tasks use: parts to copy, outputs that two of them
write."""

from __future__ import annotations

from pathlib import Path

import pytest

from plctool.compiler import compile_sources
from plctool.compiler.image.build import BuildResult
from plctool.compiler.syntax.warnings import warning_options
from plctool.image.file import NO_PARTS, ImagePart, parse_image

GLOBALS = """
VAR_GLOBAL
    bit0 AT %QX0.0 : BOOL; bit1 AT %QX0.1 : BOOL; far AT %QX20.3 : BOOL;
    word AT %QW4 : WORD;
    table AT %QB32 : ARRAY[0..15] OF BYTE;
    in AT %IW1 : INT; far_in AT %IB40 : BYTE;
    n : INT; pointer : POINTER TO WORD;
END_VAR
FUNCTION Sum : INT VAR_INPUT a : INT; END_VAR Sum := a + far_in; END_FUNCTION
FUNCTION Increase : INT VAR_IN_OUT w : WORD; END_VAR w := w OR 1; END_FUNCTION
"""
UNUSED = ImagePart()


def compiled(tmp_path: Path, one: str, two: str = "", declarations: str = "", **options: object) -> BuildResult:
    """Two tasks with these bodies; only one without the second."""
    second = "TASK B(INTERVAL := T#5ms, PRIORITY := 3); PROGRAM P2 WITH B : Two;" if two else ""
    text = f"""{GLOBALS}{declarations}
PROGRAM One VAR i : INT; END_VAR
    {one}
END_PROGRAM
PROGRAM Two VAR i : INT; END_VAR
    {two};
END_PROGRAM
CONFIGURATION C RESOURCE R ON D
    TASK A(INTERVAL := T#1ms, PRIORITY := 1); PROGRAM P1 WITH A : One; {second}
END_RESOURCE END_CONFIGURATION
"""
    path = tmp_path / "program.st"
    path.write_text(text)
    return compile_sources([path], **options)  # type: ignore[arg-type]


def parts(tmp_path: Path, one: str, two: str = "", declarations: str = "") -> list[tuple[ImagePart, ImagePart]]:
    return [task.parts for task in parse_image(compiled(tmp_path, one, two, declarations).image).tasks]


def test_a_program_without_inputs_and_outputs_says_nothing(tmp_path: Path) -> None:
    assert parts(tmp_path, "n := n + 1;", "n := n - 1") == [NO_PARTS, NO_PARTS]


def test_what_one_task_uses_is_shared_with_none(tmp_path: Path) -> None:
    (found,) = parts(tmp_path, "bit0 := in > 3; far := bit1;")
    assert found == (ImagePart(0, 1), ImagePart(0, 3, written=True))


def test_parts_that_do_not_overlap_are_not_shared(tmp_path: Path) -> None:
    one, two = parts(tmp_path, "bit0 := in > 3;", "far := far_in > 3")
    assert one == (ImagePart(0, 1), ImagePart(0, 1, written=True))
    assert two == (ImagePart(5, 1), ImagePart(2, 1, written=True))


def test_parts_that_overlap_are_shared_and_reading_is_no_writing(tmp_path: Path) -> None:
    one, two = parts(tmp_path, "bit0 := TRUE;", "IF bit1 AND far THEN n := in; END_IF")
    assert one == (UNUSED, ImagePart(0, 1, written=True, shared=True))
    assert two == (ImagePart(0, 1), ImagePart(0, 3, shared=True))


def test_what_is_called_counts(tmp_path: Path) -> None:
    one, two = parts(tmp_path, "n := Sum(1);", "n := far_in")
    assert one == (ImagePart(5, 1, shared=True), UNUSED) and two == one


def test_a_task_may_write_inputs(tmp_path: Path) -> None:
    one, two = parts(tmp_path, "in := 5;", "n := in")
    assert one == (ImagePart(0, 1, written=True, shared=True), UNUSED)
    assert two == (ImagePart(0, 1, shared=True), UNUSED)


def test_an_array_counts_as_a_whole(tmp_path: Path) -> None:
    (found,) = parts(tmp_path, "table[i MOD 16] := 1;")
    assert found == (UNUSED, ImagePart(4, 2, written=True))


KEEP = """
TYPE Holder : STRUCT p : POINTER TO WORD; r : REFERENCE TO WORD; END_STRUCT; END_TYPE
VAR_GLOBAL keep : Holder; END_VAR
"""


@pytest.mark.parametrize("take", ["keep.p := ADR(word);", "keep.r REF= word;", "i := Increase(word);"])
def test_an_address_leads_to_all_of_the_area(tmp_path: Path, take: str) -> None:
    one, two = parts(tmp_path, f"{take} table[3] := 7;", "far := NOT far", KEEP)
    assert one[1] == ImagePart(0, 6, written=True, shared=True)
    assert two[1] == ImagePart(2, 1, written=True, shared=True)


def test_an_address_that_another_task_may_use_keeps_all_on_the_shared_area(tmp_path: Path) -> None:
    found = parts(tmp_path, "pointer := ADR(word); n := in;", "pointer^ := 5; n := in")
    assert [outputs for _, outputs in found] == [UNUSED, UNUSED]
    assert [inputs for inputs, _ in found] == [ImagePart(0, 1, shared=True)] * 2


def test_an_address_taken_by_the_initialisation_keeps_all_on_the_shared_area(tmp_path: Path) -> None:
    declarations = "VAR_GLOBAL early : POINTER TO WORD := ADR(word); END_VAR"
    assert parts(tmp_path, "early^ := 1; bit0 := TRUE;", "bit1 := TRUE", declarations) == [NO_PARTS, NO_PARTS]


# ---- warnings ----


def warnings(tmp_path: Path, one: str, two: str, declarations: str = "", **options: object) -> list[str]:
    found = compiled(tmp_path, one, two, declarations, **options).warnings
    return [w.message for w in found if w.code == "shared-output"]


@pytest.mark.parametrize(
    ("one", "two", "name"),
    [
        ("bit0 := TRUE;", "bit0 := FALSE", "bit0"),
        ("bit0 := TRUE;", "%QB0 := 3", "%QB0"),
        ("%QX0.1 := TRUE;", "bit1 := FALSE", "bit1"),
        ("word.3 := TRUE;", "word.3 := FALSE", "word"),
        ("word := 1;", "word.3 := FALSE", "word"),
        ("i := Increase(word);", "%QX8.0 := TRUE", "%QX8.0"),
        ("table[i MOD 16] := 1;", "table[2] := 1", "table"),
        ("FOR word := 1 TO 3 DO ; END_FOR", "word := 1", "word"),
    ],
)
def test_two_tasks_that_write_one_bit_are_warned_of(tmp_path: Path, one: str, two: str, name: str) -> None:
    (message,) = warnings(tmp_path, one, two)
    assert message.startswith(f"{name} is written by the task B, and by A in line ")
    assert warnings(tmp_path, one, two, warnings=warning_options(["shared-output"])) == []


@pytest.mark.parametrize(
    ("one", "two"),
    [
        ("bit0 := TRUE;", "bit1 := FALSE"),
        ("%QX0.4 := TRUE;", "%QX1.0 := FALSE"),
        ("%QX0.7 := TRUE;", "%QX1.6 := FALSE"),
        ("word.3 := TRUE;", "word.4 := FALSE"),
        ("table[1] := 1;", "table[2] := 1"),
        ("bit0 := TRUE;", "n := BOOL_TO_INT(bit0)"),
        ("in := 1;", "in := 2"),
        ("n := 1;", "n := 2"),
    ],
)
def test_different_bits_and_what_is_no_output_are_not(tmp_path: Path, one: str, two: str) -> None:
    assert warnings(tmp_path, one, two) == []


def test_the_attribute_says_that_it_is_meant(tmp_path: Path) -> None:
    shared = "VAR_GLOBAL {attribute 'shared_output'} both AT %QX9.0 : BOOL; END_VAR"
    plain = "VAR_GLOBAL both AT %QX9.0 : BOOL; END_VAR"
    assert warnings(tmp_path, "both := TRUE;", "both := FALSE", shared) == []
    assert len(warnings(tmp_path, "both := TRUE;", "both := FALSE", plain)) == 1
