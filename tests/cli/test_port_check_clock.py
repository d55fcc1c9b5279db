"""The port check's measure of a clock, on made-up clocks and lines."""

from __future__ import annotations

import math
import random
from unittest.mock import Mock

import pytest
from hypothesis import given
from hypothesis import strategies as st
from shares import examples

from plctool.port_check.checks import Checks
from plctool.port_check.clock import Rate, Reading, measure
from plctool.port_check.report import judge

SHARPNESS = 0.005
TASK = 0.005  # s; how often the time that is read is renewed


def readings(drift=0.0, *, span=4.0, pause=0.02, trip=(0.001, 0.002), stalls=(), seed=1):
    """What a client sees that asks every `pause`; `stalls` are (host time, how long the clock stands still)."""
    chance = random.Random(seed)
    begin = chance.random() * 1000
    now, found = 0.0, []
    while now < span:
        out, back = (chance.uniform(*trip) / 2 for _ in "ab")
        asked = now + out
        stood = sum(min(length, max(0.0, asked - at)) for at, length in stalls)
        device = 77 + (asked - stood) * (1 + drift)
        found.append(Reading(math.floor(device / TASK) * TASK, begin + now + (out + back) / 2, out + back))
        now += out + back + chance.uniform(0.5, 1.5) * pause
    return found


@examples(30)
@given(st.floats(-0.2, 0.2), st.integers(0, 10**6))
def test_the_rate_of_a_steady_clock_is_found(drift, seed):
    rate = measure(readings(drift, seed=seed), SHARPNESS)
    assert rate.drift == pytest.approx(drift, abs=0.01)
    assert rate.uncertainty < 0.01


@examples(30)
@given(st.integers(0, 10**6))
def test_stalls_of_the_clock_are_no_drift(seed):
    chance = random.Random(seed)
    stalls = [(chance.uniform(0, 8), chance.uniform(0.005, 0.08)) for _ in range(12)]
    seen = readings(span=8.0, stalls=stalls, seed=seed)
    naive = (seen[-1].device - seen[0].device) / (seen[-1].host - seen[0].host) - 1
    rate = measure(seen, SHARPNESS)
    assert naive < -0.02
    assert abs(rate.drift) < 0.01 + rate.uncertainty and abs(rate.drift) < abs(naive)
    assert rate.lost == pytest.approx(sum(length for _, length in stalls) / 8.0, abs=0.015)


def test_a_clock_that_loses_a_tick_now_and_then_all_the_time_is_slow():
    stalls = [(0.014 * i, 0.001) for i in range(300)]
    rate = measure(readings(stalls=stalls), SHARPNESS)
    assert rate.drift == pytest.approx(-1 / 14, abs=0.01)


def test_answers_that_are_held_back_do_not_move_the_rate():
    seen = readings()
    chance = random.Random(3)
    for i in range(0, len(seen), 3):
        late = chance.uniform(0.02, 0.2)
        seen[i] = Reading(seen[i].device, seen[i].host + late / 2, seen[i].trip + late)
    assert measure(seen, SHARPNESS).drift == pytest.approx(0, abs=0.005)


def test_a_slow_line_is_made_up_for_by_longer_windows():
    rate = measure(readings(0.03, span=16, trip=(0.01, 0.04)), SHARPNESS)
    assert rate.drift == pytest.approx(0.03, abs=0.006) and rate.uncertainty < 0.01


def test_uncertainty_tells_that_a_line_is_too_slow():
    rate = measure(readings(trip=(0.1, 0.9)), SHARPNESS)
    assert rate.uncertainty > 0.01


def test_a_clock_that_runs_in_fits_and_starts_has_no_rate():
    chance = random.Random(5)
    stalls = [(0.02 * i, chance.choice([0.0, 0.005, 0.01, 0.02])) for i in range(200)]
    assert measure(readings(stalls=stalls), SHARPNESS).uncertainty > SHARPNESS


@pytest.mark.parametrize("count", [0, 1, 2, 5])
def test_nothing_is_known_from_a_few_readings(count):
    assert measure(readings()[:count], SHARPNESS).uncertainty == math.inf


@pytest.mark.parametrize(
    ("rate", "load", "verdict"),
    [
        (Rate(0.002, 0.004, 0.001), 0.1, "passed"),
        (Rate(-0.02, 0.004, 0.0), 0.1, "failed"),
        (Rate(0.02, 0.004, 0.0), 99.0, "failed"),
        (Rate(0.0, 0.004, 0.2), 0.1, "failed"),  # it stands still now and then
        (Rate(0.0, 0.004, 0.2), 99.0, "passed"),  # as simulated boards do on a busy host
        (Rate(0.0, 0.02, 0.0), 0.1, "failed"),  # not known well enough
        (Rate(0.0, math.inf, 0.0), 0.1, "failed"),
    ],
)
def test_a_clock_is_judged_by_what_is_known_of_it(monkeypatch, rate, load, verdict):
    bench = Mock()
    bench.plc.read.return_value = 0  # steps back
    checks = Checks(bench, None, max_drift=0.01)
    monkeypatch.setattr(checks, "_measure_clock", lambda: rate)
    monkeypatch.setattr("os.getloadavg", lambda: (load, load, load))
    outcome = judge(next(checks.all()))
    assert outcome.verdict == verdict, outcome.text
    assert outcome.figures.keys() == outcome.limits.keys()
    assert ("busy" in outcome.text) == (verdict == "failed" and load > 1)
