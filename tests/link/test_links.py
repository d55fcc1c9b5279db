"""LINK: what a user writes for a link, and the table of the kinds of links."""

from __future__ import annotations

from dataclasses import replace

import pytest
from fake_device import FakeDevice, FakeLine

from plctool.core import lib
from plctool.errors import UsageError
from plctool.link import services
from plctool.link.connection import Connection
from plctool.link.session import Session
from plctool.link.transport import DEFAULT_BAUD
from plctool.link.transports import TRANSPORTS, Link, make_link, open_transport, parse_link


@pytest.mark.parametrize(
    ("text", "place", "baud"),
    [
        ("serial:/dev/ttyS0", "/dev/ttyS0", DEFAULT_BAUD),
        ("serial:/dev/ttyS0?baud=9600", "/dev/ttyS0", 9600),
        ("serial:COM3", "COM3", DEFAULT_BAUD),
        ("serial:socket://host:4711", "socket://host:4711", DEFAULT_BAUD),
        ("serial:loop://?logging=debug", "loop://?logging=debug", DEFAULT_BAUD),
        ("serial:rfc2217://host:1?ign_set_control?baud=1200", "rfc2217://host:1?ign_set_control", 1200),
        ("serial:/dev/serial/by-id/usb:1-if00", "/dev/serial/by-id/usb:1-if00", DEFAULT_BAUD),
    ],
)
def test_a_link_is_its_kind_its_place_and_its_options(text: str, place: str, baud: int) -> None:
    link = parse_link(text)
    assert link == Link("serial", place, {"baud": baud})
    assert parse_link(str(link)) == link
    assert make_link("serial", place, baud=baud) == link


@pytest.mark.parametrize(
    "url", ["spy:///dev/ttyS0?file=x", "SPY://loop://", "hwgrep://.*", "alt:///dev/ttyS0", "://x", "x://"]
)
@pytest.mark.parametrize("link", ["serial", "modbus", "can:slcan", "can:serial"])
def test_a_url_that_is_no_line_is_refused(url: str, link: str) -> None:
    with pytest.raises(
        UsageError, match="is not a port: name one, or a URL that begins with loop://, rfc2217:// or soc"
    ):
        parse_link(f"{link}:{url}")


@pytest.mark.parametrize(
    "link", ["serial:socket://h:1", "serial:RFC2217://h:1", "modbus:loop://", "can:slcan:socket://h:1"]
)
def test_a_url_of_a_line_is_a_link(link: str) -> None:
    assert str(parse_link(link)).startswith(link)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("/dev/ttyS0", "serial:/dev/ttyS0"),
        ("", "serial:/dev/ttyS0"),
        ("serial:", "serial:/dev/ttyS0"),
        ("bus:1", "serial:/dev/ttyS0"),
        ("serial:?baud=9600", "serial:/dev/ttyS0"),
        ("sim:here", "'sim:here' is not a link"),
        ("tcp:", "'tcp:' is not a link"),
        ("udp:", "'udp:' is not a link"),
        ("tcp:host?baud=1", "it has none"),
        ("serial:/dev/ttyS0?speed=9600", "no option 'speed'; it has baud"),
        ("serial:/dev/ttyS0?baud=fast", "'fast' is not a number above 0"),
        ("serial:/dev/ttyS0?baud=", "'' is not a number above 0"),
        ("sim:?baud=1", "it has none"),
        ("can:", "'can:' is not a link"),
        ("can:socketcan:can0?node=0", "'0' is not the number of a device, 1 to 127"),
        ("can:socketcan:can0?node=1,128", "'128' is not the number of a device"),
        ("can:socketcan:can0?bitrate=fast", "'fast' is not a bit rate"),
        ("can:socketcan:can0?bitrate=1/2/3", "'1/2/3' is not a bit rate"),
        ("can:socketcan:can0?can-base=0x123", "'0x123' is not a base"),
        ("can:socketcan:can0?can-base=0x20000000", "is not a base"),
        ("modbus:", "'modbus:' is not a link"),
        ("modbus:/dev/ttyUSB0?unit=0", "'0' is not the address of a Modbus device, 1 to 247"),
        ("modbus-tcp:host?unit=248", "'248' is not the address of a Modbus device"),
        ("modbus:/dev/ttyUSB0?parity=mark", "'mark' is not a parity; write even, odd, none"),
        ("modbus-tcp:host?parity=even", "no option 'parity'; it has unit, baud"),
    ],
)
def test_what_is_no_link_is_refused_with_what_to_write(text: str, said: str) -> None:
    with pytest.raises(UsageError) as caught:
        parse_link(text)
    assert said in caught.value.message
    assert caught.value.code == "no-such-link"


