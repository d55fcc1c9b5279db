"""Modbus of a real plcrt with pymodbus as clients and devices, over time; each function is in test_modbus_matrix.py."""

from __future__ import annotations

import socket
import struct
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import pytest
from free_ports import free_port
from modbus_support import Devices, Wire
from pymodbus.client import ModbusTcpClient

import plctool
from plctool.cli.commands.io import parameter
from plctool.compiler import compile_sources
from plctool.core import lib
from plctool.device import Plc
from plctool.errors import DeviceError, PlcError, UsageError
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually

CONNECTIONS = 32  # MODBUS_MAX_CONNECTIONS of plcrt
FIRST_COUNTER = int(lib.MODBUS_PARAM_REQUESTS)

PROGRAM = """
PROGRAM Main
VAR
    n : DINT; setpoint : INT; ratio : REAL; recipe : ARRAY[0..9] OF INT; enable, lamp : BOOL;
    echo : INT; half : REAL; sum : DINT; alive : BOOL;
    ghost_in, ghost_out : INT;
    power, energy : REAL; counter : UDINT; speed, reference : INT; pump : BOOL; level : INT;
    wanted, given : INT; wanted_real, given_real : REAL;
END_VAR
VAR i : INT; END_VAR
n := n + 1;
echo := setpoint;
half := ratio / 2.0;
alive := enable;
lamp := enable;
sum := 0;
FOR i := 0 TO 9 DO sum := sum + recipe[i]; END_FOR
END_PROGRAM
CONFIGURATION C RESOURCE R ON PLC
    TASK T(INTERVAL := T#10ms, PRIORITY := 1);
    PROGRAM Main WITH T : Main;
END_RESOURCE END_CONFIGURATION
"""

DESCRIPTION = """
[modbus.server.tcp]
name = "Scada"
address = "127.0.0.1"
port = {server}
as_bits = true
input = {{ 30001 = "Main.half", 30003 = "Main.sum" }}
coils = {{ 5001 = "Main.enable" }}
discrete = {{ 15001 = "Main.lamp" }}
identification = {{ vendor = "Acme", product = "Tanks", version = "1.2" }}
[modbus.server.tcp.holding]
40001 = "Main.setpoint"
40002 = "Main.ratio"
40011 = "Main.recipe"
40030 = {{ var = "Main.echo", read_only = true }}

[[modbus.rs485]]
port = "{master_line}"
baud = 38400
[[modbus.rs485.device]]
name = "Meter"
unit = 3
timeout = "T#100ms"
[[modbus.rs485.device.read]]
function = 3
address = 40001
every = "T#50ms"
vars = ["Main.power", "Main.energy"]
[[modbus.rs485.device.write]]
function = 15
address = 801
every = "T#100ms"
var = "Main.pump"
[[modbus.rs485.device]]
name = "Absent"
unit = 4
timeout = "T#100ms"
[[modbus.rs485.device.read]]
function = 4
address = 30001
every = "T#50ms"
var = "Main.level"

[[modbus.rs485]]
name = "Second"
port = "{master_line}"
optional = true
[[modbus.rs485.device]]
name = "Ghost"
unit = 5
[[modbus.rs485.device.read]]
function = 3
address = 40001
every = "T#50ms"
var = "Main.ghost_in"
[[modbus.rs485.device.write]]
function = 6
address = 40001
every = "T#50ms"
var = "Main.ghost_out"

[[modbus.tcp]]
host = "127.0.0.1"
port = {drive}
[[modbus.tcp.device]]
name = "Drive"
unit = 1
timeout = "T#5s"
order = "CDAB"
[[modbus.tcp.device.read]]
function = 4
address = 30005
every = "T#50ms"
var = "Main.counter"
on_error = "zero"
[[modbus.tcp.device.write]]
function = 16
address = 40021
on_change = true
verify = true
vars = ["Main.speed"]
[[modbus.tcp.device.read_write]]
every = "T#50ms"
[modbus.tcp.device.read_write.read]
address = 40041
vars = ["Main.given", "Main.given_real"]
[modbus.tcp.device.read_write.write]
address = 40041
vars = ["Main.wanted", "Main.wanted_real"]
"""


