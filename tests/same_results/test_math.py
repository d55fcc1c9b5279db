"""Mathematical functions are within 2 ulp of the true value on every target; square roots are exact."""

from __future__ import annotations

import math
import random
import struct
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import mpmath  # type: ignore[import-untyped]
import pytest
from batch import AREAS, REFERENCE, Recorder, Recording, State, run_batch
from runners import RUNNERS

from plctool.compiler.base.source import Source
from plctool.compiler.front import check_sources
from plctool.iec.areas import Area

BOUND_ULP = 2.0
COUNT = 300  # arguments of each function

mpmath.mp.prec = 200

# Function: exact value, range of its arguments, whether these are spread over magnitudes.
FUNCTIONS: dict[str, tuple[Callable[..., Any], tuple[float, float], bool]] = {
    "SIN": (mpmath.sin, (-30.0, 30.0), False),
    "COS": (mpmath.cos, (-30.0, 30.0), False),
    "TAN": (mpmath.tan, (-30.0, 30.0), False),
    "ASIN": (mpmath.asin, (-1.0, 1.0), False),
    "ACOS": (mpmath.acos, (-1.0, 1.0), False),
    "ATAN": (mpmath.atan, (-50.0, 50.0), False),
    "EXP": (mpmath.exp, (-80.0, 80.0), False),
    "LN": (mpmath.log, (1e-30, 1e30), True),
    "LOG": (mpmath.log10, (1e-30, 1e30), True),
    "SQRT": (mpmath.sqrt, (1e-30, 1e30), True),
    "EXPT": (mpmath.power, (0.01, 30.0), True),
    "ATAN2": (mpmath.atan2, (-50.0, 50.0), False),
}
BINARY = {"EXPT": (-15.0, 15.0), "ATAN2": (-50.0, 50.0)}  # range of the second argument
EXACT = {"SQRT"}
FORMATS = {"REAL": ("f", 24, -149), "LREAL": ("d", 53, -1074)}  # struct code, bits of the mantissa, smallest exponent


def rounded(value: float, type_name: str) -> float:
    code = FORMATS[type_name][0]
    return float(struct.unpack(f"<{code}", struct.pack(f"<{code}", value))[0])


@cache
def arguments(name: str, type_name: str) -> list[tuple[float, ...]]:
    """The same in every run."""
    _, (low, high), spread = FUNCTIONS[name]
    rng = random.Random(f"{name} {type_name}")
    rows = []
    for _ in range(COUNT):
        x = math.exp(rng.uniform(math.log(low), math.log(high))) if spread else rng.uniform(low, high)
        row = [x, rng.uniform(*BINARY[name])] if name in BINARY else [x]
        rows.append(tuple(rounded(value, type_name) for value in row))
    return rows


def source() -> str:
    """Every function in both precisions over its arguments, the results in arrays."""
    variables, body = [], []
    for type_name in FORMATS:
        for name in FUNCTIONS:
            rows = arguments(name, type_name)
            for k, column in enumerate(zip(*rows, strict=True)):
                values = ", ".join(repr(v) if "." in repr(v) else repr(v).replace("e", ".0e") for v in column)
                variables.append(f"{name}_{type_name}_{k} : ARRAY[0..{COUNT - 1}] OF {type_name} := [{values}];")
            variables.append(f"{name}_{type_name} : ARRAY[0..{COUNT - 1}] OF {type_name};")
            call = ", ".join(f"{name}_{type_name}_{k}[i]" for k in range(len(rows[0])))
            body.append(f"{name}_{type_name}[i] := {name}({call});")
    lines = [*variables, "i : INT;", "END_VAR", f"FOR i := 0 TO {COUNT - 1} DO", *body, "END_FOR", "END_PROGRAM"]
    return "\n".join(["PROGRAM Main", "VAR", *lines])


@cache
def recording() -> Recording:
    checked = check_sources([Source("math.st", source())])
    assert checked.program, checked.diagnostics
    result = Recording("math", checked.program)
    with Recorder(result) as plc:
        plc.run_cycles(1)
    return result


@cache
def exact_values(name: str, type_name: str) -> list[tuple[Any, Any]]:
    """What is exact for each of the arguments, and its unit of the last place; the same for all targets."""
    function = FUNCTIONS[name][0]
    exact = [function(*map(mpmath.mpf, row)) for row in arguments(name, type_name)]
    return [(value, last_place(value, type_name)) for value in exact]


def last_place(exact: Any, type_name: str) -> Any:
    """The unit of the last place of an exact value."""
    _, bits, smallest = FORMATS[type_name]
    return mpmath.ldexp(1, max(int(mpmath.floor(mpmath.log(abs(exact), 2))) - bits + 1, smallest))


def results(state: State, name: str, type_name: str) -> tuple[float, ...]:
    symbol = recording().built.symbols.resolve(f"Main.{name}_{type_name}")
    data = state.areas[AREAS.index(Area(symbol.area))][symbol.offset : symbol.offset + symbol.size]
    return struct.unpack(f"<{COUNT}{FORMATS[type_name][0]}", data)


def worst_error(state: State, name: str, type_name: str) -> float:
    """How far a result is from the exact one at most, in units of the last place of the exact one."""
    pairs = zip(results(state, name, type_name), exact_values(name, type_name), strict=True)
    return max(float(abs(mpmath.mpf(value) - exact) / unit) for value, (exact, unit) in pairs)


@pytest.mark.parametrize("target", [REFERENCE, *RUNNERS])
def test_error_is_within_the_bound(target: str, tmp_path: Path) -> None:
    if target == REFERENCE:
        state = recording().states[0]
    else:
        RUNNERS[target].skip_without_tools()
        state = run_batch(RUNNERS[target], [recording()], tmp_path)[0][0]
    worst = {f"{n}({t})": worst_error(state, n, t) for t in FORMATS for n in FUNCTIONS}
    print({name: round(error, 2) for name, error in worst.items()})
    assert {n: e for n, e in worst.items() if e > (0.5 if n.partition("(")[0] in EXACT else BOUND_ULP)} == {}
