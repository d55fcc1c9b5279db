"""Load of tasks and its limit on a real plcrt."""

from __future__ import annotations

from pathlib import Path

import pytest

from plctool.testing.plcrt import Plcrt

PROGRAM = """PROGRAM Main
VAR
    busy : BOOL;
    n, i : DINT;
END_VAR
IF busy THEN
    FOR i := 1 TO 20_000_000 DO
        n := n * 3 + i;
    END_FOR
END_IF
END_PROGRAM

PROGRAM Other
END_PROGRAM

CONFIGURATION Config
    TASK Heavy(INTERVAL := T#1ms, PRIORITY := 2);
    TASK Light(INTERVAL := T#20ms, PRIORITY := 1);
    PROGRAM Main WITH Heavy : Main;
    PROGRAM Other WITH Light : Other;
END_CONFIGURATION
"""


@pytest.fixture
def limited(tmp_path: Path):
    config = tmp_path / "plc.cfg"
    config.write_text("[CmpSchedule]\nMaxProcessorLoad=10\n")
    with Plcrt(tmp_path / "plc.flash", "--config", str(config)) as plcrt:
        yield plcrt


def test_a_program_above_max_processor_load_stops_and_names_its_largest_task(tool, limited, eventually):
    tool.ok("flash", "--port", limited.port, str(tool.build("heavy", PROGRAM)))
    assert tool.ok("tasks", "--port", limited.port)["load_percent"] is not None
    tool.ok("write", "--port", limited.port, "Main.busy=TRUE")
    fault = eventually(lambda: tool.ok("status", "--port", limited.port)["exception"])
    assert (fault["name"], fault["task"]) == ("PROCESSORLOAD_WATCHDOG", "Heavy")
    assert "load of all tasks: 0 %" in tool("tasks", "--port", limited.port).out
