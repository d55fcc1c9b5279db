"""The firmware in QEMU as a device under test: power, reset, its serial line, its flash in a file."""

from __future__ import annotations

import json
import math
import os
import re
import socket
import subprocess
import time
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from elftools.elf.elffile import ELFFile

from plctool.errors import LinkError
from plctool.link import simplecom
from plctool.link.transport import NO_PLACES
from plctool.testing.children import ends_with_us

FLASH_SIZE = 16 * 1024 * 1024  # of the file; after the file area it has the serial number in its last 4 KiB
EEPROM_SIZE = 64 * 1024
FACTORY_OFFSET = FLASH_SIZE - 4096
START_TIMEOUT = 60.0  # machines under load are slow [s]
LOCALHOST = "127.0.0.1"


# What time is on the board: -icount of QEMU, which then counts instructions.
CLOCKS = {
    "follow": "shift=3,sleep=on",  # sleep lasts as on the host: as fast as its client, timers are late on a busy host
    "exact": "shift=3,sleep=off",  # sleep lasts no time: timers are never late, time runs away from a slow client
    "slow": "shift=8,sleep=off",  # exact with a processor of 4 MIPS: many seconds of work pass quickly
    "host": None,  # the host's clock: neither repeatable nor, on a busy host, steady
}


@dataclass(frozen=True)
class Machine:
    """How QEMU is called for a machine: its program, what keeps applications (`{file}`), and by which option it takes
    firmware. `flash_size`: of that file, of which the first `erased` bytes are; the others are as if they had never
    been. `flash_base`: where it is in memory; `has_commands`: stores into it are commands."""

    program: str
    options: tuple[str, ...]
    flash_size: int = FLASH_SIZE
    takes: str = "-kernel"
    erased: int = 0
    flash_base: int | None = None
    has_commands: bool = False


def _mps2(name: str, flash_base: int) -> Machine:
    """A part of its memory keeps them."""
    memory = "memory-backend-file,id=nv,size=16M,mem-path={file},share=on"
    return Machine("qemu-system-arm", ("-M", f"{name},memory-backend=nv", "-object", memory), flash_base=flash_base)


MACHINES = {
    "mps2-an385": _mps2("mps2-an385", 0x2100_0000),
    "mps2-an386": _mps2("mps2-an386", 0x2100_0000),
    "mps2-an500": _mps2("mps2-an500", 0x6000_0000),
    "lm3s6965evb": Machine(
        "qemu-system-arm",
        ("-M", "lm3s6965evb", "-drive", "if=none,id=nv,format=raw,file={file}",
         "-device", f"at24c-eeprom,address=0x50,rom-size={EEPROM_SIZE},drive=nv"),
        EEPROM_SIZE,
    ),
    "netduinoplus2": Machine("qemu-system-arm", ("-M", "netduinoplus2")),  # nothing keeps applications
    "virt": Machine(
        "qemu-system-riscv32",
        ("-M", "virt", "-rtc", "clock=vm", "-drive", "if=pflash,unit=1,format=raw,file={file}"),
        32 * 1024 * 1024,
        "-bios",
        erased=4 * 1024 * 1024,  # as it comes from the factory; its sectors are large
        flash_base=0x2200_0000,
        has_commands=True,
    ),
}  # fmt: skip


