"""Modbus TCP devices that are found by name or by an IPv6 address."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest
from free_ports import free_port
from modbus_support import Devices

import plctool
from plctool.compiler import compile_sources
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually

PROGRAM = "PROGRAM Main\nVAR level, other : INT; count : UDINT; END_VAR\ncount := count + 1;\nEND_PROGRAM\n"
LINE = """
[[modbus.tcp]]
host = "{host}"
port = {port}
framing = "{framing}"
[[modbus.tcp.device]]
name = "{name}"
unit = 3
timeout = "T#200ms"
read = [ {{ function = 3, address = 40001, every = "T#20ms", var = "Main.{var}" }} ]
"""


def has_ip6() -> bool:
    try:
        with socket.create_server(("::1", 0), family=socket.AF_INET6):
            return True
    except OSError:
        return False


def image(folder: Path, *lines: dict[str, object]) -> Path:
    """A program with these lines, compiled."""
    (folder / "main.st").write_text(PROGRAM)
    (folder / "main.io.toml").write_text("".join(LINE.format(**line) for line in lines))
    compile_sources([folder / "main.st"]).write(folder / "main.cdl")
    return folder / "main.cdl"


@pytest.mark.parametrize("framing", ["tcp", "rtu"])
@pytest.mark.parametrize(("host", "listens"), [("localhost", "127.0.0.1"), ("::1", "::1"), ("[::1]", "::1")])
def test_a_device_is_found_by_name_and_by_ip6(tmp_path: Path, host: str, listens: str, framing: str) -> None:
    if ":" in listens and not has_ip6():
        pytest.skip("this machine has no IPv6")
    port = free_port()
    program = image(tmp_path, {"host": host, "port": port, "framing": framing, "name": "Meter", "var": "level"})
    devices = Devices([3], tcp=port, rtu=framing == "rtu", host=listens)
    with Plcrt(tmp_path / "flash") as plcrt, plctool.connect(f"serial:{plcrt.port}") as plc:
        with devices:
            plc.flash(program)
            eventually(lambda: plc.read("Meter.ok"))
            devices.memory[3][0] = 77
            eventually(lambda: plc.read("Main.level") == 77)
        eventually(lambda: not plc.read("Meter.ok"))
        with devices:
            eventually(lambda: plc.read("Meter.ok"))


def test_a_name_that_nothing_has_is_lost_with_the_reason_and_delays_nothing(tmp_path: Path) -> None:
    """Where no name server is reached, that is the reason."""
    port = free_port()
    program = image(
        tmp_path,
        {"host": "no-such-host.invalid", "port": 502, "framing": "tcp", "name": "Gone", "var": "other"},
        {"host": "localhost", "port": port, "framing": "tcp", "name": "Meter", "var": "level"},
    )
    with (
        Devices([3], tcp=port),
        Plcrt(tmp_path / "flash") as plcrt,
        plctool.connect(f"serial:{plcrt.port}") as plc,
    ):
        plc.flash(program)
        eventually(lambda: plc.read("Meter.ok"))
        eventually(lambda: any("Gone is lost" in entry.text for entry in plc.log()))
        reasons = [entry.text for entry in plc.log() if "Gone is lost" in entry.text]
        assert reasons[0].removeprefix("Gone is lost: ") in ("its host name is not known", "no name server replies")
        before = plc.read("Main.count")
        eventually(lambda: plc.read("Main.count") > before)
        assert plc.read("Meter.ok") and not plc.read("Gone.ok")
