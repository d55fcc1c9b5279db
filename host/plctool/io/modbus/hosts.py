"""Where a client on TCP connects to: an IPv4 address, an IPv6 address, or the name of a host by RFC 1123."""

from __future__ import annotations

import ipaddress
import re
from dataclasses import dataclass

from plctool.core import lib

MAX_NAME = int(lib.MODBUS_MAX_HOST)
_LABEL = re.compile(r"[a-z0-9]([a-z0-9-]{0,61}[a-z0-9])?", re.ASCII | re.IGNORECASE)
# A name that ends so would be taken as a number of an address: 10.0.0.256, 10.1, 0x7f000001.
_NUMBER = re.compile(r"\d+|0x[0-9a-f]*", re.ASCII | re.IGNORECASE)
_SCOPE = re.compile(r"[\w.-]{1,15}", re.ASCII)
_PLACE = re.compile(
    r"([a-z][a-z0-9+.-]*://)?(?P<host>\[[^\]]+\]|[^:/\[\]]+)(:(?P<port>\d{1,5}))?/?", re.ASCII | re.IGNORECASE
)


@dataclass(frozen=True)
class Host:
    """`ipv4`: its address as a number, None: it is found by its `name`, which may be an IPv6 address."""

    ipv4: int | None
    name: str


def read_host(text: str) -> Host | None:
    """The host that a text means; None if it is not one. An IPv6 address may have brackets."""
    try:
        return Host(int(ipaddress.IPv4Address(text)), text)
    except ValueError:
        pass
    inner = text[1:-1] if text.startswith("[") and text.endswith("]") else text
    if ":" in inner:
        return Host(None, inner) if _is_ipv6(inner) else None
    return Host(None, text) if _is_name(text) else None


def split_place(text: str) -> tuple[str, int | None] | None:
    """Host and port of `HOST:PORT` or a URL, as other software writes it; None if it is neither."""
    found = _PLACE.fullmatch(text)
    if found is None or read_host(found["host"]) is None:
        return None
    port = int(found["port"]) if found["port"] else None
    return found["host"].strip("[]"), port if port is not None and 0 < port < 1 << 16 else None


def what_to_write(text: str) -> str:
    """For a text that is not a host."""
    if (place := split_place(text)) is not None:
        host, port = place
        return f'write host = "{host}"' + (f" and port = {port}" if port is not None else "")
    if ":" in text or "[" in text:
        return 'an IPv6 address is written as "fd00::7"'
    if not text.isascii() and (ascii_name := _to_ascii(text)):
        return f'write "{ascii_name}"'
    if _NUMBER.fullmatch(text.rstrip(".").rpartition(".")[2]):
        return 'an IPv4 address is four numbers of 0 to 255: write for example "192.168.0.7"'
    return (
        f"a name has at most {MAX_NAME} letters, digits, hyphens and dots, 63 between two dots, and no hyphen beside "
        'a dot: write for example "192.168.0.7" or "meter-7.plant"'
    )


def _is_ipv6(text: str) -> bool:
    address, percent, scope = text.partition("%")
    try:
        ipaddress.IPv6Address(address)
    except ValueError:
        return False
    return not percent or _SCOPE.fullmatch(scope) is not None


def _is_name(text: str) -> bool:
    labels = text.removesuffix(".").split(".")
    return len(text) <= MAX_NAME and all(map(_LABEL.fullmatch, labels)) and not _NUMBER.fullmatch(labels[-1])


def _to_ascii(text: str) -> str:
    """What name servers call a name with other letters; "" if it cannot be one."""
    try:
        name = text.encode("idna").decode()
    except UnicodeError:
        return ""
    return name if _is_name(name) else ""