@dataclass
class Plant:
    """The PLC with its program, and all that is around it."""

    plc: Plc
    folder: Path  # of its program
    server: int  # TCP port
    master: Wire
    meter: Devices
    drive: Devices

    def tcp(self) -> ModbusTcpClient:
        """A client of the PLC's server."""
        return ModbusTcpClient("127.0.0.1", port=self.server, timeout=10, retries=0)


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Plant]:
    folder = tmp_path_factory.mktemp("modbus")
    server, drive = free_port(), free_port()
    with Wire() as master:
        master.absent = {4}
        (folder / "main.st").write_text(PROGRAM)
        places = {"server": server, "drive": drive, "master_line": master.plc}
        (folder / "main.io.toml").write_text(DESCRIPTION.format(**places))
        image = folder / "main.cdl"
        compile_sources([folder / "main.st"]).write(image)
        meter = Devices([3], serial=master.other, baud=38400)
        drives = Devices([1], tcp=drive)
        with meter, drives, Plcrt(folder / "flash") as plcrt, plctool.connect(f"serial:{plcrt.port}") as plc:
            plc.flash(image)
            yield Plant(plc, folder, server, master, meter, drives)


def words(value: float) -> list[int]:
    """A REAL in registers, the high one first."""
    high, low = struct.unpack(">HH", struct.pack(">f", value))
    return [high, low]


# ---- the PLC as a server -------------------------------------------------------------------------------------------


def test_program_sees_what_is_written_and_the_client_what_it_computes(plant: Plant) -> None:
    with plant.tcp() as client:
        assert not client.write_register(0, 0x1234).isError()
        assert not client.write_registers(1, words(2.5)).isError()
        assert not client.write_registers(10, [1, 2, 3, 4, 5, 6, 7, 8, 9, 10]).isError()
        assert not client.write_coil(5000, True).isError()
        eventually(lambda: plant.plc.read("Main.setpoint", "Main.ratio", "Main.alive") ==
                   {"Main.setpoint": 0x1234, "Main.ratio": 2.5, "Main.alive": True})  # fmt: skip
        eventually(lambda: client.read_input_registers(0, count=2).registers == words(1.25))
        eventually(lambda: client.read_input_registers(2, count=2).registers == [0, 55])
        eventually(lambda: client.read_discrete_inputs(5000, count=1).bits[0])
        eventually(lambda: client.read_holding_registers(29, count=1).registers == [0x1234])
        assert client.read_coils(0, count=16).bits == [bool(0x1234 >> i & 1) for i in range(16)]


def test_read_only_registers_are_not_written(plant: Plant) -> None:
    with plant.tcp() as client:
        assert client.write_register(29, 1).exception_code == 2
        assert client.write_registers(0, [1, 2, 3, 4]).exception_code == 2  # the fourth is not there


def test_identification_is_that_of_the_description(plant: Plant) -> None:
    with plant.tcp() as client:
        information = client.read_device_information().information
        assert [information[i] for i in range(3)] == [b"Acme", b"Tanks", b"1.2"]


def test_real_is_never_torn(plant: Plant) -> None:
    """One client writes a REAL whose registers both change; another one and the program see one of both values."""
    both = [struct.unpack(">f", bytes.fromhex(bits))[0] for bits in ("3FAA5555", "C055AAAA")]
    done = threading.Event()

    def write() -> None:
        with plant.tcp() as writer:
            while not done.is_set():
                for value in both:
                    assert not writer.write_registers(1, words(value)).isError()

    with plant.tcp() as client, ThreadPoolExecutor() as threads:
        assert not client.write_registers(1, words(both[0])).isError()
        eventually(lambda: words(plant.plc.read("Main.ratio")) == words(both[0]))
        writing = threads.submit(write)
        try:
            seen = [tuple(client.read_holding_registers(1, count=2).registers) for _ in range(500)]
            used = [tuple(words(plant.plc.read("Main.ratio"))) for _ in range(200)]
        finally:
            done.set()
        writing.result()
    assert set(seen + used) == {tuple(words(value)) for value in both}


