"""Every operator and conversion on values at the edges of every numeric type gives the same bits on every target. In
`make test` each program is run by half of the targets, in `make test-whole` by all.
"""

from __future__ import annotations

import math
import random
from functools import cache
from pathlib import Path

import pytest
from batch import Recorder, Recording, run_batch
from comparison import differences
from runners import RUNNERS, Runner
from shares import share

from plctool.compiler.base.source import Source
from plctool.compiler.front import check_sources
from plctool.iec.dialect import find_dialect

SIGNED = {"SINT": 8, "INT": 16, "DINT": 32, "LINT": 64}
UNSIGNED = {"USINT": 8, "UINT": 16, "UDINT": 32, "ULINT": 64}
BITS = {"BYTE": 8, "WORD": 16, "DWORD": 32, "LWORD": 64}
REALS = {
    "REAL": [0.0, -0.0, 1.0, -1.5, 2.5, 3.5, 0.1, 3.4e38, -1.2e-38, 1.0e-45, 16777217.0, -2147483648.0, 4294967040.0],
    "LREAL": [
        0.0,
        -0.0,
        1.0,
        -1.5,
        2.5,
        3.5,
        0.1,
        1.7e308,
        -2.3e-308,
        4.9e-324,
        9007199254740993.0,
        4294967295.5,
        1.8446744073709552e19,
    ],
}
MANTISSA_BITS = {"REAL": 24, "LREAL": 53}
NUMBERS = [*SIGNED, *UNSIGNED, *REALS]
NARROW = ["SINT", "INT", "USINT", "UINT", "BYTE", "WORD"]
COUNT = 48  # values of each type
SQUARE = COUNT * COUNT


def real_values(type_name: str) -> list[float]:
    """The extremes, then runs of ones and zeros at all distances, which is where rounding goes wrong."""
    rng = random.Random(type_name)
    width = MANTISSA_BITS[type_name]
    numbers = list(REALS[type_name])
    while len(numbers) < COUNT:
        mantissa = 1 << (width - 1) | ((1 << rng.randrange(width)) - 1) << rng.randrange(width) & ((1 << width) - 1)
        numbers.append(math.ldexp(mantissa * rng.choice((1, -1)), rng.randrange(-width, width) - width))
    return numbers


def integer_values(type_name: str) -> list[int]:
    """The extremes, then numbers of every length."""
    rng = random.Random(type_name)
    signed = type_name in SIGNED
    width = (SIGNED | UNSIGNED | BITS)[type_name]
    low, high = (-(1 << (width - 1)), (1 << (width - 1)) - 1) if signed else (0, (1 << width) - 1)
    numbers = [
        0,
        1,
        2,
        3,
        7,
        10,
        100,
        low,
        low + 1,
        high,
        high - 1,
        high // 2,
        high // 2 + 1,
        high // 3,
        *([-1, -2, -7] * signed),
    ]
    while len(numbers) < COUNT:
        number = rng.getrandbits(rng.randrange(1, width + 1))
        numbers.append(number if number <= high else number - (1 << width))
    return numbers


def literal(value: float) -> str:
    text = repr(value)
    return text if "." in text or isinstance(value, int) else text.replace("e", ".0e")


def values(type_name: str) -> str:
    """COUNT values of a type as initial values of an array."""
    numbers = real_values(type_name) if type_name in REALS else integer_values(type_name)
    return ", ".join(map(literal, numbers))


def program(name: str, variables: list[str], body: list[str]) -> str:
    """A program in ST over indices i and j."""
    lines = [f"PROGRAM {name}", "VAR", "i, j : DINT;", *variables, "END_VAR", *body, "END_PROGRAM"]
    return "\n".join(lines)


def arithmetic(type_name: str) -> str:
    """+ - * / MOD and comparisons of all pairs."""
    operators = {"add": "+", "sub": "-", "mul": "*", "div": "/"} | ({} if type_name in REALS else {"rem": "MOD"})
    comparisons = {"eq": "=", "ne": "<>", "lt": "<", "le": "<=", "gt": ">", "ge": ">="}
    variables = [f"v : ARRAY[0..{COUNT - 1}] OF {type_name} := [{values(type_name)}];"]
    variables += [f"r_{name} : ARRAY[0..{SQUARE - 1}] OF {type_name};" for name in operators]
    variables += [f"c_{name} : ARRAY[0..{SQUARE - 1}] OF BOOL;" for name in comparisons]
    pairs = []
    for name, operator in operators.items():
        line = f"r_{name}[i * {COUNT} + j] := v[i] {operator} v[j];"
        pairs.append(f"IF v[j] <> 0 THEN {line} END_IF;" if name in ("div", "rem") and type_name not in REALS else line)
    pairs += [f"c_{name}[i * {COUNT} + j] := v[i] {operator} v[j];" for name, operator in comparisons.items()]
    last = COUNT - 1
    body = [f"FOR i := 0 TO {last} DO", f"FOR j := 0 TO {last} DO", *pairs, "END_FOR;", "END_FOR;"]
    return program("Main", variables, body)


