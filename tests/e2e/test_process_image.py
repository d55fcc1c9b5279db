"""Inputs hold still for a cycle and no bit is lost, on plcrt: the stress program of tests/attack for some cycles."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1] / "attack"))

from stress_image import for_cycles, on_plcrt

CYCLES = 3000  # at least, and
WRITES = 100


def test_two_tasks_and_the_pc_do_not_undo_each_other(tmp_path: Path) -> None:
    more_cycles = for_cycles(CYCLES)
    counts = on_plcrt(tmp_path, lambda so_far: more_cycles(so_far) or so_far.writes < WRITES)
    assert counts.good, str(counts)
