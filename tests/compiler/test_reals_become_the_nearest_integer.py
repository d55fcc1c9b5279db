"""A REAL or LREAL becomes the nearest integer, halves the even one; what is beyond a limit becomes the limit, and what
is no number 0."""

from __future__ import annotations

import math
import struct

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from plctool import Simulator
from plctool.compiler.base.source import Source
from plctool.compiler.codegen.lower_unit import Options
from plctool.compiler.front import check_sources
from plctool.compiler.image.build import build_program
from plctool.image.targets import find_target

LIMITS = {
    f"{prefix}INT": (0, 2**bits - 1) if prefix[:1] == "U" else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    for bits, sizes in ((8, ("S", "US")), (16, ("", "U")), (32, ("D", "UD")), (64, ("L", "UL")))
    for prefix in sizes
}
EDGES = st.sampled_from(sorted({limit for limits in LIMITS.values() for limit in limits}))
NEAR_EDGES = st.builds(lambda edge, more: float(edge) + more, EDGES, st.sampled_from([-1.5, -1, -0.5, 0, 0.5, 1, 1.5]))
REALS = st.floats() | NEAR_EDGES | st.floats(-300, 300).map(lambda x: round(x) + 0.5)


def single(value: float) -> float:
    """The REAL that is nearest."""
    try:
        return float(struct.unpack("<f", struct.pack("<f", value))[0])
    except OverflowError:
        return math.copysign(math.inf, value)


def expected(value: float, name: str) -> int:
    low, high = LIMITS[name]
    if math.isnan(value):
        return 0
    return low if value <= low else high if value >= high else round(value)


@pytest.mark.parametrize("source", ["REAL", "LREAL"])
def test_to_every_integer_type(source: str) -> None:
    variables = "".join(f"r{name} : {name};" for name in LIMITS)
    body = "".join(f"r{name} := {source}_TO_{name}(x);" for name in LIMITS)
    found = check_sources([Source("main.st", f"PROGRAM Main VAR x : {source}; {variables} END_VAR {body} END_PROGRAM")])
    assert found.program, found.diagnostics
    built = build_program(found.program, Options(find_target("x86_64-linux")))
    with Simulator(built.image, built.symbols) as plc:

        @given(REALS)
        @example(math.nan)
        @example(-math.inf)
        @example(2147483647.5)
        @example(2147483647.75)
        def check(value: float) -> None:
            given_value = single(value) if source == "REAL" else value
            plc.write({"Main.x": given_value})
            plc.run_cycles(1)
            values = {name: plc.read(f"Main.r{name}") for name in LIMITS}
            assert values == {name: expected(given_value, name) for name in LIMITS}

        check()
