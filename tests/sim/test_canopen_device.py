"""This PLC as a CANopen device in the simulator, under masters of python canopen, on virtual time."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import canopen
import pytest
from canopen.lss import LssError, LssMaster
from canopen.sdo import SdoAbortedError, SdoClient, SdoCommunicationError

sys.path.append(str(Path(__file__).parents[1]))

from canopen_device_programs import NODE, write_device

from plctool.compiler import compile_sources
from plctool.iec.types import UDINT
from plctool.sim import Simulator

TPDO, SDO, SDO_REQUEST, HEARTBEAT, EMCY = 0x180 + NODE, 0x580 + NODE, 0x600 + NODE, 0x700 + NODE, 0x80 + NODE
OWN_NODE = 0x8001
RESERVED = 0x202
TIME_IS = "DT#2027-10-22-01:00:00"  # of the frame below
FRAME_NS = 300_000  # the longest frame at 500 kbit/s, with its pause
START, STOP, PREOPERATIONAL, RESET_NODE, RESET_COMMUNICATION = 1, 2, 0x80, 0x81, 0x82


class SimNetwork:
    """What masters of python canopen use of a network: each frame is on the simulated bus before they look for a reply.
    `lose`: numbers of frames, sent or received, that get lost; `double`: that come twice; `late`: 2 s later."""

    def __init__(self, plc: Simulator) -> None:
        self.plc = plc
        self.takers: dict[int, Callable[[int, bytes, float], None]] = {}
        self.count = 0
        self.lose: set[int] = set()
        self.double: set[int] = set()
        self.late: set[int] = set()

    def _times(self) -> int:
        self.count += 1
        if self.count in self.late:
            self.plc.run_for(2000)
        return 0 if self.count in self.lose else 2 if self.count in self.double else 1

    def send_message(self, can_id: int, data: Any, remote: bool = False) -> None:
        for _ in range(self._times()):
            self.plc.can_send(can_id, bytes(data))
        self.plc.run_for(2)
        for frame in self.plc.can_receive():
            if frame.id in self.takers:
                for _ in range(self._times()):
                    self.takers[frame.id](frame.id, frame.data, 0)

    def subscribe(self, can_id: int, callback: Callable[[int, bytes, float], None]) -> None:
        self.takers[can_id] = callback


def simulated(folder: Path, **keys: str) -> Simulator:
    compile_sources([write_device(folder, **keys)]).write(folder / "app.cdl")
    return Simulator.from_file(folder / "app.cdl")


@pytest.fixture
def plc(tmp_path: Path) -> Iterator[Simulator]:
    with simulated(tmp_path) as plc:
        plc.run_for(20)
        yield plc


def client_of(network: SimNetwork) -> SdoClient:
    """python canopen's SDO client; it gives up at once, since all time that a reply may take has passed."""
    client = SdoClient(SDO_REQUEST, SDO, canopen.ObjectDictionary())
    client.network = network
    client.RESPONSE_TIMEOUT, client.MAX_RETRIES = 0.001, 0
    network.subscribe(SDO, client.on_response)
    return client


def nmt(plc: Simulator, command: int, node: int = NODE) -> None:
    plc.can_send(0, bytes([command, node]))
    plc.run_for(5)


def frames(plc: Simulator, can_id: int) -> list[bytes]:
    return [f.data for f in plc.can_receive() if f.id == can_id]


def test_boots_once_and_sends_its_heartbeat(tmp_path: Path) -> None:
    with simulated(tmp_path) as plc:
        plc.run_for(900)
        assert frames(plc, HEARTBEAT) == [b"\0"] + [b"\x7f"] * 4
        nmt(plc, RESET_NODE)
        assert frames(plc, HEARTBEAT) == [b"\0"]


def test_each_command_leads_to_its_state_from_each_state(plc: Simulator) -> None:
    states = {START: 5, STOP: 4, PREOPERATIONAL: 0x7F, RESET_NODE: 0x7F, RESET_COMMUNICATION: 0x7F}
    for before in states:
        for command, state in states.items():
            nmt(plc, before)
            nmt(plc, command, 0)
            plc.can_receive()
            plc.run_for(400)
            assert set(frames(plc, HEARTBEAT)) == {bytes([state])}, (before, command)
    for data in (b"\2", b"\2\x09\0", b"\2\x08", b"\x03\x09"):
        plc.can_send(0, data)
        plc.run_for(400)
        assert set(frames(plc, HEARTBEAT)) == {b"\x7f"}


