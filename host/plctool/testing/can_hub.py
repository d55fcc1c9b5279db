"""A CAN bus made of pseudo terminals: each is an SLCAN adapter. Frames go from an open one to all others that are.

`python -m plctool.testing.can_hub COUNT` prints their paths, one a line, and carries frames until Ctrl-C. Programs of
others are put on it by SLCAN (docs/canopen.md).
"""

from __future__ import annotations

import os
import random
import selectors
import signal
import sys
import threading
import tty
from contextlib import suppress
from dataclasses import dataclass, field

_LARGEST_BACKLOG = 1 << 20  # bytes for an adapter that no tool reads, before frames to it are dropped
_READ = 4096
_MOST_ADAPTERS = 128
_FRAMES = b"tTrRdDbB"  # first letters of lines that are frames; all others are commands to the adapter
_OPENS, _CLOSES = b"OL", b"C"  # the same of the commands after which an adapter hears the bus, and does not


@dataclass
class _Adapter:
    master: int
    slave: int
    path: str
    is_open: bool = False
    received: bytearray = field(default_factory=bytearray)
    backlog: bytearray = field(default_factory=bytearray)


class CanHub:
    """Context manager; `paths` are the adapters. `frames` counts what was carried; one frame in `lose_one_in` is lost,
    for all that would hear it, at random moments; 0: none."""

    def __init__(self, adapters: int, seed: int = 1) -> None:
        self._adapters = [_open() for _ in range(adapters)]
        self.paths = [adapter.path for adapter in self._adapters]
        self.frames = self.lost = 0
        self.lose_one_in = 0
        self._random = random.Random(seed)
        self._selector = selectors.DefaultSelector()
        self._wake, self._end = os.pipe()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> CanHub:
        for adapter in self._adapters:
            self._selector.register(adapter.master, selectors.EVENT_READ, adapter)
        self._selector.register(self._wake, selectors.EVENT_READ)
        self._thread.start()
        return self

    def __exit__(self, *exc: object) -> None:
        os.close(self._end)
        self._thread.join()
        self._selector.close()
        os.close(self._wake)
        for adapter in self._adapters:
            os.close(adapter.master)
            os.close(adapter.slave)

    def _run(self) -> None:
        while True:
            for key, events in self._selector.select():
                adapter = key.data
                if adapter is None:
                    return
                if events & selectors.EVENT_WRITE:
                    self._give(adapter, b"")
                if events & selectors.EVENT_READ:
                    self._take(adapter)

    def _take(self, adapter: _Adapter) -> None:
        """Carries the frames an adapter was given to all others."""
        with suppress(BlockingIOError):
            adapter.received += os.read(adapter.master, _READ)
        *lines, adapter.received = adapter.received.split(b"\r")
        frames = []
        for line in filter(None, lines):
            if line[0] in _OPENS + _CLOSES:
                adapter.is_open = line[0] in _OPENS
            elif adapter.is_open and line[0] in _FRAMES and not self._loses():
                frames.append(line + b"\r")
        self.frames += len(frames)
        for other in self._adapters:
            if other is not adapter and other.is_open and frames:
                self._give(other, b"".join(frames))

    def _loses(self) -> bool:
        lost = self.lose_one_in != 0 and self._random.randrange(self.lose_one_in) == 0
        self.lost += lost
        return lost

    def _give(self, adapter: _Adapter, data: bytes) -> None:
        if len(adapter.backlog) < _LARGEST_BACKLOG:
            adapter.backlog += data
        with suppress(BlockingIOError):
            while adapter.backlog:
                del adapter.backlog[: os.write(adapter.master, adapter.backlog)]
        events = selectors.EVENT_READ | (selectors.EVENT_WRITE if adapter.backlog else 0)
        self._selector.modify(adapter.master, events, adapter)


def _open() -> _Adapter:
    master, slave = os.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    return _Adapter(master, slave, os.ttyname(slave))


def main() -> None:
    """A bus for other processes, until Ctrl-C or SIGTERM."""
    words = sys.argv[1:]
    if len(words) != 1 or not words[0].isdecimal() or not 2 <= int(words[0]) <= _MOST_ADAPTERS:
        sys.exit(f"usage: python -m plctool.testing.can_hub COUNT, from 2 to {_MOST_ADAPTERS} adapters")
    signals = {signal.SIGINT, signal.SIGTERM}
    signal.pthread_sigmask(signal.SIG_BLOCK, signals)
    with CanHub(int(words[0])) as hub:
        print("\n".join(hub.paths), flush=True)
        signal.sigwait(signals)


if __name__ == "__main__":
    main()
