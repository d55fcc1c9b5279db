"""Power cuts while a program is replaced: the device starts, runs the old program or the new one, and takes another.

POWER_CUTS=all cuts after every store into the flash; otherwise a selection is tried: some from every part of the
transfer, and all of the last ones, which commit.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from contextlib import suppress
from pathlib import Path

import pytest
from programs import COUNTER, TWO_TASKS

from plctool.device import Plc
from plctool.errors import PlcError
from plctool.link.connection import Connection
from plctool.link.services import AppState

HERE = Path(__file__).parent
FLASH_BASE, FLASH_END = 0x21000000, 0x21080000
CUT = 3  # exit status of a QEMU that was cut
SELECTION = 24


@pytest.fixture(scope="session")
def cutter(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The plugin that cuts."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("needs a C compiler for QEMU's plugin")
    plugin = tmp_path_factory.mktemp("plugin") / "cut.so"
    subprocess.run([compiler, "-O2", "-shared", "-fPIC", "-o", plugin, HERE / "cut.c"], check=True)
    return plugin


@pytest.fixture
def prepared(make_board, build, eventually):
    """A board with the old program, proven, and off; and its flash."""
    board = make_board()
    with board, Plc(Connection(board.line())) as plc:
        plc.flash(build(COUNTER).path)
        eventually(lambda: plc.read("Main.n") > 3500)
    return board, board.flash_file.read_bytes()


def replace_program(board, image: Path) -> None:
    """Flashes over the running program; the line may go dead on the way."""
    with suppress(PlcError), Plc(Connection(board.line())) as plc:
        plc.flash(image)
        time.sleep(0.05)


def check_survivor(board, old, new) -> str:
    """What runs after the cut: "old" or "new". The new program can be flashed afterwards."""
    with Plc(Connection(board.line())) as plc:
        status = plc.status()
        assert status.state is AppState.RUN
        names = {old.symbols.image_crc: "old", new.symbols.image_crc: "new"}
        assert status.image_crc in names
        plc.flash(new.path)
        assert plc.status().image_crc == new.symbols.image_crc
        assert plc.status().state is AppState.RUN
    return names[status.image_crc]


def cut_points(stores: int) -> list[int]:
    """Numbers of the stores after which to cut. The last ones are those of the commit record."""
    if os.environ.get("POWER_CUTS") == "all":
        return list(range(1, stores + 1))
    early = {1 + stores * i // SELECTION for i in range(SELECTION)}
    return sorted(early | set(range(stores - SELECTION, stores + 1)))


def test_cut_after_a_store_leaves_old_or_new(prepared, build, cutter, tmp_path):
    board, flash = prepared
    old, new = build(COUNTER), build(TWO_TASKS)
    plugin = f"file={cutter},lo={FLASH_BASE:#x},hi={FLASH_END:#x}"
    count_file = tmp_path / "count"
    board.power_on(plugin=f"{plugin},out={count_file}")
    replace_program(board, new.path)
    board.power_off()
    stores = int(count_file.read_text())
    print(f"{stores} stores")
    assert stores > 500

    seen = []
    for n in cut_points(stores):
        board.flash_file.write_bytes(flash)
        board.power_on(plugin=f"{plugin},n={n}")
        replace_program(board, new.path)
        if board.is_on:
            board.power_off()
        board.power_on()
        seen.append(check_survivor(board, old, new))
        board.power_off()
    assert seen[0] == "old"
    assert "new" in seen
    assert seen == sorted(seen, reverse=True), "once it is the new one it stays the new one"


def test_pulling_the_plug_again_and_again(prepared, build):
    """Later and later in the transfer; the flash is carried on from one cut to the next."""
    board, _ = prepared
    old, new = build(COUNTER), build(TWO_TASKS)
    for number in range(6):
        board.power_on()
        image = (old, new)[number % 2]

        def cut(done: int, total: int, part: float = number / 6) -> None:
            if done >= total * part:
                board.power_off()

        with suppress(PlcError), Plc(Connection(board.line())) as plc:
            plc.flash(image.path, force=True, progress=cut)
        board.power_off()
    board.power_on()
    check_survivor(board, old, new)