@pytest.mark.parametrize("text", ["tcp:192.168.1.5", "tcp:plc.local:11741", "udp:192.168.1.255", "udp:10.0.0.7:1743"])
def test_a_network_link_has_a_place_and_needs_no_gateway(text: str) -> None:
    link = parse_link(text)
    assert (str(link), link.options, link.is_shared) == (text, {}, False)


def test_no_option_means_two_things() -> None:
    flags = [kind.flag for kind in TRANSPORTS.values() if kind.flag]
    options = {(name, option.help) for kind in TRANSPORTS.values() for name, option in kind.options.items()}
    assert len({*flags, *(name for name, _ in options)}) == len(flags) + len(options)


@pytest.mark.parametrize(
    ("text", "options", "is_shared"),
    [
        ("modbus:/dev/ttyUSB0", {"unit": 247, "baud": 38400, "parity": "even"}, True),
        ("modbus:/dev/ttyUSB0?unit=3&baud=9600&parity=none", {"unit": 3, "baud": 9600, "parity": "none"}, True),
        ("modbus-tcp:192.168.0.9?unit=3", {"unit": 3, "baud": 38400}, False),
    ],
)
def test_link_within_modbus_has_an_address_there(text: str, options: dict[str, int | str], is_shared: bool) -> None:
    link = parse_link(text)
    assert (link.options, link.is_shared, link.nodes) == (options, is_shared, None)
    assert parse_link(str(link)) == link


@pytest.mark.parametrize(
    ("text", "nodes"),
    [
        ("can:socketcan:can0", []),
        ("can:slcan:/dev/ttyACM0?node=5", ["5"]),
        ("can:virtual:x?node=press", ["press"]),
        ("can:socketcan:can0?node=1,2,mixer", ["1", "2", "mixer"]),
    ],
)
def test_a_link_to_a_bus_names_its_devices(text: str, nodes: list[str]) -> None:
    link = parse_link(text)
    assert link.nodes == nodes
    assert parse_link(str(link)) == link
    assert link.of_node("7").nodes == ["7"]
    assert link.options["can-base"] == "0x1F400000"


@pytest.mark.parametrize("text", ["serial:/dev/ttyS0", "tcp:192.168.1.5", "udp:192.168.1.5", "sim:"])
def test_other_links_lead_to_one_device(text: str) -> None:
    assert parse_link(text).nodes is None


def test_the_simulator_of_this_process_is_a_link() -> None:
    assert lib.SimFlashConfigure(1 << 20, 4096, 8, 0xFF) == lib.ERR_OK  # another test may have left a password in it
    assert lib.SimStart() == lib.ERR_OK
    try:
        with Connection(open_transport(parse_link("sim:"))) as connection:
            assert services.read_identity(Session(connection)).device_name
    finally:
        lib.SimStop()


def test_a_new_kind_of_link_is_one_row(monkeypatch: pytest.MonkeyPatch) -> None:
    line = FakeLine(FakeDevice())
    row = replace(TRANSPORTS["serial"], open=lambda link: line, flag="wire", options={}, is_shared=False)
    monkeypatch.setitem(TRANSPORTS, "wire", row)
    link = parse_link("wire:7")
    assert (link.scheme, link.place, link.is_shared) == ("wire", "7", False)
    assert open_transport(link) is line


@pytest.mark.parametrize("size", [64, 100, 256])
def test_no_packet_is_longer_than_the_transport_takes(size: int) -> None:
    line = FakeLine(FakeDevice())
    line.max_packet = size
    sent: list[int] = []
    send = line.send
    line.send = lambda *packets: (sent.extend(map(len, packets)), send(*packets))[1]  # type: ignore[method-assign]
    with Connection(line) as connection:
        connection.open()
        message = bytes(range(256)) * 4
        assert connection.exchange(message) == message
    assert size - 8 <= max(sent) <= size
