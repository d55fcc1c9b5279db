"""plcrt and what clients of others ask for and plctool does not, in two dialects, on each kind of link."""

from __future__ import annotations

import socket
import struct
from collections.abc import Callable, Iterator

import pytest
from reference_client import SHORT, THOROUGH, Client, Dialect, Link, Serial, Tcp, Udp, find, packet, serial_path, u16

import plctool
from plctool.testing.plcrt import Plcrt

PROGRAM = """PROGRAM Main VAR count : DINT; rise : BOOL; END_VAR VAR RETAIN kept : DINT; END_VAR
count := count + 1; kept := kept + 1; rise := NOT rise; END_PROGRAM
PROGRAM Often VAR count : DINT; END_VAR count := count + 1; END_PROGRAM
PROGRAM Waits VAR count : DINT; END_VAR count := count + 1; END_PROGRAM
CONFIGURATION C RESOURCE R ON plc
TASK Slow(INTERVAL := T#50ms, PRIORITY := 5); TASK Fast(INTERVAL := T#1ms, PRIORITY := 1);
TASK Event(SINGLE := Main.rise, PRIORITY := 0);
PROGRAM M WITH Slow : Main; PROGRAM O WITH Fast : Often; PROGRAM W WITH Event : Waits;
END_RESOURCE END_CONFIGURATION
"""
COUNTS = ["M.count", "O.count", "W.count"]
RESULT_OK, NOT_SUPPORTED, NO_RIGHT, RUNS, NOT_LOADED = 0, 0x18, 0x19, 0x37, 0x504


@pytest.fixture
def device(tool, tmp_path) -> Iterator[Plcrt]:
    """With a program that is stopped."""
    image = tool.build("app", PROGRAM)
    with Plcrt(tmp_path / "flash", "--tcp", "0", "--udp", "127.0.0.1") as plcrt:
        with plctool.connect(f"tcp:{plcrt.tcp}") as plc:
            plc.flash(image, start=False)
        yield plcrt


def link_to(device: Plcrt, kind: str) -> Link:
    if kind == "serial":
        return Serial(serial_path(device.port))
    return Tcp(device.tcp) if kind == "tcp" else Udp(device.udp)


@pytest.fixture(
    params=[("tcp", THOROUGH), ("udp", SHORT), ("serial", SHORT), ("serial", THOROUGH)],
    ids=["tcp-long", "udp-short", "serial-short", "serial-long"],
)
def client(request, device) -> Iterator[Client]:
    """Logged in to the device, in one of the dialects."""
    client = Client(link_to(device, request.param[0]), request.param[1])
    client.open()
    client.login()
    yield client
    client.close()


@pytest.fixture
def values(device) -> Callable[[list[str]], list[int]]:
    """Reads variables by plctool, which has a channel of its own."""

    def read(names: list[str]) -> list[int]:
        with plctool.connect(f"tcp:{device.tcp}") as plc:
            return [int(plc.read(name)) for name in names]

    return read


def control(client: Client, service: int, session: int) -> int:
    """The result of a service that takes the session of the application."""
    descriptor = client.tag(0x81, client.tag(0x11, struct.pack("<I", session)))
    return u16(find(client.call(2, service, descriptor), 1))


