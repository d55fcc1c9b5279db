"""`plctool canopen export` and `import`: nodes of a description as DCFs and nodelist.cpj, for other tools."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from plctool.cli import output
from plctool.cli.documents import Document
from plctool.cli.parser import Parser
from plctool.errors import UsageError, counted
from plctool.files import check_inside, usable_path, write_atomically
from plctool.io.canopen.eds import Eds, load_eds, mapping_of, setting_of
from plctool.io.canopen.lock import locked
from plctool.io.canopen.nodelist import FILE_NAME, ListedNode, NodeList, load_nodelist, nodelist_text

if TYPE_CHECKING:
    from plctool.io.canopen.manager import CanopenDevice, CanopenLine
    from plctool.io.mistakes import Mistakes

_PDOS = ((0x1A00, "in"), (0x1600, "out"))
_MAPPING = 0x200  # from the parameters of a PDO to its mapping
_INVALID = 0x8000_0000
_FIRST_OBJECT = 0x1000  # those below are dummies
_BIT_RATE = 500  # kbit/s


def add_export(action: Callable[..., Parser]) -> None:
    command = action("export", "write DCFs and nodelist.cpj of the nodes of a description", _export)
    command.add_argument("description", type=usable_path, metavar="FILE.io.toml")
    command.add_argument("folder", type=usable_path, metavar="FOLDER", help="where the files are written")
    command.add_argument("--network", metavar="NAME", help="of several networks, the one with this name")
    command.add_argument(
        "--bitrate", type=int, default=_BIT_RATE, metavar="KBIT/S", help=f"that the DCFs name, {_BIT_RATE} by default"
    )


def add_import(action: Callable[..., Parser]) -> None:
    command = action("import", "write the beginning of a description from nodelist.cpj and its DCFs", _import)
    command.add_argument("folder", type=usable_path, metavar="FOLDER", help=f"where {FILE_NAME} and the DCFs are")
    command.add_argument(
        "-o", "--output", type=usable_path, metavar="FILE.io.toml", help="default: network.io.toml in the folder"
    )


def _export(args: argparse.Namespace) -> int:
    document = export_nodes(args.description, args.folder, args.network, args.bitrate)
    return output.show(args, document, lambda d: "\n".join(f"{file} written" for file in d["files"]))


def _import(args: argparse.Namespace) -> int:
    document = import_nodes(args.folder, args.output)
    return output.show(args, document, lambda d: f"{d['description']} written: {counted(d['nodes'], 'node')}")


# ---- export --------------------------------------------------------------------------------------------------------


def export_nodes(description: Path, folder: Path, network: str | None, bit_rate: int) -> Document:
    """Writes a DCF of each node and the list of them. Raises UsageError for a description with errors."""
    line, devices = _network(description, network)
    folder.mkdir(parents=True, exist_ok=True)
    with locked(folder):
        files = _write_nodes(line, devices, folder, bit_rate)
    return {"network": line.name, "files": files}


def _write_nodes(line: CanopenLine, devices: list[CanopenDevice], folder: Path, bit_rate: int) -> list[str]:
    """Returns the files."""
    files, listed = [], []
    for device in sorted(devices, key=lambda d: d.node):
        file = folder / f"{device.name}.dcf"
        write_atomically(file, _dcf_text(device, line, file.name, bit_rate).encode())
        files.append(str(file))
        listed.append(ListedNode(device.node, device.pos, device.name, file.name))
    write_atomically(folder / FILE_NAME, nodelist_text(line.name, listed).encode())
    return [*files, str(folder / FILE_NAME)]


def _network(path: Path, name: str | None) -> tuple[CanopenLine, list[CanopenDevice]]:
    from plctool.io.canopen.manager import CanopenDevice, CanopenLine
    from plctool.io.description import load_description

    made = load_description(path)
    _refuse(made.mistakes)
    lines = [c for c in made.connectors if isinstance(c, CanopenLine) and (name is None or c.name == name)]
    if not lines:
        which = "no [[canopen]]" if name is None else f"no [[canopen]] with the name {name}"
        raise UsageError(f"{path} has {which}.", "no-network")
    if len(lines) > 1:
        names = ", ".join(line.name for line in lines)
        raise UsageError(f"{path} has several networks; choose one with --network: {names}.", "no-network")
    return lines[0], [c for c in made.connectors if isinstance(c, CanopenDevice) and c.parent is lines[0]]


def _dcf_text(device: CanopenDevice, line: CanopenLine, file_name: str, bit_rate: int) -> str:
    from plctool.io.canopen.dcf import NodeOf, dcf_of

    assert device.eds is not None
    node = NodeOf(
        file_name, Path(device.eds.file).name, device.node, device.name, line.network, line.name, bit_rate
    )  # fmt: skip
    return dcf_of(device.eds, device.writes, node)


def _refuse(mistakes: Mistakes) -> None:
    """Raises UsageError with the first error, at its place."""
    errors = [m for m in mistakes.found if m.severity == "error"]
    if errors:
        first = errors[0]
        more = f" ({len(errors) - 1} more)" if len(errors) > 1 else ""
        raise UsageError(
            f"{first.pos.file}:{first.pos.line}:{first.pos.column}: {first.message.rstrip('.')}{more}.", "bad-file"
        )


# ---- import --------------------------------------------------------------------------------------------------------


def import_nodes(folder: Path, to: Path | None) -> Document:
    """Writes a description with the nodes of a list. Raises UsageError for a file with errors."""
    found = load_nodelist(folder / FILE_NAME)
    _refuse(found.findings)
    to = folder / "network.io.toml" if to is None else to
    files = {node.number: _load(node, folder, to) for node in found.nodes.values()}
    write_atomically(to, _description(found, files, folder, to).encode())
    return {"description": str(to), "nodes": len(files)}


def _load(node: ListedNode, folder: Path, to: Path) -> Eds:
    place = f"{node.pos.file}:{node.pos.line}:{node.pos.column}"
    if not node.dcf:
        raise UsageError(f"{place}: node {node.number} has no Node{node.number}DCFName.", "bad-file")
    assert node.dcf_pos is not None
    path = folder / node.dcf
    check_inside(path, folder)
    check_inside(path, to.parent)
    if not path.is_file():
        pos = node.dcf_pos
        raise UsageError(f"{pos.file}:{pos.line}:{pos.column}: there is no file {path}.", "bad-file")
    eds = load_eds(path)
    _refuse(eds.findings)
    known = eds.commissioning.node if eds.commissioning is not None else None
    if known is not None and known != node.number:
        raise UsageError(f"{place}: node {node.number} has the DCF of node {known}, {path}.", "bad-file")
    return eds


def _description(found: NodeList, files: dict[int, Eds], folder: Path, to: Path) -> str:
    own = [n for n, eds in files.items() if eds.commissioning is not None and eds.commissioning.manager]
    lines = [
        f"# From {FILE_NAME}. Name the variables of the objects in the comments, and delete those that none has.",
        "[[canopen]]",
        f'name = "{_name(found.name, "Bus")}"',
        *(f"node = {number}" for number in own[:1]),
    ]
    names: set[str] = set()
    for number, eds in files.items():
        if number in own:
            continue
        name = _name(found.nodes[number].name, f"Node{number}")
        name = f"{name}_{number}" if name.casefold() in names else name
        names.add(name.casefold())
        relative = Path(eds.file).resolve().relative_to(to.parent.resolve()).as_posix()
        lines += ["", "[[canopen.device]]", f'name = "{name}"', f"node = {number}", f'dcf = "{relative}"']
        lines += _channels(eds, name, number)
    return "\n".join([*lines, ""])


def _name(text: str, default: str) -> str:
    """A name as a description takes it."""
    words = re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_")
    return words if re.match(r"[A-Za-z]", words) else default


def _channels(eds: Eds, name: str, node: int) -> list[str]:
    """The objects in PDOs, as comments: the variables are not known."""
    lines = []
    for first, key in _PDOS:
        used = [n for n in eds.pdos(first - _MAPPING) if _is_valid(eds, first - _MAPPING + n, node)]
        mapped = [m for n in used for m in mapping_of(eds, first + n, node) if m.index >= _FIRST_OBJECT]
        items = [f'"{m.place}" = "Main.{name}_{m.index:04X}_{m.sub:02X}"' for m in mapped]
        lines += [f"# {key} = {{ {', '.join(items)} }}"] if items else []
    return lines


def _is_valid(eds: Eds, parameters: int, node: int) -> bool:
    """True if a PDO is switched on."""
    cob = setting_of(eds.entry(parameters, 1), node)
    return not (isinstance(cob, int) and cob & _INVALID)
