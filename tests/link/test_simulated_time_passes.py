"""Waiting on a link to the simulator lets time pass, however little of it is left."""

from __future__ import annotations

from pathlib import Path

import pytest

from plctool.link.sim import SimTransport
from plctool.sim import Simulator


@pytest.mark.parametrize("seconds", [1e-15, 4e-10, 1e-9, 0.0015, 2.0])
def test_a_wait_takes_at_least_its_time(tmp_path: Path, seconds: float) -> None:
    source = tmp_path / "main.st"
    source.write_text("PROGRAM Main VAR n : INT; END_VAR n := n + 1; END_PROGRAM")
    with Simulator.from_sources(source):
        link = SimTransport()
        begin = link.now()
        assert link.receive(seconds) is None
        assert link.now() - begin >= max(seconds, 1e-9) * 0.999