class SocketSerial:
    """Block transport over a serial line that QEMU offers as a socket."""

    max_packet = simplecom.MAX_PACKET
    long_packet = simplecom.LONG_PACKET
    packet_overhead = simplecom.FRAME_OVERHEAD
    point_to_point = False
    heard_at = -math.inf
    peer_words = 1
    places = NO_PLACES
    byte_rate = math.inf
    is_slow = False
    is_bus = False
    local_address = b"\x00\x02"

    def __init__(self, port: int) -> None:
        self.name = f"socket://{LOCALHOST}:{port}"
        self._socket = socket.create_connection((LOCALHOST, port))
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._decoder = simplecom.Decoder()
        self._packets: deque[bytes] = deque()

    def now(self) -> float:
        return time.monotonic()

    def send(self, *packets: bytes) -> None:
        self.send_raw(b"".join(map(simplecom.encode, packets)))

    def send_raw(self, data: bytes) -> None:
        """Bytes as they are, also damaged ones."""
        self._socket.settimeout(None)
        try:
            self._socket.sendall(data)
        except OSError as error:
            raise LinkError(f"QEMU is gone ({error}).", "link-lost") from error

    def receive_raw(self, size: int) -> bytes:
        """Waits for the next bytes that the board sends, whatever they are."""
        self._socket.settimeout(START_TIMEOUT)
        data = b""
        while len(data) < size and (more := self._socket.recv(size - len(data))):
            data += more
        return data

    def receive(self, timeout: float) -> bytes | None:
        end = time.monotonic() + timeout
        while not self._packets:
            self._socket.settimeout(max(0.001, end - time.monotonic()))
            try:
                data = self._socket.recv(4096)
            except TimeoutError:
                return None
            except OSError as error:
                raise LinkError(f"QEMU is gone ({error}).", "link-lost") from error
            if not data:
                raise LinkError("QEMU is gone.", "link-lost")
            self._packets.extend(self._decoder.feed(data))
        return self._packets.popleft()

    def close(self) -> None:
        self._socket.close()


def _connect(path: Path) -> socket.socket:
    """Connects to a socket that QEMU has made, and may be about to listen on."""
    end = time.monotonic() + START_TIMEOUT
    while True:
        connection = socket.socket(socket.AF_UNIX)
        try:
            connection.connect(os.path.relpath(path))
            return connection
        except OSError as error:
            connection.close()
            if time.monotonic() > end:
                raise LinkError(f"QEMU does not listen on {path} ({error}).", "open") from error
            time.sleep(0.005)


def _ask_debugger(stub: socket.socket, request: str) -> str:
    """One exchange in the remote protocol of GDB."""
    stub.sendall(f"${request}#{sum(request.encode()) % 256:02x}".encode())
    said = b""
    while not (answers := re.findall(rb"\$([^T#][^#]*)#..", said)):  # T...: that the processor has stopped
        said += stub.recv(256)
    return answers[0].decode()


