"""`plctool render`: the diagram of a unit as SVG."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from plctool.cli import output
from plctool.cli.arguments import add_link, utf8
from plctool.cli.connections import connect
from plctool.cli.documents import Document
from plctool.cli.overwriting import check_output
from plctool.cli.parser import Parser
from plctool.files import file_path, usable_path, write_atomically

if TYPE_CHECKING:
    from plctool.doc.drawn import Diagram
    from plctool.doc.monitor import Monitor


def render_arguments(command: Parser) -> None:
    command.add_argument("source", type=usable_path, metavar="FILE|DIR", help="a file, a folder or a project")
    command.add_argument("pou", metavar="POU", help="a program, function block or function; POU.NAME for an action")
    command.add_argument("-o", "--output", type=file_path, metavar="FILE.svg", help="default: POU.svg")
    command.add_argument(
        "--live", nargs="?", const="", type=utf8, metavar="INSTANCE",
        help="with the values of a device; INSTANCE: of which function block, such as Main.pump; default: POU",
    )  # fmt: skip
    add_link(command, symbols=True)
    command.set_defaults(action=_render)


def _render(args: argparse.Namespace) -> int:
    file = args.output or Path(f"{args.pou}.svg")
    return output.show(args, document(args, file), _text)


def _text(document: Document) -> str:
    return f"{document['unit']} is drawn in {document['file']}"


def document(args: argparse.Namespace, file: Path) -> Document:
    """Draws a unit. Raises UsageError if it has no diagram."""
    from plctool.doc.drawn import diagram_of
    from plctool.doc.network import picture

    sources = [args.source] if args.source.is_file() else []
    check_output(file, sources, f"{file.stem}.svg")
    diagram = diagram_of(args.source, args.pou)
    monitor = None if args.live is None else _monitor(args, diagram)
    write_atomically(file, picture(f"{args.pou} ({diagram.language})", diagram, monitor).encode())
    found: Document = {"unit": args.pou, "language": diagram.language, "file": str(file)}
    if monitor is not None:
        found["pins"] = [
            {"element": element, "pin": pin, "variable": name, "value": monitor.values[name]}
            for (element, pin), name in monitor.names.items()
        ]
    return found


def _monitor(args: argparse.Namespace, diagram: Diagram) -> Monitor:
    from plctool.doc.monitor import Monitor, monitored

    with connect(args) as plc:
        names = monitored(diagram, args.live or diagram.name.partition(".")[0], plc.symbols())
        reading = plc.sample(sorted(set(names.values()))) if names else None
    return Monitor(names, {} if reading is None else reading.marked_texts)
