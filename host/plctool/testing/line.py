"""A serial line between a client and a device that can be as slow and as bad as real ones.

`SerialLine(device)` opens the device's pseudo terminal and offers another one (`line.path`) to the client. Bytes
pass at the
line's rate, and are lost, doubled or flipped at the rates asked for, from a seed, so that a failing run can be
repeated.
"""

from __future__ import annotations

import os
import random
import select
import threading
import time
import tty
from dataclasses import dataclass, field

from plctool.link.transport import BITS_PER_BYTE

CHUNK = 4096


@dataclass
class Damage:
    """Odds per byte of each kind of damage (0..1)."""

    lose: float = 0.0
    double: float = 0.0
    flip: float = 0.0
    seed: int = 1
    random: random.Random = field(init=False)

    def __post_init__(self) -> None:
        self.random = random.Random(self.seed)

    def apply(self, data: bytes) -> bytes:
        """The bytes that arrive when `data` is sent."""
        if not (self.lose or self.double or self.flip):
            return data
        out = bytearray()
        for byte in data:
            if self.random.random() < self.lose:
                continue
            if self.random.random() < self.flip:
                byte ^= 1 << self.random.randrange(8)
            out.append(byte)
            if self.random.random() < self.double:
                out.append(byte)
        return bytes(out)


class _Direction:
    """Bytes on their way from one file descriptor to another, each taking its time on the line."""

    def __init__(self, source: int, sink: int, byte_time: float, damage: Damage) -> None:
        self.source, self.sink, self.byte_time, self.damage = source, sink, byte_time, damage
        self.queue = bytearray()
        self.free_at = 0.0  # when the last byte taken has left the line
        self.carried = 0

    def take(self) -> None:
        """Reads what the sender has written; a paced line takes no more than a hardware buffer holds."""
        room = CHUNK - len(self.queue)
        if room > 0:
            self.queue += os.read(self.source, room)

    def give(self, now: float) -> None:
        """Delivers the bytes whose time on the line has passed."""
        if not self.queue:
            self.free_at = max(self.free_at, now)
            return
        count = len(self.queue)
        if self.byte_time:
            count = min(count, int((now - self.free_at) / self.byte_time))
            self.free_at += count * self.byte_time
        if count <= 0:
            return
        data = self.damage.apply(bytes(self.queue[:count]))
        del self.queue[:count]
        self.carried += count
        while data:
            data = data[os.write(self.sink, data) :]


class SerialLine:
    """Context manager; `path` is the pseudo terminal for the client, `baud` 0 means as fast as it goes."""

    def __init__(self, device: str, baud: int = 0, damage: Damage | None = None) -> None:
        self._device = os.open(device, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self._device)
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.path = os.ttyname(self._slave)
        byte_time = BITS_PER_BYTE / baud if baud else 0.0
        damage = damage or Damage()
        back = Damage(damage.lose, damage.double, damage.flip, damage.seed + 1)
        self.to_device = _Direction(self._master, self._device, byte_time, damage)
        self.to_client = _Direction(self._device, self._master, byte_time, back)
        self._moving = threading.Lock()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> SerialLine:
        self._thread.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self._stop.set()
        self._thread.join()
        for fd in (self._device, self._master, self._slave):
            os.close(fd)

    @property
    def is_quiet(self) -> bool:
        """Whether no byte is on its way."""
        with self._moving:
            ready, _, _ = select.select([self._master, self._device], [], [], 0)
            return not (ready or self.to_device.queue or self.to_client.queue)

    def _run(self) -> None:
        directions = {self._master: self.to_device, self._device: self.to_client}
        while not self._stop.is_set():
            waiting = any(d.queue for d in directions.values())
            readable = [fd for fd, d in directions.items() if len(d.queue) < CHUNK]
            ready, _, _ = select.select(readable, [], [], 0.001 if waiting else 0.02)
            now = time.monotonic()
            for fd, d in directions.items():
                try:
                    with self._moving:
                        d.give(now)
                        if fd in ready:
                            d.take()
                except OSError:  # the other end is gone for now
                    time.sleep(0.005)
