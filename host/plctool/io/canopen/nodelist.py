"""`nodelist.cpj`, CiA 306: the nodes of a network and their DCFs, as other tools exchange them."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

from plctool.errors import UsageError
from plctool.files import Pos, read_regular
from plctool.io.canopen.data_types import parse_whole
from plctool.io.canopen.eds import LAST_NODE
from plctool.io.canopen.ini import NotText, Section, read_sections, shown, text_of
from plctool.io.mistakes import Mistakes

FILE_NAME = "nodelist.cpj"
MAX_SIZE = 1 << 20
_KEY = re.compile(r"node([0-9]{1,3})(present|name|dcfname)")


@dataclass
class ListedNode:
    """A node of the list. `dcf`: the name of its file; "" if the list has none."""

    number: int
    pos: Pos
    name: str = ""
    dcf: str = ""
    dcf_pos: Pos | None = None
    present: bool = True


@dataclass
class NodeList:
    """What a file says of a network."""

    file: str
    name: str = ""
    nodes: dict[int, ListedNode] = field(default_factory=dict)
    findings: Mistakes = field(default_factory=Mistakes)


def load_nodelist(path: Path) -> NodeList:
    """Reads a file. Raises UsageError if it cannot be read at all."""
    try:
        data = read_regular(path, MAX_SIZE)
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}.", "bad-nodelist") from None
    return read_nodelist(str(path), data)


def read_nodelist(file: str, data: bytes) -> NodeList:
    """What the bytes of a file say. Raises UsageError for what is not a text file."""
    try:
        text = text_of(data)
    except NotText:
        raise UsageError(f"{file} is not a text file; give a {FILE_NAME}.", "bad-nodelist") from None
    found = NodeList(file)
    section = read_sections(file, text, found.findings).get("topology")
    if section is None:
        found.findings.error(Pos(file, 1, 1), f"section [TOPOLOGY] is missing; give a {FILE_NAME}.")
        return found
    _read_topology(section, found)
    return found


def _read_topology(section: Section, found: NodeList) -> None:
    item = section.get("NetName")
    found.name = "" if item is None else item.value
    for key, item in section.items.items():
        match = _KEY.fullmatch(key)
        if match is None:
            continue
        number = int(match[1])
        if not 1 <= number <= LAST_NODE:
            found.findings.error(item.pos, f"{shown(item.name)}: a node has a number from 1 to {LAST_NODE}.")
            continue
        node = found.nodes.setdefault(number, ListedNode(number, item.pos))
        if match[2] == "present":
            node.present = _is_present(item.value, item.pos, found)
        elif match[2] == "name":
            node.name = item.value
        else:
            node.dcf, node.dcf_pos = item.value, item.pos
    found.nodes = {number: node for number, node in sorted(found.nodes.items()) if node.present}
    _check_count(section, found)


def _is_present(value: str, pos: Pos, found: NodeList) -> bool:
    try:
        return parse_whole(value) != 0
    except ValueError as error:
        found.findings.error(pos, f"{error}; write 0x01 for a node that is present, else 0x00.")
        return False


def _check_count(section: Section, found: NodeList) -> None:
    item = section.get("Nodes")
    if item is None:
        return
    try:
        count = parse_whole(item.value)
    except ValueError as error:
        found.findings.error(item.pos, f"Nodes: {error}.")
        return
    if count != len(found.nodes):
        found.findings.warning(item.pos, f"Nodes is {count}, but {len(found.nodes)} are listed.")


def nodelist_text(name: str, nodes: list[ListedNode]) -> str:
    """The text of a file."""
    lines = ["[TOPOLOGY]", f"NetName={name}", f"Nodes=0x{len(nodes):02X}"]
    for node in nodes:
        key = f"Node{node.number}"
        lines += [f"{key}Present=0x01", f"{key}Name={node.name}", f"{key}DCFName={node.dcf}"]
    return "\n".join([*lines, "EDSBaseName=.", ""])
