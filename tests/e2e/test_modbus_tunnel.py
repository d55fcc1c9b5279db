"""Tools within Modbus: one RS-485 line with plcrt, another master and plctool on it, and plctool through a gateway."""

from __future__ import annotations

import os
import random
import select
import socket
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from free_ports import free_port
from pymodbus.client import ModbusSerialClient, ModbusTcpClient
from pymodbus.exceptions import ModbusException

import plctool
from plctool.compiler import compile_sources
from plctool.device import Plc
from plctool.errors import LinkError, PlcError
from plctool.link.modbus import modbus_crc
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually

OWN_UNIT = 247  # of plcrt while no program has a server
BAUD = 38400

PROGRAM = """
PROGRAM Main
VAR n : DINT; setpoint, echo : INT; level : INT; text : STRING := '{text}'; END_VAR
n := n + 1;
echo := setpoint + 1;
END_PROGRAM
CONFIGURATION C RESOURCE R ON PLC
    TASK T(INTERVAL := T#10ms, PRIORITY := 1);
    PROGRAM Main WITH T : Main;
END_RESOURCE END_CONFIGURATION
"""

SERVER = """
[modbus.server.rs485]
name = "Scada"
port = "{port}"
baud = 38400
unit = {unit}
holding = {{ 40001 = "Main.setpoint" }}
input = {{ 30001 = "Main.echo" }}
"""

CLIENT = """
[[modbus.rs485]]
port = "{port}"
[[modbus.rs485.device]]
name = "Meter"
unit = 3
[[modbus.rs485.device.read]]
function = 3
address = 40001
every = "T#50ms"
var = "Main.level"
"""


