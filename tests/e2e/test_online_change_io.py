"""Online changes of programs with Modbus and CANopen devices on plcrt."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from free_ports import free_port
from pymodbus.client import ModbusTcpClient
from test_canopen_manager_of_plcrt import ForeignNode, hub  # noqa: F401
from test_modbus_losses import DESCRIPTION, PROGRAM, Drive

sys.path.append(str(Path(__file__).parents[1]))

from canopen_programs import write_program
from online_programs import built

from plctool import connect
from plctool.core import lib
from plctool.device import Plc
from plctool.errors import DeviceError
from plctool.iec.types import UDINT
from plctool.testing.can_hub import CanHub
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually

SERVER = """
[modbus.server.tcp]
name = "Scada"
address = "127.0.0.1"
port = {own}
holding = {{ 40001 = "Main.setpoint" }}
"""
BODY = "IF level = 7"


def change(plc: Plc, folder: Path, text: str) -> None:
    result = built(folder, text, plc.symbols())
    assert result.change is not None and result.change.problems == []
    plc.add_symbols(result.symbols)
    plc.change(result.image)


def test_connections_stay_and_nothing_is_written_again(tmp_path: Path) -> None:
    """To a device of the program, and from a client of it. The memory of each image is used by another one after two
    changes."""
    port, own = free_port(), free_port()
    text = PROGRAM.replace("VAR ", "VAR setpoint : INT; n : DINT; ").replace(BODY, f"n := n + 1;\n{BODY}")
    (tmp_path / "main.io.toml").write_text(DESCRIPTION.format(port=port) + SERVER.format(own=own))
    result = built(tmp_path, text)
    with (
        Drive(port) as drive,
        Plcrt(tmp_path / "flash") as plcrt,
        connect(f"serial:{plcrt.port}") as plc,
        ModbusTcpClient("127.0.0.1", port=own, timeout=20, retries=0) as client,
    ):
        plc.add_symbols(result.symbols)
        plc.flash(result.image)
        eventually(lambda: plc.read("Main.good") > 10 and drive.writes == 2)
        eventually(client.connect)
        for n in range(6):
            assert not client.write_register(0, n).isError()
            change(plc, tmp_path, text.replace("n + 1", f"n + {n + 2}"))
            assert client.read_holding_registers(0, count=1).registers == [n]
            eventually(lambda n=n: plc.read("Main.setpoint") == n)  # type: ignore[misc]
            good = plc.read("Main.good")
            eventually(lambda good=good: plc.read("Main.good") > good)  # type: ignore[misc]
        assert (len(drive._connections), drive.writes, plc.read("Main.bad")) == (1, 2, 0)
        assert plc.io_read_parameter("Scada", int(lib.MODBUS_PARAM_ACCEPTED), UDINT) == 1
        plc.write({"Main.speed": 12})
        eventually(lambda: drive.written[6, 10] == 12)
        (tmp_path / "main.io.toml").write_text(DESCRIPTION.format(port=port))
        result = built(tmp_path, text, plc.symbols())
        assert result.change is not None
        assert result.change.problems == ["the I/O configuration has changed (Drive, Scada)"]
        crc = plc.status().image_crc
        with pytest.raises(DeviceError, match="I/O configuration has changed; download the program"):
            plc.change(result.image)
        assert plc.status().image_crc == crc
        assert not client.read_holding_registers(0, count=1).isError()


def test_canopen_node_stays_in_operation(hub: CanHub, tmp_path: Path) -> None:  # noqa: F811
    folder = write_program(tmp_path / "program").parent
    text = (folder / "app.st").read_text()
    (folder / "app.st").unlink()
    devices = folder / "app.io.toml"
    devices.write_text(devices.read_text().replace("T#200ms", "T#4s"))  # on a busy machine it may be late
    result = built(folder, text)
    options = ("--can", f"slcan:{hub.paths[0]}", "--node", "5")
    with Plcrt(tmp_path / "flash", *options), connect(f"can:slcan:{hub.paths[1]}?node=5") as plc:
        plc.add_symbols(result.symbols)
        plc.flash(result.image)
        with ForeignNode(f"slcan:{hub.paths[2]}") as foreign:
            eventually(lambda: plc.read("Valves.ok"))
            eventually(lambda: foreign.send_inputs(b"\x10\x27\x5a") or foreign.outputs[-1:] == [b"\x5a"])
            lost, since = plc.read("Main.lost"), len(foreign.outputs)
            boots = plc.io_read_parameter("Valves", int(lib.CANOPEN_PARAM_BOOTS), UDINT)
            for n in range(3):
                change(plc, folder, text.replace("coils := inputs;", f"coils := inputs; bytes[0] := {n};"))
            eventually(lambda: foreign.send_inputs(b"\x10\x27\x5b") or foreign.outputs[-1:] == [b"\x5b"])
            assert plc.read("Main.lost") == lost
            assert set(foreign.outputs[since:]) <= {b"\x5a", b"\x5b"}
            assert plc.io_read_parameter("Valves", int(lib.CANOPEN_PARAM_BOOTS), UDINT) == boots
