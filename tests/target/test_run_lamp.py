"""A lamp of the board shows whether the program runs: a component of the port hears of it."""

from __future__ import annotations

from environment import MACHINE
from programs import program

from plctool.device import Plc
from plctool.link.connection import Connection
from plctool.testing.waiting import eventually

LAMP = 0x40025004 if MACHINE == "lm3s6965evb" else 0x4002F004  # its register, in which it is the lowest bit
COUNTER = program("VAR count : DINT; divisor : DINT := 1; END_VAR", "count := count + 1 / divisor;")


def test_lamp_is_on_while_the_program_runs(make_board, build):
    with make_board("full") as board, Plc(Connection(board.line())) as plc:

        def shines():
            return board.read_memory(LAMP, 4) == bytes([1, 0, 0, 0])

        assert not shines()
        plc.flash(build(COUNTER).path)
        assert shines()
        plc.force({"Main.count": 5})
        eventually(lambda: not shines())  # for a moment of each second
        eventually(shines)
        plc.unforce()
        eventually(shines)
        plc.stop()
        assert not shines()
        plc.start()
        assert shines()
        plc.write({"Main.divisor": 0})
        eventually(lambda: plc.status().exception)
        assert not shines()
        plc.reset("warm")
        plc.start()
        assert shines()