class Rs485:
    """A line with several ends: what one sends arrives at all others. `plc`, `tool` and `scada` are pseudo terminals.
    Context manager. `lose`: odds per piece of a frame that it is not heard; `flip`: that a bit of it is another one."""

    def __init__(self) -> None:
        self._pairs = [os.openpty() for _ in range(3)]
        for _, slave in self._pairs:
            tty.setraw(slave)
        self.plc, self.tool, self.scada = (os.ttyname(slave) for _, slave in self._pairs)
        self.lose = self.flip = 0.0
        self.deaf = 0  # pieces from the PLC that no end hears, from now on
        self.damaged = 0
        self._random = random.Random(1)
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Rs485:
        self._thread.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self._end.set()
        self._thread.join()
        for fd in (fd for pair in self._pairs for fd in pair):
            os.close(fd)

    def _run(self) -> None:
        ends = [master for master, _ in self._pairs]
        while not self._end.is_set():
            for ready in select.select(ends, [], [], 0.05)[0]:
                data = self._damage(ready == ends[0], bytearray(os.read(ready, 4096)))
                for end in ends:
                    if end != ready and select.select([], [end], [], 0)[1]:  # an end that is not read is full
                        os.write(end, data)

    def _damage(self, from_plc: bool, data: bytearray) -> bytes:
        if from_plc and self.deaf:
            self.deaf -= 1
            self.damaged += 1
            return b""
        if self._random.random() < self.lose:
            self.damaged += 1
            return bytes(data[: len(data) // 2])
        if self._random.random() < self.flip:
            self.damaged += 1
            data[self._random.randrange(len(data))] ^= 1 << self._random.randrange(8)
        return bytes(data)


class Scada:
    """Another master, which polls a register of the program all the time. Context manager."""

    def __init__(self, port: str, unit: int) -> None:
        self._client = ModbusSerialClient(port, baudrate=BAUD, timeout=0.3, retries=0)
        self._unit = unit
        self.good = self.bad = 0
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Scada:
        assert self._client.connect()
        self._thread.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self._end.set()
        self._thread.join()
        self._client.close()

    def _run(self) -> None:
        while not self._end.wait(0.05):
            try:
                reply = self._client.read_input_registers(0, count=1, device_id=self._unit)
                good = not reply.isError() and len(reply.registers) == 1
            except ModbusException:
                good = False
            self.good += good
            self.bad += not good


class Gateway:
    """A Modbus TCP gateway to the line at a pseudo terminal, as simple as one can be. Context manager."""

    def __init__(self, port: str) -> None:
        self._line = os.open(port, os.O_RDWR | os.O_NOCTTY)
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.place = f"127.0.0.1:{self._listener.getsockname()[1]}"
        self.requests = 0
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def __enter__(self) -> Gateway:
        return self

    def __exit__(self, *exc: object) -> None:
        self._listener.shutdown(socket.SHUT_RDWR)  # ends `accept`
        self._thread.join()
        self._listener.close()
        os.close(self._line)

    def _run(self) -> None:
        while True:
            try:
                connected, _ = self._listener.accept()
            except OSError:
                return
            with connected, suppress(ConnectionError):
                self._serve(connected)

    def _serve(self, connected: socket.socket) -> None:
        while head := connected.recv(6, socket.MSG_WAITALL):
            adu = connected.recv(int.from_bytes(head[4:6]), socket.MSG_WAITALL)
            self.requests += 1
            os.write(self._line, adu + modbus_crc(adu))
            frame = self._frame()
            good = frame and frame[-2:] == modbus_crc(frame[:-2])
            adu = frame[:-2] if good else bytes([adu[0], adu[1] | 0x80, 11])
            connected.sendall(head[:4] + len(adu).to_bytes(2) + adu)

    def _frame(self) -> bytes:
        """What comes up to a silence."""
        frame, patience = b"", 0.5
        while select.select([self._line], [], [], patience)[0]:
            frame += os.read(self._line, 300)
            patience = 0.005
        return frame


@pytest.fixture(autouse=True)
def _no_gateway_of_tools(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PLCTOOL_GATEWAY", "off")


@pytest.fixture
def line() -> Iterator[Rs485]:
    with Rs485() as made:
        yield made


@pytest.fixture
def plcrt(line: Rs485, tmp_path: Path) -> Iterator[Plcrt]:
    with Plcrt(tmp_path / "flash", "--tunnel", line.plc) as made:
        yield made


Build = Callable[..., Path]


@pytest.fixture
def build(line: Rs485, tmp_path: Path) -> Build:
    def make(name: str, description: str = "", unit: int = OWN_UNIT) -> Path:
        folder = tmp_path / name
        folder.mkdir()
        (folder / "main.st").write_text(PROGRAM.format(text=name))
        if description:
            (folder / "main.io.toml").write_text(description.format(port=line.plc, unit=unit))
        compile_sources([folder / "main.st"]).write(folder / "main.cdl")
        return folder / "main.cdl"

    return make


def connect(line: Rs485, unit: int = OWN_UNIT) -> Plc:
    return plctool.connect(f"modbus:{line.tool}?unit={unit}")


def text_of(plc: Plc) -> object:
    """Which of the programs runs."""
    return plc.read("Main.text")


def read_echo(line: Rs485, unit: int) -> int:
    """-1: the server is not there yet."""
    with ModbusSerialClient(line.scada, baudrate=BAUD, timeout=2, retries=3) as client:
        reply = client.read_input_registers(0, count=1, device_id=unit)
        return -1 if reply.isError() else int(reply.registers[0])


# ---- flash, read, watch --------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("plcrt")
def test_program_is_flashed_read_and_watched_through_the_line(line: Rs485, build: Build) -> None:
    with connect(line) as plc:
        plc.flash(build("first"))
        assert text_of(plc) == "first"
        plc.write({"Main.setpoint": 41})
        eventually(lambda: plc.read("Main.echo") == 42)
        values = [plc.read("Main.n") for _ in range(20)]
        assert values == sorted(values)
        assert values[0] < values[-1]


@pytest.mark.usefixtures("plcrt")
def test_download_that_begins_changes_or_ends_the_server_comes_to_its_end(line: Rs485, build: Build) -> None:
    with connect(line) as plc:
        for name, description in (("plain", ""), ("served", SERVER), ("again", SERVER + "# other\n"), ("bare", "")):
            plc.flash(build(name, description))
            assert text_of(plc) == name
            if description:
                eventually(lambda: read_echo(line, OWN_UNIT) == 1)
        with ModbusSerialClient(line.scada, baudrate=BAUD, timeout=2, retries=3) as client:
            reply = client.read_input_registers(0, count=1, device_id=OWN_UNIT)
            assert reply.exception_code == 1
            assert client.read_device_information(device_id=OWN_UNIT).information[0]


@pytest.mark.usefixtures("plcrt")
def test_server_with_another_address_has_the_tools_at_its_own(
    line: Rs485, build: Build, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("plctool.link.services.SLOW_PATIENCE", 2.0)
    with connect(line) as plc, pytest.raises(LinkError, match="unit 247"):
        plc.flash(build("moved", SERVER, 7))  # it is in the device, but its reply is at the other address
    with connect(line, 7) as plc:
        assert text_of(plc) == "moved"
        plc.start()  # what the tool would have done next
        eventually(lambda: read_echo(line, 7) == 1)


@pytest.mark.usefixtures("plcrt")
def test_another_master_polls_while_the_tool_works(line: Rs485, build: Build) -> None:
    first, second = build("first", SERVER), build("second", SERVER)
    with connect(line) as plc:
        plc.flash(first)
        with Scada(line.scada, OWN_UNIT) as scada:
            for image, name in ((second, "second"), (first, "first")):
                plc.flash(image)
                assert text_of(plc) == name
            before = scada.good
            for _ in range(20):
                assert text_of(plc) == "first"
            eventually(lambda: text_of(plc) == "first" and scada.good > before + 10)


def test_program_goes_through_a_gateway(plcrt: Plcrt, line: Rs485, build: Build) -> None:
    assert plcrt.process
    with Gateway(line.tool) as gateway:
        with plctool.connect(f"modbus-tcp:{gateway.place}?unit={OWN_UNIT}") as plc:
            plc.flash(build("far"))
            assert text_of(plc) == "far"
        assert gateway.requests > 10


# ---- what goes wrong -----------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("plcrt")
@pytest.mark.parametrize(("lose", "flip"), [(0.05, 0.0), (0.0, 0.05)])
def test_lost_and_damaged_frames_cost_time_only(line: Rs485, build: Build, lose: float, flip: float) -> None:
    image = build("bad_line", SERVER)
    line.lose, line.flip = lose, flip
    with connect(line) as plc:
        plc.flash(image)
        for _ in range(30):
            assert text_of(plc) == "bad_line"
    assert line.damaged > 3


@pytest.mark.usefixtures("plcrt")
def test_lost_reply_is_asked_for_again(line: Rs485, build: Build) -> None:
    with connect(line) as plc:
        plc.flash(build("kept"))
        for setpoint in range(1, 6):
            line.deaf = 2
            plc.write({"Main.setpoint": setpoint})
            eventually(lambda wanted=setpoint: plc.read("Main.echo") == wanted + 1)
        assert line.damaged == 10


@pytest.mark.usefixtures("plcrt")
def test_second_tool_takes_the_line_over_and_the_first_one_hears_of_it(line: Rs485, build: Build) -> None:
    with connect(line) as first:
        first.flash(build("taken"))
        frame = bytes([OWN_UNIT, 0x2B, 0x80, 0])
        begins = os.open(line.scada, os.O_RDWR | os.O_NOCTTY)
        time.sleep(0.1)
        os.write(begins, frame + modbus_crc(frame))
        time.sleep(0.2)
        os.close(begins)
        eventually(lambda: reads_again(first))


def reads_again(plc: Plc) -> bool:
    """Whether a tool gets on after it has lost its connection."""
    try:
        return text_of(plc) == "taken"
    except LinkError as error:
        assert "forgotten" in error.message
        return False


@pytest.mark.usefixtures("plcrt")
def test_wrong_address_says_which_one_was_asked(line: Rs485) -> None:
    with connect(line, 9) as plc, pytest.raises(LinkError) as caught:
        plc.status()
    assert f"{line.tool}, unit 9" in caught.value.message
    assert caught.value.code == "no-answer"


def test_server_of_a_program_alone_lets_no_tool_in(line: Rs485, build: Build, tmp_path: Path) -> None:
    with Plcrt(tmp_path / "closed") as plcrt, plctool.connect(f"serial:{plcrt.port}") as near:
        near.flash(build("closed_one", SERVER))
        with connect(line) as far, pytest.raises(LinkError) as caught:
            far.status()
        assert "--tunnel" in caught.value.message
        assert caught.value.code == "no-tunnel"


def test_client_cannot_have_the_line_of_tools(plcrt: Plcrt, line: Rs485, build: Build) -> None:
    with connect(line) as plc:
        plc.flash(build("stays"))
        with pytest.raises(PlcError) as caught:
            plc.flash(build("refused", CLIENT))
        assert f'tools have the serial line "{line.plc}"; only a server can be on it' in caught.value.message
        assert text_of(plc) == "stays"


def test_tcp_server_has_no_tools(plcrt: Plcrt, line: Rs485, build: Build) -> None:
    port = free_port()
    with connect(line) as plc:
        server = f'[modbus.server.tcp]\naddress = "127.0.0.1"\nport = {port}\ninput.30001 = "Main.echo"\n'
        plc.flash(build("net", server))
        with ModbusTcpClient("127.0.0.1", port=port, timeout=10) as client:
            assert not client.read_input_registers(0, count=1).isError()
        with socket.create_connection(("127.0.0.1", port), timeout=10) as raw:
            raw.sendall(bytes([0, 1, 0, 0, 0, 4, 1, 0x2B, 0x80, 0]))
            assert raw.recv(100)[7:] == b"\xab\x01"


def test_line_is_the_firmwares_again_after_a_restart(line: Rs485, build: Build, tmp_path: Path) -> None:
    plcrt = Plcrt(tmp_path / "flash", "--tunnel", line.plc, "--tunnel-unit", "12")
    with plcrt:
        with connect(line, 12) as plc:
            plc.flash(build("boot", SERVER, 12))
        plcrt.stop()
        plcrt.start()
        with connect(line, 12) as plc:
            assert text_of(plc) == "boot"
            eventually(lambda: read_echo(line, 12) == 1)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--tunnel", "/dev/null"], "cannot open serial line /dev/null"),
        (["--tunnel-unit", "248"], "--tunnel-unit 248 is not an address of Modbus: give 1 to 247"),
        (["--tunnel-unit", "0"], "--tunnel-unit 0 is not an address"),
        (["--tunnel-baud", "1"], "--tunnel-baud 1 is not a speed"),
        (["--tunnel-parity", "mark"], "--tunnel-parity mark is not a parity: give even, odd or none"),
    ],
)
def test_wrong_options_are_refused(tmp_path: Path, options: list[str], said: str) -> None:
    with pytest.raises(PlcError, match=said.replace(".", r"\.")):
        Plcrt(tmp_path / "flash", *options).start()


def test_line_of_serial_is_not_that_of_tunnel(tmp_path: Path) -> None:
    path = str(tmp_path / "flash.tty")  # what plcrt itself has just made there
    with pytest.raises(PlcError, match="cannot be used twice"):
        Plcrt(tmp_path / "flash", "--tunnel", path).start()


def test_a_line_whose_adapter_is_not_plugged_in_is_waited_for(tmp_path: Path) -> None:
    plcrt = Plcrt(tmp_path / "flash", "--tunnel", "/dev/no-such-line")
    with plcrt, plctool.connect(f"serial:{plcrt.port}") as plc:
        assert any("/dev/no-such-line is away" in entry.text for entry in plc.log())
