"""plctool run --fault: what happens to simulated devices, and when."""

from __future__ import annotations

from pathlib import Path

import pytest

PROGRAM = """\
PROGRAM Main
VAR level : INT; cycles : DINT; lost : DINT; END_VAR
cycles := cycles + 1;
IF NOT Tank.ok THEN lost := lost + 1; END_IF;
END_PROGRAM
"""
DESCRIPTION = """\
[[modbus.rs485]]
name = "Bus"
port = "/dev/ttyS1"
[[modbus.rs485.device]]
name = "Tank"
unit = 1
timeout = "T#50ms"
[[modbus.rs485.device.read]]
function = 4
address = 30001
every = "T#100ms"
var = "Main.level"
"""


@pytest.fixture
def app(tool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:  # type: ignore[no-untyped-def]
    (tmp_path / "main.st").write_text(PROGRAM)
    (tmp_path / "main.io.toml").write_text(DESCRIPTION)
    monkeypatch.chdir(tmp_path)
    assert tool("build", "main.st").status == 0


@pytest.mark.parametrize(
    ("faults", "lost"),
    [
        ([], range(15)),
        (["Tank=absent"], range(990, 1001)),
        (["Bus=absent@T#5s"], range(460, 500)),
        (["Bus=absent@T#5s", "Bus=absent:0@T#6s"], range(70, 210)),
        (["Tank=late:30"], range(15)),
        (["Tank=late:60"], range(990, 1001)),
        (["Tank=answers:1@T#5s"], range(15)),
        (["Tank=answers:3@T#5s"], range(100, 260)),
        (["Tank=cut:1@T#5s"], range(15)),
        (["Tank=cut:3@T#5s"], range(100, 260)),
    ],
)
def test_a_fault_begins_when_it_is_said(tool, app: None, faults: list[str], lost: range) -> None:  # type: ignore[no-untyped-def]
    """Of 1000 cycles of 10 ms so many have no device."""
    options = [word for fault in faults for word in ("--fault", fault)]
    done = tool("run", "app.cdl", "--time", "T#10s", *options, "--get", "Main.lost", "--json")
    assert done.json["values"]["Main.lost"] in lost


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        ("Tank", "is not DEVICE=FAULT"),
        ("Tank=late:x", "is not DEVICE=FAULT"),
        ("Tank=absent@", "is not DEVICE=FAULT"),
        ("Tank=broken", "choose one of absent, late, type, answers"),
        ("Tnak=absent@T#1s", "no simulated device Tnak that can be 'absent'"),
        ("Bus=late:5", "a line can only be absent"),
        ("Tank=absent@soon", "soon"),
        ("Tank=absent@-T#1s", "T#"),
        ("Tank=absent@T#-1s", "so it is not negative"),
        ("Tank=late:4294967296", "at most 4294967295"),
    ],
)
def test_what_cannot_happen_is_an_error_before_the_run(tool, app: None, fault: str, reason: str) -> None:  # type: ignore[no-untyped-def]
    done = tool("run", "app.cdl", "--fault", fault)
    assert (done.status, done.err.count("\n")) == (2, 1), done.err
    assert reason in done.err
