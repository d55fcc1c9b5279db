"""The calls that led to an exception, on a real plcrt: a checked error, a signal, and a loop that is broken."""

from __future__ import annotations

import pytest

PROGRAM = """FUNCTION Fail : DINT
VAR_INPUT
    how : INT;
END_VAR
VAR
    a : ARRAY[0..9] OF DINT;
    p : POINTER TO DINT;
END_VAR
a[how] := how;
CASE how OF
    1: Fail := 100 / a[0];
    2: Fail := p^;
    3: WHILE a[0] = 0 DO a[1] := a[1] + 1; END_WHILE
END_CASE
END_FUNCTION

FUNCTION_BLOCK Pump
VAR_INPUT
    how : INT;
END_VAR
VAR
    x : DINT;
END_VAR
x := Fail(how);
x := x + 1;
END_FUNCTION_BLOCK

PROGRAM Main
VAR
    how : INT;
    pump : Pump;
    n : DINT;
END_VAR
pump(how := how);
n := n + 1;
END_PROGRAM

CONFIGURATION Config
    TASK Fast(INTERVAL := T#20ms, PRIORITY := 1, WATCHDOG := T#100ms);
    PROGRAM Main WITH Fast : Main;
END_CONFIGURATION
"""
CALLS = [("Pump", PROGRAM.split("\n").index("x := Fail(how);") + 1)]
CALLS += [("Main", PROGRAM.split("\n").index("pump(how := how);") + 1)]


@pytest.mark.parametrize("level", ["-O0", "-O2"])
@pytest.mark.parametrize("how, name", [(1, "DIVIDEBYZERO"), (2, "ACCESS_VIOLATION"), (3, "WATCHDOG")])
def test_status_and_log_tell_the_calls(tool, plcrt, eventually, how, name, level):
    image = tool.build("calls", PROGRAM, level, "--checks", "div")
    tool.ok("flash", "--port", plcrt.port, str(image))
    tool.ok("write", "--port", plcrt.port, f"Main.how={how}")
    fault = eventually(lambda: tool.ok("status", "--port", plcrt.port)["exception"])
    assert (fault["name"], fault["pou"]) == (name, "Fail")
    assert [(call["pou"], call["line"]) for call in fault["calls"]] == CALLS
    entry = [e for e in tool.ok("log", "--port", plcrt.port)["entries"] if e["class"] == "exception"][-1]
    assert entry["calls"] == fault["calls"]
    text = tool("status", "--port", plcrt.port).out
    assert f"called from Pump, {fault['calls'][0]['file']}:{CALLS[0][1]}" in text
