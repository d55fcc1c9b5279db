"""What clients of others ask for, on a Cortex-M: single cycles, the boot project again, a node name."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest
from qemu import Board
from test_headroom import HEADROOM

from plctool.device import Plc
from plctool.errors import DeviceError
from plctool.link.connection import Connection

PROGRAM = """
PROGRAM Main
VAR n : DINT; rise : BOOL; END_VAR
VAR RETAIN kept : DINT; END_VAR
n := n + 1; kept := kept + 1; rise := NOT rise; %QB0 := 16#FF;
END_PROGRAM
PROGRAM Count
VAR n : DINT; END_VAR
n := n + 1;
END_PROGRAM
PROGRAM Bad
VAR a, b : DINT; END_VAR
IF b > 100 THEN a := 1 / a; END_IF
WHILE b < 0 DO a := a + 1; END_WHILE
b := b * 2;
END_PROGRAM
CONFIGURATION Config
    RESOURCE Res ON PLC
        TASK Slow(INTERVAL := T#20ms, PRIORITY := 9, WATCHDOG := T#100ms);
        TASK OnEdge(SINGLE := Main.rise, PRIORITY := 1);
        TASK Fast(INTERVAL := T#1ms, PRIORITY := 5);
        PROGRAM Main WITH Slow : Main;
        PROGRAM OnEdge1 WITH OnEdge : Count;
        PROGRAM Fast1 WITH Fast : Count;
        PROGRAM Bad1 WITH Slow : Bad;
    END_RESOURCE
END_CONFIGURATION
"""
COUNTS = ["Main.n", "Fast1.n", "OnEdge1.n"]


@pytest.fixture
def board(make_board: Callable[..., Board]) -> Board:
    board = make_board("full")
    board.power_on()
    return board


@pytest.fixture
def plc(board: Board, build) -> Iterator[Plc]:
    """With a program that is stopped."""
    with Plc(Connection(board.line())) as plc:
        plc.flash(build(PROGRAM).path, start=False)
        yield plc


def counts(plc: Plc) -> list[object]:
    return [plc.read(name) for name in COUNTS]


def test_a_single_cycle_runs_each_task_once_and_leaves_room_on_the_stack(plc):
    for cycles in (1, 2, 3):
        plc.cycle()
        assert counts(plc) == [cycles, cycles, (cycles + 1) // 2]
        assert plc.status().state == "stop"
    stack = plc.stack()
    assert stack and stack.unused >= HEADROOM


def test_an_exception_in_a_single_cycle_stops_it(plc):
    plc.write({"Bad1.b": 101})
    with pytest.raises(DeviceError, match="EXCEPTION"):
        plc.cycle()
    status = plc.status()
    assert status.state == "exception" and status.exception and status.exception.pou == "Bad1"
    plc.reset("cold")
    plc.cycle()
    assert plc.read("Main.n") == 1


def test_an_endless_loop_in_a_single_cycle_is_broken(plc):
    plc.write({"Bad1.b": -1})
    with pytest.raises(DeviceError, match="EXCEPTION"):
        plc.cycle()
    status = plc.status()
    assert status.exception and (status.exception.name, status.exception.pou) == ("WATCHDOG", "Bad1")
    plc.reset("cold")
    plc.cycle()
    assert plc.read("Main.n") == 1


def test_the_boot_project_comes_back_and_keeps_what_is_kept(plc):
    plc.cycle()
    plc.cycle()
    assert plc.shell("reload") == "reload: done"
    assert plc.status().state == "run"
    plc.stop()
    assert plc.read("Main.kept") == plc.read("Main.n") + 2


def test_a_node_name_survives_a_loss_of_power(board):
    with Plc(Connection(board.line())) as plc:
        plc.write_file("NodeName.txt", b"Mixer 7")
    board.power_off()
    board.power_on()
    with Plc(Connection(board.line())) as plc:
        assert "Node: Mixer 7" in plc.shell("rtsinfo")
        plc.delete_file("NodeName.txt")
        assert "Node: Mixer 7" not in plc.shell("rtsinfo")
