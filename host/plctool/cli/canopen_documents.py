"""What the actions of `plctool canopen` return, as `--json` prints it, and how users read it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from plctool.errors import counted

if TYPE_CHECKING:
    from plctool.io.canopen.eds import Eds

Document = dict[str, Any]


# ---- files -----------------------------------------------------------------------------------------------------------


def check(path: Path) -> tuple[Document, list[str]]:
    """Every diagnostic of an EDS or DCF, also as users read them, and what the file describes."""
    from plctool.compiler.diagnostics import Diagnostic, render_all
    from plctool.compiler.source import Source
    from plctool.io.canopen.eds import load_eds

    eds = load_eds(path)
    found = [Diagnostic(m.pos.file, m.pos.line, m.pos.column, m.severity, "eds", m.message) for m in eds.findings.found]
    document = {
        "file": eds.file,
        "diagnostics": [{name: value for name, value in vars(d).items() if name != "missing"} for d in found],
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
    name = " ".join(filter(None, (device["vendor_name"], device["product_name"]))) or "a device without a name"
    numbers = [counted(document["objects"], "object"), f"{document['rpdos']} RPDOs", f"{document['tpdos']} TPDOs"]
    more = f"; {document['more_diagnostics']} more are not shown" if document["more_diagnostics"] else ""
    return f"{document['file']}: {name}, {', '.join(numbers)}; {', '.join(counts)}{more}"