def conversions(source: str) -> str:
    """To every other numeric type, and to text; REALs too by truncation and square root."""
    targets = [name for name in NUMBERS if name != source]
    variables = [f"v : ARRAY[0..{COUNT - 1}] OF {source} := [{values(source)}];"]
    variables += [f"r_{name} : ARRAY[0..{COUNT - 1}] OF {name};" for name in targets]
    variables.append(f"text : ARRAY[0..{COUNT - 1}] OF STRING[40];")
    body = [f"r_{name}[i] := {source}_TO_{name}(v[i]);" for name in targets]
    body.append(f"text[i] := {source}_TO_STRING(v[i]);")
    if source in REALS:
        variables.append(f"root : ARRAY[0..{COUNT - 1}] OF {source};")
        variables.append(f"whole : ARRAY[0..{COUNT - 1}] OF DINT;")
        body += ["root[i] := SQRT(v[i]);", "whole[i] := TRUNC(v[i]);"]
    return program("Main", variables, [f"FOR i := 0 TO {COUNT - 1} DO", *body, "END_FOR;"])


def bits(type_name: str) -> str:
    """Shifts and rotations by every count up to beyond the width, and the bitwise operators."""
    counts = BITS[type_name] + 3
    size = COUNT * counts - 1
    shifts, operators = ("SHL", "SHR", "ROL", "ROR"), ("AND", "OR", "XOR")
    variables = [f"v : ARRAY[0..{COUNT - 1}] OF {type_name} := [{values(type_name)}];"]
    variables += [f"r_{name} : ARRAY[0..{size}] OF {type_name};" for name in shifts]
    variables += [f"o_{name} : ARRAY[0..{SQUARE - 1}] OF {type_name};" for name in operators]
    body = [f"FOR i := 0 TO {COUNT - 1} DO", f"FOR j := 0 TO {counts - 1} DO"]
    body += [f"r_{name}[i * {counts} + j] := {name}(v[i], j);" for name in shifts]
    body += ["END_FOR;", f"FOR j := 0 TO {COUNT - 1} DO"]
    body += [f"o_{name}[i * {COUNT} + j] := v[i] {name} NOT v[j];" for name in operators]
    return program("Main", variables, [*body, "END_FOR;", "END_FOR;"])


def results_of_32_bits(type_name: str) -> str:
    """Operators whose operands are below 32 bits, and what takes their whole results."""
    variables = [f"v : ARRAY[0..{COUNT - 1}] OF {type_name} := [{values(type_name)}];"]
    names = ("sum", "product", "mean", "quotient", "magnitude", "most")
    variables += [f"{name} : ARRAY[0..{SQUARE - 1}] OF LINT;" for name in names]
    variables += [f"less : ARRAY[0..{SQUARE - 1}] OF BOOL;", "k : DINT;"]
    body = [f"FOR i := 0 TO {COUNT - 1} DO", f"FOR j := 0 TO {COUNT - 1} DO", f"k := i * {COUNT} + j;"]
    body += ["sum[k] := v[i] + v[j];", "product[k] := v[i] * v[j];", "mean[k] := (v[i] + v[j]) / 2;"]
    body += ["IF v[j] <> 0 THEN quotient[k] := v[i] * 100 / v[j] - v[i] MOD v[j]; END_IF;"]
    body += ["magnitude[k] := ABS(TO_INT(v[i]) - TO_INT(v[j]));", "most[k] := MAX(v[i] + v[j], v[i] * v[j]);"]
    body += ["less[k] := v[i] - v[j] < v[j];", "END_FOR;", "END_FOR;"]
    return program("Main", variables, body)


@cache
def recordings() -> list[Recording]:
    texts = {f"arithmetic {name}": arithmetic(name) for name in NUMBERS}
    texts |= {f"conversions {name}": conversions(name) for name in NUMBERS}
    texts |= {f"bits {name}": bits(name) for name in BITS}
    wide = {f"32 bits {name}": results_of_32_bits(name) for name in NARROW}
    found = []
    for name, text in (texts | wide).items():
        checked = check_sources([Source(f"{name}.st", text)], dialect=find_dialect("codesys" if name in wide else None))
        assert checked.program, checked.diagnostics
        recording = Recording(name, checked.program)
        with Recorder(recording) as plc:
            plc.run_cycles(1)
        assert recording.states[0].exception is None
        found.append(recording)
    return found


@pytest.mark.parametrize("runner", RUNNERS.values(), ids=lambda r: r.target)
def test_edges_give_the_same_bits(runner: Runner, tmp_path: Path) -> None:
    runner.skip_without_tools()
    chosen = share(recordings(), 2, list(RUNNERS).index(runner.target))
    results = run_batch(runner, chosen, tmp_path)
    wrong = [text for r, states in zip(chosen, results, strict=True) for text in differences(r, states)]
    assert not wrong, "\n".join(wrong)
