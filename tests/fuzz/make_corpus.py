"""Puts what compiler and tool make into corpora: images into that of the loader, I/O configurations into that of the
I/O manager, with which tests/c/test_io_mutation.c begins, too, and what plctool says to a controller into that of the
lines."""

from __future__ import annotations

import platform
import struct
import tempfile
from collections.abc import Callable, Generator, Iterable
from itertools import chain, zip_longest
from pathlib import Path
from typing import Any

from plctool.compiler import compile_sources
from plctool.device import Plc
from plctool.image.file import parse_image
from plctool.link.connection import Connection
from plctool.link.sim import SimTransport
from plctool.sim import Simulator

CORPUS = Path(__file__).parent / "corpus"

PROGRAMS = {
    "smallest": "PROGRAM Main VAR n : INT; END_VAR n := n + 1; END_PROGRAM",
    "retain": """
        PROGRAM Main VAR n : INT; END_VAR VAR RETAIN a : DINT; b : STRING(20); c : ARRAY[0..9] OF REAL; END_VAR
        n := n + 1; a := a + n; b := 'kept'; c[3] := 1.5; END_PROGRAM""",
    "externals": """
        PROGRAM Main VAR x : REAL; y : LREAL; END_VAR
        x := SIN(x) + EXP(x); y := ATAN(y) / LOG(y + 1.0); END_PROGRAM""",
    "tasks": """
        VAR_GLOBAL go : BOOL; in AT %IX0.0 : BOOL; out AT %QW2 : WORD; flag AT %MX1.1 : BOOL; END_VAR
        PROGRAM A VAR n : DINT; END_VAR n := n + 1; go := NOT go; out := DINT_TO_WORD(n); END_PROGRAM
        PROGRAM B VAR n : DINT; END_VAR n := n + 1; flag := in; END_PROGRAM
        CONFIGURATION C RESOURCE R ON PLC
            TASK Fast(INTERVAL := T#1ms, PRIORITY := 1, WATCHDOG := T#5ms, SENSITIVITY := 3);
            TASK OnEdge(SINGLE := go, PRIORITY := 2);
            TASK Free(PRIORITY := 9);
            PROGRAM P1 WITH Fast : A; PROGRAM P2 WITH OnEdge : B; PROGRAM P3 WITH Free : B;
        END_RESOURCE END_CONFIGURATION""",
    "blocks": """
        FUNCTION_BLOCK F VAR n : DINT; END_VAR
        METHOD FB_Init : BOOL VAR_INPUT bInitRetains : BOOL; bInCopyCode : BOOL; END_VAR n := 3; END_METHOD
        METHOD FB_Exit : BOOL VAR_INPUT bInCopyCode : BOOL; END_VAR n := 0; END_METHOD
        END_FUNCTION_BLOCK
        PROGRAM Main VAR f : F; t : TON; s : STRING := 'abc'; END_VAR
        t(IN := NOT t.Q, PT := T#1s); s := CONCAT(s, 'd'); END_PROGRAM""",
}


DEVICE = """
name = "IO-16"
[gpio]
in = { DI0 = "DI0", DI1 = "DI1", DI2 = "DI2" }
out = { DO0 = "DO0", DO1 = "DO1" }"""

