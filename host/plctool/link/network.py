"""Hosts and ports: what a user writes for a place on a network, and advice if it cannot be reached."""

from __future__ import annotations

import errno
import re
import socket

from plctool.errors import LinkError, UsageError
from plctool.link import mdns

_PORTS = 65536


def split_place(text: str) -> tuple[str, int | None]:
    """Host and port of HOST[:PORT]; None when there is no port. Raises UsageError."""
    host, colon, port = text.partition(":")
    known = re.fullmatch(r"[0-9]{1,5}", port) and 0 < int(port) < _PORTS
    if not host or (colon and not known):
        raise UsageError(
            f"'{text}' is not a valid HOST[:PORT]; write for example 192.168.1.5 or 192.168.1.5:11740.", "no-such-link"
        )
    return host, int(port) if colon else None


def find_host(host: str) -> str:
    """The IPv4 address of a host; that of NAME.local is asked for on the network if the system does not know it. Raises
    LinkError."""
    try:
        return socket.gethostbyname(host)
    except (OSError, UnicodeError):
        if address := mdns.find_address(host):
            return address
        advice = f"write --port {host}" if host.startswith("/dev/") else "check its name, or write its address"
        raise LinkError(f"The host {host} is unknown; {advice}.", "open") from None


def own_address(connected: socket.socket) -> bytes:
    """The router address of this end of a socket: port and IPv4 address (codesys-v3-protocol 1.2)."""
    ip, port = connected.getsockname()
    return int(port).to_bytes(2, "big") + socket.inet_aton(ip)


def advice(error: OSError) -> str:
    """The end of a sentence: what is wrong and what to do."""
    if isinstance(error, TimeoutError):
        return "there is no reply; check the address, and that the device is on."
    known = {
        errno.ECONNREFUSED: "the host refuses connections to this port; check the port, and that the device serves it.",
        errno.EHOSTUNREACH: "there is no reply; check the address, and that the device is on.",
        errno.ENETUNREACH: "the network is not reachable; check the address and the network settings of this machine.",
        errno.EACCES: "the system does not allow it; check the address and the firewall.",
    }
    return known.get(error.errno or 0, f"{error.strerror or error}.")
