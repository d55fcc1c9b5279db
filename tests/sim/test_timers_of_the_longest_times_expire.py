"""The elapsed time may go beyond the longest TIME from one cycle to the next."""

from __future__ import annotations

from datetime import timedelta
from pathlib import Path

import pytest

from plctool import Simulator

PROGRAM = """PROGRAM Main
VAR on : TON; off : TOF; pulse : TP; late : TON; begun : BOOL; END_VAR
on(IN := begun, PT := T#24d20h31m23s647ms);
late(IN := begun, PT := T#24d20h31m23s600ms);
off(IN := NOT begun, PT := T#24d20h31m23s647ms);
pulse(IN := begun, PT := T#24d20h31m23s647ms);
begun := TRUE;
END_PROGRAM
CONFIGURATION C RESOURCE R ON PLC TASK T(INTERVAL := T#30m); PROGRAM Main WITH T : Main; END_RESOURCE END_CONFIGURATION
"""


@pytest.mark.parametrize("level", [0, 3])
def test_they_expire(level: int, tmp_path: Path) -> None:
    (tmp_path / "main.st").write_text(PROGRAM)
    names = ("on.Q", "late.Q", "off.Q", "pulse.Q")
    with Simulator.from_sources(tmp_path / "main.st", level=level) as plc:
        plc.run_for(timedelta(days=24, hours=20))
        assert [plc.read(f"Main.{name}") for name in names] == [False, False, True, True]
        plc.run_for(timedelta(hours=3))
        assert [plc.read(f"Main.{name}") for name in names] == [True, True, False, False]
        assert plc.read("Main.on.ET") == "T#24d20h31m23s647ms"
