"""A serial line in the network (`framing = "rtu"`): plcrt with devices of pymodbus whose frames have a CRC."""

from __future__ import annotations

from pathlib import Path

import pytest
from free_ports import free_port
from modbus_support import Devices

import plctool
from plctool.compiler import compile_sources
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually

PROGRAM = "PROGRAM Main\nVAR level, other, speed : INT; END_VAR\nEND_PROGRAM\n"
DESCRIPTION = """
[[modbus.tcp]]
host = "127.0.0.1"
port = {port}
framing = "rtu"
[[modbus.tcp.device]]
name = "Tank"
unit = 3
read = [ {{ function = 3, address = 40001, every = "T#20ms", var = "Main.level" }} ]
write = [ {{ function = 16, address = 40011, on_change = true, verify = true, var = "Main.speed" }} ]
[[modbus.tcp.device]]
name = "Pump"
unit = 4
read = [ {{ function = 4, address = 30001, every = "T#20ms", var = "Main.other" }} ]
"""


@pytest.mark.parametrize("framing", ["rtu", "tcp"])
def test_registers_go_over_the_gateway_if_it_has_the_same_frames(tmp_path: Path, framing: str) -> None:
    port = free_port()
    (tmp_path / "main.st").write_text(PROGRAM)
    (tmp_path / "main.io.toml").write_text(DESCRIPTION.format(port=port).replace('"rtu"', f'"{framing}"'))
    compile_sources([tmp_path / "main.st"]).write(tmp_path / "main.cdl")
    devices = Devices([3, 4], tcp=port, rtu=True)
    with devices, Plcrt(tmp_path / "flash") as plcrt, plctool.connect(f"serial:{plcrt.port}") as plc:
        plc.flash(tmp_path / "main.cdl")
        if framing == "tcp":
            eventually(lambda: plc.io_device("Tank").errors >= 2)
            assert not plc.read("Tank.ok")
            return
        eventually(lambda: plc.read("Tank.ok") and plc.read("Pump.ok"))
        devices.memory[3][0], devices.memory[4][0] = 77, 88
        eventually(lambda: (plc.read("Main.level"), plc.read("Main.other")) == (77, 88))
        plc.write({"Main.speed": 1234})
        eventually(lambda: devices.memory[3][10] == 1234)
        assert next(plc.io_scan("modbus_127.0.0.1")).slot in (1, 3)