class Board:
    """One board with its firmware. Context manager: power is on inside."""

    def __init__(self, machine: str, firmware: Path, folder: Path) -> None:
        self.machine, self.firmware, self.folder = machine, firmware, folder
        self.flash_file = folder / "flash.bin"
        self.qemu = MACHINES[machine]
        self.starts_from = [self.qemu.takes, str(firmware)]  # options of QEMU: what is in its memory when power comes
        self._process: subprocess.Popen[bytes] | None = None
        self._port = self._second_port = 0
        if not self.flash_file.exists():
            self.flash_file.write_bytes(b"\xff" * self.qemu.erased)
            os.truncate(self.flash_file, self.qemu.flash_size)  # a sparse file: flash that was never erased

    def write_flash(self, offset: int, data: bytes) -> None:
        """What the factory does, while power is off."""
        with self.flash_file.open("r+b") as file:
            file.seek(offset)
            file.write(data)

    def read_flash(self, offset: int, size: int) -> bytes:
        """The bytes of the flash, on or off."""
        with self.flash_file.open("rb") as file:
            file.seek(offset)
            return file.read(size)

    def power_on(self, clock: str = "follow", *, plugin: str = "") -> None:
        """Starts QEMU and waits until its serial line can be opened. `clock` is one of CLOCKS."""
        (self.folder / "qmp").unlink(missing_ok=True)
        icount = CLOCKS[clock]
        command = [
            self.qemu.program, *(option.format(file=self.flash_file) for option in self.qemu.options),
            "-display", "none", "-monitor", "none", *self.starts_from,
            *(2 * ["-serial", f"tcp:{LOCALHOST}:0,server=on,wait=off,nodelay=on"]),
            "-qmp", "unix:qmp,server,nowait",
            *(["-icount", icount] if icount else []),
            *(["-plugin", plugin] if plugin else []),
        ]  # fmt: skip
        with (self.folder / "qemu.log").open("ab") as log:
            self._process = subprocess.Popen(ends_with_us(command), cwd=self.folder, stdout=log, stderr=log)
        end = time.monotonic() + START_TIMEOUT
        while not (self.folder / "qmp").exists():
            if self._process.poll() is not None or time.monotonic() > end:
                raise RuntimeError(f"QEMU did not start: {(self.folder / 'qemu.log').read_text()}")
            time.sleep(0.005)
        self._port, self._second_port = self._find_port(0), self._find_port(1)

    def _find_port(self, line: int) -> int:
        """The TCP port that QEMU has chosen for a serial line."""
        names = [device["filename"] for device in self._qmp("query-chardev") if device["label"] == f"serial{line}"]
        return int(names[0].removeprefix("disconnected:").split(",")[0].rsplit(":", 1)[1])

    def power_off(self) -> None:
        """Power cut: whatever the firmware does now stays half done."""
        if self._process:
            self._process.kill()
            self._process.wait()
            self._process = None

    @property
    def pid(self) -> int:
        """Of the QEMU process."""
        assert self._process
        return self._process.pid

    def reset(self) -> None:
        """The reset pin: RAM is kept."""
        self._qmp("system_reset")

    def address_of(self, symbol: str) -> int:
        """Where something of the firmware is."""
        with self.firmware.open("rb") as file:
            return int(ELFFile(file).get_section_by_name(".symtab").get_symbol_by_name(symbol)[0]["st_value"])

    def read_memory(self, address: int, size: int) -> bytes:
        """RAM, without stopping the processor."""
        file = self.folder / "memory"
        self._qmp("pmemsave", val=address, size=size, filename=str(file))
        return file.read_bytes()

    def patch(self, function: str, code: bytes) -> None:
        """Overwrites the beginning of a function of the firmware, as a debugger would. Until the next reset.

        Not in the first KiB, which QEMU's debugger takes for as inaccessible as the vectors are.
        """
        self._qmp("human-monitor-command", **{"command-line": "gdbserver unix:gdb,server=on,wait=off"})
        with _connect(self.folder / "gdb") as stub:
            where = f"{self.address_of(function) & ~1:x},{len(code):x}"
            answers = [_ask_debugger(stub, request) for request in (f"M{where}:{code.hex()}", "D")]
        self._qmp("human-monitor-command", **{"command-line": "gdbserver none"})
        if answers != ["OK", "OK"]:
            raise RuntimeError(f"QEMU's debugger says {answers}")

    @property
    def port(self) -> str:
        """The serial line, for `plctool --port`."""
        return f"socket://{LOCALHOST}:{self._port}"

    @property
    def can(self) -> str:
        """The second serial line, which carries CAN frames, for `plctool --can`."""
        return f"slcan:socket://{LOCALHOST}:{self._second_port}"

    @property
    def field_bus(self) -> tuple[str, int]:
        """Where the second serial line can be reached that a field bus has."""
        return LOCALHOST, self._second_port

    def line(self) -> SocketSerial:
        """The serial line, from the client's end."""
        return SocketSerial(self._port)

    def _qmp(self, command: str, **arguments: Any) -> Any:
        with _connect(self.folder / "qmp") as qmp:
            stream = qmp.makefile("rw")
            stream.readline()  # the greeting
            for message in ({"execute": "qmp_capabilities"}, {"execute": command, "arguments": arguments}):
                stream.write(json.dumps(message) + "\n")
                stream.flush()
                while "return" not in (answer := json.loads(stream.readline())):
                    if "error" in answer:
                        raise RuntimeError(f"QEMU: {answer['error']['desc']}")
            return answer["return"]

    def __enter__(self) -> Board:
        self.power_on()
        return self

    def __exit__(self, *exc: object) -> None:
        self.power_off()
