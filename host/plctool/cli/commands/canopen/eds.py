"""`plctool canopen check` and `eds`: diagnostics of an EDS or DCF, and the EDS of this PLC."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

from plctool.cli import output
from plctool.cli.arguments import add_image
from plctool.cli.builds import image_of
from plctool.cli.documents import Document, diagnostic_document
from plctool.cli.output import EXIT_OK, EXIT_USAGE
from plctool.cli.parser import Parser
from plctool.errors import counted
from plctool.files import usable_path, write_atomically
from plctool.io.canopen.eds import Eds, load_eds


def add_check(action: Callable[..., Parser]) -> None:
    check = action("check", "print every diagnostic of an EDS or DCF", _check)
    check.add_argument("eds", type=usable_path, metavar="FILE.eds|.dcf")


def _check(args: argparse.Namespace) -> int:
    document, texts = check(args.eds)
    output.show(args, document, lambda d: "\n".join([*texts, check_text(d)]), colours=True)
    return EXIT_USAGE if any(d["severity"] == "error" for d in document["diagnostics"]) else EXIT_OK


def add_eds_of_image(action: Callable[..., Parser]) -> None:
    eds = action("eds", "write the EDS of a program that makes this PLC a CANopen device", _eds)
    add_image(eds)
    eds.add_argument(
        "-o", "--output", type=usable_path, metavar="FILE.eds", help="default: beside the image, with its name"
    )


def _eds(args: argparse.Namespace) -> int:
    return output.show(args, write_eds(image_of(args), args.output), lambda d: f"{d['eds']} written")


def write_eds(path: Path, to: Path | None) -> Document:
    """Writes the EDS of an image."""
    from plctool.debug.symbols import find_symbols
    from plctool.image.file import describe_image, parse_image, read_program
    from plctool.io.canopen.eds_of_image import eds_of_image

    program = read_program(path)
    symbols = find_symbols(int(describe_image(program)["crc"], 16), path)
    to = path.with_suffix(".eds") if to is None else to
    text = eds_of_image(parse_image(program), symbols.io.get("channels", []), to.name)
    write_atomically(to, text.encode("ascii", "replace"))
    return {"eds": str(to)}


def check(path: Path) -> tuple[Document, list[str]]:
    """Every diagnostic of an EDS or DCF, also as users read them, and what the file describes."""
    from plctool.compiler.base.source import Source
    from plctool.compiler.syntax.diagnostics import Diagnostic, render_all

    eds = load_eds(path)
    found = [Diagnostic(m.pos.file, m.pos.line, m.pos.column, m.severity, "eds", m.message) for m in eds.findings.found]
    document = {
        "file": eds.file,
        "diagnostics": [diagnostic_document(d) for d in found],
        "more_diagnostics": eds.more_findings,
        **_contents(eds),
    }
    return document, render_all(found, [Source(eds.file, eds.text)])


def _contents(eds: Eds) -> Document:
    commissioning = eds.commissioning
    return {
        "device": vars(eds.device),
        "commissioning": None if commissioning is None else vars(commissioning),
        "objects": len(eds.objects),
        "rpdos": len(eds.pdos(0x1400)),
        "tpdos": len(eds.pdos(0x1800)),
    }


def check_text(document: Document) -> str:
    """One line: what the file describes, and how many doubts there are."""
    device = document["device"]
    severities = [d["severity"] for d in document["diagnostics"]]
    counts = [counted(severities.count(s), s) for s in ("error", "warning")]
    title = " ".join(filter(None, (device["vendor_name"], device["product_name"]))) or "a device without a name"
    kinds = (("objects", "object"), ("rpdos", "RPDO"), ("tpdos", "TPDO"))
    numbers = [counted(document[key], name) for key, name in kinds]
    more = f"; {document['more_diagnostics']} more are not shown" if document["more_diagnostics"] else ""
    return f"{document['file']}: {title}, {', '.join(numbers)}; {', '.join(counts)}{more}"