def test_a_single_cycle_runs_each_task_once_and_stops_again(client, values):
    session = client.login_app()[0]
    for cycles in (1, 2, 3):
        assert control(client, 0x22, session) == RESULT_OK
        assert values(COUNTS) == [cycles, cycles, (cycles + 1) // 2]
        assert client.shell("getprgstat") == "stop\r\n"
    assert control(client, 0x10, session) == RESULT_OK
    assert control(client, 0x22, session) == RUNS


def test_a_deleted_application_is_gone_after_a_restart_too(client, device):
    session = client.login_app()[0]
    assert control(client, 4, session) == RESULT_OK
    assert client.shell("applist") == "No Application loaded\r\n"
    with plctool.connect(f"tcp:{device.tcp}") as plc:
        assert plc.status().state == "none"
    assert control(client, 0x22, session) == NOT_LOADED
    client.link.close()
    device.stop()
    device.start()
    with plctool.connect(f"tcp:{device.tcp}") as plc:
        assert plc.status().state == "none"
    client.link = link_to(device, "tcp")


def test_areas_have_addresses_as_pointers_do(client):
    session = client.tag(0x11, struct.pack("<I", client.login_app()[0]))
    addresses = set()
    for area in (0, 1):
        reply = find(client.call(2, 0x38, session + client.tag(0x13, struct.pack("<I", area))), 0x14)
        addresses.add(int.from_bytes(reply, "little"))
    assert len(addresses) == 2 and 0 not in addresses
    assert u16(find(client.call(2, 0x38, session + client.tag(0x13, struct.pack("<I", 99))), 0xFF7F)) == 0x513


def test_the_node_gets_a_name_that_scans_show_and_that_lasts(client, device):
    def called(name: str) -> bool:
        wide = name.encode("utf-16le") + b"\0\0"
        return wide in client.scan() and find(client.call(1, 1, session=0), 4)[4:].startswith(wide)

    def call_it(name: str) -> int:
        return u16(find(client.call(1, 9, client.tag(0x58, name.encode("utf-16le") + b"\0\0")), 1))

    before = client.shell("rtsinfo")
    assert call_it("Mixer 7") == RESULT_OK
    assert called("Mixer 7") and "Node: Mixer 7\r\n" in client.shell("rtsinfo")
    assert call_it("x" * 50) != RESULT_OK and called("Mixer 7")
    assert call_it("") == RESULT_OK and client.shell("rtsinfo") == before


def test_settings_are_refused_for_want_of_a_right(client):
    limit = client.tag(0x81, client.tag(0x10, b"CmpChannelServer\0") + client.tag(0x11, b"MaxChannels\0"))
    for service in range(1, 8):
        assert u16(find(client.call(6, service, limit), 0xFF7F)) == NO_RIGHT


def test_the_operation_mode_is_debug_and_stays_so(client):
    def put(mode: int) -> int:
        return u16(find(client.call(1, 6, client.tag(0x54, struct.pack("<I", mode))), 1))

    assert (put(1), put(2), put(0)) == (RESULT_OK, NOT_SUPPORTED, NOT_SUPPORTED)
    assert struct.unpack("<I", find(client.call(1, 7), 0x54)) == (1,)


def test_the_shell_knows_the_words_of_published_clients(client, values):
    listed = client.shell("?")
    words = ["rtsinfo", "applist", "getprgstat", "startprg", "stopprg", "resetprg", "resetprgcold", "reload"]
    words += ["tasklist", "plcload"]
    assert all(f"{word}: " in listed for word in words)
    assert client.shell("applist") == "Application\r\n" and "Runtime: 0x" in client.shell("rtsinfo")
    assert client.shell("startprg") == "startprg: done\r\n" and client.shell("getprgstat") == "run\r\n"
    assert "Fast: priority 1, interval 1000 us" in client.shell("tasklist")
    assert client.shell("plcload").startswith("PLC load: ")
    assert client.shell("stopprg") == "stopprg: done\r\n" and client.shell("getprgstat") == "stop\r\n"
    count, kept = values(["M.count", "M.kept"])
    assert count == kept > 0
    assert client.shell("resetprg") == "resetprg: done\r\n" and values(["M.count", "M.kept"]) == [0, kept]
    assert client.shell("resetprgcold") == "resetprgcold: done\r\n" and values(["M.kept"]) == [0]
    assert client.shell("reload") == "reload: done\r\n" and client.shell("getprgstat") == "run\r\n"


def test_a_variable_that_cannot_be_read_has_its_error_in_place_of_a_value(client):
    session, guid = client.login_app()
    code = [bytes.fromhex(text) for text in ("0200000600", "0200000663", "18", "0200000600")]
    listed = b"".join(
        client.tag(0x82, client.tag(1, struct.pack("<I", n)) + client.tag(2, struct.pack("<I", 4)) + client.tag(5, c))
        for n, c in enumerate(code)
    )
    reply = client.call(0x1B, 1, client.tag(1, struct.pack("<I", session) + guid) + client.tag(0x81, listed))
    data, at = find(reply, 0x40), 0
    read, area, operator, last = 0, 1, 2, 3
    assert struct.unpack_from("<HI", data, at) == (read, 4)
    at += 6 + 4
    assert struct.unpack_from("<HI", data, at) == (area | 0x8000, 0x01)  # there is no area 0x63
    at += 6
    assert struct.unpack_from("<HI", data, at) == (operator | 0x8000, 0x0A)  # a call
    at += 6
    assert struct.unpack_from("<HI", data, at) == (last, 4)
    at += 6 + 4
    assert len(data) == at + -at % 4 and not any(data[at:])


def test_the_program_that_64_bit_systems_write_with_is_taken(client, device, values):
    session, guid = client.login_app()
    with plctool.connect(f"tcp:{device.tcp}") as plc:
        area, offset, _ = plc.symbols().variables["M.count"].place
    address = struct.pack("<BHBB", 2, offset, 6, area)
    code = bytes.fromhex("151000") + address + bytes.fromhex("171009041B060001000017080908170C090404")
    entry = struct.pack("<HIiH", 0, 4, 4711, len(code)) + code
    head = client.tag(1, struct.pack("<I", session) + guid)
    assert client.call(0x1B, 2, head + client.tag(3, entry)) == b""
    assert values(["M.count"]) == [4711]


@pytest.mark.parametrize("receiver", ["FFFFFFFF", "03FFFFFF"])
def test_ones_alone_are_the_udp_address_of_all(device, receiver):
    host, port = device.udp.split(":")
    dialect = Dialect(receiver=bytes.fromhex(receiver), sender=b"\x12\x34")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        line.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        line.settimeout(60)
        line.sendto(packet(dialect, 3, struct.pack("<HHI", 0xC202, 0x0400, 1)), ("127.255.255.255", int(port)))
        while line.recvfrom(600)[1] != (host, int(port)):
            pass  # of a device of another test on this machine


def test_the_identity_has_the_networks_of_the_device(client):
    networks = find(client.call(1, 1, session=0), 0x0A)
    assert u16(networks) == 1
    assert networks[2:10] == bytes([1, 0, 0, 127]) + bytes([0, 0, 0, 255])


def test_plctool_runs_single_cycles_too(tool, device, values):
    for link in (["--port", device.port], ["--tcp", device.tcp]):
        assert tool.ok("cycle", *link)["state"] == "stop"
    assert values(["M.count"]) == [2]
    tool.ok("start", "--tcp", device.tcp)
    refused = tool("cycle", "--tcp", device.tcp)
    assert refused.status == 1 and "it runs, stop it first" in refused.err


def test_an_exception_in_a_single_cycle_is_reported_with_its_line(tool, device):
    image = tool.build("bad", "PROGRAM Main VAR a, b : DINT; END_VAR\na := 1 / b;\nEND_PROGRAM")
    tool.ok("flash", "--tcp", device.tcp, str(image), "--no-start")
    refused = tool("cycle", "--tcp", device.tcp)
    assert refused.status == 1 and "which status shows" in refused.err
    status = tool.ok("status", "--tcp", device.tcp)
    assert status["state"] == "exception" and status["exception"]["line"] == 2
    again = tool("cycle", "--tcp", device.tcp)
    assert again.status == 1 and "reset it first" in again.err
