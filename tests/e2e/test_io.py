"""plctool io on a real plcrt: devices, parameters, and a description that it cannot run."""

from __future__ import annotations

from pathlib import Path

from conftest import Tool

from plctool.testing.plcrt import Plcrt

PROGRAM = """\
PROGRAM Main
VAR start, motor : BOOL; level : INT; END_VAR
motor := start AND Bench.ok;
END_PROGRAM
"""
DESCRIPTION = """\
[[sim]]
name = "Bench"
in = { button = "Main.start", level = "Main.level" }
out = { motor = { var = "Main.motor", on_stop = 1 } }
[[sim]]
name = "Other"
in = { level = "%IW20" }
"""


def test_devices_of_a_running_program(tool: Tool, plcrt: Plcrt, eventually) -> None:  # type: ignore[no-untyped-def]
    (tool.folder / "main.io.toml").write_text(DESCRIPTION)
    image = tool.build("main", PROGRAM)
    link = ("--port", plcrt.port)
    tool.ok("flash", *link, str(image))

    devices = eventually(
        lambda: (
            [d for d in tool.ok("io", "status", *link)["devices"] if d["state"] == "ok"][1:]
            and tool.ok("io", "status", *link)["devices"]
        )
    )
    assert [(d["name"], d["driver"], d["errors"]) for d in devices] == [
        ("Bench", "IoDrvSim", 0),
        ("Other", "IoDrvSim", 0),
    ]

    parameter = tool.ok("io", "param", "set", "Bench", "1=1", "--type", "BYTE", *link)
    assert parameter["value"] == 1
    assert eventually(lambda: tool.ok("read", *link, "Bench.motor")["values"]["Bench.motor"])
    assert tool.ok("io", "param", "get", "Bench", "3", "--type", "BYTE", *link)["value"] == 1
    tool.ok("io", "param", "set", "Bench", "2=-5", "--type", "INT", *link)
    assert eventually(lambda: tool.ok("read", *link, "Main.level")["values"]["Main.level"] == -5)

    assert tool.ok("io", "identify", "Bench", *link)["identified"] is True
    assert tool.ok("io", "scan", "Other", *link)["devices"] == []
    wrong = tool("io", "identify", "Bensh", *link)
    assert (wrong.status, "did you mean Bench?" in wrong.err) == (2, True)
    missing = tool("io", "param", "get", "Bench", "77", *link)
    assert (missing.status, "no such parameter" in missing.err) == (1, True)

    refused(tool, plcrt)


def refused(tool: Tool, plcrt: Plcrt) -> None:
    """A driver that is not there refuses the download by the name of the device; the old program runs on."""
    (tool.folder / "acme.toml").write_text('[[module]]\nname = "Analog"\ndriver = "IoDrvAcme"\n')
    description = 'device = "acme.toml"\n[local.Analog]\nname = "Boiler"\n'
    Path(tool.folder / "main.io.toml").write_text(description)
    image = tool.build("main", "PROGRAM Main\nVAR n : INT; END_VAR\nn := n + 1;\nEND_PROGRAM\n")
    done = tool("flash", "--port", plcrt.port, str(image))
    assert done.status == 1
    assert "Boiler" in done.err
    assert "IoDrvAcme" in done.err
    assert tool.ok("status", "--port", plcrt.port)["state"] == "run"
