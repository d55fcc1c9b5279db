"""The firmware in QEMU as a device under test: power, reset, its serial line, its flash in a file."""

from __future__ import annotations

import json
import math
import os
import socket
import subprocess
import time
from collections import deque
from pathlib import Path
from typing import Any

from plctool.errors import LinkError
from plctool.link import simplecom

FLASH_SIZE = 16 * 1024 * 1024  # of the file; what is behind the file area holds the serial number in its last 4 KiB
FACTORY_OFFSET = FLASH_SIZE - 4096
START_TIMEOUT = 10.0


class UnixSerial:
    """Block transport over a serial line that QEMU offers as a unix socket."""

    packet_overhead = simplecom.FRAME_OVERHEAD
    byte_rate = math.inf
    local_address = b"\x00\x02"

    def __init__(self, path: Path) -> None:
        self.name = str(path)
        self._socket = _connect(path)
        self._decoder = simplecom.Decoder()
        self._packets: deque[bytes] = deque()

    def now(self) -> float:
        return time.monotonic()

    def send(self, packet: bytes) -> None:
        self.send_raw(simplecom.encode(packet))

    def send_raw(self, data: bytes) -> None:
        """Bytes as they are, also damaged ones."""
        self._socket.settimeout(None)
        try:
            self._socket.sendall(data)
        except OSError as error:
            raise LinkError(f"QEMU is gone ({error}).", "link-lost") from error

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


class Board:
    """One board with its firmware. Context manager: power is on inside.

    Time counts instructions. While the processor sleeps it follows the host's clock, so that the board is as fast as
    its client, and a busy host makes timers late.
    """

    def __init__(self, machine: str, firmware: Path, folder: Path) -> None:
        self.machine, self.firmware, self.folder = machine, firmware, folder
        self.flash_file = folder / "flash.bin"
        self._process: subprocess.Popen[bytes] | None = None
        if not self.flash_file.exists():
            self.flash_file.touch()
            os.truncate(self.flash_file, FLASH_SIZE)  # a sparse file: flash that nobody has erased yet

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

    def power_on(self, *, exact: bool = False, plugin: str = "") -> None:
        """Starts QEMU and waits until its serial line can be opened.

        `exact`: sleep takes no time on the host, so timers are never late, but time runs away from a slow client.
        """
        for name in ("uart", "qmp"):
            (self.folder / name).unlink(missing_ok=True)
        command = [
            "qemu-system-arm", "-M", f"{self.machine},memory-backend=nv",
            "-object", f"memory-backend-file,id=nv,size=16M,mem-path={self.flash_file},share=on",
            "-display", "none", "-monitor", "none", "-kernel", str(self.firmware),
            "-icount", f"shift=3,sleep={'off' if exact else 'on'}",
            "-serial", "unix:uart,server,nowait", "-qmp", "unix:qmp,server,nowait",
            *(["-plugin", plugin] if plugin else []),
        ]  # fmt: skip
        with (self.folder / "qemu.log").open("ab") as log:
            self._process = subprocess.Popen(command, cwd=self.folder, stdout=log, stderr=log)
        end = time.monotonic() + START_TIMEOUT
        while not ((self.folder / "uart").exists() and (self.folder / "qmp").exists()):
            if self._process.poll() is not None or time.monotonic() > end:
                raise RuntimeError(f"QEMU did not start: {(self.folder / 'qemu.log').read_text()}")
            time.sleep(0.005)

    def power_off(self) -> None:
        """Power cut: whatever the firmware does now stays half done."""
        if self._process:
            self._process.kill()
            self._process.wait()
            self._process = None

    def wait_off(self, timeout: float = 20.0) -> int:
        """Waits until QEMU ends by itself, by a plugin; its exit status."""
        assert self._process
        status = self._process.wait(timeout)
        self._process = None
        return status

    @property
    def is_on(self) -> bool:
        return self._process is not None and self._process.poll() is None

    def reset(self) -> None:
        """The reset pin: RAM is kept."""
        self._qmp("system_reset")

    def read_memory(self, address: int, size: int) -> bytes:
        """RAM, without stopping the processor."""
        file = self.folder / "memory"
        self._qmp("pmemsave", val=address, size=size, filename=str(file))
        return file.read_bytes()

    def line(self) -> UnixSerial:
        """The serial line, from the client's end."""
        return UnixSerial(self.folder / "uart")

    def _qmp(self, command: str, **arguments: Any) -> None:
        with _connect(self.folder / "qmp") as qmp:
            stream = qmp.makefile("rw")
            stream.readline()  # the greeting
            for message in ({"execute": "qmp_capabilities"}, {"execute": command, "arguments": arguments}):
                stream.write(json.dumps(message) + "\n")
                stream.flush()
                while "return" not in (answer := json.loads(stream.readline())):
                    if "error" in answer:
                        raise RuntimeError(f"QEMU: {answer['error']['desc']}")

    def __enter__(self) -> Board:
        self.power_on()
        return self

    def __exit__(self, *exc: object) -> None:
        self.power_off()
