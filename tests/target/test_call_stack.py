"""The calls that led to an exception: a checked error, a fault, and a loop that is aborted, with and without an FPU."""

from __future__ import annotations

from pathlib import Path

import pytest
from environment import TARGET
from programs import compile_text

from plctool.compiler import Level
from plctool.device import Plc
from plctool.testing.waiting import eventually

TEXT = """FUNCTION Fail : REAL
VAR_INPUT
    how : INT;
    factor : REAL;
END_VAR
VAR
    a : ARRAY[0..4] OF DINT;
    p : POINTER TO DINT;
END_VAR
a[how] := how;
CASE how OF
    1: a[2] := 100 / a[0];
    2: p^ := REAL_TO_DINT(factor);
    3: WHILE a[0] = 0 DO a[1] := a[1] + 1; END_WHILE
    4: WHILE factor > 0.0 DO factor := factor * 2.0 / 2.0; END_WHILE
END_CASE
Fail := factor * 0.5;
END_FUNCTION
FUNCTION_BLOCK Pump
VAR_INPUT
    how : INT;
END_VAR
VAR
    flow : REAL;
END_VAR
flow := flow * Fail(how, 1.5 + flow) + 1.0;
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
    TASK Fast(INTERVAL := T#5ms, PRIORITY := 1, WATCHDOG := T#100ms);
    PROGRAM Main WITH Fast : Main;
END_CONFIGURATION
"""
LINES = TEXT.split("\n")
CALLS = [
    ("Pump", LINES.index("flow := flow * Fail(how, 1.5 + flow) + 1.0;") + 1),
    ("Main", LINES.index("pump(how := how);") + 1),
]
FAULTS = {1: "DIVIDEBYZERO", 2: "ACCESS_VIOLATION", 3: "WATCHDOG", 4: "WATCHDOG"}


@pytest.mark.parametrize("level", [0, 2])
def test_each_call_is_reported(plc: Plc, tmp_path: Path, level: Level) -> None:
    plc.flash(compile_text(TEXT, TARGET, tmp_path, checks="div", level=level).path)
    for how, name in FAULTS.items():
        plc.write({"Main.how": how})
        exception = eventually(lambda: plc.status().exception)
        assert (exception.name, exception.pou) == (name, "Fail")
        assert [(call.pou, call.line) for call in exception.calls] == CALLS
        plc.reset("cold")
        plc.start()
