"""`run-board` starts a board from what `plctool image` wrote, and from an empty flash."""

from __future__ import annotations

import subprocess
from contextlib import contextmanager

import pytest
from environment import CONFIG, MACHINE, ROOT, firmware
from programs import COUNTER

from plctool.cli.commands.images import production
from plctool.device import connect
from plctool.image.board import read_firmware
from plctool.link.services import AppState
from plctool.testing.children import ends_with_us

RUN_BOARD = ROOT / "tests/target/run-board"
FACTS = read_firmware(firmware(CONFIG)).board


@contextmanager
def run_board(runs, flash):
    """The controller on the terminal that is printed."""
    command = ends_with_us([RUN_BOARD, MACHINE, runs, flash])
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as board:
        try:
            assert board.stdout
            with connect(f"serial:{board.stdout.readline().split()[4]}", gateway=False) as plc:
                yield plc
        finally:
            board.kill()


def test_a_bin_is_the_memory_of_a_board(build, tmp_path):
    built = build(COUNTER)
    production(built.path, FACTS.slug, None, tmp_path / "flash.bin")
    for _ in range(2):
        with run_board(firmware(CONFIG), tmp_path / "flash.bin") as plc:
            assert plc.status().state is AppState.RUN
            assert plc.raw_status().image_crc == built.symbols.image_crc


def test_a_hex_with_the_firmware_is_burned(build, tmp_path):
    if FACTS.flash.address is None:
        pytest.skip("programs have a memory of their own")
    built = build(COUNTER)
    production(built.path, None, firmware(CONFIG), tmp_path / "all.hex")
    with run_board(tmp_path / "all.hex", tmp_path / "flash.bin") as plc:
        assert plc.raw_status().image_crc == built.symbols.image_crc


def test_a_memory_that_is_not_there_is_made(tmp_path):
    with run_board(firmware(CONFIG), tmp_path / "flash.bin") as plc:
        assert plc.status().state is AppState.NONE


@pytest.mark.parametrize(("runs", "flash"), [("none.elf", "flash.bin"), ("none.elf", "product.hex")])
def test_a_board_that_does_not_start_prints_no_terminal(tmp_path, runs, flash):
    (tmp_path / "product.hex").write_text(":00000001FF\n")
    command = [RUN_BOARD, MACHINE, tmp_path / runs, tmp_path / flash]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode != 0
    assert done.stdout == ""
    assert done.stderr
    assert (tmp_path / "product.hex").read_text() == ":00000001FF\n"
