"""How much of the main stack is left after the worst that the other tests do."""

from __future__ import annotations

from elftools.elf.elffile import ELFFile
from programs import COUNTER, TWO_TASKS

from plctool.device import Plc
from plctool.link.connection import Connection

PAINT = 0x5A
GUARD = 32
HEADROOM = 256  # bytes; nested interrupts at the worst moment need more than a test provokes


def unused_stack(board) -> int:
    """Bytes of the main stack that still have the pattern of start-up."""
    with board.firmware.open("rb") as file:
        symbols = ELFFile(file).get_section_by_name(".symtab")
        bottom, top = (symbols.get_symbol_by_name(name)[0]["st_value"] for name in ("stack_bottom", "stack_top"))
    stack = board.read_memory(bottom, top - bottom)[GUARD:]
    return next(i for i, byte in enumerate(stack) if byte != PAINT)


def test_main_stack_has_headroom(board, build, eventually):
    with Plc(Connection(board.line())) as plc:
        for text, variable in ((TWO_TASKS, "Fast.n"), (COUNTER, "Main.n"), (TWO_TASKS, "Fast.n")):
            plc.flash(build(text).path)
            eventually(lambda variable=variable: plc.read(variable) > 20)
        plc.log()
        plc.tasks()
        plc.reset("cold")
    assert unused_stack(board) >= HEADROOM