# Programs with descriptions of their inputs and outputs: each driver, every kind of parameter and channel.
DESCRIBED = {
    "gpio": (
        """
        PROGRAM Main VAR start, door, motor, lamp : BOOL; n : INT; END_VAR
        motor := start AND NOT door; lamp := Board.ok; n := n + 1; END_PROGRAM
        PROGRAM Count VAR count : BOOL; END_VAR END_PROGRAM
        CONFIGURATION C RESOURCE R ON PLC
            TASK Cycle(INTERVAL := T#10ms); TASK OnEdge(EVENT := 'pulse');
            PROGRAM Main WITH Cycle : Main; PROGRAM Count WITH OnEdge : Count;
        END_RESOURCE END_CONFIGURATION""",
        """
        device = "device.toml"
        [gpio]
        name = "Board"
        [gpio.in]
        DI0 = "Main.start"
        DI1 = { var = "Main.door", pull = "up", invert = true, on_error = "zero" }
        DI2 = { var = "Count.count", event = "pulse", edge = "both" }
        [gpio.out]
        DO0 = { var = "Main.motor", on_stop = "hold" }
        DO1 = { var = "Main.lamp", on_stop = 1 }""",
    ),
    "sim": (
        """
        PROGRAM Main VAR start AT %IX0.1 : BOOL; level : INT; motor AT %QX0.6 : BOOL; speed : DINT; END_VAR
        motor := start AND level < 900; speed := level; END_PROGRAM
        PROGRAM Slow VAR start AT %IX0.1 : BOOL; raw : REAL; lamp : BOOL; END_VAR
        lamp := start AND raw < 1.0 AND Bench.ok; END_PROGRAM
        CONFIGURATION C RESOURCE R ON PLC
            TASK Fast(INTERVAL := T#10ms, PRIORITY := 1); TASK Rest(INTERVAL := T#20ms, PRIORITY := 5);
            PROGRAM Main WITH Fast : Main; PROGRAM Slow WITH Rest : Slow;
        END_RESOURCE END_CONFIGURATION""",
        """
        [[sim]]
        name = "Bench"
        in = { button = "Main.start", level = { var = "Main.level", on_error = -3 } }
        out = { motor = "Main.motor", speed = { var = "Main.speed", on_stop = 77 } }
        [[sim]]
        name = "Other"
        task = "Rest"
        optional = true
        in = { raw = { var = "Slow.raw", on_error = "zero" } }
        out = { lamp = { var = "Slow.lamp", on_stop = "hold" } }""",
    ),
    "modbus_client": (
        """
        PROGRAM Main VAR power : REAL; door : BOOL; count : INT; speed : INT; valve : BOOL; limit : DINT; END_VAR
        speed := count; valve := door AND Meter.ok; limit := REAL_TO_DINT(power); END_PROGRAM""",
        """
        [[modbus.rs485]]
        port = "COM2"
        baud = 38400
        parity = "odd"
        [[modbus.rs485.device]]
        name = "Meter"
        unit = 3
        timeout = "T#20ms"
        [[modbus.rs485.device.read]]
        function = 4
        address = 30001
        every = "T#10ms"
        var = "Main.power"
        [[modbus.rs485.device.read]]
        function = 2
        address = 10007
        every = "T#10ms"
        var = "Main.door"
        [[modbus.rs485.device.write]]
        function = 16
        address = 40011
        on_change = true
        every = "T#10ms"
        verify = true
        vars = ["Main.speed", "Main.limit"]
        [[modbus.tcp]]
        host = "127.0.0.1"
        [[modbus.tcp.device]]
        name = "Drive"
        order = "CDAB"
        optional = true
        [[modbus.tcp.device.read]]
        function = 3
        address = 40001
        every = "T#10ms"
        var = "Main.count"
        on_error = "zero"
        [[modbus.tcp.device.write]]
        function = 5
        address = 1
        every = "T#10ms"
        var = "Main.valve"
        """,
    ),
    "modbus_server": (
        """
        PROGRAM Main VAR setpoint : REAL; recipe : ARRAY[0..3] OF INT; enable, alarm : BOOL; level : INT; END_VAR
        alarm := enable AND setpoint > 1.0; level := recipe[1]; END_PROGRAM""",
        """
        [modbus.server.rs485]
        port = "COM2"
        unit = 5
        [modbus.server.rs485.holding]
        40001 = "Main.setpoint"
        40003 = "Main.recipe"
        [modbus.server.tcp]
        port = 1502
        as_bits = true
        [modbus.server.tcp.holding]
        "40020.0" = "Main.enable"
        [modbus.server.tcp.input]
        "30001.0" = "Main.alarm"
        30002 = "Main.level"
        """,
    ),
    "sysfs": (
        """
        PROGRAM Main VAR level : REAL; raw : DINT; setpoint, power : REAL; END_VAR
        setpoint := level; power := DINT_TO_REAL(raw); END_PROGRAM""",
        """
        [[iio]]
        name = "Adc"
        device = "ads1115"
        every = "T#1ms"
        in = { in_voltage0 = { var = "Main.level", on_error = "zero" }, in_voltage1 = "Main.raw" }
        out = { out_voltage0 = "Main.setpoint" }
        [[pwm]]
        name = "Heater"
        chip = "pwmchip0"
        out = { pwm1 = { var = "Main.power", frequency = 1000 } }""",
    ),
}


