"""The table of `watch` on a terminal: it scrolls, and what was named comes before what patterns match."""

from __future__ import annotations

import io
import os
import pty
import select
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fake_device import FakePlc
from rich.console import Console

from plctool.cli.commands.values import _named_first
from plctool.cli.live_table import LiveTable

ROWS = {f"Main.v{number:02}": str(number) for number in range(40)}
PATIENCE_S = 60.0
DOWN, UP, PAGE_DOWN, HOME, END = b"\x1b[B", b"\x1b[A", b"\x1b[6~", b"\x1b[H", b"\x1b[F"


class Screen:
    """A terminal of 80 columns and 16 lines: 10 rows of a table."""

    def __init__(self) -> None:
        self._file = io.StringIO()
        console = Console(file=self._file, force_terminal=True, width=80, height=16, legacy_windows=False)
        self.table = LiveTable(console)

    def rows(self) -> list[str]:
        """The names that were drawn last."""
        drawn = self._file.getvalue().rpartition("variable")[2]
        return [name for name in ROWS if name in drawn]


@pytest.fixture
def screen() -> Iterator[Screen]:
    screen = Screen()
    with screen.table._live:
        screen.table.show(0.5, ROWS)
        yield screen


@pytest.mark.parametrize(
    ("keys", "first"),
    [
        ([], 0), ([DOWN], 1), ([DOWN, DOWN, UP], 1), ([UP], 0), ([PAGE_DOWN], 10), ([PAGE_DOWN] * 9, 30),
        ([END], 30), ([END, HOME], 0), ([b"?"], 0),
    ],
)  # fmt: skip
def test_keys_scroll_by_lines_and_pages_up_to_the_ends(screen: Screen, keys: list[bytes], first: int) -> None:
    for key in keys:
        screen.table.press(key)
    assert screen.rows() == list(ROWS)[first : first + 10]


def test_the_caption_says_which_rows_are_shown(screen: Screen) -> None:
    screen.table.press(PAGE_DOWN)
    assert "11 to 20 of 40, arrow keys scroll" in screen._file.getvalue()


def test_a_table_that_became_shorter_shows_its_last_rows(screen: Screen) -> None:
    screen.table.press(END)
    screen.table.show(1.0, dict(list(ROWS.items())[:12]))
    assert screen.rows() == list(ROWS)[2:12]


def test_named_variables_come_before_patterns() -> None:
    assert _named_first(["Main.*", "Main.level", "GVL.*", "Main.speed"]) == [
        "Main.level", "Main.speed", "Main.*", "GVL.*"
    ]  # fmt: skip


def test_keys_of_a_real_terminal_scroll_and_its_settings_come_back(scratch: Path) -> None:
    import termios

    script = scratch / "table.py"
    script.write_text(
        "import sys, time\n"
        "from plctool.cli.live_table import LiveTable\n"
        "rows = {f'v{n:02}': str(n) for n in range(60)}\n"
        "with LiveTable().shown() as table:\n"
        "    table.show(0.0, rows)\n"
        f"    end = time.monotonic() + {PATIENCE_S}\n"
        "    while table._top < 36 and time.monotonic() < end:\n"
        "        time.sleep(0.01)\n"
    )
    ours, theirs = pty.openpty()
    before = termios.tcgetattr(theirs)
    process = subprocess.Popen(
        [sys.executable, str(script)], stdin=theirs, stdout=theirs, stderr=theirs, start_new_session=True,
        preexec_fn=lambda: _take_terminal(theirs), env={**os.environ, "TERM": "xterm", "LINES": "30", "COLUMNS": "80"},
    )  # fmt: skip
    seen, end = b"", time.monotonic() + PATIENCE_S
    while b"v10" not in seen and time.monotonic() < end:
        seen += _read(ours)
    os.write(ours, END)
    while b"v59" not in seen and time.monotonic() < end:
        seen += _read(ours)
    assert b"v59" in seen
    assert process.wait(timeout=PATIENCE_S) == 0
    assert termios.tcgetattr(theirs) == before
    os.close(ours)
    os.close(theirs)


def _take_terminal(terminal: int) -> None:
    import fcntl
    import termios

    fcntl.ioctl(terminal, termios.TIOCSCTTY, 0)


def _read(terminal: int) -> bytes:
    ready, _, _ = select.select([terminal], [], [], 0.1)
    return os.read(terminal, 4096) if ready else b""


PORT = ["--port", "/dev/fake"]


@pytest.fixture
def running(tool: Any, plc: FakePlc, image: Path) -> FakePlc:
    """The controller with the small application."""
    assert tool("flash", *PORT, str(image)).status == 0
    return plc


def test_watch_writes_a_csv_file_that_has_a_row_for_each_reading(tool: Any, running: FakePlc, scratch: Path) -> None:
    done = tool("watch", *PORT, "Main.ok", "Main.count", "--interval", "0", "--count", "3", "--csv", "values.csv")
    assert (done.status, done.out) == (0, "")
    lines = (scratch / "values.csv").read_text().splitlines()
    assert lines[0] == "time_s,Main.ok,Main.count"
    assert len(lines) == 4
    assert lines[1].split(",")[1:] == ["0", "0"]


def test_the_csv_goes_to_the_standard_output_with_a_dash(tool: Any, running: FakePlc) -> None:
    done = tool("watch", *PORT, "Main.count", "--interval", "0", "--count", "1", "--csv", "-")
    assert done.out.startswith("time_s,Main.count\n0.")


@pytest.mark.parametrize("name", ["main.st", "plc.toml", "app.cdl", "app.sym"])
def test_the_csv_does_not_replace_a_file_of_another_kind(tool: Any, running: FakePlc, name: str) -> None:
    done = tool("watch", *PORT, "Main.count", "--count", "1", "--csv", name)
    assert done.status == 2
    assert "--csv values.csv" in done.err


def test_csv_and_json_exclude_each_other(tool: Any, running: FakePlc) -> None:
    assert tool("watch", *PORT, "Main.count", "--count", "1", "--csv", "v.csv", "--json").status == 2
