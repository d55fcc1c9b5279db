"""`plctool info`, `symbols`, `image`: what is in an image, and what a production programmer burns."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plctool.cli import io_documents, output
from plctool.cli.arguments import add_board, add_firmware, add_image, add_link, utf8
from plctool.cli.builds import fresh_image, image_of, project_of
from plctool.cli.connections import on_device
from plctool.cli.documents import Document
from plctool.cli.library_list import library, library_text
from plctool.cli.links import names_link
from plctool.cli.output import table
from plctool.cli.overwriting import check_not_read
from plctool.cli.parser import Parser
from plctool.errors import DeviceError, UsageError
from plctool.files import file_path, read_image
from plctool.project import IMAGE_SUFFIX

if TYPE_CHECKING:
    from plctool.device import Plc


def info_arguments(command: Parser) -> None:
    add_image(command)
    add_link(command)
    command.set_defaults(action=_info)


def image_arguments(command: Parser) -> None:
    add_image(command)
    add_board(command, "such as plcrt, mps2-an385/standard")
    add_firmware(command, "burn it as well; a board of your own is read from it")
    command.add_argument("-o", "--output", type=file_path, required=True, metavar="FILE.hex|.bin")
    command.set_defaults(action=_image)


def symbols_arguments(command: Parser) -> None:
    add_image(command)
    command.add_argument("patterns", nargs="*", type=utf8, metavar="PATTERN", help="names with * and ?: 'Main.pump.*'")
    command.add_argument(
        "--library",
        action="store_true",
        help="the functions and blocks of the standard library instead, such as 'CRC*'",
    )
    command.set_defaults(action=_symbols)


def _info(args: argparse.Namespace) -> int:
    from plctool.image.production import is_production

    if names_link(args):
        if args.image is not None:
            raise UsageError(f"Name {args.image} or a link, not both: each is described by its own command.", "no-link")
        return on_device(args, device_info, info_text)
    image = image_of(args)
    if is_production(image):
        return output.show(args, production_info(image), production_info_text)
    return output.show(args, info(image), info_text)


def info(path: Path) -> Document:
    """Header, tables and POUs of an image; with its symbols also the bytes of code that each POU made."""
    from plctool.debug.symbols import find_symbols
    from plctool.image.file import describe_image, read_program

    data = read_program(path)
    document = describe_image(data)
    if board := io_documents.board_in(data):
        document["board"] = board
    if devices := io_documents.devices_of(data):
        document["devices"] = devices
    try:
        table = find_symbols(int(document["crc"], 16), path)
    except UsageError:
        return document
    from plctool.compiler.image.build import code_sizes

    units = {unit.name: unit for unit in table.pous}
    document["pous"] = [
        {"name": name, "size": size, "file": units[name].file, "line": units[name].line}
        for name, size in code_sizes(table, document["code_size"]).items()
    ]
    return document


def device_info(plc: Plc) -> Document:
    """Returns program and components of a device, under the names that `info` prints. "info" is empty without a program
    or without application information in the firmware; "components" is left out if the firmware lists none."""
    from plctool.image.file import target_name

    identity, status = plc.identity(), plc.raw_status()
    document: Document = {"device": identity.device_name, "state": str(status.state)}
    if status.image_crc:
        document |= {"size": status.image_size, "crc": f"{status.image_crc:08X}"}
    document |= {"target": target_name(identity.target_id), "info": {}}
    if status.image_crc:
        with suppress(DeviceError):
            document["info"] = plc.info()
    if components := components_of(plc):
        document["components"] = components
    return document


_COMPONENT = re.compile(
    r"(?P<name>[\w.-]{1,64}): id 0x(?P<id>[0-9A-Fa-f]{1,8}), version (?P<version>\d{1,3}(?:\.\d{1,3}){3})"
)


def components_of(plc: Plc) -> list[Document]:
    """The components of the firmware of a device; those of a vendor have its number in the upper half of their id."""
    try:
        lines = plc.shell("complist").splitlines()
    except DeviceError:
        return []
    found = [match for match in map(_COMPONENT.fullmatch, lines) if match]
    return [
        {
            "name": match["name"],
            "id": f"0x{int(match['id'], 16):04X}",
            "version": match["version"],
            "vendor": f"0x{vendor:04X}" if (vendor := int(match["id"], 16) >> 16) else "",
        }
        for match in found
    ]


def info_text(document: dict[str, Any]) -> str:
    """Header first, then one section for each table that is not empty."""
    lines = [f"{name}: {value}" for name, value in document.items() if not isinstance(value, list | dict)]
    lines += [f"{name}: {text}" for name, text in document["info"].items() if text]
    for name, rows in document.items():
        if isinstance(rows, list) and rows:
            lines += ["", f"{name}:", table(rows, rows[0])]
    return "\n".join(lines)


def _symbols(args: argparse.Namespace) -> int:
    if args.library:
        patterns = [str(args.image), *args.patterns] if args.image is not None else args.patterns
        return output.show(args, library(patterns), library_text)
    if args.image is not None and _is_pattern(args.image):
        args.image, args.patterns = None, [str(args.image), *args.patterns]
    return output.show(args, variables(image_of(args), args.patterns), variables_text)


def _is_pattern(image: Path) -> bool:
    """True if the first argument of `symbols` names variables of the project of the current folder."""
    from plctool.image.production import is_production
    from plctool.project import find_project

    is_image = image.exists() or image.suffix.lower() == IMAGE_SUFFIX or is_production(image)
    return not is_image and find_project() is not None


def variables(path: Path, patterns: Sequence[str]) -> Document:
    """The variables of an image, and parts of them, whose names match one of the patterns; without patterns all
    variables. Raises UsageError for a pattern that matches nothing."""
    from plctool.debug.symbols import find_symbols
    from plctool.iec.areas import Area
    from plctool.image.file import describe_image, read_program

    symbols = find_symbols(int(describe_image(read_program(path))["crc"], 16), path)
    areas = {area.value: area.name.lower() for area in Area}
    return {
        "variables": [
            {"name": s.name, "type": str(s.type), "area": areas[s.area], "offset": s.offset, "size": s.size}
            for s in symbols.listed(patterns)
        ]
    }


def variables_text(document: dict[str, Any]) -> str:
    """A line for each variable of an image."""
    return table(document["variables"], ("name", "type", "area"))


def _image(args: argparse.Namespace) -> int:
    project = project_of(args)
    image = fresh_image(args, project)
    if args.board is None and args.firmware is None and project is not None:
        args.board = project.board
    inputs = [file for file in (image, args.firmware) if file is not None]
    check_not_read(args.output, inputs, f"-o {args.output.stem}-production{args.output.suffix}")
    return output.show(args, production(image, args.board, args.firmware, args.output), production_text)


def production(image: Path, board: str | None, firmware: Path | None, output: Path) -> Document:
    """Writes what a programmer burns to `output`; "burn_at" is the address that a .bin belongs to, "burn_apart" the
    firmware that cannot be in it, "stack" what the program needs of it, if its symbols are found. Raises UsageError
    when the parts do not go together."""
    from plctool.debug.symbols import find_symbols
    from plctool.image.board import board_of, read_firmware
    from plctool.image.file import image_crc, parse_image, read_program
    from plctool.image.limits import needs_of_image
    from plctool.image.production import is_production, production_pieces, write_production
    from plctool.io.fit import check_board

    if not is_production(output):
        raise UsageError(f"{output} is neither .bin nor .hex; write for example -o {_as_hex(output)}.", "bad-output")
    of_firmware = None if firmware is None else read_firmware(firmware)
    wanted = board_of(board, of_firmware)
    data = read_program(image)
    meant = io_documents.board_in(data)
    if meant not in ("", wanted.name) and not wanted.is_program:
        raise UsageError(
            f"The inputs and outputs of {image} are those of {meant}, this is {wanted.title}; build it for this board.",
            "other-board",
        )
    pieces = production_pieces(data, wanted, of_firmware)
    advice = "Make the program smaller, or use a firmware with more room."
    parsed = parse_image(data)
    needs, stack = needs_of_image(parsed, len(data)), None
    with suppress(UsageError):
        stack = find_symbols(parsed.crc, image).stack
    check_board(parsed, needs if stack is None else {**needs, "stack": stack}, wanted, advice)
    start = write_production(output, pieces, wanted)
    apart = None if firmware is None or wanted.flash.address is not None else str(firmware)
    return {
        "output": str(output),
        "board": wanted.title,
        "target": wanted.target,
        "crc": f"{image_crc(data):08X}",
        "pieces": [
            {"address": f"{p.segment.address:08X}", "size": len(p.segment.data), "what": p.what} for p in pieces
        ],
        "burn_at": None if start is None else f"{start:08X}",
        "burn_apart": apart,
        "stack": None if stack is None else {"bytes": stack.amount, "at_least": stack.at_least},
    }


def _as_hex(output: Path) -> Path:
    """A name for a file that has none for its kind."""
    name = output.stem.lstrip(".")
    return output.parent / f"{'product' if name.lower() in ('', 'bin', 'hex') else name}.hex"


def production_info(path: Path) -> Document:
    """What is in a .bin or .hex."""
    from plctool.image.production import describe_production

    return describe_production(path, read_image(path))


def production_text(document: dict[str, Any]) -> str:
    """What was written, a line for each piece, and what is burned besides."""
    pieces = [{**p, "address": f"0x{p['address']}"} for p in document["pieces"]]
    head = f"{document['output']}: {document['board']} with program CRC {document['crc']}"
    lines = [head, table(pieces, ("address", "size", "what"))]
    if document["burn_at"]:
        lines.append(f"A .bin has no addresses: burn it at 0x{document['burn_at']}.")
    if document["burn_apart"]:
        lines.append(f"Programs have a memory of their own: burn {document['burn_apart']} into the processor as it is.")
    if document["stack"] is None:
        lines.append("Whether its stack is large enough is not known: the symbols of the program are not found.")
    elif document["stack"]["at_least"]:
        lines.append(f"The program needs at least {document['stack']['bytes']} bytes of stack; the sum is not known.")
    return "\n".join(lines)


def production_info_text(document: dict[str, Any]) -> str:
    """The parts, and each program as an image is described."""
    parts = [{**p, "address": f"0x{p['address']}"} for p in document["parts"]]
    lines = [table(parts, ("address", "size"))]
    if document["addresses"] == "file":
        lines.append("A .bin has no addresses: these count from its beginning.")
    for program in document["programs"]:
        seal = "without a valid seal, so that no device runs it" if program["seal"] is None else "sealed"
        image = {name: value for name, value in program.items() if name not in ("address", "seal")}
        lines += ["", f"program at 0x{program['address']}, {seal}:", info_text(image)]
    return "\n".join(lines)
