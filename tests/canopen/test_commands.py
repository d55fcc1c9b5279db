"""`plctool canopen` against a foreign device on a virtual bus."""

from __future__ import annotations

import re
import shlex
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import can
import canopen
import pytest
from conftest import NODE, VALVES, Tool
from lss_slave import LssSlave

from plctool.canopen.words import abort_text, emcy_text, register_text

STATES = {name: byte for byte, name in canopen.nmt.NMT_STATES.items()}
LISTEN = ("--timeout", "0.8")
PATIENT = ("--timeout", "10")


@contextmanager
def repeated(action: Callable[[], object], every: float = 0.02) -> Iterator[None]:
    """Does something again and again in a thread: a command that listens gets it, whenever it begins."""
    ended = threading.Event()

    def run() -> None:
        while not ended.wait(every):
            action()

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


# ---- scan ----


def test_scan_lists_identity_and_state_of_a_node(tool: Tool, device: canopen.LocalNode) -> None:
    with repeated(lambda: device.network.send_message(0x700 + NODE, b"\x7f")):
        done = tool("scan", *LISTEN, "--json")
    assert done.json == {
        "nodes": [
            {
                "node": NODE, "state": "pre-operational", "device_type": 0x30191, "profile": "401 inputs and outputs",
                "vendor": 0x319, "product": 0x1008, "revision": 0x10002, "serial": 1, "name": "Valves 8", "problem": "",
            }
        ]
    }  # fmt: skip
    text = tool("scan", *LISTEN).out
    assert "   5  no heartbeat  401 inputs and outputs  0x319   0x1008   0x10002   0x1     Valves 8" in text


def test_scan_finds_every_one_of_many_nodes(tool: Tool, network: canopen.Network) -> None:
    numbers = [1, 8, 9, 64, 127]
    for number in numbers:
        network.create_node(number, str(VALVES))
    assert [n["node"] for n in tool("scan", *LISTEN, "--json").json["nodes"]] == numbers


def test_scan_shows_a_node_that_only_sends_heartbeats(tool: Tool, network: canopen.Network) -> None:
    with repeated(lambda: network.send_message(0x709, b"\x04")):
        (node,) = tool("scan", *LISTEN, "--json").json["nodes"]
    assert (node["node"], node["state"], node["problem"]) == (9, "stopped", "does not reply to SDO")


def test_scan_reports_two_devices_with_one_number(tool: Tool, device: canopen.LocalNode, channel: str) -> None:
    other = canopen.Network()
    other.connect(interface="virtual", channel=channel)
    try:
        other.create_node(NODE, str(VALVES))
        (node,) = tool("scan", *LISTEN, "--json").json["nodes"]
    finally:
        other.disconnect()
    assert node["problem"] == "several devices have this number"


def test_scan_of_an_empty_bus_says_what_to_check(tool: Tool) -> None:
    done = tool("scan", *LISTEN)
    assert done.status == 3
    assert "No CANopen device answers on virtual:" in done.err
    assert "--bitrate" in done.err


# ---- NMT ----


def test_nmt_shows_the_state_that_the_node_reports(tool: Tool, device: canopen.LocalNode) -> None:
    with repeated(lambda: device.network.send_message(0x700 + NODE, bytes([STATES[device.nmt.state]]))):
        done = tool("nmt", "start", "5", *PATIENT)
        assert (done.status, done.out) == (0, "node 5: operational\n")
        assert tool("nmt", "stop", "5", *PATIENT, "--json").json["states"] == {"5": "stopped"}
        assert tool("nmt", "preop", "all", *LISTEN, "--json").json["states"] == {"5": "pre-operational"}


@pytest.mark.parametrize(
    ("name", "sent"), [("start", 1), ("stop", 2), ("preop", 0x80), ("reset", 0x81), ("reset-comm", 0x82)]
)
def test_nmt_commands_are_two_bytes_to_a_node_or_all(tool: Tool, channel: str, name: str, sent: int) -> None:
    with can.Bus(interface="virtual", channel=channel) as bus:
        assert tool("nmt", name, "7", "--timeout", "0").status == 0
        assert tool("nmt", name, "all", "--timeout", "0").status == 0
        frames = [bus.recv(10), bus.recv(10)]
    assert [(f.arbitration_id, bytes(f.data)) for f in frames if f] == [(0, bytes([sent, 7])), (0, bytes([sent, 0]))]


