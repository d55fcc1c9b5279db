"""A board that was burned in production runs its program from its first start, with the firmware it was burned with."""

from __future__ import annotations

import pytest
from environment import CONFIG, MACHINE, eventually, firmware
from programs import COUNTER

from plctool.cli.image_documents import production
from plctool.device import Plc
from plctool.image.board import read_firmware
from plctool.link.connection import Connection
from plctool.link.services import AppState

IS_MPS2 = MACHINE.startswith("mps2")


def check(board, built):
    with Plc(Connection(board.line())) as plc:
        status = plc.raw_status()
        assert (status.state, status.image_crc) == (AppState.RUN, built.symbols.image_crc)
        assert not any("commit" in entry.text.lower() or "laid out" in entry.text for entry in plc.log())
        assert eventually(lambda: plc.read("Main.n", "Main.kept"))["Main.n"] > 0


def test_a_burned_flash_runs_its_program_at_once(make_board, build, tmp_path):
    built = build(COUNTER)
    slug = read_firmware(firmware(CONFIG)).board.slug
    production(built.path, slug, None, tmp_path / "flash.bin")
    check_burned(make_board(), built, tmp_path / "flash.bin")


def check_burned(board, built, flash):
    """Both the first start and one from what the first left."""
    board.write_flash(0, flash.read_bytes())
    for _ in range(2):
        with board:
            check(board, built)


@pytest.mark.skipif(not IS_MPS2, reason="programs have a memory of their own")
def test_one_file_has_firmware_and_program(make_board, build, tmp_path):
    built = build(COUNTER)
    production(built.path, None, firmware(CONFIG), tmp_path / "all.hex")
    board = make_board()
    board.starts_from = ["-device", f"loader,file={tmp_path / 'all.hex'}"]
    with board:
        check(board, built)


@pytest.mark.skipif(IS_MPS2, reason="firmware and programs are in one address space")
def test_a_memory_of_their_own_is_burned_for_a_board_that_only_its_firmware_describes(make_board, build, tmp_path):
    built = build(COUNTER)
    document = production(built.path, None, firmware(CONFIG), tmp_path / "eeprom.bin")
    assert document["burn_apart"] == str(firmware(CONFIG))
    check_burned(make_board(), built, tmp_path / "eeprom.bin")