def test_one_client_more_than_there_is_room_for_replaces_the_idlest(plant: Plant) -> None:
    sockets = [socket.create_connection(("127.0.0.1", plant.server), timeout=20) for _ in range(CONNECTIONS)]
    question = bytes([0, 1, 0, 0, 0, 6, 1, 3, 0, 0, 0, 1])
    for one in sockets[1:]:
        one.sendall(question)
        assert one.recv(100)[7] == 3
    with plant.tcp() as client:
        assert not client.read_holding_registers(0, count=1).isError()
        assert sockets[0].recv(1) == b""
    for one in sockets[1:]:
        one.sendall(question)
        assert one.recv(100)[7] == 3
    for one in sockets:
        one.close()


def test_flood_of_requests_is_replied_to_in_order(plant: Plant) -> None:
    count = 3000
    with socket.create_connection(("127.0.0.1", plant.server), timeout=60) as flood, plant.tcp() as client:
        requests = b"".join(struct.pack(">HHHBBHH", i, 0, 6, 1, 3, 0, 1) for i in range(count))
        flood.sendall(requests)
        assert not client.read_holding_registers(0, count=1).isError()
        replies = b""
        while len(replies) < 11 * count:
            part = flood.recv(65536)
            assert part
            replies += part
        assert [struct.unpack(">H", replies[11 * i : 11 * i + 2])[0] for i in range(count)] == list(range(count))


# ---- the PLC as a client -------------------------------------------------------------------------------------------


def ok(plant: Plant, device: str) -> bool:
    """Whether the program sees a device as well."""
    return bool(plant.plc.read(f"{device}.ok"))


def test_registers_of_a_device_reach_the_program(plant: Plant) -> None:
    eventually(lambda: ok(plant, "Meter"))
    plant.meter.memory[3][0:4] = words(12.5) + words(-3.0)
    eventually(lambda: plant.plc.read("Main.power", "Main.energy") == {"Main.power": 12.5, "Main.energy": -3.0})


def test_outputs_reach_the_device(plant: Plant) -> None:
    eventually(lambda: ok(plant, "Meter"))
    plant.plc.write({"Main.pump": True})
    eventually(lambda: plant.meter.memory[3][50] & 1 == 1)
    plant.plc.write({"Main.pump": False})
    eventually(lambda: plant.meter.memory[3][50] & 1 == 0)


def test_absent_device_is_said_to_be_and_holds_up_no_other(plant: Plant) -> None:
    eventually(lambda: ok(plant, "Meter") and plant.plc.read("Absent.errors") >= 2)
    assert not ok(plant, "Absent")
    before = plant.meter.count(3)
    eventually(lambda: plant.meter.count(3) >= before + 100)


def test_counters_of_the_driver_have_names(plant: Plant) -> None:
    eventually(lambda: parameter(plant.plc, "Absent", "timeouts", None)["value"] >= 2)
    assert parameter(plant.plc, "Meter", "Requests", None)["value"] > 0
    absent = ("Second", "Ghost")  # an optional line that is in use, and its device
    present = [d for d in plant.plc.symbols().io["devices"] if d["name"] not in absent]
    counters = [(d["name"], p["name"]) for d in present for p in d["parameters"] if p["id"] >= FIRST_COUNTER]
    assert len(counters) == 3 * 7 + 6 + 2, "of three devices, the server and two lines"
    assert all(parameter(plant.plc, device, name, None)["value"] >= 0 for device, name in counters)
    with pytest.raises(UsageError, match=r"Meter has no parameter requets; did you mean requests\?"):
        parameter(plant.plc, "Meter", "requets", None)


