"""Places on a network: what a user writes for one, and what is wrong with it when it cannot be reached."""

from __future__ import annotations

import errno
import re
import socket

from plctool.errors import LinkError, UsageError

_PORTS = 65536


def split_place(text: str) -> tuple[str, int | None]:
    """Host and port of HOST[:PORT]; None when there is no port. Raises UsageError."""
    host, colon, port = text.partition(":")
    known = re.fullmatch(r"[0-9]{1,5}", port) and 0 < int(port) < _PORTS
    if not host or (colon and not known):
        raise UsageError(
            f"'{text}' is no place on a network; write for example 192.168.1.5 or 192.168.1.5:11740.", "no-such-link"
        )
    return host, int(port) if colon else None


def find_host(host: str) -> str:
    """The IPv4 address of a host. Raises LinkError."""
    try:
        return socket.gethostbyname(host)
    except (OSError, UnicodeError):
        raise LinkError(f"The host {host} is unknown; check its name, or write its address.", "open") from None


def own_address(connected: socket.socket) -> bytes:
    """The router address of this end of a socket: port and IPv4 address (codesys-v3-protocol 1.2)."""
    ip, port = connected.getsockname()
    return int(port).to_bytes(2, "big") + socket.inet_aton(ip)


def advice(error: OSError) -> str:
    """What is wrong and what to do about it, as the end of a sentence."""
    if isinstance(error, TimeoutError):
        return "nothing answers there; check the address, and that the device is on."
    known = {
        errno.ECONNREFUSED: "the device is there and serves no such port; check the port.",
        errno.EHOSTUNREACH: "nothing answers there; check the address, and that the device is on.",
        errno.ENETUNREACH: "there is no way to that network; check the address, and that of this machine.",
        errno.EACCES: "the system does not allow it; check the address and the firewall.",
    }
    return known.get(error.errno or 0, f"{error.strerror or error}.")
