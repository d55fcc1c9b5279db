"""plctool io on a real plcrt: devices, parameters, and a description that it cannot run."""

from __future__ import annotations

from pathlib import Path

from conftest import Tool

from plctool.core import lib
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

    lost_and_found(tool, link, eventually)
    refused(tool, plcrt)


def test_parameters_are_kept_over_power_off_if_a_setting_says_so(tool: Tool, tmp_path: Path) -> None:
    (tool.folder / "main.io.toml").write_text(DESCRIPTION)
    image = tool.build("main", PROGRAM)
    config = tmp_path / "plc.cfg"
    config.write_text("[CmpIoMgr]\nStoreChangedParameters=1\n")
    with Plcrt(tmp_path / "plc.flash", "--config", str(config)) as plcrt:
        tool.ok("flash", "--port", plcrt.port, str(image))
        tool.ok("io", "param", "set", "Bench", "2=-5", "--type", "INT", "--port", plcrt.port)
        plcrt.stop()
        plcrt.start()
        assert tool.ok("io", "param", "get", "Bench", "2", "--type", "INT", "--port", plcrt.port)["value"] == -5
        tool.ok("files", "delete", "IoConfig.par", "--port", plcrt.port)
        plcrt.stop()
        plcrt.start()
        assert tool.ok("io", "param", "get", "Bench", "2", "--type", "INT", "--port", plcrt.port)["value"] == 0


def test_program_of_another_board_is_refused_by_its_name(tool: Tool, tmp_path: Path) -> None:
    """What a machine is, only its user can say: plcrt --board."""
    (tool.folder / "main.io.toml").write_text(DESCRIPTION)
    (tool.folder / "press.toml").write_text('name = "Press 4"\n')
    image = tool.build("main", PROGRAM, "--device", "press.toml")
    assert tool.ok("info", str(image))["board"] == "Press 4"
    for board, said in (("Press 4", None), ("Press 5", "those of the board Press 4, this is Press 5"), (None, None)):
        options = () if board is None else ("--board", board)
        with Plcrt(tmp_path / f"{board}.flash", *options) as other:
            done = tool("flash", "--port", other.port, str(image))
            assert (done.status, said or "") == (0 if said is None else 1, said if said and said in done.err else "")


def lost_and_found(tool: Tool, link: tuple[str, ...], eventually) -> None:  # type: ignore[no-untyped-def]
    """A device that does not answer is shown, and the program knows; both end when it answers again."""

    def state() -> str:
        return str(tool.ok("io", "status", *link)["devices"][0]["state"])

    absent = str(int(lib.IO_SIM_ABSENT))
    tool.ok("io", "param", "set", "Bench", f"{absent}=1", *link)
    assert eventually(lambda: state() == "not found")
    assert eventually(lambda: not tool.ok("read", *link, "Bench.ok")["values"]["Bench.ok"])
    tool.ok("io", "param", "set", "Bench", f"{absent}=0", *link)
    assert eventually(lambda: state() == "ok")


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
