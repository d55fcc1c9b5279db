"""In the dialects of CODESYS and TwinCAT narrow integers are computed in 32 bits; elsewhere in their own type."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import pytest

from plctool import Simulator
from plctool.compiler import CompileError, compile_sources
from plctool.compiler.base.level import Level
from plctool.iec.dialect import DIALECTS

VENDORS = ["codesys", "twincat"]
VARIABLES = """
    w : WORD := 65535; z : WORD; i : INT := 30000; raw : INT := 20000; least : INT := -32768; u : USINT := 200;
    ui : UINT := 65535; by : BYTE := 200; hundred : BYTE := 100; large : DWORD := 16#80000000;
    huge : ULINT := 16#8000000000000000; yes : BOOL := TRUE; si : SINT := 127;
"""
# type and expression, with 32 bits, in the type of the operands; the first three are of both manuals
CASES: list[tuple[str, str, Any, Any]] = [
    ("DWORD", "w + 1", 65536, 0),
    ("BOOL", "(w + 1) = z", False, True),
    ("BOOL", "(z - 1) = w", False, True),
    ("BOOL", "TO_WORD(w + 1) = z", True, True),
    ("BOOL", "WORD_TO_WORD(z - 1) = w", True, True),
    ("BOOL", "TO_USINT(USINT#0 - 1) <> 255", False, False),
    ("INT", "raw * 100 / 27648", 72, -1),
    ("DINT", "raw * 100", 2000000, -31616),
    ("USINT", "(u + u) / 2", 200, 72),
    ("INT", "(i + raw) / 2", 25000, -7768),
    ("INT", "(i + raw) MOD 7", 50000 % 7, -(15536 % 7)),
    ("BOOL", "i + i > 40000", True, False),
    ("BOOL", "u + u > 255", True, False),
    ("WORD", "by + hundred", 300, 44),
    ("BYTE", "by + hundred", 44, 44),
    ("DINT", "-least", 32768, -32768),
    ("DINT", "least / -1", 32768, -32768),
    ("DINT", "-(i + i)", -60000, 5536),
    ("DINT", "ABS(i - (-i))", 60000, 5536),
    ("DINT", "MAX(i + i, 5)", 60000, 5),
    ("DINT", "MIN(i + i, i)", 30000, -5536),
    ("DINT", "LIMIT(0, i + i, 30001)", 30001, 0),
    ("DINT", "SEL(yes, 0, i + i)", 60000, -5536),
    ("DINT", "MUX(1, 0, i + i, 5)", 60000, -5536),
    ("DINT", "ADD(i, i, i)", 90000, 24464),
    ("DINT", "MUL(raw, 100)", 2000000, -31616),
    ("LREAL", "i + i", 60000.0, -5536.0),
    ("LREAL", "INT_TO_LREAL(i + i)", 60000.0, -5536.0),
    ("LREAL", "EXPT(i + i, 2)", 3.6e9, 30647296.0),
    ("UDINT", "ui * ui", 4294836225, 1),
    ("LINT", "ui * ui", 4294836225, 1),
    ("LINT", "ui * ui - i", 4294806225, -29999),
    ("LINT", "z - 1", -1, 65535),
    ("ULINT", "ui + 1", 65536, 0),
    ("BOOL", "large > w + 1", True, True),
    ("BOOL", "huge > ui + 1", True, True),
    ("DWORD", "(w + 1) AND 16#1FFFF", 65536, 0),
    ("WORD", "SHR(w + 1, 1)", 0, 0),
    ("WORD", "NOT w", 0, 0),
    ("DWORD", "NOT z", 65535, 65535),
    ("DINT", "si + si", 254, -2),
    ("DINT", "ten(i + i)", -55360, -55360),
]  # fmt: skip


def program_of(cases: list[tuple[str, str, Any, Any]]) -> str:
    declared = "".join(f"r{n} : {t};\n" for n, (t, *_) in enumerate(cases))
    body = "".join(f"r{n} := {expression};\n" for n, (_, expression, *_) in enumerate(cases))
    ten = "FUNCTION ten : DINT\nVAR_INPUT x : INT; END_VAR\nten := 10 * INT_TO_DINT(x);\nEND_FUNCTION\n"
    return f"{ten}PROGRAM Main\nVAR\n{VARIABLES}\n{declared}END_VAR\n{body}END_PROGRAM\n"


@pytest.mark.parametrize("level", [0, 1, 2, 3, "s"])
@pytest.mark.parametrize("dialect", [None, *DIALECTS])
def test_only_assignments_and_conversions_cut_results(tmp_path: Path, dialect: str | None, level: Level) -> None:
    (tmp_path / "m.st").write_text(program_of(CASES))
    with Simulator.from_sources(tmp_path, dialect=dialect, level=level) as plc:
        plc.run_cycles(1)
        found = [plc.read(f"Main.r{n}") for n in range(len(CASES))]
    wanted = [case[2] if dialect in VENDORS else case[3] for case in CASES]
    wrong = [(case[1], got, want) for case, got, want in zip(CASES, found, wanted, strict=True) if got != want]
    assert not wrong


def test_constants_have_the_values_of_the_running_program(tmp_path: Path) -> None:
    constants = VARIABLES.replace("z : WORD;", "z : WORD := 0;")
    text = program_of(CASES).replace(f"VAR\n{VARIABLES}", f"VAR CONSTANT\n{constants}\nEND_VAR\nVAR\n")
    (tmp_path / "m.st").write_text(text)
    with Simulator.from_sources(tmp_path, dialect="codesys") as plc:
        plc.run_cycles(1)
        found = [plc.read(f"Main.r{n}") for n in range(len(CASES))]
    wrong = [(case[1], got) for case, got in zip(CASES, found, strict=True) if got != case[2]]
    assert not wrong


def test_choices_and_indices_take_the_whole_result(tmp_path: Path) -> None:
    (tmp_path / "m.st").write_text(
        "PROGRAM Main\nVAR i : INT := 30000; u : USINT := 200; chosen : INT; list : ARRAY[0..400] OF INT; END_VAR\n"
        "CASE i + i OF\n60000: chosen := 1;\n-5536: chosen := 2;\nEND_CASE\nlist[u + u] := 7;\nEND_PROGRAM\n"
    )
    with Simulator.from_sources(tmp_path, dialect="twincat") as plc:
        plc.run_cycles(1)
        assert (plc.read("Main.chosen"), plc.read("Main.list[400]")) == (1, 7)


def test_an_exception_names_the_index_and_a_subrange_is_checked_whole(tmp_path: Path) -> None:
    for body, wanted in (("a[i + 1] := 1;", "the index of Main.a is 6"), ("s := i * 13108;", "65540")):
        (tmp_path / "m.st").write_text(
            f"PROGRAM Main\nVAR i : INT := 5; a : ARRAY[0..5] OF INT; s : INT(0..100); END_VAR\n{body}\nEND_PROGRAM\n"
        )
        with Simulator.from_sources(tmp_path, dialect="codesys") as plc, pytest.raises(Exception, match=wanted):
            plc.run_cycles(1)


def test_ordinary_arithmetic_gets_no_new_warning(tmp_path: Path) -> None:
    (tmp_path / "m.st").write_text(
        "PROGRAM Main\nVAR i : INT; u : USINT; w : WORD; d : DINT; r : REAL; END_VAR\n"
        "i := i + 1; u := u * 2 - u; w := (w + 1) AND 16#FF; d := d + i * 100; r := i * 3; i := -i;\n"
        "IF i + 1 > 40000 THEN i := 0; END_IF\nEND_PROGRAM\n"
    )
    assert compile_sources([tmp_path], dialect="codesys").warnings == []


def test_a_constant_that_does_not_fit_is_said_to_be_cut(tmp_path: Path) -> None:
    (tmp_path / "m.st").write_text(
        "PROGRAM Main\nVAR CONSTANT a : INT := 30000; END_VAR\nVAR i : INT; d : DINT; END_VAR\n"
        "d := a + a;\ni := a + a;\nEND_PROGRAM\n"
    )
    (warning,) = compile_sources([tmp_path], dialect="codesys").warnings
    assert (warning.line, warning.code) == (5, "narrowing") and "60000" in warning.message


def test_a_wrong_operand_is_named_once(tmp_path: Path) -> None:
    (tmp_path / "m.st").write_text("PROGRAM Main\nVAR i : INT; END_VAR\ni := MAX(i + i, 'text');\nEND_PROGRAM\n")
    with pytest.raises(CompileError) as caught:
        compile_sources([tmp_path], dialect="codesys")
    assert str(caught.value).count("error:") == 1


# ---- random expressions against a model ----

LIMITS = {"SINT": (-128, 127), "USINT": (0, 255), "INT": (-32768, 32767), "UINT": (0, 65535), "BYTE": (0, 255)}


def random_expression(rng: random.Random, values: dict[str, int], depth: int) -> tuple[str, int]:
    """An expression and its value; all that is in between fits DINT."""
    if depth == 0:
        name = rng.choice([*values])
        return name, values[name]
    while True:
        (a, x), (b, y) = (random_expression(rng, values, rng.randrange(depth)) for _ in range(2))
        op = rng.choice("+-*/")
        if op == "/" and y == 0:
            continue
        quotient = abs(x) // abs(y or 1) * (1 if (x < 0) == (y < 0) else -1)
        value = {"+": x + y, "-": x - y, "*": x * y, "/": quotient}[op]
        if -(1 << 31) <= value < 1 << 31:
            return f"({a} {op} {b})", value


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("level", [0, 2])
def test_random_expressions_have_the_value_of_mathematics(tmp_path: Path, seed: int, level: Level) -> None:
    rng = random.Random(seed)
    values, declared = {}, ""
    for number, t in enumerate([*LIMITS] * 3):
        values[f"v{number}"] = rng.choice([*LIMITS[t], rng.randint(*LIMITS[t])])
        declared += f"v{number} : {t} := {values[f'v{number}']};\n"
    made = [random_expression(rng, values, 1 + n % 4) for n in range(120)]
    results = "".join(f"r{n} : LINT; c{n} : BOOL;\n" for n in range(len(made)))
    body = "".join(f"r{n} := {e};\nc{n} := {e} < {made[n - 1][0]};\n" for n, (e, _) in enumerate(made))
    (tmp_path / "m.st").write_text(f"PROGRAM Main\nVAR\n{declared}{results}END_VAR\n{body}END_PROGRAM\n")
    with Simulator.from_sources(tmp_path, dialect="codesys", level=level) as plc:
        plc.run_cycles(1)
        wrong = [(e, plc.read(f"Main.r{n}"), v) for n, (e, v) in enumerate(made) if plc.read(f"Main.r{n}") != v]
        order = [n for n, (_, v) in enumerate(made) if plc.read(f"Main.c{n}") is not (v < made[n - 1][1])]
    assert not wrong and not order
