"""A stop makes safe what leaves the controller; the variables of the program stay, until a reset."""

from __future__ import annotations

from pathlib import Path

import pytest

from plctool import Simulator
from plctool.controller import ProgramStopped

SOURCE = """
PROGRAM Main
VAR
    plain, counted, shown, sent : UDINT; held : UDINT; valued : INT; motor : BOOL;
    setpoint : REAL := 12.5;
END_VAR
plain := plain + 1;
counted := plain;
shown := shown + 1;
sent := sent + 1;
held := held + 1;
valued := 77;
motor := TRUE;
END_PROGRAM
CONFIGURATION C RESOURCE R ON PLC
    TASK T(INTERVAL := T#10ms, PRIORITY := 1);
    PROGRAM Main WITH T : Main;
END_RESOURCE END_CONFIGURATION
"""
DESCRIPTION = """
[gpio.out]
DO0 = "Main.motor"
[[sim]]
name = "Bench"
out = { a = "Main.counted", b = { var = "Main.held", on_stop = "hold" }, c = { var = "Main.valued", on_stop = 5 } }
[modbus.server.tcp]
name = "Scada"
input = { 30001 = "Main.shown" }
holding = { 40001 = "Main.setpoint" }
[[modbus.tcp]]
host = "10.0.0.1"
[[modbus.tcp.device]]
name = "Drive"
write = [ { function = 16, address = 40001, every = "T#50ms", on_change = true, var = "Main.sent" } ]
"""
OUTPUTS = ("Main.counted", "Main.shown", "Main.sent", "Main.held", "Main.valued", "Main.motor")


def simulator(folder: Path) -> Simulator:
    (folder / "main.st").write_text(SOURCE)
    (folder / "main.io.toml").write_text(DESCRIPTION)
    return Simulator.from_sources(folder / "main.st")


def test_what_leaves_is_safe_and_variables_go_on_where_they_were(tmp_path: Path) -> None:
    with simulator(tmp_path) as plc:
        plc.run_for(1000)
        before = {name: plc.read(name) for name in OUTPUTS}
        assert before["Main.shown"] == before["Main.sent"] >= 100
        plc.stop()
        plc.run_for(1000)
        assert {name: plc.read(name) for name in OUTPUTS} == before
        left = [plc.output(name) for name in OUTPUTS]
        assert left == [0, before["Main.shown"], 0, before["Main.held"], 5, False]
        plc.start()
        plc.run_for(500)
        assert plc.read("Main.shown") == plc.read("Main.plain") > before["Main.shown"]
        assert plc.output("Main.motor") is True and plc.output("Main.valued") == 77
        assert plc.output("Main.sent") >= before["Main.sent"]


def test_an_exception_makes_outputs_safe_and_keeps_variables(tmp_path: Path) -> None:
    failing = "motor := TRUE;\nIF plain = 50 THEN valued := valued / (valued - 77); END_IF"
    (tmp_path / "main.st").write_text(SOURCE.replace("motor := TRUE;", failing))
    (tmp_path / "main.io.toml").write_text(DESCRIPTION)
    with Simulator.from_sources(tmp_path / "main.st") as plc:
        with pytest.raises(ProgramStopped):
            plc.run_for(1000)
        assert (plc.output("Main.motor"), plc.output("Main.counted"), plc.output("Main.valued")) == (False, 0, 5)
        assert (plc.read("Main.motor"), plc.read("Main.counted"), plc.read("Main.valued")) == (True, 50, 77)


@pytest.mark.parametrize("kind", ["warm", "cold"])
def test_a_reset_forgets_what_clients_have_written(tmp_path: Path, kind: str) -> None:
    with simulator(tmp_path) as plc:
        plc.run_for(200)
        plc.set_input("Main.setpoint", 99.0)
        plc.run_for(200)
        assert plc.read("Main.setpoint") == 99.0
        plc.stop()
        plc.start()
        plc.run_for(200)
        assert plc.read("Main.setpoint") == 99.0
        plc.reset(kind)
        plc.start()
        plc.run_for(200)
        assert plc.read("Main.setpoint") == 12.5 and plc.read("Main.shown") <= 21
        plc.set_input("Main.setpoint", 7.0)
        plc.run_for(200)
        assert plc.read("Main.setpoint") == 7.0