def test_serves_and_exchanges_only_what_its_state_allows(plc: Simulator) -> None:
    request = bytes([0x40, 0, 0x10, 0, 0, 0, 0, 0])
    for command, serves, exchanges in ((PREOPERATIONAL, 1, 0), (START, 1, 1), (STOP, 0, 0)):
        nmt(plc, command)
        plc.can_receive()
        plc.can_send(0x200 + NODE, bytes([command, 0, 0]))
        plc.can_send(SDO_REQUEST, request)
        plc.run_for(600)
        sent = [f.id for f in plc.can_receive()]
        assert sent.count(SDO) == serves, command
        assert (TPDO in sent) == bool(exchanges), command
        assert plc.read("Main.ok") is bool(exchanges), command
    for size in range(8):
        nmt(plc, START)
        plc.can_send(SDO_REQUEST, request[:size])
        plc.run_for(5)
        assert frames(plc, SDO) == [], size


def test_synchronous_values_are_of_one_sync(plc: Simulator) -> None:
    nmt(plc, START)
    plc.can_send(0x300 + NODE, b"\0\0\x80\x3f")
    plc.run_for(50)
    assert plc.read("Main.level") == 0.0
    plc.can_send(0x80)
    plc.run_for(50)
    assert plc.read("Main.level") == 1.0
    plc.can_receive()
    for _ in range(8):
        plc.can_send(0x80)
        plc.run_for(10)
    assert len(frames(plc, 0x280 + NODE)) == 4, "after each second SYNC"


def test_tpdo_waits_for_the_sync_with_its_start_value(plc: Simulator) -> None:
    sdo = client_of(SimNetwork(plc))
    for refused in (1, 241, 255):
        with pytest.raises(SdoAbortedError, match="0x06090030"):
            sdo.download(0x1019, 0, bytes([refused]))
    sdo.download(0x1019, 0, b"\x0a")
    with pytest.raises(SdoAbortedError, match="0x06090030"):
        sdo.download(0x1801, 6, b"\3")  # it is valid
    sdo.download(0x1801, 1, (0xC000_0000 | 0x280 + NODE).to_bytes(4, "little"))
    sdo.download(0x1801, 6, b"\3")
    sdo.download(0x1801, 1, (0x4000_0000 | 0x280 + NODE).to_bytes(4, "little"))
    nmt(plc, START)
    plc.can_receive()
    after: list[int] = []
    for counter in (9, 10, 1, 2, 3, 4, 5, 6, 7):
        plc.can_send(0x80, bytes([counter]))
        plc.run_for(10)
        after += [counter] * len(frames(plc, 0x280 + NODE))
    assert after == [3, 5, 7], "then after each second one"
    sdo.download(0x1019, 0, b"\0")
    nmt(plc, PREOPERATIONAL)
    nmt(plc, START)
    plc.can_receive()
    for _ in range(2):
        plc.can_send(0x80)
        plc.run_for(10)
    assert len(frames(plc, 0x280 + NODE)) == 1, "without counters it is not waited for"


def test_short_rpdo_is_not_used_and_reported_once(plc: Simulator) -> None:
    nmt(plc, START)
    for _ in range(3):
        plc.can_send(0x200 + NODE, b"\x10\x27")
        plc.run_for(20)
    assert plc.read("Main.setpoint") == 700
    assert frames(plc, EMCY) == [b"\x10\x82\x11\0\0\0\0\0"]
    plc.can_send(0x200 + NODE, b"\x10\x27\1\xff")
    plc.run_for(20)
    assert plc.read("Main.setpoint") == 10_000
    assert frames(plc, EMCY) == [bytes(8)]


def test_device_with_our_number_is_reported_once(plc: Simulator) -> None:
    for data in (b"\0", b"\5", b"\5"):
        plc.can_send(HEARTBEAT, data)
        plc.run_for(20)
    assert frames(plc, EMCY) == [b"\x50\x81\x11\0\0\0\0\0"]
    assert [e.text for e in plc.log()].count(f"Another CANopen device has number {NODE}") == 1
    nmt(plc, RESET_COMMUNICATION)
    plc.can_receive()
    plc.can_send(HEARTBEAT + 1, b"\5")
    plc.run_for(20)
    assert frames(plc, EMCY) == [], "another number"