# ---- conversations: fuzz_lines.c says what a step is ----

SERIAL, UDP, OTHER_UDP, TCP, OTHER_TCP, CAN, OTHER_CAN = range(7)
MESSAGE, PACKAGE, PACKET, BYTES, WAIT, VANISH, OPEN, CLOSE = range(8)
FAKE_IMAGE_CRC = 0x1C2D3E4F  # of comm_fakes.h
L7_SIZE = 20  # bytes of the header that plctool sends

Conversation = list[bytes]  # messages of layer 7


def step(peer: int, what: int, data: bytes = b"", length: int | None = None) -> bytes:
    return struct.pack("<BH", peer | what << 3, len(data) if length is None else length) + data


class Recorder(Connection):
    """Keeps what is sent, with places for what another controller will grant."""

    def __init__(self, crc: int) -> None:
        super().__init__(SimTransport())
        self.messages: Conversation = []
        self.plc: Plc | None = None
        self._crc = crc.to_bytes(4, "little")

    def stream(self, messages: Iterable[bytes], *rest: Any, **options: Any) -> Generator[bytes, None, None]:
        return super().stream(map(self._keep, messages), *rest, **options)

    def _keep(self, message: bytes) -> bytes:
        head, session, content = message[:8], message[8:12], message[L7_SIZE:]
        if int.from_bytes(session, "little") != 0x11:
            session = b"ssss"
        assert self.plc
        if number := self.plc._session.application_session:
            content = content.replace(number.to_bytes(4, "little"), b"SSSS")
        content = content.replace(self._crc, FAKE_IMAGE_CRC.to_bytes(4, "little"))
        self.messages.append(head + session + b"\xff" * 4 + message[16:L7_SIZE] + content)
        return message


def looks(plc: Plc) -> None:
    plc.identity()
    plc.info()
    plc.raw_status()
    plc.tasks()
    plc.log()


def watches(plc: Plc) -> None:
    for _ in range(3):
        plc.read_all(["Main.n", "Main.kept", "Main.points[2].y", "Main.name"])
    plc.write({"Main.n": 5, "Main.name": "new", "Main.on": True})


def controls(plc: Plc) -> None:
    plc.stop()
    plc.cycle()
    plc.reset("cold")
    plc.start()


def types_commands(plc: Plc) -> None:
    for command in ("?", "rtsinfo", "applist", "tasklist", "getprgstat"):
        plc.shell(command)


def sets_a_password(plc: Plc) -> None:
    plc.set_password("long enough")
    plc.set_password(None)


PROGRAM = """
TYPE Point : STRUCT x, y : REAL; END_STRUCT END_TYPE
PROGRAM Main VAR n : DINT; on : BOOL; name : STRING(20); points : ARRAY[1..3] OF Point; END_VAR
VAR RETAIN kept : DINT; END_VAR n := n + 1; kept := kept + 1; END_PROGRAM"""


def record(image: Path, action: Callable[[Plc], object]) -> Conversation:
    """What plctool says to a controller that has the program, from the login on."""
    with Simulator.from_file(image) as simulator:
        recorder = Recorder(simulator.symbols().image_crc)
        recorder.plc = Plc(recorder, image.with_suffix(".sym"))
        action(recorder.plc)
        recorder.close()
    return recorder.messages


