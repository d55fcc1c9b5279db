"""Inputs hold still for a cycle and no bit is lost: the stress program of tests/attack for some cycles."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1] / "attack"))

from environment import MACHINE, firmware
from stress_image import Counts, for_cycles, on_board

CYCLES = 2000  # at least, and
WRITES = 20


def test_two_tasks_and_the_pc_do_not_undo_each_other(tmp_path: Path) -> None:
    more_cycles = for_cycles(CYCLES)

    def go_on(so_far: Counts) -> bool:
        return more_cycles(so_far) or so_far.writes < WRITES

    counts = on_board(MACHINE, firmware("standard"), tmp_path, go_on)
    assert counts.good, str(counts)
