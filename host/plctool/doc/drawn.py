"""The bodies of a program that are diagrams, by the name of their unit.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from plctool.compiler import load_sources
from plctool.compiler.base.source import Source
from plctool.compiler.formats import codesys2, twincat
from plctool.compiler.formats.plcopen import is_project
from plctool.compiler.formats.plcopen_body import NotTranslatedError
from plctool.compiler.formats.xml_tree import Element, XmlError, read_xml
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import did_you_mean
from plctool.compiler.syntax.parser import parse
from plctool.errors import UsageError

DRAWN = ("LD", "FBD", "CFC")
_HAS_STEPS = re.compile(r"\bINITIAL_STEP\b", re.IGNORECASE)
_PRIORITY = re.compile(r"\(\s*PRIORITY\s*:=\s*\d+\s*\)", re.IGNORECASE)
_CONDITION = re.compile(r":=(.*?);?\s*(?:\bEND_TRANSITION\b|\Z)", re.IGNORECASE | re.DOTALL)


@dataclass(frozen=True)
class ChartBody:
    """A Sequential Function Chart; `conditions`: those of its transitions, as written."""

    chart: ast.Chart
    conditions: tuple[str, ...]


@dataclass(frozen=True)
class Diagram:
    """The diagram of a unit, or of an action or method as UNIT.NAME. `body`: its networks or its chart."""

    name: str
    body: Element | ChartBody

    @property
    def language(self) -> str:
        """LD, FBD, CFC or SFC."""
        return self.body.tag if isinstance(self.body, Element) else "SFC"


def diagram_of(path: Path, name: str) -> Diagram:
    """Returns the diagram of a unit in a file, folder or project. Raises UsageError if there is none."""
    sources = load_sources([path])
    found = diagrams(sources)
    drawn = next((d for key, d in found.items() if key.casefold() == name.casefold()), None)
    if drawn is not None:
        return drawn
    for source in sources:
        for finding in source.findings:
            if finding.code in ("xml", "language") and (finding.code == "xml" or f" {name} " in f" {finding.message} "):
                raise UsageError(f"{source.path}:{finding.line}: {finding.message}.", "no-diagram")
    units = [unit.name for source in sources for unit in _units(source)]
    if name.casefold() in {unit.casefold() for unit in units}:
        raise UsageError(f"{name} is text; LD, FBD, CFC and SFC are drawn.", "no-diagram")
    meant = did_you_mean(name, found) or (f"; it has {', '.join(list(found)[:10])}." if found else "; it has none.")
    raise UsageError(f"{path} has no diagram {name}{meant}", "unknown")


def diagrams(sources: Sequence[Source]) -> dict[str, Diagram]:
    """Returns all diagrams of a program, by name; those that cannot be read are left out."""
    found: dict[str, Diagram] = {}
    seen: set[str] = set()
    for source in sources:
        for name, body in _networks(source).items() if source.path not in seen else ():
            found[name] = Diagram(name, body)
        seen.add(source.path)
        for unit in _units(source) if _HAS_STEPS.search(source.text) else ():
            if unit.chart is not None:
                found[unit.name] = Diagram(unit.name, _chart(unit.chart, source.text))
    return found


def _units(source: Source) -> list[ast.PouDecl]:
    return [u for u in parse(source, lambda offset, code, message: None) if isinstance(u, ast.PouDecl)]


def _chart(chart: ast.Chart, text: str) -> ChartBody:
    ends = [*(t.pos for t in chart.transitions[1:]), len(text)]
    written = [_PRIORITY.sub("", text[t.pos : end]) for t, end in zip(chart.transitions, ends, strict=False)]
    found = [_CONDITION.search(part) for part in written]
    return ChartBody(chart, tuple("" if m is None else " ".join(m[1].split()).rstrip("; ") for m in found))


def _networks(source: Source) -> dict[str, Element]:
    text, suffix = source.original or source.text, Path(source.path).suffix.lower()
    try:
        if suffix == ".xml" and is_project(text):
            return {key: body for pou in read_xml(text).every("pou") for key, body in _bodies(pou)}
        if suffix == ".tcpou":
            return twincat.drawn_bodies(text)
        if suffix == ".exp":
            return codesys2.drawn_bodies(source.path, text)
    except (XmlError, NotTranslatedError):
        pass  # is among the findings of the source
    return {}


def _bodies(pou: Element) -> list[tuple[str, Element]]:
    name = pou.get("name")
    inner = [*pou.every("action"), *pou.every("Method", "Action")]
    parts = [(f"{name}.{e.get('name')}", e) for e in inner if e.get("name")]
    bodies = [(key, body) for key, e in [(name, pou), *parts] for body in e.all("body")[:1]]
    return [(key, drawn) for key, body in bodies if (drawn := next(body.every(*DRAWN), None)) is not None]
