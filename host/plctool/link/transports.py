"""The kinds of links there are, and LINK: how a user names one, such as `serial:/dev/ttyS0?baud=9600`.

A new kind is one row of `TRANSPORTS`; the command line gets its options from there. What opens it is imported when
it is needed, so that the command line starts quickly.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from plctool.errors import UsageError
from plctool.link.transport import DEFAULT_BAUD, BlockTransport

Value = int | str
LATER = {"can": "INTERFACE:CHANNEL"}
"""Kinds of links that are still to come, and what a place looks like."""


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


def _above_zero(text: str) -> int:
    if not text.isdecimal() or int(text) == 0:
        raise ValueError(f"'{text}' is not a number above 0")
    return int(text)


def _open_serial(link: Link) -> BlockTransport:
    from plctool.link.serial import SerialTransport

    return SerialTransport(link.place, int(link.options["baud"]))


def _open_tcp(link: Link) -> BlockTransport:
    from plctool.link.tcp import TcpTransport

    return TcpTransport(link.place)


def _open_udp(link: Link) -> BlockTransport:
    from plctool.link.udp import UdpTransport

    return UdpTransport(link.place)


def _open_sim(link: Link) -> BlockTransport:
    from plctool.link.sim import SimTransport

    return SimTransport()


TRANSPORTS: dict[str, Transport] = {
    "serial": Transport(
        _open_serial,
        flag="port",
        shape="PORT",
        example="/dev/ttyS0",
        help="serial port or pyserial URL, for example /dev/ttyS0",
        options={"baud": Option(DEFAULT_BAUD, _above_zero, "bits per second")},
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
    "sim": Transport(_open_sim),  # the simulator of this process, which has to be on
}


def parse_link(text: str) -> Link:
    """The link that a user names by SCHEME:PLACE[?OPTION=VALUE&...]. Raises UsageError.

    A place may have a question mark of its own, as pyserial's URLs do: only what names options of the link is taken for
    them.
    """
    scheme, colon, rest = text.partition(":")
    if not colon or scheme not in (*TRANSPORTS, *LATER):
        raise _no_link(text)
    if scheme in LATER:
        raise not_yet(f"A {scheme} link")
    place, mark, options = rest.rpartition("?")
    named = dict(pair.partition("=")[::2] for pair in options.split("&"))
    if not mark or ("://" in rest and not named.keys() <= TRANSPORTS[scheme].options.keys()):
        return make_link(scheme, rest)
    return make_link(scheme, place, **named)


def make_link(scheme: str, place: str, **options: Value) -> Link:
    """A link of a kind in TRANSPORTS from its parts; the text of an option stands for its value. Raises UsageError."""
    kind = TRANSPORTS[scheme]
    if bool(place) != bool(kind.flag):
        raise _no_link(f"{scheme}:{place}")
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


def open_transport(link: Link) -> BlockTransport:
    """Opens a link for this process alone. Raises LinkError."""
    return TRANSPORTS[link.scheme].open(link)


def not_yet(what: str) -> UsageError:
    """The error about a kind of link, or an option for one, that is still to come."""
    return UsageError(
        f"{what} is not in this version; use a serial line (--port) or the network (--tcp, --udp).", "no-such-link"
    )


def _no_link(text: str) -> UsageError:
    examples = " or ".join(f"{scheme}:{kind.example}" for scheme, kind in TRANSPORTS.items() if kind.flag)
    return UsageError(f"'{text}' is not a link; write for example {examples}.", "no-such-link")
