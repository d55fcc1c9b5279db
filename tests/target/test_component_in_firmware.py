"""A component of a vendor finds a function of the program by its name, on the processors that test_outside has not."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1]))

from environment import FIRMWARE, MACHINE, TARGET, firmware
from programs import compile_text, program
from qemu import Board
from vendor_component import cmp_list_of, relink, tank

from plctool.device import Plc
from plctool.link.connection import Connection
from plctool.testing.waiting import eventually


def test_a_component_calls_a_function_of_the_program(tmp_path: Path) -> None:
    assert FIRMWARE
    build = FIRMWARE.parents[2]
    elf = str(firmware("full").relative_to(build))
    folder = tmp_path / "product"
    folder.mkdir()
    shutil.copy(cmp_list_of(build, elf), folder)
    source = tank(folder)
    built = compile_text(source + program("VAR n : DINT; END_VAR", "n := n + 1;"), TARGET, folder)
    with Board(MACHINE, relink(build, elf, folder), folder) as board, Plc(Connection(board.line())) as plc:
        plc.flash(built.path)
        eventually(lambda: "The level is above the limit" in [entry.text for entry in plc.log()])
        assert plc.read("level") == 52.5