def test_low_register_may_come_first(plant: Plant) -> None:
    eventually(lambda: ok(plant, "Drive"))
    plant.drive.memory[1][4:6] = [0x5678, 0x1234]
    eventually(lambda: plant.plc.read("Main.counter") == 0x12345678)


def test_change_is_written_once_and_verified(plant: Plant) -> None:
    eventually(lambda: ok(plant, "Drive"))
    plant.plc.write({"Main.speed": 0})
    eventually(lambda: plant.drive.memory[1][20] == 0)
    before = plant.drive.requests.count((1, 16))
    plant.plc.write({"Main.speed": 1500})
    eventually(lambda: plant.drive.memory[1][20] == 1500)
    reads = plant.drive.count(1)
    eventually(lambda: plant.drive.count(1) >= reads + 20)
    assert plant.drive.requests.count((1, 16)) == before + 1


def test_one_request_writes_and_reads(plant: Plant) -> None:
    """Function 23: what is read is there after what is written."""
    plant.plc.write({"Main.wanted": 77, "Main.wanted_real": -0.625})
    eventually(lambda: plant.plc.read("Main.given") == 77)
    assert plant.plc.read("Main.given_real") == -0.625
    assert (1, 23) in plant.drive.requests


def test_scan_finds_the_devices_of_a_line(plant: Plant) -> None:
    """The exchange of data goes on meanwhile. pymodbus says what it is for every unit, without words."""
    eventually(lambda: ok(plant, "Meter"))
    asked = plant.meter.count(3)
    line = next(d for d in plant.plc.io_devices() if d.index == plant.plc.io_device("Meter").parent)
    # A unit whose reply is late is left out.
    eventually(lambda: (found := next(plant.plc.io_scan(line.name), None)) and (found.slot, found.name) == (1, ""))
    eventually(lambda: plant.meter.count(3) > asked + 20 and ok(plant, "Meter"))


def test_scan_of_a_device_names_its_bus(plant: Plant) -> None:
    with pytest.raises(DeviceError, match=r"Meter has no bus of its own; it is on .*: plctool io scan"):
        list(plant.plc.io_scan("Meter"))


def test_name_that_is_almost_one_of_a_device_is_a_question(plant: Plant) -> None:
    with pytest.raises(UsageError, match=r"no device Metre; did you mean Meter\?$"):
        plant.plc.io_device("Metre")


def test_a_part_of_a_number_is_refused_and_all_of_it_is_written(plant: Plant) -> None:
    """One register of a REAL, from a client that takes it for an INT."""
    with plant.tcp() as client:
        assert not client.write_registers(1, words(2.5)).isError()
        assert client.write_register(1, 16000).exception_code == 2
        assert client.write_registers(2, [1]).exception_code == 2
        assert client.write_registers(0, [1, 0x4080]).exception_code == 2  # INT and half of the REAL
        assert client.read_holding_registers(1, count=2).registers == words(2.5)
        assert not client.write_registers(0, [1, *words(4.0)]).isError()
        eventually(lambda: plant.plc.read("Main.ratio") == 4.0)


def test_server_whose_port_is_in_use_says_so_until_it_is_free(plant: Plant, tmp_path: Path) -> None:
    (tmp_path / "main.st").write_text("PROGRAM Main\nVAR n : INT; END_VAR\nEND_PROGRAM\n")
    with socket.create_server(("127.0.0.1", 0)) as other, Plcrt(tmp_path / "flash") as plcrt:
        port = other.getsockname()[1]
        description = f'[modbus.server.tcp]\nname = "S"\naddress = "127.0.0.1"\nport = {port}\n'
        (tmp_path / "main.io.toml").write_text(description + 'holding = { 40001 = "Main.n" }\n')
        compile_sources([tmp_path / "main.st"]).write(tmp_path / "main.cdl")
        with plctool.connect(f"serial:{plcrt.port}") as plc:
            plc.flash(tmp_path / "main.cdl")
            eventually(lambda: plc.io_device("S").state == "error")
            assert any("S cannot listen: its port is in use" in entry.text for entry in plc.log())
            other.close()
            eventually(lambda: plc.io_device("S").state == "ok")


