"""Writing a bit writes that bit and nothing else on every target; tests/compiler/bit_programs.py makes the programs."""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1] / "compiler"))

from batch import Recorder, Recording, run_batch
from bit_programs import BitProgram, bit_programs, block_programs
from comparison import differences
from hypothesis import Phase, given, settings
from runners import RUNNERS, Runner
from shares import share

from plctool.compiler.base.source import Source
from plctool.compiler.front import check_sources

PROGRAMS = 40
LEVELS = (0, 2)


@cache
def programs() -> list[BitProgram]:
    """The same ones at every run."""
    found: list[BitProgram] = []

    @settings(max_examples=PROGRAMS, derandomize=True, database=None, phases=[Phase.generate])
    @given(bit_programs() | block_programs())
    def collect(p: BitProgram) -> None:
        found.append(p)

    collect()
    return found


@cache
def recordings() -> list[Recording]:
    found = []
    for number, p in enumerate(programs()):
        checked = check_sources([Source("bits.st", p.text)])
        assert checked.program, checked.diagnostics
        recording = Recording(f"bits {number}", checked.program, LEVELS[number % len(LEVELS)])
        with Recorder(recording) as plc:
            plc.run_cycles(1)
            assert {name: plc.read(name) for name in p.expected} == p.expected
        found.append(recording)
    return found


@pytest.mark.parametrize("runner", RUNNERS.values(), ids=lambda r: r.target)
def test_bits_are_the_same(runner: Runner, tmp_path: Path) -> None:
    runner.skip_without_tools()
    chosen = share(recordings(), 2, list(RUNNERS).index(runner.target))
    results = run_batch(runner, chosen, tmp_path)
    wrong = [text for r, states in zip(chosen, results, strict=True) for text in differences(r, states)]
    assert not wrong, "\n".join(wrong)
