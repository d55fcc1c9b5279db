"""Power cuts while a program is replaced: the device starts, runs the old program or the new one, and takes another.

A plugin of QEMU writes down every store into the flash while a program is stopped, started, replaced, and proves
itself. The flash after the first n stores is what a power cut there leaves; boards are started with it. Tried are all
n in the logs of commit records and retain variables and at the end of the program, where its seal makes it count, and
a selection in the rest of the slot, which is not read before (more of them in `make test-whole`). POWER_CUTS=all tries
all n, POWER_CUTS=few a fifth of the selection.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue

import pytest
from environment import MACHINE, TARGET, firmware
from plugins import compile_plugin, compiler
from programs import COUNTER, TWO_TASKS, Built, compile_text
from qemu import Board
from shares import WHOLE

from plctool.debug.symbols import symbol_path
from plctool.device import Plc
from plctool.errors import PlcError
from plctool.image.board import read_firmware
from plctool.link.connection import Connection
from plctool.link.services import AppState
from plctool.testing.waiting import eventually

HERE = Path(__file__).parent
STORE = struct.Struct("<I8s")
PROVEN = 3500  # cycles of 1 ms after which a program has proven itself
IN_SLOT = 40 if WHOLE else 12  # cuts to try in the slot
SEAL_STORES = 4  # the two of the seal, and what is before
AT_ONCE = 2  # boards
WHICH = os.environ.get("POWER_CUTS", "")


@dataclass(frozen=True)
class Cut:
    """A power cut after `stores` stores; `in_slot`: the last one was into the new slot."""

    stores: int
    in_slot: bool


@dataclass(frozen=True)
class Replacement:
    """What happened to the flash while `old` was replaced by `new`."""

    old: Built
    new: Built
    kept: int  # the retain variable of the old program before
    before: bytes
    stores: list[tuple[int, bytes]]
    sector_size: int

    @property
    def slot(self) -> range:
        """The sectors that the new program was written to."""
        begin = self.after(len(self.stores)).index(self.new.image)
        end = begin + len(self.new.image)
        return range(begin // self.sector_size * self.sector_size, -(-end // self.sector_size) * self.sector_size)

    def after(self, stores: int) -> bytes:
        """The flash after the first of them."""
        flash = bytearray(self.before)
        for offset, block in self.stores[:stores]:
            flash[offset : offset + len(block)] = block
        return bytes(flash)

    def cuts(self) -> Iterator[Cut]:
        """Every cut that leaves something else than the previous one."""
        slot = self.slot
        flash = bytearray(self.before)
        for n, (offset, block) in enumerate(self.stores, 1):
            if flash[offset : offset + len(block)] != block:
                flash[offset : offset + len(block)] = block
                yield Cut(n, offset in slot)


@pytest.fixture(scope="module")
def replacement(tmp_path_factory: pytest.TempPathFactory) -> Replacement:
    """Recorded on a board whose time does not depend on the host."""
    if compiler() is None:
        pytest.skip("needs a C compiler for QEMU's plugin")
    folder = tmp_path_factory.mktemp("replacement")
    record = folder / "stores"
    board = Board(MACHINE, firmware("standard"), folder)
    plugin = compile_plugin("stores", board.qemu.program, folder)
    old, new = (compile_text(text, TARGET, folder) for text in (COUNTER, TWO_TASKS))

    board.power_on("exact")
    with Plc(Connection(board.line())) as plc:
        plc.flash(old.path)
        eventually(lambda: plc.read("Main.n") > PROVEN)
        plc.stop()  # saves the retain variable
        kept = plc.read("Main.kept")
    board.power_off()
    flash = read_firmware(board.firmware).board.flash
    before = board.read_flash(0, flash.size)

    arguments = f"base={board.qemu.flash_base},size={flash.size},memory={board.flash_file},out={record}"
    if board.qemu.has_commands:
        arguments += f",sector={flash.sector_size}"
    board.power_on("exact", plugin=f"file={plugin},{arguments}")
    with Plc(Connection(board.line())) as plc:
        plc.stop()
        plc.start()
        plc.flash(new.path)
        eventually(lambda: plc.read("Fast.n") > PROVEN)
    board.power_off()
    return Replacement(old, new, kept, before, list(STORE.iter_unpack(record.read_bytes())), flash.sector_size)


def test_the_running_program_is_untouched_by_the_download(replacement):
    place = replacement.before.index(replacement.old.image)
    program = range(place - 8 + 1, place + len(replacement.old.image))  # a store changes 8 bytes from its offset on
    assert [hex(offset) for offset, _ in replacement.stores if offset in program] == []


def selected(replacement: Replacement) -> list[Cut]:
    """The cuts to try."""
    cuts = list(replacement.cuts())
    if WHICH == "all":
        return cuts
    in_slot = [cut.stores for cut in cuts if cut.in_slot]
    some = {in_slot[len(in_slot) * i // IN_SLOT] for i in range(IN_SLOT)} | set(in_slot[-SEAL_STORES:])
    chosen = [cut for cut in cuts if not cut.in_slot or cut.stores in some]
    return chosen[::5] if WHICH == "few" else chosen


def survivor(board: Board, replacement: Replacement, cut: Cut) -> str:
    """What runs after the cut: "old" with its retain variable, or "new". A program can be flashed afterwards."""
    board.write_flash(0, replacement.after(cut.stores))
    with board, Plc(Connection(board.line()), symbol_path(replacement.old.path)) as plc:
        status = plc.status()
        assert status.state is AppState.RUN, f"after {cut.stores} stores"
        name = {replacement.old.symbols.image_crc: "old", replacement.new.symbols.image_crc: "new"}[status.image_crc]
        if name == "old":
            assert plc.read("Main.kept") >= replacement.kept, f"after {cut.stores} stores"
        plc.flash(replacement.new.image, force=True)
        status = plc.status()
        assert (status.image_crc, status.state) == (replacement.new.symbols.image_crc, AppState.RUN)
    return name


def test_cut_after_a_store_leaves_old_or_new(replacement, make_board):
    boards: SimpleQueue[Board] = SimpleQueue()
    for _ in range(AT_ONCE):
        boards.put(make_board())

    def attempt(cut: Cut) -> str:
        board = boards.get()
        try:
            return survivor(board, replacement, cut)
        finally:
            boards.put(board)

    cuts = selected(replacement)
    with ThreadPoolExecutor(AT_ONCE) as pool:
        seen = list(pool.map(attempt, cuts))
    print(f"{len(replacement.stores)} stores, {len(cuts)} cuts: {seen.count('old')} old, {seen.count('new')} new")
    assert len(cuts) > (IN_SLOT + 20 if WHICH != "few" else 15)
    assert set(seen) == {"old", "new"}
    assert seen == sorted(seen, reverse=True), "once it is the new one it stays the new one"


def test_pulling_the_plug_again_and_again(make_board, build):
    """Later and later in the transfer; the flash is carried on from one cut to the next."""
    board = make_board()
    old, new = build(COUNTER), build(TWO_TASKS)
    board.power_on("exact")
    with Plc(Connection(board.line())) as plc:
        plc.flash(old.path)
        eventually(lambda: plc.read("Main.n") > PROVEN)
    board.power_off()
    for number in range(6):
        board.power_on()
        image = (new, old)[number % 2]

        def cut(done: int, total: int, part: float = number / 6) -> None:
            if done >= total * part:
                board.power_off()

        with suppress(PlcError), Plc(Connection(board.line())) as plc:
            plc.flash(image.path, force=True, progress=cut)
        board.power_off()
    board.power_on()
    with Plc(Connection(board.line())) as plc:
        assert plc.status().state is AppState.RUN
        plc.flash(new.path)
        assert plc.status().image_crc == new.symbols.image_crc
