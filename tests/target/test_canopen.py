"""A board as a CANopen device on its second UART, which carries the frames as SLCAN, under python canopen."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import canopen
import pytest
from environment import TARGET
from programs import compile_text
from qemu import Board

from plctool.debug.symbols import find_symbols
from plctool.device import Plc
from plctool.image.file import describe_image, parse_image
from plctool.io.canopen.eds import read_eds
from plctool.io.canopen.eds_of_image import eds_of_image
from plctool.link.canbus import open_bus
from plctool.link.connection import Connection
from plctool.testing.waiting import PATIENCE, eventually

sys.path.append(str(Path(__file__).parents[1]))

from canopen_device_programs import DESCRIPTION, NODE, SOURCE, WRITE


def load(board: Board, folder: Path, more: str = "") -> tuple[Plc, str]:
    """The program on the board, and its EDS. `more`: keys of the device."""
    (folder / "field.io.toml").write_text(DESCRIPTION + f"node = {NODE}\n{more}" + WRITE)
    built = compile_text(SOURCE, TARGET, folder)
    symbols = built.path.with_suffix(".sym")
    plc = Plc(Connection(board.line()), symbols)
    plc.flash(built.image)
    channels = find_symbols(int(describe_image(built.image)["crc"], 16), built.path).io["channels"]
    return plc, eds_of_image(parse_image(built.image), channels, "field.eds")


def test_manager_reads_writes_maps_and_stores(make_board: Callable[..., Any], tmp_path: Path) -> None:
    board = make_board("canopen")
    board.power_on("host")
    plc, text = load(board, tmp_path)
    network = canopen.Network(bus=open_bus(board.can, 500000, 0))
    network.connect()
    with plc:
        path = tmp_path / "field.eds"
        path.write_text(text)
        node = network.add_node(NODE, str(path))
        node.sdo.RESPONSE_TIMEOUT = PATIENCE
        node.nmt.wait_for_heartbeat(PATIENCE)
        for found in read_eds("field.eds", text.encode()).objects.values():
            for entry in found.entries.values():
                assert entry.type is not None
                value = entry.type.decode(node.sdo.upload(entry.index, entry.sub))
                assert entry.default is None or value == entry.default.at(NODE), entry.place
        sent: list[bytes] = []
        network.subscribe(0x180 + NODE, lambda cob, data, time: sent.append(bytes(data)))
        node.nmt.state = "OPERATIONAL"
        eventually(lambda: plc.read("Main.ok"))
        network.send_message(0x200 + NODE, b"\x10\x27\x01")
        eventually(lambda: sent[-1:] == [b"\x10\x27\x01"])
        text_of_100 = b"a text of a hundred characters " * 3 + b"and so."
        with node.sdo.open(0x2202, 0, "wb", size=len(text_of_100), block_transfer=True) as writer:
            writer.write(text_of_100)
        with node.sdo.open(0x2202, 0, "rb", block_transfer=True) as reader:
            assert reader.read() == text_of_100
        eventually(lambda: plc.read("Main.recipe").encode() == text_of_100)
        node.sdo.download(0x1017, 0, (350).to_bytes(2, "little"))
        node.sdo.download(0x1010, 1, b"save")
        node.sdo.download(0x1017, 0, (100).to_bytes(2, "little"))
        node.nmt.send_command(0x81)
        eventually(lambda: node.sdo.upload(0x1017, 0) == (350).to_bytes(2, "little"))
        assert node.sdo.upload(0x2202, 0) == text_of_100
    network.disconnect()


def test_manager_replaces_the_program(make_board: Callable[..., Any], tmp_path: Path) -> None:
    board = make_board("canopen-download")
    board.power_on("host")
    plc, text = load(board, tmp_path, "download = true")
    second = compile_text(SOURCE.replace("'none'", "'second'"), TARGET, tmp_path).image
    damaged = bytes([*second[:-20], second[-20] ^ 1, *second[-19:]])
    network = canopen.Network(bus=open_bus(board.can, 500000, 0))
    network.connect()
    path = tmp_path / "field.eds"
    path.write_text(text)
    sdo = network.add_node(NODE, str(path)).sdo
    sdo.RESPONSE_TIMEOUT = PATIENCE
    with plc:
        assert sdo.upload(0x2101, 0) == b"none"
        write_program(sdo, damaged)
        with pytest.raises(canopen.SdoAbortedError):
            sdo.download(0x1F51, 1, b"\1")
        assert sdo.upload(0x1F57, 1) != bytes(4)
        assert sdo.upload(0x2101, 0) == b"none"
        write_program(sdo, second)
        sdo.download(0x1F51, 1, b"\1")
        eventually(lambda: sdo.upload(0x2101, 0) == b"second")
    network.disconnect()


def write_program(sdo: Any, image: bytes) -> None:
    with sdo.open(0x1F50, 1, "wb", size=len(image), block_transfer=True) as writer:
        writer.write(image)