def test_nmt_without_heartbeat_says_that_the_state_is_not_known(tool: Tool) -> None:
    done = tool("nmt", "start", "7", "--timeout", "0.05")
    assert (done.status, done.out) == (
        0, "The command was sent. Node 7 does not send a heartbeat, so the state is not known.\n"
    )  # fmt: skip


def test_nmt_fails_if_the_node_does_not_follow(tool: Tool, network: canopen.Network) -> None:
    with repeated(lambda: network.send_message(0x707, b"\x7f")):
        done = tool("nmt", "start", "7", *LISTEN)
    assert done.status == 1
    assert "node 7 is not operational but pre-operational" in done.err


# ---- SDO ----


def test_sdo_reads_a_value_with_the_name_and_type_of_the_eds(tool: Tool, device: canopen.LocalNode) -> None:
    assert tool("sdo", "read", "5", "2001", "--eds", str(VALVES)).out == "2001:00 Pressure limit = 600 (0x0258)\n"
    assert tool("sdo", "read", "5", "1008").out == "1008:00 = Valves 8\n"
    assert tool("sdo", "read", "5", "1018:01").out == "1018:01 = 793 (0x00000319)\n"
    assert tool("sdo", "read", "5", "0x6401:01", "--type", "I16").status == 1  # no value yet


def test_sdo_writes_and_reads_back(tool: Tool, device: canopen.LocalNode, scratch: Path) -> None:
    assert tool("sdo", "write", "5", "2001", "700", "--eds", str(VALVES)).status == 0
    assert tool("sdo", "read", "5", "2001", "--type", "UINT", "--json").json["value"] == 700
    text = "the very long name of a place " * 10
    assert tool("sdo", "write", "5", "2000", text, "--type", "STRING").status == 0
    assert tool("sdo", "read", "5", "2000", "--type", "STRING", "--json").json["value"] == text
    (scratch / "in.bin").write_bytes(b"from a file")
    assert tool("sdo", "write", "5", "2000", "--file", "in.bin").status == 0
    assert tool("sdo", "read", "5", "2000", "--file", "out.bin").out == "out.bin: 11 bytes of 2000:00\n"
    assert (scratch / "out.bin").read_bytes() == b"from a file"


@pytest.mark.parametrize(
    ("words", "status", "message"),
    [
        (("read", "5", "5555"), 1, "Node 5 refuses 5555:00: the object does not exist (06020000)."),
        (("read", "9", "1000", "--timeout", "0.05"), 3, "Node 9 does not reply to 1000:00 within 0.05 s."),
        (("read", "0", "1000"), 2, "'0' is not the number of a node, 1 to 127"),
        (("read", "128", "1000"), 2, "'128' is not the number of a node, 1 to 127"),
        (("read", "5", "xyz"), 2, "'xyz' is not an object; write its index in hex: 6041 or 1018:01"),
        (("read", "5", "1000:100"), 2, "is not an object"),
        (("read", "5", "1000", "7"), 2, "'sdo read' takes no value"),
        (("read", "5", "1000", "--type", "U17"), 2, "'U17' is not a data type"),
        (
            ("read", "5", "1000", "--type", "U16"),
            1,
            "1000:00 of node 5 has another type: UNSIGNED16 has 2 bytes, not 4.",
        ),
        (("write", "5", "2001"), 2, "Give what to write: VALUE, or --file FILE."),
        (("write", "5", "2001", "7"), 2, "Say the type of 2001:00: --type U16, for example, or --eds FILE."),
        (("write", "5", "2001", "70000", "--type", "U16"), 2, "70000 is outside UNSIGNED16, 0 to 65535."),
        (("write", "5", "2001", "1001", "--eds", str(VALVES)), 2, "2001:00: 1001 is above its high limit 1000."),
        (("write", "5", "1000", "1", "--eds", str(VALVES)), 2, "1000:00 is ro: it cannot be written."),
        (("read", "5", "3333", "--eds", str(VALVES)), 2, "valves.eds has no object 3333:00; give --type"),
        (("write", "5", "2001", "--file", "none.bin"), 2, "none.bin cannot be read: No such file"),
    ],
)
def test_sdo_errors_say_what_to_do(
    tool: Tool, device: canopen.LocalNode, words: tuple[str, ...], status: int, message: str
) -> None:
    done = tool("sdo", *words)
    assert (done.status, message in done.err) == (status, True), done.err
    as_json = tool("sdo", *words, "--json")
    assert as_json.status == status
    assert message in as_json.json["error"]["message"]


