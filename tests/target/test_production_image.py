"""A board that was burned in production runs its program from its first start, with the firmware it was burned with."""

from __future__ import annotations

from environment import CONFIG, firmware
from programs import COUNTER

from plctool.cli.commands.images import production
from plctool.device import Plc
from plctool.image.board import read_firmware
from plctool.link.connection import Connection
from plctool.link.services import AppState
from plctool.testing.waiting import eventually


def check(board, built):
    """The retain variable of the program, which counts its cycles in all lives."""
    with Plc(Connection(board.line())) as plc:
        status = plc.raw_status()
        assert (status.state, status.image_crc) == (AppState.RUN, built.symbols.image_crc)
        assert not any("commit" in entry.text.lower() or "laid out" in entry.text for entry in plc.log())
        eventually(lambda: plc.read("Main.n") > 2000)  # it was saved
        return plc.read("Main.kept")


def test_a_burned_flash_runs_its_program_at_once(make_board, build, tmp_path):
    built = build(COUNTER)
    slug = read_firmware(firmware(CONFIG)).board.slug
    production(built.path, slug, None, tmp_path / "flash.bin")
    check_burned(make_board(), built, tmp_path / "flash.bin")


def check_burned(board, built, flash):
    """The first start, and one from what the first left."""
    board.write_flash(0, flash.read_bytes())
    with board:
        kept = check(board, built)
    with board:
        assert check(board, built) > kept


def test_firmware_describes_its_board(make_board, build, tmp_path):
    """It is in the same file as the program, unless programs have a memory of their own."""
    built, elf = build(COUNTER), firmware(CONFIG)
    board_facts = read_firmware(elf).board
    if board_facts.flash.address is None:
        assert production(built.path, board_facts.slug, elf, tmp_path / "memory.bin")["burn_apart"] == str(elf)
        check_burned(make_board(), built, tmp_path / "memory.bin")
        return
    production(built.path, board_facts.slug, elf, tmp_path / "all.hex")
    board = make_board()
    board.starts_from = ["-device", f"loader,file={tmp_path / 'all.hex'}"]
    with board:
        check(board, built)
