"""Forced variables in the simulator, and what holds for any of them."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

sys.path.append(str(Path(__file__).parents[1]))

from forcing import PROGRAM, Forcing

from plctool import Simulator
from plctool.controller import Controller

TWIN = """
PROGRAM Main
VAR a, b, c : DINT; w : WORD; x : BOOL; r : REAL; l : ARRAY[0..2] OF INT; i AT %IW0 : INT; o AT %QW0 : INT; END_VAR
a := a + 1; b := a * 3 - c; c := c XOR b; w := ROL(w, 1) OR 1; x := NOT x;
r := r + 0.5; l[a MOD 3] := l[0] + 1; IF x THEN o := i + l[1]; END_IF; i := i + 1;
END_PROGRAM
CONFIGURATION C RESOURCE R ON PLC TASK T(INTERVAL := T#10ms, PRIORITY := 1); PROGRAM Main WITH T : Main;
END_RESOURCE END_CONFIGURATION
"""
INT = st.integers(-(2**15), 2**15 - 1)
DINT = st.integers(0, 2**30)
FORCES = st.fixed_dictionaries(
    {},
    optional={
        "Main.a": DINT, "Main.b": DINT, "Main.c": DINT, "Main.w": st.integers(0, 2**16 - 1), "Main.x": st.booleans(),
        "Main.r": st.sampled_from([0.0, 1.5, -2.25]), "Main.l[0]": INT, "Main.l[1]": INT, "Main.i": INT, "Main.o": INT,
    },
)  # fmt: skip


class TestSimulator(Forcing):
    @pytest.fixture
    def plc(self, tmp_path: Path) -> Iterator[Simulator]:
        source = tmp_path / "forcing.st"
        source.write_text(PROGRAM)
        with Simulator.from_sources(source) as plc:
            plc.run_for(10)
            yield plc

    def wait(self, plc: Controller, condition: Callable[[], Any]) -> None:
        assert isinstance(plc, Simulator)
        for _ in range(100):
            plc.run_for(10, check=False)
            if condition():
                return
        raise AssertionError("it does not come")


@pytest.fixture(scope="module")
def twins(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Simulator, Simulator]]:
    source = tmp_path_factory.mktemp("twins") / "twin.st"
    source.write_text(TWIN)
    with Simulator.from_sources(source) as one, Simulator.from_sources(source) as other:
        yield one, other


@given(steps=st.lists(st.tuples(FORCES, st.integers(1, 3)), min_size=1, max_size=4))
def test_a_force_is_a_write_before_and_after_each_cycle(twins, steps):
    forced, written = twins
    for plc in twins:
        plc.reset("cold")
        plc.start()
        plc.run_cycles(1)
    for forces, cycles in steps:
        forced.unforce()
        forced.force(forces)
        assert forced.forced() == forces
        written.write(forces)
        for _ in range(cycles):
            forced.run_cycles(1)
            written.write(forces)
            written.run_cycles(1)
            written.write(forces)
            assert forced.read("Main.*") == written.read("Main.*")


def test_power_off_ends_it(tmp_path):
    source = tmp_path / "twin.st"
    source.write_text(TWIN)
    with Simulator.from_sources(source) as plc:
        plc.force({"Main.a": 5})
        plc.restart()
        assert plc.forced() == {}


def test_without_symbols_the_list_has_addresses(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    source = tmp_path / "twin.st"
    source.write_text(TWIN)
    with Simulator.from_sources(source) as plc:
        plc.force({"Main.a": 5, "Main.o": 6, "Main.w.9": True})
        plc._tables.clear()
        names = plc.status().forced
        assert names[1] == "%QW0"
        assert all(name.startswith("data+") for name in (names[0], names[2]))