def test_device_that_was_switched_off_comes_back_with_its_outputs(plant: Plant) -> None:
    eventually(lambda: ok(plant, "Drive"))
    plant.plc.write({"Main.speed": 321})
    eventually(lambda: plant.drive.memory[1][20] == 321)
    plant.drive.memory[1][4:6] = [7, 0]
    eventually(lambda: plant.plc.read("Main.counter") == 7)
    plant.drive.__exit__()
    eventually(lambda: not ok(plant, "Drive") and plant.plc.read("Main.counter") == 0)
    plant.drive.memory.clear()
    plant.drive.__enter__()
    eventually(lambda: ok(plant, "Drive"))
    eventually(lambda: plant.drive.memory[1][20] == 321)


def test_line_that_was_pulled_comes_back_without_a_command(plant: Plant) -> None:
    eventually(lambda: ok(plant, "Meter"))
    plant.master.pulled = True
    eventually(lambda: not ok(plant, "Meter"))
    plant.master.pulled = False
    eventually(lambda: ok(plant, "Meter"))


def test_damaged_frames_are_not_taken(plant: Plant) -> None:
    eventually(lambda: ok(plant, "Meter"))
    before = plant.plc.read("Main.power")
    plant.master.flipped = True
    plant.meter.memory[3][0:2] = words(99.0)
    eventually(lambda: not ok(plant, "Meter"))
    assert plant.plc.read("Main.power") == before
    plant.master.flipped = False
    eventually(lambda: plant.plc.read("Main.power") == 99.0)


# ---- what a controller cannot have ---------------------------------------------------------------------------------


def test_optional_line_that_is_in_use_is_left_out(plant: Plant) -> None:
    assert not ok(plant, "Ghost")
    assert not ok(plant, "Second")
    eventually(lambda: ok(plant, "Meter"))


def test_line_that_two_want_refuses_the_image(plant: Plant, tmp_path: Path) -> None:
    description = '[[modbus.rs485]]\nport = "{}"\n[[modbus.rs485]]\nname = "Twice"\nport = "{}"\n'
    (tmp_path / "main.st").write_text(PROGRAM)
    second_name = f"/.{plant.master.plc}"  # that it is the same line is known to the controller only
    (tmp_path / "main.io.toml").write_text(description.format(plant.master.plc, second_name))
    compile_sources([tmp_path / "main.st"]).write(tmp_path / "main.cdl")
    with pytest.raises(PlcError, match=r"Twice \(IoDrvModbus\): the serial line \".*\" is in use"):
        plant.plc.flash(tmp_path / "main.cdl")
    eventually(lambda: ok(plant, "Meter"))  # the old program goes on, with its devices


def test_line_whose_direction_the_port_cannot_switch_refuses_the_image(plant: Plant, tmp_path: Path) -> None:
    """Pseudo terminals cannot."""
    (tmp_path / "main.st").write_text(PROGRAM)
    with Wire() as wire:
        (tmp_path / "main.io.toml").write_text(f'[[modbus.rs485]]\nname = "Bus"\nport = "{wire.plc}"\ndrive = true\n')
        compile_sources([tmp_path / "main.st"]).write(tmp_path / "main.cdl")
        with pytest.raises(PlcError, match=r"Bus .*cannot run with this baud, parity, stop_bits or drive"):
            plant.plc.flash(tmp_path / "main.cdl")
    why = f"Serial device {wire.plc} cannot run with its settings: its driver cannot switch the direction of the bus"
    assert any(why in entry.text for entry in plant.plc.log())
    eventually(lambda: ok(plant, "Meter"))
