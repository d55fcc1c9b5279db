"""Requests of a hostile debugger: traps anywhere, senseless conditions and lists, stacks that are not there."""

from __future__ import annotations

import random

from plctool.core import lib
from plctool.debug.forced import ForcedPlace
from plctool.debug.target import DeviceCondition, Target

CODE = 1 << 12  # offsets are below that, mostly in the code of the program


def act(target: Target, chooser: random.Random) -> None:
    action = chooser.randrange(9)
    offset = chooser.choice((chooser.randrange(CODE), chooser.randrange(1 << 32)))
    if action == 0:
        target.set(offset, 0, None)
    elif action == 1:
        target.set(chooser.randrange(CODE), chooser.randrange(3), _condition(chooser))
    elif action == 2:
        target.temporary([chooser.randrange(CODE) for _ in range(chooser.choice((1, 300, 6000)))])
    elif action == 3:
        target.go(chooser.randrange(5), chooser.choice((target.status().serial, chooser.randrange(1 << 32))))
    elif action == 4:
        target.pause()
    elif action == 5:
        target.read_stack(chooser.randrange(1 << 20), chooser.randrange(1, 4096))
    elif action == 6:
        target.write_stack(chooser.randrange(1 << 9), chooser.randbytes(chooser.randrange(1, 64)))
    elif action == 7:
        places = [_place(chooser) for _ in range(chooser.randrange(7))]
        target.watch(places, [chooser.randrange(CODE) for _ in range(chooser.choice((0, 1, 300, 6000)))])
    else:
        target.clear(offset)


def _place(chooser: random.Random) -> ForcedPlace:
    """Anything, in no area or in one."""
    size = chooser.choice((1, 2, 4, 8, 3, 255))
    hops = tuple(chooser.randrange(1 << 32) for _ in range(chooser.randrange(lib.PLACE_POINTERS + 1)))
    return ForcedPlace(
        chooser.choice((0, 1, 2, 3, 0xFF)), chooser.choice((0, 8, chooser.randrange(1 << 32))), hops, size,
        chooser.choice((0xFF, 1, 0)), chooser.randbytes(8),
    )  # fmt: skip


def _condition(chooser: random.Random) -> DeviceCondition:
    """A comparison of anything with anything."""
    return DeviceCondition(_place(chooser), chooser.randrange(256), chooser.randrange(256))