# ---- EMCY, PDO, watch ----


def test_emcy_prints_codes_in_words(tool: Tool, device: canopen.LocalNode) -> None:
    with repeated(lambda: device.emcy.send(0x8130, 0x11, b"\1\2\3\4\5")):
        (line,) = tool("emcy", "--count", "1", "--json").lines
        assert (line["node"], line["code"], line["text"]) == (NODE, 0x8130, "heartbeat or guarding error")
        assert line["register_text"] == "generic, communication"
        text = tool("emcy", "--count", "1", "--node", "5").out
    assert "node 5  8130  heartbeat or guarding error; register: generic, communication; data 0102030405\n" in text


@pytest.mark.parametrize(
    ("code", "words"),
    [(0, "all errors are gone"), (0x3210, "voltage inside the device"), (0x3FFF, "voltage"),
     (0x0123, "a code that CiA 301 does not define"), (0xFF12, "device specific"),
     (0x8115, "CAN overrun, objects lost")],
)  # fmt: skip
def test_emergency_codes_are_explained_by_their_class(code: int, words: str) -> None:
    assert emcy_text(code) == words


def test_numbers_without_words_are_shown() -> None:
    assert abort_text(0x12345678) == "a code that CiA 301 does not define (12345678)"
    assert register_text(0x85) == "generic, voltage, manufacturer"


TPDO = bytes([0b101, 0xFE, 0xFF])


def test_pdo_decodes_by_the_mapping_of_the_device(tool: Tool, device: canopen.LocalNode) -> None:
    with repeated(lambda: device.network.send_message(0x185, TPDO)):
        (line,) = tool("pdo", "5", "--count", "1", "--json", *PATIENT).lines
        assert line["pdo"] == "TPDO1"
        assert [(v["name"], v["value"]) for v in line["values"]] == [("6000:01", 5), ("6401:01", 0xFFFE)]
        text = tool("pdo", "5", "--count", "1", "--eds", str(VALVES), *PATIENT).out
    assert "TPDO1  6000:01 Inputs 1 to 8 = 5  6401:01 Pressure = -2\n" in text


def test_pdo_follows_a_mapping_that_was_changed(tool: Tool, device: canopen.LocalNode) -> None:
    device.sdo[0x1A00][1].raw, device.sdo[0x1A00][0].raw = 0x64010110, 1
    device.sdo[0x1800][1].raw = 0x3A5
    with repeated(lambda: device.network.send_message(0x3A5, b"\x34\x12")):
        (line,) = tool("pdo", "5", "--count", "1", "--json", *PATIENT).lines
    assert [(v["name"], v["value"]) for v in line["values"]] == [("6401:01", 0x1234)]


def test_passive_pdo_sends_nothing(tool: Tool, network: canopen.Network) -> None:
    seen: list[int] = []
    network.subscribe(0x605, lambda *frame: seen.append(1))
    with repeated(lambda: (network.send_message(0x185, TPDO), network.send_message(0x205, b"\x03"))):
        lines = tool("pdo", "5", "--passive", "--eds", str(VALVES), "--count", "8", "--json").lines
    assert {line["pdo"] for line in lines} == {"TPDO1", "RPDO1"}
    assert seen == []


