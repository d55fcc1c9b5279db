"""Breakpoints on a board; what they promise is in tests/breakpoints.py."""

from __future__ import annotations

import random
import sys
from contextlib import suppress
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parents[1]))

import breakpoints
from breakpoints import FILE, Breaking
from environment import TARGET
from hostile_debugger import act
from shares import share

from plctool.device import Plc
from plctool.errors import DeviceError
from plctool.link.connection import Connection
from plctool.testing.waiting import eventually


@pytest.fixture
def plc(make_board, tmp_path):
    with make_board("full") as board, Plc(Connection(board.line())) as plc:
        plc.flash(breakpoints.build(tmp_path, target=TARGET))
        try:
            plc.breakpoints.list()
        except DeviceError as error:
            pytest.skip(str(error))
        yield plc


class TestBoard(Breaking):
    target = TARGET


@pytest.mark.parametrize("seed", share(range(6), 3))
def test_a_hostile_debugger_leaves_a_board_that_takes_a_program(plc, tmp_path, seed):
    chooser = random.Random(seed)
    for _ in range(40):
        with suppress(DeviceError):
            act(plc.breakpoints._target, chooser)
    plc.end_debugging()
    assert plc.status().state in ("run", "exception", "stop")
    plc.flash(breakpoints.build(tmp_path, target=TARGET))
    eventually(lambda: plc.read("Main.cycles") > 10)
    assert not any("fault of the runtime" in entry.text for entry in plc.log())


def test_a_trap_within_the_parts_of_an_instruction_is_refused(plc):
    target = plc.breakpoints._target
    target.attach(keep=False)
    target.set(64, 0, None)
    target.clear(64)
    for offset in (1, 63, 65):
        with pytest.raises(DeviceError):
            target.set(offset, 0, None)
        with pytest.raises(DeviceError):
            target.temporary([offset])


def test_a_trap_that_would_overwrite_a_part_of_another_one_is_refused(plc):
    debugger = plc.breakpoints
    debugger.set(FILE, 27)
    breakpoints.halt(debugger)
    target = debugger._target
    taken = 0
    for offset in range(4, 64, 2):  # also within instructions: neither trap may leave a part of the other one
        target.set(offset, 0, None)
        with suppress(DeviceError):
            target.set(offset + 2, 0, None)
            taken += 1
        target.clear(offset)
        with suppress(DeviceError):
            target.clear(offset + 2)
    assert taken > 3
    debugger.clear_all()
    debugger.go()
    before = plc.read("Main.cycles")
    eventually(lambda: plc.read("Main.cycles") > before + 5)


def test_a_firmware_without_breakpoints_says_so(make_board, build):
    with make_board("standard") as board, Plc(Connection(board.line())) as plc:
        plc.flash(build("PROGRAM Main VAR n : DINT; END_VAR n := n + 1; END_PROGRAM").path)
        with pytest.raises(DeviceError, match="not supported on this device"):
            plc.breakpoints.set(FILE, 1)