def test_synchronous_values_keep_their_sync_during_a_block_transfer(plc: Simulator) -> None:
    """A master writes one block transfer after the other without a pause, and sends SYNC each 10 ms."""
    nmt(plc, START)
    segments = [bytes([number | (0x80 if number == 15 else 0), *b"a recipe"[:7]]) for number in range(1, 16)]
    begin = bytes([0xC2, 0x02, 0x22, 0, 100, 0, 0, 0])
    sent: list[int] = []
    for _ in range(50):
        plc.can_send(0x80)
        for data in (begin, *segments, bytes([0xC1 | 5 << 2, 0, 0, 0, 0, 0, 0, 0])):
            plc.can_send(SDO_REQUEST, data)
        plc.run_for(10)
        got = plc.can_receive()
        sent += [f.time_ns for f in got if f.id == 0x280 + NODE]
        assert [f.data[0] for f in got if f.id == SDO] == [0xA4, 0xA2, 0xA1]
    assert len(sent) == 25, "after each second SYNC"
    assert all(abs(b - a - 20_000_000) <= FRAME_NS for a, b in pairwise(sent))


def test_late_rpdo_is_reported(plc: Simulator) -> None:
    client_of(SimNetwork(plc)).download(0x1400, 5, (50).to_bytes(2, "little"))
    nmt(plc, START)
    plc.run_for(40)
    assert frames(plc, EMCY) == []
    plc.run_for(100)
    assert frames(plc, EMCY) == [b"\x50\x82\x11\0\0\0\0\0"]
    plc.can_send(0x200 + NODE, b"\0\0\0")
    plc.run_for(10)
    assert frames(plc, EMCY) == [bytes(8)]


@pytest.mark.parametrize("wrong", ["lose", "double", "late"])
@pytest.mark.parametrize("block", [False, True])
def test_one_frame_lost_doubled_or_late_never_makes_wrong_data(plc: Simulator, wrong: str, block: bool) -> None:
    """Each frame of a transfer in turn: it ends well, or the value is the previous one."""
    before, text = b"as it was", b"a recipe of several segments, up to a hundred bytes of it, and yet more of them"

    def transfer(network: SimNetwork) -> None:
        client = client_of(network)
        network.count = 0
        with client.open(0x2202, 0, "wb", size=len(text), block_transfer=block) as writer:
            writer.write(text)

    network = SimNetwork(plc)
    transfer(network)
    total = network.count
    assert total > 20 if not block else total > 10
    for number in range(1, total + 1):
        client_of(SimNetwork(plc)).download(0x2202, 0, before)
        network = SimNetwork(plc)
        setattr(network, wrong, {number})
        ended = True
        try:
            transfer(network)
        except (SdoAbortedError, SdoCommunicationError, OSError):
            ended = False
        plc.run_for(4000)
        found = client_of(SimNetwork(plc)).upload(0x2202, 0)
        assert found in ((text,) if ended else (before, text)), (wrong, number)


def test_sdo_time_out_is_an_abort(plc: Simulator) -> None:
    plc.can_send(SDO_REQUEST, bytes([0x21, 0x02, 0x22, 0, 20, 0, 0, 0]))
    plc.run_for(2000)
    assert frames(plc, SDO) == [b"\x60\x02\x22\0\0\0\0\0"]
    plc.run_for(2000)
    assert frames(plc, SDO) == [b"\x80\x02\x22\0\0\0\x04\x05"]


def test_initial_values_of_written_objects_are_those_of_the_variables(plc: Simulator) -> None:
    assert client_of(SimNetwork(plc)).upload(0x2200, 0) == (700).to_bytes(2, "little")
    assert client_of(SimNetwork(plc)).upload(0x2202, 0) == b"first"
    assert plc.read("Main.setpoint") == 700


def lss_of(plc: Simulator, monkeypatch: pytest.MonkeyPatch) -> LssMaster:
    monkeypatch.setattr("canopen.lss.time.sleep", lambda s: None)
    network = SimNetwork(plc)
    lss = LssMaster()
    lss.network, lss.RESPONSE_TIMEOUT = network, 0.001
    network.subscribe(0x7E4, lss.on_message_received)
    return lss


