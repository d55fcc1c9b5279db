"""The program of examples/five-languages gives the same results in ST, IL, LD, FBD and SFC, on every target."""

from __future__ import annotations

import random
from functools import cache
from pathlib import Path

import pytest
from batch import Recorder, Recording, run_batch
from comparison import differences
from runners import RUNNERS, Runner

from plctool.compiler import load_sources
from plctool.compiler.front import check_sources

EXAMPLE = Path(__file__).parents[2] / "examples" / "five-languages"
LANGUAGES = ("st", "il", "ld", "fbd", "sfc")
OUTPUTS = ("pump", "alarm", "starts")
CYCLES = 300
STAYS = 0.8  # how often an input is as it was in the cycle before


@cache
def recording() -> Recording:
    """The program with random inputs; in each cycle its blocks have the same outputs."""
    checked = check_sources(load_sources([EXAMPLE]))
    assert checked.program is not None
    assert not checked.diagnostics
    made = Recording("five languages", checked.program)
    r = random.Random(5)
    inputs = {"low": False, "high": False, "stop": False}
    seen = set()
    with Recorder(made) as plc:
        for _ in range(CYCLES):
            inputs = {name: value if r.random() < STAYS else r.random() < 0.3 for name, value in inputs.items()}
            plc.write({f"Main.{name}": value for name, value in inputs.items()})
            plc.run_cycles(1)
            results = {language: tuple(plc.read(f"Main.by_{language}.{o}") for o in OUTPUTS) for language in LANGUAGES}
            assert set(results.values()) == {results["st"]}, results
            seen.add(results["st"][:2])
        assert plc.read("Main.differences") == 0
        assert plc.read("Main.by_st.starts") > 5
    assert seen == {(False, False), (True, False), (True, True)}
    return made


def test_all_languages_give_the_same_results() -> None:
    assert recording().states


@pytest.mark.parametrize("runner", RUNNERS.values(), ids=lambda r: r.target)
def test_they_give_them_on_every_target(runner: Runner, tmp_path: Path) -> None:
    runner.skip_without_tools()
    (states,) = run_batch(runner, [recording()], tmp_path)
    assert not list(differences(recording(), states))
