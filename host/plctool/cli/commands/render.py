"""`plctool render`: the diagram of a unit as SVG."""

from __future__ import annotations

import argparse
from pathlib import Path

from plctool.cli import output
from plctool.cli.documents import Document
from plctool.cli.overwriting import check_output
from plctool.cli.parser import Parser
from plctool.files import file_path, usable_path, write_atomically


def render_arguments(command: Parser) -> None:
    command.add_argument("source", type=usable_path, metavar="FILE.xml", help="a project in PLCopen XML")
    command.add_argument("unit", metavar="POU", help="a program, function block or function; POU.NAME for an action")
    command.add_argument("-o", "--output", type=file_path, metavar="FILE.svg", help="default: POU.svg")
    command.set_defaults(action=_render)


def _render(args: argparse.Namespace) -> int:
    file = args.output or Path(f"{args.unit}.svg")
    return output.show(args, document(args.source, args.unit, file), _text)


def _text(document: Document) -> str:
    return f"{document['unit']} is drawn in {document['file']}"


def document(source: Path, unit: str, file: Path) -> Document:
    """Draws a unit. Raises UsageError if it has no diagram."""
    from plctool.doc.drawn import body_of
    from plctool.doc.network import picture

    check_output(file, [source], f"{file.stem}.svg")
    body = body_of(source, unit)
    write_atomically(file, picture(f"{unit} ({body.tag})", body).encode())
    return {"unit": unit, "language": body.tag, "file": str(file)}