def test_device_without_a_number_gets_one_by_fastscan(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with simulated(tmp_path, device="lss = true") as plc:
        plc.run_for(1000)
        assert plc.can_receive() == [], "not a word without a number"
        lss = lss_of(plc, monkeypatch)
        found, identity = lss.fast_scan()
        assert found
        assert identity[:3] == [0x319, 7, 0x10002]
        assert lss.inquire_node_id() == 0xFF
        assert [lss.inquire_lss_address(0x5A + part) for part in range(4)] == identity
        lss.configure_bit_timing(2)
        with pytest.raises(LssError, match="LSS Error: 1"):
            lss.configure_bit_timing(0)
        with pytest.raises(LssError, match="LSS Error: 1"):
            lss.configure_node_id(128)
        lss.configure_node_id(23)
        lss.store_configuration()
        lss.send_switch_state_global(lss.WAITING_STATE)
        plc.run_for(300)
        assert plc.io_read_parameter("Field", OWN_NODE, UDINT) == 23
        assert lss.fast_scan() == (False, None)
        lss.send_switch_state_selective(*identity)
        assert lss.inquire_node_id() == 23
        lss.send_switch_state_global(lss.WAITING_STATE)
        plc.can_receive()
        nmt(plc, RESET_NODE, 23)
        assert frames(plc, 0x700 + 23) == [b"\0"], "the stored number"


def test_subrange_is_a_limit_for_sdo(plc: Simulator) -> None:
    client = client_of(SimNetwork(plc))
    for number, code in ((-90, 0), (90, 0), (-91, 0x06090032), (91, 0x06090031), (-32768, 0x06090032), (-1, 0)):
        try:
            client.download(0x2205, 0, number.to_bytes(2, "little", signed=True))
            assert code == 0, number
        except SdoAbortedError as refused:
            assert refused.code == code, number
    nmt(plc, START)
    plc.run_for(20)
    assert plc.read("Main.angle") == -1


def test_inputs_and_outputs_are_objects_of_the_device(plc: Simulator) -> None:
    plc.set_input("Main.setpoint", 321)
    plc.run_for(50)
    assert (plc.read("Main.setpoint"), plc.output("Field.2104")) == (321, 321)
    assert client_of(SimNetwork(plc)).upload(0x2200, 0) == (321).to_bytes(2, "little")


@pytest.mark.parametrize("number", [0x000, TPDO, 0x200 + NODE, SDO, SDO_REQUEST, HEARTBEAT, EMCY, 0x7E4])
def test_program_cannot_send_what_the_device_does(tmp_path: Path, number: int) -> None:
    source = write_device(tmp_path)
    more = "frame : CAN_SEND; id : DWORD; go : BOOL; bytes : ARRAY[0..7] OF BYTE; END_VAR"
    call = "frame(Execute := go, ID := id, Data := bytes);"
    source.write_text(source.read_text().replace("END_VAR", f"{more}\n{call}", 1))
    with Simulator.from_sources(source) as plc:
        plc.run_for(20)
        plc.write({"Main.id": number, "Main.go": True})
        plc.run_cycles(3)
        assert plc.read("Main.frame.ErrorID") == RESERVED
        plc.write({"Main.go": False})
        plc.run_cycles(2)
        plc.write({"Main.id": 0x123, "Main.go": True})
        plc.run_cycles(3)
        assert plc.read("Main.frame.ErrorID") == 0


def test_time_frame_sets_the_wall_clock(tmp_path: Path) -> None:
    path = write_device(tmp_path, device=f"node = {NODE}\ntime = true")
    path.write_text(path.read_text().replace("END_VAR", "now : DT; END_VAR\nnow := UTC_NOW();", 1))
    with Simulator.from_sources(path) as plc:
        plc.run_for(20)
        for data in (b"", bytes(5), b"\xff" * 6):  # not a time
            plc.can_send(0x100, data)
            plc.run_for(20)
        plc.can_send(0x100, (3_600_000).to_bytes(4, "little") + (16000).to_bytes(2, "little"))
        plc.run_for(50)
        assert plc.read("Main.now") == TIME_IS, plc.read("Main.now")
