"""The minimal configuration: one serial line, a super loop, no monitoring. What it does shows in its RAM."""

from __future__ import annotations

import pytest
from programs import COUNTER, TWO_TASKS, program

from plctool.core import lib
from plctool.device import Plc
from plctool.link.connection import Connection
from plctool.link.services import AppState
from plctool.testing.waiting import eventually

TWO_COUNTERS = TWO_TASKS.replace("100000", "100")
FAULTY = program("VAR n, zero : DINT; END_VAR", "n := n + 1; IF n > 50 THEN n := n / zero; END_IF")


@pytest.fixture
def minimal(make_board):
    """A board with the minimal configuration, on."""
    board = make_board("minimal")
    board.power_on()
    return board


def value(board, built, name: str) -> int:
    """A DINT, from where the runtime keeps the data area."""
    symbol = built.symbols.resolve(name)
    assert symbol.area == lib.APP_AREA_DATA
    return int.from_bytes(board.read_memory(board.address_of("areas") + symbol.offset, 4), "little")


def test_super_loop_runs_all_tasks(minimal, build):
    built = build(TWO_COUNTERS)
    with Plc(Connection(minimal.line())) as plc:
        assert plc.flash(built.path).state is AppState.RUN
        eventually(lambda: value(minimal, built, "Slow.n") > 10)
        slow = value(minimal, built, "Slow.n")  # first: time passes between the two
        assert value(minimal, built, "Fast.n") > 5 * slow


def test_program_is_booted_after_power_on(minimal, build):
    built = build(TWO_COUNTERS)
    with Plc(Connection(minimal.line())) as plc:
        plc.flash(built.path)
    minimal.power_off()
    minimal.power_on()
    with Plc(Connection(minimal.line())) as plc:
        status = plc.status()
        assert (status.state, status.image_crc) == (AppState.RUN, built.symbols.image_crc)
    eventually(lambda: value(minimal, built, "Slow.n") > 10)


def test_fault_stops_the_program_and_another_one_takes_its_place(minimal, build):
    with Plc(Connection(minimal.line())) as plc:
        plc.flash(build(FAULTY).path)
        eventually(lambda: plc.status().state is AppState.EXCEPTION)
        assert plc.status().exception.name == "DIVIDEBYZERO"
        assert plc.status().exception.pou == "Main"
        plc.flash(build(COUNTER.replace("VAR RETAIN", "VAR")).path)
        assert plc.status().state is AppState.RUN
