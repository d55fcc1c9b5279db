"""A board on CAN: its second UART carries the frames as SLCAN, and plctool takes it for an adapter."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import plctool
from plctool.device import Plc
from plctool.errors import LinkError
from plctool.link.connection import Connection
from plctool.link.names import Node
from plctool.link.transports import parse_link
from plctool.testing.waiting import PATIENCE, eventually

PROGRAM = """
PROGRAM Main
VAR
    count : DINT;
    table : ARRAY[0..399] OF DINT := [400(5)];
END_VAR
count := count + 1;
END_PROGRAM
"""


def scanned(link: str) -> list[Node]:
    """The devices that answer in time."""
    try:
        return plctool.scan(link)
    except LinkError:
        return []


def test_it_is_scanned_flashed_and_read_over_can(make_board: Callable[..., Any], build: Callable[[str], Any]) -> None:
    board = make_board("can")
    board.power_on("host")
    built = build(PROGRAM)
    (node,) = eventually(lambda: scanned(f"can:{board.can}"))
    assert node.place == "node 1"
    with plctool.connect(parse_link(f"can:{board.can}?node=1")) as plc:
        assert plc.identity().node_name == node.node_name
        plc.flash(built.image)
        assert plc.read("Main.table[399]") == 5
        first = plc.read("Main.count")
        eventually(lambda: plc.read("Main.count") > first)
        plc.stop()
        assert plc.status().state == "stop"


def test_can_and_the_serial_line_serve_at_once(make_board: Callable[..., Any], build: Callable[[str], Any]) -> None:
    """One tool watches over the serial line while another one flashes over CAN."""
    board = make_board("can")
    board.power_on("host")
    built = build(PROGRAM)
    seen: list[int] = []
    ended = threading.Event()

    def watch() -> None:
        with Plc(Connection(board.line()), built.path.with_suffix(".sym")) as plc:
            for _, reading in plc.watch(["Main.count"], interval=0.01):
                seen.append(reading.values["Main.count"])
                if ended.is_set():
                    return

    with plctool.connect(parse_link(f"can:{board.can}?node=1")) as plc:
        plc.flash(built.image)
        watcher = threading.Thread(target=watch, daemon=True)
        watcher.start()
        eventually(lambda: seen)
        for _ in range(20):
            assert plc.read("Main.table[1]") == 5
        ended.set()
        watcher.join(PATIENCE)
    assert not watcher.is_alive()
    assert seen == sorted(seen)
