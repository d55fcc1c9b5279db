"""Values on a terminal, in a table that is drawn again in place and scrolls with the keys.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import os
import select
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress

from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from plctool.printable import one_line

_FRAME = 6  # lines that are not rows: head, borders, caption, cursor
_KEYS = {
    b"\x1b[A": ("line", -1), b"k": ("line", -1), b"\x1b[B": ("line", 1), b"j": ("line", 1),
    b"\x1b[5~": ("page", -1), b"\x1b[6~": ("page", 1), b" ": ("page", 1),
    b"\x1b[H": ("end", -1), b"\x1b[1~": ("end", -1), b"\x1b[F": ("end", 1), b"\x1b[4~": ("end", 1),
}  # fmt: skip
"""What a key moves, and in which direction: terminals send these bytes (xterm's, and the letters of `less`)."""


class LiveTable:
    """A table of names and values with as many rows as the terminal has room for. Keys arrive in a thread of their own,
    so that it scrolls between two readings."""

    def __init__(self, console: Console | None = None) -> None:
        self._live = Live(auto_refresh=False, console=console)
        self._lock = threading.Lock()
        self._texts: Mapping[str, str] = {}
        self._time_s = 0.0
        self._top = 0

    @contextmanager
    def shown(self) -> Iterator[LiveTable]:
        """Draws the table and listens to the keys until the block ends."""
        with self._live, _keys(self.press):
            yield self

    def show(self, time_s: float, texts: Mapping[str, str]) -> None:
        """Draws new values, `time_s` after the first ones."""
        with self._lock:
            self._time_s, self._texts = time_s, texts
            self._draw()

    def say(self, text: str) -> None:
        """Prints a line above the table."""
        self._live.console.print(text, markup=False)

    def press(self, key: bytes) -> None:
        """Scrolls by a key; others are ignored."""
        what, direction = _KEYS.get(key, ("line", 0))
        with self._lock:
            self._top += direction * {"line": 1, "page": self._height, "end": len(self._texts)}[what]
            self._draw()

    @property
    def _height(self) -> int:
        return max(1, self._live.console.size.height - _FRAME)

    def _draw(self) -> None:
        rows = list(self._texts.items())
        self._top = max(0, min(self._top, len(rows) - self._height))
        shown = rows[self._top : self._top + self._height]
        caption = f"{self._time_s:.1f} s, Ctrl-C ends"
        if len(shown) < len(rows):
            caption = f"{self._top + 1} to {self._top + len(shown)} of {len(rows)}, arrow keys scroll; {caption}"
        table = Table("variable", "value")
        for name, text in shown:
            table.add_row(Text(one_line(name), no_wrap=True), Text(one_line(text), no_wrap=True, overflow="ellipsis"))
        self._live.update(Group(table, Text(caption, no_wrap=True, style="dim")), refresh=True)


@contextmanager
def _keys(pressed: Callable[[bytes], None]) -> Iterator[None]:
    """Calls `pressed` with the bytes of each key until the block ends, from a thread. Does nothing where keys cannot be
    read one by one: without a terminal, in the background, on systems other than POSIX."""
    try:
        import termios
        import tty
    except ImportError:
        yield
        return
    if not (sys.stdin.isatty() and os.tcgetpgrp(sys.stdin.fileno()) == os.getpgrp()):
        yield
        return
    terminal = sys.stdin.fileno()
    before = termios.tcgetattr(terminal)
    ended, end = os.pipe()
    thread = threading.Thread(target=_read_keys, args=(terminal, ended, pressed), daemon=True)
    tty.setcbreak(terminal)
    thread.start()
    try:
        yield
    finally:
        os.close(end)
        thread.join()
        os.close(ended)
        termios.tcsetattr(terminal, termios.TCSADRAIN, before)


def _read_keys(terminal: int, ended: int, pressed: Callable[[bytes], None]) -> None:
    """Reads keys until the other end of the pipe `ended` is closed or the terminal is gone. What a key sends arrives in
    one piece."""
    while True:
        ready, _, _ = select.select([terminal, ended], [], [])
        if ended in ready:
            return
        with suppress(OSError):
            if key := os.read(terminal, 16):
                pressed(key)
                continue
        return
