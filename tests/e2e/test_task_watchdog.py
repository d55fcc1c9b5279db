"""WATCHDOG and SENSITIVITY of a TASK on a real plcrt."""

from __future__ import annotations

import pytest

PROGRAM = """PROGRAM Main
VAR
    slow : BOOL;
    n, i : DINT;
END_VAR
n := n + 1;
IF slow THEN
    FOR i := 1 TO 2000000000 DO
        n := n * 3 + i;
    END_FOR
END_IF
END_PROGRAM

PROGRAM Other
VAR
    n : DINT;
END_VAR
n := n + 1;
END_PROGRAM

CONFIGURATION Config
    TASK Fast(INTERVAL := T#20ms, PRIORITY := 1, {properties});
    TASK Slow(INTERVAL := T#20ms, PRIORITY := 2);
    PROGRAM Main WITH Fast : Main;
    PROGRAM Other WITH Slow : Other;
END_CONFIGURATION
"""
LOOP = range(8, 11)  # lines of the FOR loop


def started(tool, plcrt, properties: str) -> None:
    image = tool.build("guarded", PROGRAM.replace("{properties}", properties))
    tool.ok("flash", "--port", plcrt.port, str(image))


def exception(tool, plcrt):
    return tool.ok("status", "--port", plcrt.port)["exception"]


def counted(tool, plcrt) -> int:
    return int(tool.ok("read", "--port", plcrt.port, "Other.n")["values"]["Other.n"])


@pytest.mark.parametrize("properties", ["WATCHDOG := T#100ms", "WATCHDOG := T#50ms, SENSITIVITY := 2"])
def test_a_task_that_exceeds_its_watchdog_stops_where_it_was(tool, plcrt, eventually, properties):
    started(tool, plcrt, properties)
    eventually(lambda: counted(tool, plcrt) > 2)
    assert exception(tool, plcrt) is None
    tool.ok("write", "--port", plcrt.port, "Main.slow=TRUE")
    fault = eventually(lambda: exception(tool, plcrt))
    assert (fault["name"], fault["task"], fault["pou"]) == ("WATCHDOG", "Fast", "Main")
    assert fault["line"] in LOOP
    before = counted(tool, plcrt)
    assert counted(tool, plcrt) == before  # the other task starts no new cycle


def test_a_task_within_its_watchdog_goes_on(tool, plcrt, eventually):
    started(tool, plcrt, "WATCHDOG := T#10s")
    eventually(lambda: counted(tool, plcrt) > 20)
    assert exception(tool, plcrt) is None
