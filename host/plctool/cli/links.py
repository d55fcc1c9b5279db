"""Which link a command uses: the one of its options, else the environment's PLC_LINK, else `link` in plc.toml."""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

from plctool.cli import output
from plctool.errors import LinkError, UsageError
from plctool.files import read_utf8
from plctool.io.positions import BadToml, TomlText
from plctool.link import mdns
from plctool.link.transports import TRANSPORTS, Link, Value, make_link, parse_link, url_of
from plctool.project import PROJECT_FILE, find_project

VARIABLE = "PLC_LINK"
_ARPHRD_CAN, _IFF_UP = "280", 1  # linux/if_arp.h, linux/if.h


def link_of(args: argparse.Namespace) -> Link:
    """The link of a command. Raises UsageError if there is none."""
    link = find_link(args)
    if link is None:
        raise UsageError(
            f"Say where the device is: --port /dev/ttyS0, for example, or once and for all by "
            f'link = "serial:/dev/ttyS0" in {PROJECT_FILE}, or in the environment: {VARIABLE}=serial:/dev/ttyS0.',
            "no-link",
        )
    return link


def find_link(args: argparse.Namespace) -> Link | None:
    """The same, if there is one; options such as --baud also hold for one that the arguments do not name."""
    given = _given(args)
    if len(given) > 1:
        flags = " or ".join(f"--{TRANSPORTS[scheme].flag}" for scheme in given)
        raise UsageError(f"Name one link only, {flags}.", "no-link")
    if given:
        kind = TRANSPORTS[given[0]]
        if not (place := _argument(args, kind.flag)):
            raise UsageError(f"--{kind.flag} is followed by nothing; write for example {kind.example}.", "no-link")
        return make_link(given[0], place, **_options(args))
    link = _default_link(args)
    return None if link is None else make_link(link.scheme, link.place, **{**link.options, **_options(args)})


def all_links(args: argparse.Namespace) -> list[Link]:
    """The serial ports and CAN interfaces of this machine, and the controllers that announce themselves on its
    networks. Raises LinkError if there are none."""
    from serial.tools.list_ports import comports

    links = [
        *(make_link("serial", port.device, **_options_for("serial", args)) for port in sorted(comports())),
        *(make_link("can", f"socketcan:{name}", **_options_for("can", args)) for name in can_interfaces()),
        *(make_link("tcp", device.place) for device in mdns.find_devices()),
    ]
    if not links:
        raise LinkError(
            "This machine has no serial ports and no CAN interface that is up, and no controller announces itself on "
            f"its networks; say where to look, for example --udp 192.168.1.255.{_hint(mdns.is_available())}",
            "open",
        )
    return links


def can_interfaces(folder: Path = Path("/sys/class/net")) -> list[str]:
    """The CAN interfaces of the system that are up."""
    return sorted(path.parent.name for path in folder.glob("*/type") if _is_can(path.parent))


def _is_can(interface: Path) -> bool:
    try:
        flags = int((interface / "flags").read_text(), 16)
        return (interface / "type").read_text().strip() == _ARPHRD_CAN and bool(flags & _IFF_UP)
    except (OSError, ValueError):
        return False


def _hint(available: bool) -> str:
    return "" if available else f" To find controllers on the network: {mdns.INSTALL}."


def _options_for(scheme: str, args: argparse.Namespace) -> dict[str, Value]:
    return {name: value for name, value in _options(args).items() if name in TRANSPORTS[scheme].options}


def names_link(args: argparse.Namespace) -> bool:
    """True if the arguments name a link, or an option of one; not for that of the environment or of plc.toml."""
    return bool(_given(args) or _options(args))


def _given(args: argparse.Namespace) -> list[str]:
    """The kinds of link that the arguments name."""
    return [scheme for scheme, kind in TRANSPORTS.items() if kind.flag and _argument(args, kind.flag) is not None]


def _argument(args: argparse.Namespace, name: str) -> Any:
    """What follows --`name`; None if it is not there."""
    return getattr(args, name.replace("-", "_"))


def _options(args: argparse.Namespace) -> dict[str, Value]:
    names = {name for kind in TRANSPORTS.values() for name in kind.options}
    return {name: value for name in sorted(names) if (value := _argument(args, name)) is not None}


def _default_link(args: argparse.Namespace) -> Link | None:
    if text := os.environ.get(VARIABLE):
        return _parse(text, f"In the environment's {VARIABLE}")
    file = find_project()
    link = None if file is None else _link_in(file)
    if link is not None:
        _announce(args, f"the link is {link}, from {file}")
    return link


def _announce(args: argparse.Namespace, words: str) -> None:
    """Says once that a file decides which controller a command is for: it may have come with a checked-out project."""
    if not args.json and "announced" not in args:
        args.announced = True
        output.say(f"plctool: {words}", sys.stderr)


def _link_in(file: Path) -> Link | None:
    """What a project says. Raises UsageError for a file that cannot be understood."""
    try:
        toml = TomlText(str(file), read_utf8(file, "bad-project"))
        text = toml.values.get("link")
    except BadToml as error:
        where = f"{file}:{error.pos.line}:{error.pos.column}"
        raise UsageError(f"{where}: {error.message}.", "bad-project") from None
    if not text:
        return None
    line = toml.key_pos(("link",)).line
    if not isinstance(text, str):
        raise UsageError(
            f'{file}:{line}: link is not a text; write for example link = "serial:/dev/ttyS0".', "bad-project"
        )
    return project_link(file, line, text)


def project_link(file: Path, line: int, text: str) -> Link:
    """The link that a line of a project names. Raises UsageError if it is none, or a URL: a checked-out project names
    ports and addresses only."""
    link = _parse(text, f"{file}:{line}")
    if url_of(link.place) is not None:
        raise UsageError(
            f"{file}:{line}: {link.place} is a URL, which {PROJECT_FILE} cannot name; give it with "
            f"--{TRANSPORTS[link.scheme].flag} or in the environment: {VARIABLE}={text}.",
            "bad-project",
        )
    return _beside(file, link)


def _beside(file: Path, link: Link) -> Link:
    """The link of a project whose port is a path that begins at its folder, as that of `--serial pty:plc.tty` may."""
    place = file.parent / link.place
    return replace(link, place=str(place)) if link.is_shared and place.exists() else link


def _parse(text: str, where: str) -> Link:
    try:
        return parse_link(text)
    except UsageError as error:
        raise UsageError(f"{where}: {error.message}", error.code) from None
