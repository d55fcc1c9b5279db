"""A password on a Cortex-M: the device checks proofs itself, and keeps it over power cuts, also with a program."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from programs import program
from qemu import Board
from test_headroom import HEADROOM

from plctool.device import Plc
from plctool.errors import DeviceError
from plctool.link.connection import Connection

RIGHT, WRONG = "nine green bottles", "ten green bottles"
COUNTER = program("VAR count : DINT; END_VAR", "count := count + 1;")


@pytest.fixture
def board(make_board: Callable[..., Board]) -> Board:
    """The configuration that has passwords, on."""
    board = make_board("full")
    board.power_on()
    return board


@contextmanager
def connected(board: Board, password: str | None) -> Iterator[Plc]:
    with Plc(Connection(board.line()), ask_password=lambda: password) as plc:
        yield plc


def refused(board: Board, password: str | None) -> str:
    with connected(board, password) as plc, pytest.raises(DeviceError) as error:
        plc.status()
    return error.value.code


def test_a_password_is_checked_and_survives_programs_and_power_cuts(board: Board, build: Any) -> None:
    with connected(board, RIGHT) as plc:
        plc.set_password(RIGHT)
        plc.flash(build(COUNTER).image)
    for _ in range(2):
        assert refused(board, None) == "password-needed"
        assert refused(board, WRONG) == "wrong-password"
        with connected(board, RIGHT) as plc:
            assert plc.status().state == "run"
        board.power_off()
        board.power_on()
    with connected(board, RIGHT) as plc:
        plc.set_password(None)
    with connected(board, None) as plc:
        assert plc.status().state == "run"


def test_checking_and_setting_it_leave_room_on_the_stack(board: Board) -> None:
    with connected(board, RIGHT) as plc:
        plc.set_password(RIGHT)
        plc.set_password(WRONG)
    with connected(board, WRONG) as plc:
        stack = plc.stack()
        assert stack and stack.unused >= HEADROOM
