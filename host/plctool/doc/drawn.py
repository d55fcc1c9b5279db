"""The bodies of PLCopen XML that are diagrams, by the name of their unit.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from pathlib import Path

from plctool.compiler.formats.xml_tree import Element, XmlError, read_xml
from plctool.compiler.sources.source_files import decode
from plctool.compiler.syntax.diagnostics import did_you_mean
from plctool.errors import UsageError
from plctool.files import MAX_TEXT, read_regular

DRAWN = ("LD", "FBD", "CFC")


def body_of(file: Path, name: str) -> Element:
    """Returns the diagram of a unit, or of an action or method as UNIT.NAME. Raises UsageError if there is none."""
    try:
        root = read_xml(decode(read_regular(file, MAX_TEXT)))
    except XmlError as error:
        raise UsageError(f"{file}:{error.at.line}: {error}. Give a PLCopen XML file.", "xml") from None
    bodies = {key: body for pou in root.every("pou") for key, body in _bodies(pou)}
    wanted = name.casefold()
    found = next((body for key, body in bodies.items() if key.casefold() == wanted), None)
    if found is None:
        raise UsageError(f"{file} has no unit {name}{did_you_mean(name, bodies) or _listed(bodies)}", "unknown")
    drawn = next((e for e in found.every(*DRAWN)), None)
    if drawn is None:
        kind = next((e.tag for e in found.children if e.tag != "addData"), "nothing")
        raise UsageError(f"{name} is written in {kind}; only LD, FBD and CFC are drawn.", "no-diagram")
    return drawn


def _listed(names: dict[str, Element]) -> str:
    return f"; it has {', '.join(list(names)[:10])}." if names else "; it has none."


def _bodies(pou: Element) -> list[tuple[str, Element]]:
    name = pou.get("name")
    inner = [*pou.every("action"), *pou.every("Method", "Action")]
    parts = [(f"{name}.{e.get('name')}", e) for e in inner if e.get("name")]
    return [(key, body) for key, e in [(name, pou), *parts] for body in e.all("body")[:1]]