def test_a_short_pdo_is_named(tool: Tool, network: canopen.Network) -> None:
    with repeated(lambda: network.send_message(0x185, b"\1")):
        out = tool("pdo", "5", "--passive", "--eds", str(VALVES), "--count", "1").out
    assert "TPDO1  01: shorter than its mapping\n" in out


def test_pdo_of_a_node_that_is_not_there_is_an_error(tool: Tool) -> None:
    done = tool("pdo", "5", "--timeout", "0.05")
    assert (done.status, "Node 5 does not reply to 1800:01" in done.err) == (3, True)
    assert "--passive takes the mapping from an EDS" in tool("pdo", "5", "--passive").err


def test_watch_reads_objects_again_and_again(tool: Tool, device: canopen.LocalNode) -> None:
    lines = tool(
        "watch", "5", "2001", "1017", "--eds", str(VALVES), "--interval", "0.01", "--count", "3", "--json"
    ).lines
    assert [[v["value"] for v in line["values"]] for line in lines] == [[600, 0]] * 3
    assert lines[0]["time_s"] < lines[1]["time_s"] < lines[2]["time_s"]
    assert "2001:00 Pressure limit = 600" in tool("watch", "5", "2001", "--eds", str(VALVES), "--count", "1").out


# ---- LSS ----


@pytest.fixture
def slaves(channel: str) -> Iterator[Callable[..., LssSlave]]:
    made: list[LssSlave] = []

    def make(*args: object, **words: object) -> LssSlave:
        made.append(LssSlave(channel, *args, **words))  # type: ignore[arg-type]
        return made[-1]

    yield make
    for slave in made:
        slave.close()


FIRST, SECOND = (0x319, 0x1008, 0x10002, 0x80000001), (0x319, 0x1008, 0x10002, 0xFFFFFFFF)


def test_lss_scan_finds_every_device_without_a_number(tool: Tool, slaves: Callable[..., LssSlave]) -> None:
    slaves(FIRST), slaves(SECOND), slaves((1, 2, 3, 4), node=9)
    done = tool("lss", "scan")
    assert sorted(done.out.splitlines()) == ["0x319:0x1008:0x10002:0x80000001", "0x319:0x1008:0x10002:0xFFFFFFFF"]


def test_lss_sets_and_stores_the_number_of_the_only_device_without_one(
    tool: Tool, slaves: Callable[..., LssSlave]
) -> None:
    slave = slaves(FIRST)
    done = tool("lss", "set-node", "12", "--timeout", "2")
    assert done.out == "0x319:0x1008:0x10002:0x80000001 is node 12 now, and keeps that.\n"
    assert (slave.node, slave.stored) == (12, True)


def test_lss_names_the_devices_if_there_are_several(tool: Tool, slaves: Callable[..., LssSlave]) -> None:
    first, second = slaves(FIRST), slaves(SECOND)
    done = tool("lss", "set-node", "12")
    assert (done.status, "2 devices have no node number; name one of them: 0x319:" in done.err) == (2, True)
    assert tool("lss", "set-node", "13", "0x319:0x1008:0x10002:0xFFFFFFFF", *PATIENT).status == 0
    assert (first.node, second.node) == (0xFF, 13)


def test_lss_bit_rate_needs_a_yes(tool: Tool, slaves: Callable[..., LssSlave]) -> None:
    slave = slaves(FIRST, node=5)
    words = ("lss", "set-bitrate", "250", "0x319:0x1008:0x10002:0x80000001")
    assert tool(*words).status == 2
    assert slave.bit_rate is None
    assert tool(*words, "--yes", *PATIENT).status == 0
    assert (slave.bit_rate, slave.stored) == (3, True)


def test_lss_reports_what_a_device_refuses(tool: Tool, slaves: Callable[..., LssSlave]) -> None:
    slaves(FIRST, refuses=1)
    done = tool("lss", "set-node", "12", "0x319:0x1008:0x10002:0x80000001", *PATIENT)
    assert (done.status, "The device refuses the node number 12 (error 1)." in done.err) == (1, True)


