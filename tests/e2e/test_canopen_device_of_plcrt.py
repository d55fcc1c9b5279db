"""plcrt as a CANopen device under a foreign manager, python canopen, on a hub of pseudo terminals."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import canopen
import pytest
from canopen.sdo import SdoAbortedError

sys.path.append(str(Path(__file__).parents[1]))

from canopen_device_programs import NODE, write_device

from plctool import connect
from plctool.cli.commands.canopen.eds import write_eds
from plctool.compiler import compile_sources
from plctool.device import Plc
from plctool.io.canopen.eds import Eds, load_eds
from plctool.link.canbus import open_bus
from plctool.testing.can_hub import CanHub
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually

TIMEOUT_S = 20.0


class Manager:
    """A foreign manager with one node."""

    def __init__(self, path: str, eds: Path, node: int = NODE) -> None:
        self.network = canopen.Network(bus=open_bus(f"slcan:{path}", 500000, 0))
        self.network.connect()
        self.node = self.network.add_node(node, str(eds))
        self.node.sdo.RESPONSE_TIMEOUT = TIMEOUT_S
        self.node.sdo.MAX_RETRIES = 0
        self.frames: dict[int, list[bytes]] = {}
        for cob in (0x180 + node, 0x280 + node, 0x80 + node, 0x700 + node):
            self.network.subscribe(cob, lambda cob, data, time: self.frames.setdefault(cob, []).append(bytes(data)))

    def start(self) -> None:
        self.node.nmt.state = "OPERATIONAL"
        eventually(lambda: self.node.nmt.state == "OPERATIONAL")

    def abort_of(self, index: int, sub: int, data: bytes | None = None) -> int:
        """The code with which the device refuses to read an object, or to write it."""
        with pytest.raises(SdoAbortedError) as refused:
            if data is None:
                self.node.sdo.upload(index, sub)
            else:
                self.node.sdo.download(index, sub, data)
        return int(refused.value.code)


@pytest.fixture
def hub() -> Iterator[CanHub]:
    with CanHub(2) as hub:
        yield hub


@pytest.fixture
def image(tmp_path: Path) -> Path:
    image = tmp_path / "app.cdl"
    compile_sources([write_device(tmp_path / "program")]).write(image)
    assert write_eds(image, None) == {"eds": str(image.with_suffix(".eds"))}
    return image


@pytest.fixture
def plcrt(hub: CanHub, tmp_path: Path) -> Iterator[Plcrt]:
    with Plcrt(tmp_path / "flash", "--can", f"slcan:{hub.paths[0]}", "--node", "5") as plcrt:
        yield plcrt


@pytest.fixture
def plc(plcrt: Plcrt, image: Path) -> Iterator[Plc]:
    with connect(f"serial:{plcrt.port}") as plc:
        plc.flash(image)
        yield plc


@pytest.fixture
def eds(image: Path) -> Eds:
    return load_eds(image.with_suffix(".eds"))


@pytest.fixture
def manager(hub: CanHub, plc: Plc, image: Path) -> Iterator[Manager]:
    manager = Manager(hub.paths[1], image.with_suffix(".eds"))
    manager.node.nmt.wait_for_heartbeat(TIMEOUT_S)
    yield manager
    manager.network.disconnect()


def test_each_object_of_the_eds_is_read_with_its_type_and_default(manager: Manager, eds: Eds) -> None:
    assert not eds.findings.found
    for found in eds.objects.values():
        for entry in found.entries.values():
            data = manager.node.sdo.upload(entry.index, entry.sub)
            assert entry.type is not None, entry.place
            value = entry.type.decode(data)
            if entry.default is not None:
                assert value == entry.default.at(NODE), entry.place
            if entry.access in ("ro", "const") and entry.type.bits:
                assert manager.abort_of(entry.index, entry.sub, data) == 0x06010002, entry.place


def test_what_is_not_in_the_eds_does_not_exist(manager: Manager, eds: Eds) -> None:
    for index in (0x1002, 0x1404, 0x1804, 0x1A04, 0x2100, 0x2206, 0xFFFF):
        assert index not in eds.objects
        assert manager.abort_of(index, 0) == 0x06020000
    for index, sub in ((0x1018, 5), (0x1800, 4), (0x1400, 6), (0x1800, 7), (0x1A00, 9), (0x2102, 4), (0x2200, 1)):
        assert eds.entry(index, sub) is None
        assert manager.abort_of(index, sub) == 0x06090011


def test_values_are_exchanged_by_sdo_and_pdo(manager: Manager, plc: Plc) -> None:
    manager.start()
    eventually(lambda: plc.read("Main.ok"))
    sdo = manager.node.sdo
    assert sdo.upload(0x2101, 0) == b"none"
    sdo.download(0x2200, 0, (1234).to_bytes(2, "little"))
    eventually(lambda: plc.read("Main.setpoint") == 1234)
    eventually(lambda: manager.frames.get(0x189, [])[-1:] == [b"\xd2\x04\x00"])
    long_text = "a recipe that is longer than one segment and has more than one block of it " + "x" * 20
    sdo.download(0x2202, 0, long_text.encode())
    eventually(lambda: plc.read("Main.recipe") == long_text)
    assert sdo.upload(0x2202, 0) == long_text.encode()
    with sdo.open(0x2202, 0, "wb", size=len(long_text), block_transfer=True) as writer:
        writer.write(long_text.upper().encode())
    with sdo.open(0x2202, 0, "rb", block_transfer=True) as reader:
        assert reader.read() == long_text.upper().encode()
    manager.network.send_message(0x209, b"\x10\x27\x01")
    eventually(lambda: plc.read("Main.setpoint") == 10_000 and plc.read("Main.run"))
    eventually(lambda: manager.frames.get(0x189, [])[-1:] == [b"\x10\x27\x01"])
    manager.network.send_message(0x309, b"\x00\x00\x80\x3f")
    manager.network.sync.transmit()
    eventually(lambda: plc.read("Main.level") == 1.0)
    manager.network.sync.transmit()
    eventually(lambda: manager.frames.get(0x289, [])[-1:] == [b"\x0a\x00\xec\xff"])


def test_manager_maps_pdos_anew(manager: Manager, plc: Plc) -> None:
    node = manager.node
    node.tpdo.read()
    node.tpdo[3].clear()
    node.tpdo[3].add_variable(0x2103, 1, length=1)
    node.tpdo[3].add_variable(0x2102, 3)
    node.tpdo[3].trans_type = 1
    node.tpdo[3].enabled = True
    node.tpdo[3].save()
    got: list[bytes] = []
    manager.network.subscribe(0x389, lambda cob, data, time: got.append(bytes(data)))
    manager.start()
    manager.network.sync.transmit()
    eventually(lambda: got == [(30 << 1).to_bytes(3, "little")])
    assert manager.abort_of(0x1A02, 0, b"\x00") == 0x08000022, "while it is valid"
    assert manager.abort_of(0x1802, 1, (0x40000390).to_bytes(4, "little")) == 0x06090030
    node.sdo.download(0x1802, 1, (0xC0000389).to_bytes(4, "little"))
    node.sdo.download(0x1A02, 0, b"\0")
    assert manager.abort_of(0x1A02, 1, (0x21020110 + 8).to_bytes(4, "little")) == 0x06040041
    assert manager.abort_of(0x1A02, 1, (0x77770008).to_bytes(4, "little")) == 0x06020000
    assert manager.abort_of(0x1A02, 1, (0x22040008).to_bytes(4, "little")) == 0x06040041, "others write it"
    assert manager.abort_of(0x1A02, 0, b"\x09") == 0x06040042
    assert manager.abort_of(0x1802, 2, b"\xfc") == 0x06090030


def test_bad_values_are_refused_with_their_codes(manager: Manager) -> None:
    assert manager.abort_of(0x2200, 0, b"\1") == 0x06070013
    assert manager.abort_of(0x2200, 0, b"\1\2\3") == 0x06070012
    assert manager.abort_of(0x2202, 0, b"x" * 101) == 0x06070012
    assert manager.abort_of(0x2201, 1, b"\2") == 0x06090031
    assert manager.abort_of(0x1003, 0, b"\1") == 0x06090030
    assert manager.abort_of(0x1010, 1, b"evas") == 0x08000020
    assert manager.abort_of(0x1014, 0, (0x95).to_bytes(4, "little")) == 0x06090030
    assert manager.abort_of(0x1029, 1, b"\3") == 0x06090031


def test_emergency_of_the_program_and_of_a_lost_manager(manager: Manager, plc: Plc) -> None:
    emcy = manager.frames.setdefault(0x89, [])
    manager.start()
    plc.write({"Main.error": 0x5123})
    eventually(lambda: emcy == [b"\x23\x51\x01\0\0\0\0\0"])
    assert (manager.node.sdo.upload(0x1001, 0), manager.node.sdo.upload(0x1003, 1)) == (b"\1", b"\x23\x51\0\0")
    plc.write({"Main.error": 0})
    eventually(lambda: emcy[1:] == [bytes(8)])
    manager.node.sdo.download(0x1016, 1, (127 << 16 | 300).to_bytes(4, "little"))
    plc.write({"Main.small": 1})
    manager.network.send_message(0x77F, b"\5")
    eventually(lambda: manager.node.nmt.state == "PRE-OPERATIONAL")
    assert emcy[2] == b"\x30\x81\x11\0\0\0\0\0"
    eventually(lambda: not plc.read("Main.ok"))
    eventually(lambda: plc.read("Main.small") == 7)
    manager.node.sdo.download(0x1003, 0, b"\0")
    assert manager.node.sdo.upload(0x1003, 0) == b"\0"


def test_settings_are_stored_and_restored(manager: Manager, plc: Plc, plcrt: Plcrt) -> None:
    sdo = manager.node.sdo
    sdo.download(0x1017, 0, (350).to_bytes(2, "little"))
    sdo.download(0x2200, 0, (4321).to_bytes(2, "little"))
    sdo.download(0x1010, 1, b"save")
    sdo.download(0x1017, 0, (100).to_bytes(2, "little"))
    plc.close()
    heartbeats = manager.frames.setdefault(0x709, [])
    before = heartbeats.count(b"\0")
    plcrt.stop()
    plcrt.start()
    eventually(lambda: heartbeats.count(b"\0") > before)
    assert sdo.upload(0x1017, 0) == (350).to_bytes(2, "little")
    assert sdo.upload(0x2200, 0) == (4321).to_bytes(2, "little")
    sdo.download(0x1011, 2, b"load")
    manager.node.nmt.send_command(0x82)
    eventually(lambda: heartbeats.count(b"\0") > before + 1)
    assert sdo.upload(0x1017, 0) == (200).to_bytes(2, "little")
    assert sdo.upload(0x2200, 0) == (4321).to_bytes(2, "little"), "still there: of the application"


MANAGER = """
PROGRAM Main
VAR echo, setpoint : UINT; running, run : BOOL; END_VAR
setpoint := 41 + SEL(Mixer.ok, 0, 1);
run := TRUE;
END_PROGRAM
"""
MANAGED = """
[[canopen]]
name = "Bus"
node = 127
[[canopen.device]]
name = "Mixer"
node = 9
eds = "app.eds"
heartbeat = "T#200ms"
set = { "2202" = "a text that the manager writes in segments" }
in = { "2104" = "Main.echo", "2103:01" = "Main.running" }
out = { "2200" = "Main.setpoint", "2201:01" = "Main.run" }
"""


def test_controller_of_ours_manages_another_by_its_eds(hub: CanHub, plc: Plc, image: Path, tmp_path: Path) -> None:
    folder = tmp_path / "manager"
    folder.mkdir()
    (folder / "app.eds").write_bytes(image.with_suffix(".eds").read_bytes())
    (folder / "manager.io.toml").write_text(MANAGED)
    (folder / "manager.st").write_text(MANAGER)
    compile_sources([folder / "manager.st"]).write(folder / "manager.cdl")
    with Plcrt(tmp_path / "second", "--can", f"slcan:{hub.paths[1]}", "--node", "6") as second:
        with connect(f"serial:{second.port}") as manager:
            manager.flash(folder / "manager.cdl")
            eventually(lambda: manager.read("Mixer.ok") and manager.read("Main.echo") == 42)
            eventually(lambda: manager.read("Main.running"))
        assert plc.read("Main.ok")
        assert plc.read("Main.recipe") == "a text that the manager writes in segments"
