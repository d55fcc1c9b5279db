"""The kinds of links there are, and LINK: how a user names one, such as `serial:/dev/ttyS0?baud=9600`.

A new kind is one row of `TRANSPORTS`; the command line gets its options from there. What opens it is imported when
it is needed, so that the command line starts quickly.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from plctool.errors import UsageError, listed
from plctool.link.transport import DEFAULT_BAUD, BlockTransport

if TYPE_CHECKING:
    from plctool.link.canbus import Bus, SharedBus

Value = int | str
PARITIES = ("even", "odd", "none")
_LAST_NODE = 127  # CAN_NODE_MAX; the command line starts without the core
_LAST_UNIT = 247  # MODBUS_MAX_UNIT
_MODBUS_BAUD = 38400
URLS = ("loop", "rfc2217", "socket")
"""The URLs of pyserial that name a line. Others write a file (spy://), look for a port (hwgrep://) or wrap another URL
(alt://)."""


@dataclass(frozen=True)
class Option:
    """An option of a link, described by `help`. `parse` raises ValueError for what is not a value
    of it."""

    default: Value
    parse: Callable[[str], Value]
    help: str


@dataclass(frozen=True)
class Link:
    """Where a controller is: the kind of link, its place, and all options the kind has, by name."""

    scheme: str
    place: str
    options: Mapping[str, Value] = field(default_factory=dict)

    def __str__(self) -> str:
        """What `parse_link` makes this link of again."""
        options = "&".join(f"{name}={value}" for name, value in self.options.items())
        return f"{self.scheme}:{self.place}" + (f"?{options}" if options else "")

    @property
    def is_shared(self) -> bool:
        """Whether one process at a time can have it, so that the tools of this machine need a gateway to share it."""
        return TRANSPORTS[self.scheme].is_shared

    @property
    def nodes(self) -> list[str] | None:
        """The devices that are meant, by number or name, on a link where several may reply; [] if the user names none.
        None: it is a link to one device."""
        if not TRANSPORTS[self.scheme].is_bus:
            return None
        return [name for name in str(self.options["node"]).split(",") if name]

    def of_node(self, node: str) -> Link:
        """The same link, to one of the devices."""
        return replace(self, options={**self.options, "node": node})


@dataclass(frozen=True)
class Transport:
    """A kind of link. `flag`: the option of the command line that takes its place, such as `example`; "" if it has no
    place, of the form `shape`. `open` raises LinkError, and UsageError for what is no place."""

    open: Callable[[Link], BlockTransport]
    flag: str = ""
    shape: str = ""
    example: str = ""
    help: str = ""
    options: Mapping[str, Option] = field(default_factory=dict)
    is_shared: bool = False
    is_bus: bool = False  # several devices may reply; its option `node` says which one is meant


def _above_zero(text: str) -> int:
    if not text.isdecimal() or int(text) == 0:
        raise ValueError(f"'{text}' is not a number above 0")
    return int(text)


def _nodes(text: str) -> str:
    for node in text.split(","):
        if node.isdecimal() and not 1 <= int(node) <= _LAST_NODE:
            raise ValueError(f"'{node}' is not the number of a device, 1 to {_LAST_NODE}")
    return text


def _bit_rate(text: str) -> str:
    rates = text.split("/")
    if len(rates) > 2 or not all(rate.isdecimal() and int(rate) for rate in rates):
        raise ValueError(f"'{text}' is not a bit rate; write 500000, or 500000/2000000 for CAN FD")
    return text


def _can_base(text: str) -> str:
    try:
        base = int(text, 0)
    except ValueError:
        base = -1
    if not 0 <= base <= 0x1FFFFFFF or base & 0xFFFF:
        raise ValueError(f"'{text}' is not a base of identifiers, of 29 bits with the last 16 zero")
    return f"0x{base:08X}"


def _unit(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= _LAST_UNIT:
        raise ValueError(f"'{text}' is not the address of a Modbus device, 1 to {_LAST_UNIT}")
    return int(text)


def _parity(text: str) -> str:
    if text not in PARITIES:
        raise ValueError(f"'{text}' is not a parity; write {', '.join(PARITIES)}")
    return text


def _open_can(link: Link) -> BlockTransport:
    from plctool.link import canbus

    return can_transport(link, canbus.PythonCanBus(canbus.open_bus(link.place, *_bit_rates(link))))


def share_bus(link: Link) -> SharedBus:
    """Opens the bus of a link for several transports of this process. Raises LinkError."""
    from plctool.link import canbus

    rates = _bit_rates(link)
    return canbus.SharedBus(canbus.open_bus(link.place, *rates))


def _bit_rates(link: Link) -> tuple[int, int]:
    """Of arbitration and of data; 0: no CAN FD."""
    first, _, second = str(link.options["bitrate"]).partition("/")
    return int(first), int(second or 0)


def can_transport(link: Link, bus: Bus) -> BlockTransport:
    """The transport of a link on a bus that is open."""
    from plctool.link.canbus import CanTransport

    node = str(link.options["node"])
    return CanTransport(
        link.place,
        bus,
        int(node) if node.isdecimal() else None,
        base=int(str(link.options["can-base"]), 16),
        fd=_bit_rates(link)[1] != 0,
    )


def _open_serial(link: Link) -> BlockTransport:
    from plctool.link.serial import SerialTransport

    return SerialTransport(link.place, int(link.options["baud"]))


def _open_modbus(link: Link) -> BlockTransport:
    from plctool.link.modbus import ModbusTransport, RtuBus

    unit, baud = int(link.options["unit"]), int(link.options["baud"])
    return ModbusTransport(RtuBus(link.place, unit, baud, str(link.options["parity"])))


def _open_modbus_tcp(link: Link) -> BlockTransport:
    from plctool.link.modbus import GatewayBus, ModbusTransport

    return ModbusTransport(GatewayBus(link.place, int(link.options["unit"]), int(link.options["baud"])))


def _open_tcp(link: Link) -> BlockTransport:
    from plctool.link.tcp import TcpTransport

    return TcpTransport(link.place)


def _open_udp(link: Link) -> BlockTransport:
    from plctool.link.udp import UdpTransport

    return UdpTransport(link.place)


def _open_sim(link: Link) -> BlockTransport:
    from plctool.link.sim import SimTransport

    return SimTransport()


_BAUD_HELP = "bits per second"
_MODBUS_OPTIONS = {
    "unit": Option(_LAST_UNIT, _unit, "address of the device on a Modbus line"),
    "baud": Option(_MODBUS_BAUD, _above_zero, _BAUD_HELP),
}

TRANSPORTS: dict[str, Transport] = {
    "serial": Transport(
        _open_serial,
        flag="port",
        shape="PORT",
        example="/dev/ttyS0",
        help="serial port, for example /dev/ttyS0, or URL: socket://HOST:PORT, rfc2217://HOST:PORT",
        options={"baud": Option(DEFAULT_BAUD, _above_zero, _BAUD_HELP)},
        is_shared=True,
    ),
    "tcp": Transport(
        _open_tcp,
        flag="tcp",
        shape="HOST[:PORT]",
        example="192.168.1.5",
        help="controller on the network, over TCP",
    ),
    "udp": Transport(
        _open_udp,
        flag="udp",
        shape="HOST[:PORT]",
        example="192.168.1.5",
        help="the same over UDP; for scan also the broadcast address of a network",
    ),
    "can": Transport(
        _open_can,
        flag="can",
        shape="INTERFACE:CHANNEL",
        example="socketcan:can0",
        help="controller on a CAN bus, by an interface of python-can",
        options={
            "node": Option("", _nodes, "which device on the bus, by number or name; flash takes several: 1,2,3"),
            "bitrate": Option("500000", _bit_rate, "bits per second; CAN FD with two numbers: 500000/2000000"),
            "can-base": Option("0x1F400000", _can_base, "of the identifiers"),
        },
        is_bus=True,
    ),
    "modbus": Transport(
        _open_modbus,
        flag="modbus",
        shape="PORT",
        example="/dev/ttyUSB0",
        help="controller on an RS-485 line, within the Modbus RTU of others there",
        options={**_MODBUS_OPTIONS, "parity": Option("even", _parity, "of a Modbus line: even, odd or none")},
        is_shared=True,
    ),
    "modbus-tcp": Transport(
        _open_modbus_tcp,
        flag="modbus-tcp",
        shape="HOST[:PORT]",
        example="192.168.1.5",
        help="the same through a Modbus TCP gateway, whose line has this baud rate",
        options=_MODBUS_OPTIONS,
    ),
    "sim": Transport(_open_sim),  # the simulator of this process, which has to be on
}


def parse_link(text: str) -> Link:
    """The link that a user names by SCHEME:PLACE[?OPTION=VALUE&...]. Raises UsageError.

    A place may have a question mark of its own, as pyserial's URLs do: only what names options of the link is taken for
    them.
    """
    if not isinstance(text, str):
        raise UsageError(f'A link is a string such as "serial:/dev/ttyS0", not {text!r}.', "no-such-link")
    scheme, colon, rest = text.partition(":")
    if not colon or scheme not in TRANSPORTS:
        raise _no_link(text)
    place, mark, options = rest.rpartition("?")
    named = dict(pair.partition("=")[::2] for pair in options.split("&"))
    if not mark or ("://" in rest and not named.keys() <= TRANSPORTS[scheme].options.keys()):
        return make_link(scheme, rest)
    return make_link(scheme, place, **named)


def make_link(scheme: str, place: str, /, **options: Value) -> Link:
    """A link of a kind in TRANSPORTS from its parts; the text of an option stands for its value. Raises UsageError."""
    kind = TRANSPORTS[scheme]
    if bool(place) != bool(kind.flag):
        raise _no_link(f"{scheme}:{place}")
    if (url := url_of(place)) is not None and url not in URLS:
        usable = listed((f"{name}://" for name in URLS), "or")
        raise UsageError(f"{place} is not a port: name one, or a URL that begins with {usable}.", "no-such-link")
    values = {name: option.default for name, option in kind.options.items()}
    for name, value in options.items():
        if name not in values:
            which = f"it has {', '.join(values)}" if values else "it has none"
            raise UsageError(f"A {scheme} link has no option '{name}'; {which}.", "no-such-link")
        try:
            values[name] = kind.options[name].parse(str(value))
        except ValueError as error:
            raise UsageError(f"The option {name} of {scheme}:{place} is wrong: {error}.", "no-such-link") from None
    return Link(scheme, place, values)


def url_of(place: str) -> str | None:
    """The kind of the URL that a place is or, after the interface of a CAN bus, contains: `socket` of `socket://host:1`.
    None if it is no URL."""
    kind, mark, _ = place.partition("://")
    return kind.rpartition(":")[2].lower() if mark else None


def open_transport(link: Link) -> BlockTransport:
    """Opens a link for this process alone. Raises LinkError."""
    return TRANSPORTS[link.scheme].open(link)


def _no_link(text: str) -> UsageError:
    examples = " or ".join(f"{scheme}:{kind.example}" for scheme, kind in TRANSPORTS.items() if kind.flag)
    return UsageError(f"'{text}' is not a link; write for example {examples}.", "no-such-link")
