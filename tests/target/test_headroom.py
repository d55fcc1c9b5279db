"""How much of the main stack is left after the worst that the other tests do."""

from __future__ import annotations

from programs import COUNTER, TWO_TASKS

from plctool.testing.waiting import eventually

HEADROOM = 256  # bytes; nested interrupts at the worst moment need more than a test provokes


def test_main_stack_has_headroom(plc, build):
    for text, variable in ((TWO_TASKS, "Fast.n"), (COUNTER, "Main.n"), (TWO_TASKS, "Fast.n")):
        plc.flash(build(text).path)
        eventually(lambda variable=variable: plc.read(variable) > 20)
    plc.log()
    plc.tasks()
    plc.reset("cold")
    stack = plc.stack()
    assert HEADROOM <= stack.unused < stack.size