@pytest.mark.parametrize(
    ("words", "status", "message"),
    [
        (("scan", "5"), 2, "Write 'lss scan'"),
        (("set-node",), 2, "Write 'lss scan'"),
        (("set-node", "128"), 2, "128 is not the number of a node"),
        (("set-bitrate", "300", "--yes"), 2, "300 kbit/s is not a bit rate of CANopen: 1000, 800"),
        (("set-node", "5", "1:2:3"), 2, "'1:2:3' is not VENDOR:PRODUCT:REVISION:SERIAL"),
        (("set-node", "5", "1:2:3:4", "--timeout", "0.05"), 3, "No device with the identity 0x1:0x2:0x3:0x4 replies"),
        (("set-node", "5", "--timeout", "0.05"), 1, "No device without a node number answers"),
    ],
)
def test_lss_errors_say_what_to_do(tool: Tool, words: tuple[str, ...], status: int, message: str) -> None:
    done = tool("lss", *words)
    assert (done.status, message in done.err) == (status, True), done.err


# ---- the bus ----


def test_no_bus_or_another_link_is_refused(tool: Tool, monkeypatch: pytest.MonkeyPatch, channel: str) -> None:
    from plctool.cli import main as cli

    assert cli.main(["canopen", "scan"]) == 2
    monkeypatch.setenv("PLC_LINK", "tcp:192.168.1.5")
    assert cli.main(["canopen", "scan"]) == 2
    monkeypatch.setenv("PLC_LINK", f"can:virtual:{channel}")
    assert cli.main(["canopen", "nmt", "start", "5", "--timeout", "0"]) == 0
    assert "write --bitrate 500000" in tool("scan", "--bitrate", "500000/2000000").err
    assert cli.main(["canopen", "scan", "--can", "nonsense:x"]) == 2


def test_frames_of_other_protocols_and_hostile_ones_change_nothing(
    tool: Tool, device: canopen.LocalNode, channel: str
) -> None:
    import random

    rng = random.Random(1)
    with can.Bus(interface="virtual", channel=channel) as bus:

        def noise() -> None:
            for identifier in (0x000, 0x085, 0x185, 0x585, 0x701, 0x7E4, rng.randrange(0x800)):
                if identifier != 0x605:
                    data = rng.randbytes(rng.randrange(9))
                    bus.send(can.Message(arbitration_id=identifier, is_extended_id=rng.random() < 0.3, data=data))
            bus.send(can.Message(arbitration_id=0x585, is_extended_id=False, is_remote_frame=True))

        with repeated(noise):
            assert tool("scan", *LISTEN).status == 0
            for _ in range(20):
                done = tool("sdo", "read", "5", "1018:01", "--json")
                assert done.status == 0
                assert done.json["value"] == 0x319
            assert tool("emcy", "--count", "3").status == 0
            assert tool("lss", "scan", "--question", "0.01", "--timeout", "0.1").status in (0, 3)


# ---- the documentation ----

DOC = Path(__file__).parents[2] / "docs/canopen.md"
# A download needs a controller: tests/e2e/test_canopen_program_of_plcrt.py.
COMMANDS = re.findall(r"^plctool canopen (?!download)(.*--can .*)$", DOC.read_text(), re.MULTILINE)


@pytest.mark.parametrize("words", COMMANDS)
def test_commands_of_the_documentation_work(
    tool: Tool, device: canopen.LocalNode, slaves: Callable[..., LssSlave], scratch: Path, words: str
) -> None:
    slaves(FIRST)
    (scratch / "valves.eds").write_text(VALVES.read_text())
    (scratch / "recipe.bin").write_bytes(bytes(5))
    given = shlex.split(re.sub(r" --can \S+", "", words))

    def talk() -> None:
        device.emcy.send(0x8130, 0x11)
        device.network.send_message(0x185, TPDO)

    with repeated(talk):
        done = tool(*given)
    assert done.status == 0, done.err
