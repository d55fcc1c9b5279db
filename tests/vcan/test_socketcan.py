"""plcrt and plctool on the CAN of a real kernel: three controllers and two tools on one bus. See `run`."""

from __future__ import annotations

import os
import subprocess
import threading
import time
from pathlib import Path

import can
import pytest
from nodes import NODES

import plctool
from plctool.device import connect_several
from plctool.errors import PlcError
from plctool.link.transports import parse_link
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import PATIENCE, eventually

pytestmark = pytest.mark.skipif(not Path("/sys/class/net/vcan0").exists(), reason="there is no vcan0: make test-vcan")


def test_all_are_found(bus: str) -> None:
    assert {node.node_name for node in plctool.scan(parse_link(bus))} == set(NODES.values())


def test_several_are_flashed_at_once(bus: str, image: Path) -> None:
    with connect_several(parse_link(bus + "1,mixer,3")) as plcs:
        threads = [threading.Thread(target=plc.flash, args=(image,)) for plc in plcs.values()]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(PATIENCE)
        assert [plc.status().state for plc in plcs.values()] == ["run"] * 3


def test_one_tool_flashes_while_another_one_watches(bus: str, image: Path) -> None:
    seen: list[int] = []
    errors: list[PlcError] = []
    ended = threading.Event()

    def watch() -> None:
        try:
            with plctool.connect(bus + "mixer") as plc:
                for _, reading in plc.watch(["Main.count"], interval=0.0):
                    seen.append(reading.values["Main.count"])
                    if ended.is_set():
                        return
        except PlcError as error:
            errors.append(error)

    with plctool.connect(bus + "mixer") as plc:
        plc.flash(image)
    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    eventually(lambda: seen)
    with plctool.connect(bus + "press") as plc:
        plc.flash(image, force=True)
        assert plc.read("Main.t[1999]") == 3
    ended.set()
    watcher.join(PATIENCE)
    assert errors == []
    assert seen == sorted(seen)


def test_frames_of_others_are_left_alone(bus: str) -> None:
    """CANopen beside it: nothing is sent in reply, and nothing is disturbed."""
    interface = parse_link(bus).place.partition(":")[2]
    standard = [can.typechecking.CanFilter(can_id=0, can_mask=0, extended=False)]
    with (
        can.Bus(interface="socketcan", channel=interface, fd=True, can_filters=standard) as other,
        plctool.connect(bus + "1") as plc,
    ):
        for identifier in (0x000, 0x080, 0x181, 0x601, 0x701, 0x7E5):
            other.send(can.Message(arbitration_id=identifier, is_extended_id=False, data=bytes(8)))
        assert plc.identity().node_name == "press"
        assert other.recv(0.2) is None


def test_an_interface_that_goes_down_comes_back(bus: str) -> None:
    interface = parse_link(bus).place.partition(":")[2]
    ip = [os.environ.get("BUSYBOX", "busybox"), "ip", "link", "set", interface]
    subprocess.run([*ip, "down"], check=True)
    time.sleep(0.1)  # plcrt looks at it in its next pass
    subprocess.run([*ip, "up"], check=True)

    def answers() -> bool:
        try:
            with plctool.connect(bus + "3") as plc:
                return plc.identity().node_name == "oven"
        except PlcError:
            return False

    assert eventually(answers)


def test_an_interface_that_is_down_is_told(tmp_path: Path) -> None:
    ip = [os.environ.get("BUSYBOX", "busybox"), "ip", "link"]
    subprocess.run([*ip, "add", "dev", "vcan9", "type", "vcan"], check=True)
    with pytest.raises(PlcError, match=r"cannot open CAN vcan9: .*; set it up, for example with: ip link set"):
        Plcrt(tmp_path / "x.flash", "--can", "vcan9").start()
    subprocess.run([*ip, "set", "vcan9", "mtu", "16"], check=True)
    subprocess.run([*ip, "set", "vcan9", "up"], check=True)
    with pytest.raises(PlcError, match=r"cannot open CAN vcan9: .*mtu 72"):
        Plcrt(tmp_path / "x.flash", "--can", "vcan9", "--bitrate", "500000/2000000").start()  # its mtu is 16