def spoken(peer: int, conversation: Conversation) -> list[bytes]:
    return [step(peer, OPEN), *(step(peer, MESSAGE, message) for message in conversation), step(peer, CLOSE)]


def at_once(*speakers: list[bytes]) -> bytes:
    """One step of each in turn."""
    return b"".join(chain.from_iterable(zip_longest(*speakers, fillvalue=b"")))


def conversations(folder: Path) -> dict[str, bytes]:
    images = [folder / "before.cdl", folder / "after.cdl"]
    for number, image in enumerate(images):
        source = image.with_suffix(".st")
        source.write_text(PROGRAM.replace("n + 1", f"n + {number + 1}"))
        compile_sources([source], target=f"{platform.machine()}-linux").write(image)
    actions = (looks, watches, controls, types_commands, sets_a_password)
    said = {action.__name__: record(images[0], action) for action in actions}
    said["flashes"] = record(images[0], lambda plc: plc.flash(images[1]))
    watch, flash, look, control = (said[name] for name in ("watches", "flashes", "looks", "controls"))
    cut = len(flash) // 2
    alone = {
        f"{name}_{line}": at_once(spoken(peer, messages))
        for name, messages in said.items()
        for line, peer in (("serial", SERIAL), ("udp", UDP), ("tcp", TCP), ("can", CAN))
    }
    together = {
        "flash_beside_watching": at_once(spoken(SERIAL, flash), spoken(TCP, watch)),
        "four_at_once": at_once(
            spoken(SERIAL, watch), spoken(UDP, look), spoken(OTHER_UDP, control), spoken(TCP, watch)
        ),
        "five_for_four_places": at_once(*(spoken(peer, look) for peer in range(5))),
        "tools_on_can": at_once(spoken(CAN, flash), spoken(OTHER_CAN, watch), spoken(SERIAL, look)),
        "vanishes_on_can": b"".join([*spoken(CAN, flash)[:cut], step(CAN, VANISH), *spoken(OTHER_CAN, control)]),
        "vanishes_in_a_download": b"".join(
            [*spoken(TCP, flash)[:cut], step(TCP, VANISH), *spoken(OTHER_TCP, flash)[:cut], *spoken(SERIAL, watch)]
        ),
        "late": b"".join(
            [*spoken(UDP, watch)[:-2], step(UDP, WAIT, length=600), *spoken(OTHER_UDP, look), *spoken(UDP, watch)]
        ),
        "noise_between_frames": b"".join(
            step(SERIAL, BYTES, b"\x00#<#_noise") + step(TCP, PACKET, b"\xc5\x0b\x40\x03") + part
            for part in spoken(SERIAL, look)
        ),
    }
    return {**alone, **together}


# ---- images and configurations ----


def compile_image(folder: Path, name: str, text: str) -> bytes:
    source = folder / f"{name}.st"
    source.write_text(text)
    return compile_sources([source], target=f"{platform.machine()}-linux").image


def configuration(folder: Path, name: str, text: str, description: str) -> bytes:
    """The I/O configuration of a program with a description."""
    place = folder / name
    place.mkdir()
    (place / f"{name}.io.toml").write_text(description)
    (place / "device.toml").write_text(DEVICE)
    image = parse_image(compile_image(place, name, text))
    if image.io is None:
        raise SystemExit(f"{name} has no I/O configuration.")
    offset, size = image.io
    return image.code[offset : offset + size]


def put(corpus: str, name: str, data: bytes) -> None:
    (CORPUS / corpus).mkdir(parents=True, exist_ok=True)
    (CORPUS / corpus / name).write_bytes(data)
    print(f"{corpus}/{name}: {len(data)} bytes")


def main() -> None:
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        for name, text in PROGRAMS.items():
            put("loader", name, compile_image(folder, name, text))
        for name, (text, description) in DESCRIBED.items():
            put("io", name, configuration(folder, name, text, description))
        for name, data in conversations(folder).items():
            put("lines", name, data)


if __name__ == "__main__":
    main()
