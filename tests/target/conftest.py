"""Boards for the tests. Environment: see environment.py, and PLCTOOL_BUILD."""

from __future__ import annotations

import importlib.util
import os
import shutil
import sys
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parent))

from environment import CONFIG, FIRMWARE, MACHINE, ROOT, TARGET, firmware

SKIPPED = 77  # exit status that Meson counts as skipped

sys.path.insert(0, str(ROOT / os.environ.get("PLCTOOL_BUILD", "build") / "host"))


def _missing() -> str | None:
    """What these tests cannot do without."""
    if FIRMWARE is None:
        return "firmware: run them by meson test -C build-cm3"
    program = "qemu-system-riscv32" if TARGET == "rv32imac" else "qemu-system-arm"
    if shutil.which(program) is None:
        return program
    if importlib.util.find_spec("_plccore") is None:
        return "plctool's extension module in build/host (make build), or in the folder that PLCTOOL_BUILD names"
    return None


MISSING = _missing()
if MISSING:
    collect_ignore_glob = ["test_*.py"]
else:
    from programs import Built, compile_text
    from qemu import Board

    from plctool.device import Plc
    from plctool.link.connection import Connection


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Nothing to run is a skipped test for Meson, not a failed one."""
    if MISSING and session.testscollected == 0:
        print(f"tests/target is skipped, it needs {MISSING}")
        session.exitstatus = SKIPPED


@pytest.fixture
def make_board(tmp_path: Path) -> Iterator[Callable[..., Board]]:
    """Makes boards that are off: `make_board("full")`. They are switched off at the end."""
    boards: list[Board] = []

    def make(config: str = CONFIG) -> Board:
        folder = tmp_path / f"board{len(boards)}"
        folder.mkdir()
        boards.append(Board(MACHINE, firmware(config), folder))
        return boards[-1]

    yield make
    for board in boards:
        board.power_off()


@pytest.fixture
def board(make_board: Callable[..., Board]) -> Board:
    """A board with the configuration under test, on."""
    board = make_board()
    board.power_on()
    return board


@pytest.fixture
def plc(board: Board) -> Iterator[Plc]:
    """plctool on the board's serial line."""
    with Plc(Connection(board.line())) as plc:
        yield plc


@pytest.fixture
def build(tmp_path: Path) -> Callable[[str], Built]:
    """Compiles Structured Text for the board's processor."""
    return cache(lambda text: compile_text(text, TARGET, tmp_path))
