"""The standard function blocks under random inputs, compared with what the standard's diagrams say of the history."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from shares import examples

from plctool.compiler import compile_sources
from plctool.compiler.image.build import BuildResult
from plctool.iec.literals import typed
from plctool.sim import Simulator

CYCLE_MS = 10
CYCLES = 40
CASES = examples(40)

PROGRAM = """
PROGRAM Main
VAR
    a, b, c, d : BOOL;
    pt : TIME;
    pv : INT;
    on_delay : TON;
    off_delay : TOF;
    pulse : TP;
    rise : R_TRIG;
    fall : F_TRIG;
    set_dominant : SR;
    reset_dominant : RS;
    up : CTU;
    down : CTD;
    both : CTUD;
END_VAR
on_delay(IN := a, PT := pt);
off_delay(IN := a, PT := pt);
pulse(IN := a, PT := pt);
rise(CLK := a);
fall(CLK := a);
set_dominant(S1 := a, R := b);
reset_dominant(S := a, R1 := b);
up(CU := a, R := c, PV := pv);
down(CD := b, LD := d, PV := pv);
both(CU := a, CD := b, R := c, LD := d, PV := pv);
END_PROGRAM
"""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> BuildResult:
    path: Path = tmp_path_factory.mktemp("blocks") / "main.st"
    path.write_text(PROGRAM)
    return compile_sources([path])


def run(built: BuildResult, inputs: dict[str, Sequence[object]], outputs: Sequence[str]) -> list[tuple[object, ...]]:
    """The outputs after each cycle; durations in ms."""
    rows = []
    with Simulator(built.image, built.symbols) as plc:
        for cycle in range(CYCLES):
            for name, values in inputs.items():
                plc.write({f"Main.{name}": values[cycle]})
            plc.run_cycles(1)
            rows.append(tuple(plain(plc.read(f"Main.{name}")) for name in outputs))
    return rows


def plain(value: object) -> object:
    if isinstance(value, str):
        ns = typed(value)[1]
        assert isinstance(ns, int)
        return ns // 1_000_000
    return value


signals = st.lists(st.booleans(), min_size=CYCLES, max_size=CYCLES)
rare = st.lists(st.integers(0, 9).map(lambda n: n == 0), min_size=CYCLES, max_size=CYCLES)
slow = st.lists(st.tuples(st.booleans(), st.integers(1, 12)), min_size=CYCLES, max_size=CYCLES).map(
    lambda runs: [level for level, length in runs for _ in range(length)][:CYCLES]
)
presets = st.sampled_from([0, 5, 10, 20, 30, 45, 80])


def since(signal: Sequence[bool], cycle: int) -> int:
    """For how long the signal has had its present value [ms]."""
    first = cycle
    while first > 0 and signal[first - 1] == signal[cycle]:
        first -= 1
    return (cycle - first) * CYCLE_MS


def rises(signal: Sequence[bool]) -> list[bool]:
    return [now and not before for before, now in zip([False, *signal], signal, strict=False)]


@CASES
@given(slow, presets)
def test_ton_is_true_after_in_was_true_for_pt(built: BuildResult, signal: list[bool], pt: int) -> None:
    expected = [(on and since(signal, i) >= pt, min(since(signal, i), pt) if on else 0) for i, on in enumerate(signal)]
    inputs = {"a": signal, "pt": [f"T#{pt}ms"] * CYCLES}
    assert run(built, inputs, ("on_delay.Q", "on_delay.ET")) == expected


@CASES
@given(slow, presets)
def test_tof_is_true_until_in_was_false_for_pt(built: BuildResult, signal: list[bool], pt: int) -> None:
    expected = []
    for i, on in enumerate(signal):
        off_for = since(signal, i) if not on and any(signal[:i]) else None
        expected.append((True, 0) if on else (False, 0) if off_for is None else (off_for < pt, min(off_for, pt)))
    inputs = {"a": signal, "pt": [f"T#{pt}ms"] * CYCLES}
    assert run(built, inputs, ("off_delay.Q", "off_delay.ET")) == expected


@CASES
@given(slow, presets)
def test_tp_gives_pulses_of_pt_that_nothing_disturbs(built: BuildResult, signal: list[bool], pt: int) -> None:
    expected: list[tuple[bool, int]] = []
    begin: int | None = None  # of the pulse
    for i, (on, rise) in enumerate(zip(signal, rises(signal), strict=True)):
        running = begin is not None and i * CYCLE_MS - begin < pt
        if rise and not running and (begin is None or not expected[-1][0]):
            begin, running = i * CYCLE_MS, pt > 0
        if begin is None:
            expected.append((False, 0))
            continue
        elapsed = min(i * CYCLE_MS - begin, pt)
        if not running and not on:
            begin, elapsed = None, 0
        expected.append((running, elapsed))
    inputs = {"a": signal, "pt": [f"T#{pt}ms"] * CYCLES}
    assert run(built, inputs, ("pulse.Q", "pulse.ET")) == expected


@CASES
@given(signals)
def test_edges_are_seen_once(built: BuildResult, signal: list[bool]) -> None:
    falls = [before and not now for before, now in zip([False, *signal], signal, strict=False)]
    assert run(built, {"a": signal}, ("rise.Q", "fall.Q")) == list(zip(rises(signal), falls, strict=True))


@CASES
@given(signals, signals)
def test_flip_flops_remember_the_last_command(built: BuildResult, sets: list[bool], resets: list[bool]) -> None:
    expected, sr, rs = [], False, False
    for s, r in zip(sets, resets, strict=True):
        sr = True if s else False if r else sr
        rs = False if r else True if s else rs
        expected.append((sr, rs))
    assert run(built, {"a": sets, "b": resets}, ("set_dominant.Q1", "reset_dominant.Q1")) == expected


@dataclass
class Counters:
    """CTU, CTD and CTUD by the words of the standard."""

    up: int = 0
    down: int = 0
    both: int = 0

    def step(self, cu: bool, cd: bool, reset: bool, load: bool, pv: int) -> tuple[object, ...]:
        self.up = 0 if reset else self.up + cu
        self.down = pv if load else self.down - cd
        self.both = 0 if reset else pv if load else self.both + cu - cd
        return (self.up, self.up >= pv, self.down, self.down <= 0, self.both, self.both >= pv, self.both <= 0)


@CASES
@given(signals, signals, rare, rare, st.integers(-2, 6))
def test_counters_count_rises(
    built: BuildResult, ups: list[bool], downs: list[bool], resets: list[bool], loads: list[bool], pv: int
) -> None:
    model = Counters()
    steps = zip(rises(ups), rises(downs), resets, loads, strict=True)
    expected = [model.step(*inputs, pv) for inputs in steps]
    inputs = {"a": ups, "b": downs, "c": resets, "d": loads, "pv": [pv] * CYCLES}
    outputs = ("up.CV", "up.Q", "down.CV", "down.Q", "both.CV", "both.QU", "both.QD")
    assert run(built, inputs, outputs) == expected
