"""After edits of random programs the check of bodies alone finds what a fresh check finds."""

from __future__ import annotations

from pathlib import Path

from random_edits import campaign

EDITS = 200


def test_random_edits_of_random_programs_show_what_a_fresh_check_finds(tmp_path: Path) -> None:
    result = campaign(EDITS, 1, tmp_path)
    assert not result.differences, "\n".join(result.differences)
    assert result.compared > EDITS / 4
