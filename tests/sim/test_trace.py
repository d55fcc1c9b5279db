"""Traces in the simulator, and what holds for any values."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

sys.path.append(str(Path(__file__).parents[1]))

from tracing import PROGRAM, Tracing

from plctool import Simulator
from plctool.errors import LinkError
from plctool.link.traces import TraceOptions, unpack_samples


class TestSimulator(Tracing):
    @pytest.fixture
    def plc(self, tmp_path: Path) -> Iterator[Simulator]:
        (tmp_path / "tracing.st").write_text(PROGRAM)
        with Simulator.from_sources(tmp_path / "tracing.st") as plc:
            yield plc

    def test_a_trace_stays_however_much_virtual_time_passes(self, plc: Simulator) -> None:
        with plc.start_trace(["Main.n"], TraceOptions(trigger="Main.n = 20000")) as running:
            plc.run_for(seconds=101)
            running.poll()
            assert running.recording["Main.n"][0] == 20000

    def test_samples_that_are_lost_are_counted(self, plc: Simulator) -> None:
        with plc.start_trace(["Main.n"], TraceOptions()) as running:
            plc.run_for(seconds=600)
            while running.poll():
                pass
            found = running.recording
            assert found.lost > 10_000
            assert len(found) + found.lost == running.state.written
            assert found["Main.n"] == list(range(found["Main.n"][0], found["Main.n"][-1] + 1))


@given(data=st.binary(max_size=60), count=st.integers(0, 300), sizes=st.lists(st.sampled_from([1, 2, 4]), max_size=9))
def test_any_bytes_are_samples_or_refused(data, count, sizes):
    try:
        samples = unpack_samples(data, count, sizes)
    except LinkError:
        return
    assert len(samples) == count
    assert all(len(content) == sum(sizes) for _, content in samples)
