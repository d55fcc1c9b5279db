"""Multicast DNS: the controllers that announce themselves (`_plcrt._tcp`), and the address of NAME.local.

It needs the package zeroconf (`pip install 'plctool[net]'`). The environment's PLCTOOL_MDNS is an address of this
machine, to ask on its network only, or "off".
"""

from __future__ import annotations

import logging
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from plctool.errors import LinkError

if TYPE_CHECKING:
    from zeroconf import ServiceInfo, Zeroconf

VARIABLE = "PLCTOOL_MDNS"
INSTALL = "pip install 'plctool[net]'"
_SERVICE = "_plcrt._tcp.local."
_SUFFIX = ".local"
_LISTEN = 1.5  # for announcements: replies come within 0.12 s, a second question after 1 s [s]
_ASK_MS = 1500
_MOST = 250  # devices: what floods a network with names ends a scan, not this tool


@dataclass(frozen=True)
class Announced:
    """A controller as it announces itself; `place` is HOST:PORT of TCP."""

    name: str
    host: str
    place: str


def is_available() -> bool:
    """True if zeroconf is installed."""
    from importlib.util import find_spec

    return find_spec("zeroconf") is not None


def is_off() -> bool:
    """True if the user has switched questions to the network off."""
    return os.environ.get(VARIABLE, "") == "off"


def find_devices() -> list[Announced]:
    """The controllers that announce themselves, by name; [] without zeroconf, or if no network can be asked."""
    if is_off() or not is_available():
        return []
    from threading import Event

    from zeroconf import ServiceBrowser

    class Found:
        """Collects what the browser hears in its thread."""

        def __init__(self) -> None:
            self.names: list[str] = []
            self.is_full = Event()

        def add_service(self, zeroconf: Zeroconf, kind: str, name: str) -> None:
            self.names.append(name)
            if len(self.names) >= _MOST:
                self.is_full.set()

        def update_service(self, zeroconf: Zeroconf, kind: str, name: str) -> None:
            pass

        def remove_service(self, zeroconf: Zeroconf, kind: str, name: str) -> None:
            if name in self.names:
                self.names.remove(name)

    found = Found()
    try:
        with _opened() as asking:
            browser = ServiceBrowser(asking, _SERVICE, found)  # type: ignore[arg-type]
            found.is_full.wait(_LISTEN)
            browser.cancel()
            infos = [_info(asking, name) for name in found.names[:_MOST]]
    except OSError:
        return []
    return sorted((a for info in infos if info and (a := _announced(info))), key=lambda a: (a.name, a.place))


def find_address(host: str) -> str | None:
    """The IPv4 address of NAME.local; None if no machine of this name replies. Raises LinkError if zeroconf, which is
    needed for it, is not installed."""
    if not is_local(host) or is_off():
        return None
    if not is_available():
        raise LinkError(
            f"The system does not know {host}, and plctool cannot ask the network for it: {INSTALL}, or write its "
            "address.",
            "open",
        )
    from zeroconf import AddressResolverIPv4  # type: ignore[attr-defined]

    try:
        resolver = AddressResolverIPv4(host.rstrip(".") + ".")
        with _opened() as asking:
            resolver.request(asking, _ASK_MS)
    except (OSError, ValueError):
        return None
    addresses = resolver.parsed_addresses()
    return addresses[0] if addresses else None


def is_local(host: str) -> bool:
    """True for NAME.local, whose address the network knows."""
    name = host.rstrip(".").lower()
    return name.endswith(_SUFFIX) and name != _SUFFIX


@contextmanager
def _opened() -> Iterator[Zeroconf]:
    from zeroconf import InterfaceChoice, IPVersion, Zeroconf

    for name in ("zeroconf", "asyncio"):  # reports of messages that other machines have sent are not for users
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    address = os.environ.get(VARIABLE, "")
    asking = Zeroconf(interfaces=[address] if address else InterfaceChoice.All, ip_version=IPVersion.V4Only)
    try:
        yield asking
    finally:
        asking.close()


def _info(asking: Zeroconf, name: str) -> ServiceInfo | None:
    from zeroconf import Error

    try:
        return asking.get_service_info(_SERVICE, name, _ASK_MS)
    except Error:  # a name that is not valid
        return None


def _announced(info: ServiceInfo) -> Announced | None:
    """None if a device announces no IPv4 address, or no port."""
    addresses = [socket.inet_ntoa(address) for address in info.addresses]
    if not addresses or not info.port:
        return None
    return Announced(
        info.name.removesuffix("." + _SERVICE), (info.server or "").rstrip("."), f"{addresses[0]}:{info.port}"
    )
