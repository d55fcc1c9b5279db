"""The clock of plcrt is that of the machine, and a program sets it only where plcrt is allowed to."""

from __future__ import annotations

import time

import pytest

from plctool import connect
from plctool.core import lib
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually

# It sets the clock to what it has just read, so the machine keeps its time.
PROGRAM = """
PROGRAM Main
VAR now, again : SYSTIME; read, set : UDINT := 99; END_VAR
IF set = 99 THEN
    read := SysTimeRtcHighResGet(now);
    again := now;
    set := SysTimeRtcHighResSet(again);
END_IF
END_PROGRAM
"""


@pytest.mark.parametrize(
    ("options", "results"),
    [((), {lib.ERR_NO_ACCESS_RIGHTS}), (("--set-clock",), {lib.ERR_OK, lib.ERR_NO_ACCESS_RIGHTS})],
)
def test_program_has_the_time_of_the_machine_and_sets_it_only_if_it_may(plcrt: Plcrt, tool, options, results) -> None:
    image = tool.build("clock", PROGRAM)
    plcrt.stop()
    plcrt.options = ("--tcp", "0", *options)
    plcrt.start()
    with connect(f"tcp:{plcrt.tcp}") as plc:
        before = time.time_ns() // 1_000_000
        plc.flash(image)
        eventually(lambda: plc.read("Main.set") != 99)
        assert plc.read("Main.read") == lib.ERR_OK
        assert plc.read("Main.set") in results
        assert before - 1 <= plc.read("Main.now") <= time.time_ns() // 1_000_000 + 1
