"""TwinCAT 3: units, lists and types in XML, and tasks.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re

from plctool.compiler.base.source import Source
from plctool.compiler.formats.text import Findings, Text
from plctool.compiler.formats.units import unit_keyword
from plctool.compiler.formats.xml_tree import Element, XmlError, read_xml
from plctool.iec.tasks import LOWEST_PRIORITY

_TEXT = frozenset(("ST", "STNonEdit"))
_MEMBERS = {"Method": "METHOD", "Property": "PROPERTY", "Action": "ACTION"}
_DRAWN = {"NWL": "LD, FBD or IL", "SFC": "SFC", "LD": "LD", "FBD": "FBD"}
_EXPORT = "export the project as PLCopen XML, of which SFC, LD and FBD are read"


def read_object(path: str, text: str) -> Source:
    """A .TcPOU, .TcGVL, .TcDUT, .TcIO or .TcTTO as Structured Text, with the END_... that are not written there."""
    findings, made, name = Findings(), Text(), ""
    try:
        reader = _Object(made, findings)
        for part in read_xml(text).children:
            reader.read(part)
            name = part.get("Name") if part.tag == "GVL" else name
    except XmlError as error:
        findings.add(error.at, "xml", str(error))
    return made.source(path, text, name=name, findings=findings.all)


class _Object:
    def __init__(self, text: Text, findings: Findings) -> None:
        self._text = text
        self._findings = findings

    def read(self, part: Element) -> None:
        if part.tag == "Task":
            self._task(part)
        elif part.tag in ("POU", "Itf", "GVL", "DUT"):
            self._unit(part)

    def _unit(self, part: Element) -> None:
        declaration = part.child("Declaration")
        if declaration is None:
            return
        self._text.copied(declaration.chunks)
        self._text.made("\n", part.at)
        self._body(part, part.get("Name"))
        for member in part.all(*_MEMBERS):
            self._member(member, part.get("Name"))
        if part.tag in ("POU", "Itf"):
            keyword = unit_keyword("".join(chunk.text for chunk in declaration.chunks))
            self._text.made(f"\nEND_{keyword}\n", part.at)

    def _member(self, member: Element, owner: str) -> None:
        keyword, name = _MEMBERS[member.tag], f"{owner}.{member.get('Name')}"
        declaration = member.child("Declaration")
        self._text.made("\n", member.at)
        if member.tag == "Action":
            self._text.made(f"ACTION {member.get('Name')}:\n", member.at)
        elif declaration is not None:
            self._text.copied(declaration.chunks)
            self._text.made("\n", member.at)
        self._body(member, name)
        for accessor in member.all("Get", "Set"):
            self._accessor(accessor, f"{name}.{accessor.tag}")
        self._text.made(f"\nEND_{keyword}\n", member.at)

    def _accessor(self, accessor: Element, name: str) -> None:
        keyword = accessor.tag.upper()
        self._text.made(f"{keyword}\n", accessor.at)
        declaration = accessor.child("Declaration")
        if declaration is not None:
            self._text.copied(declaration.chunks)
            self._text.made("\n", accessor.at)
        self._body(accessor, name)
        self._text.made(f"\nEND_{keyword}\n", accessor.at)

    def _body(self, part: Element, name: str) -> None:
        for implementation in part.all("Implementation"):
            for body in implementation.children:
                if body.tag in _TEXT:
                    self._text.copied(body.chunks)
                elif body.tag in _DRAWN:
                    self._findings.refuse(body.at, name, _DRAWN[body.tag], _EXPORT)
                elif body.tag in ("CFC", "UML", "IL"):
                    self._findings.refuse(body.at, name, body.tag)

    def _task(self, task: Element) -> None:
        """Becomes a CONFIGURATION, because that is what tasks are in."""
        cycle, priority = task.child("CycleTime"), task.child("Priority")
        calls = [called for call in task.all("PouCall") if (called := call.child("Name")) is not None]
        properties = []
        if cycle is not None and cycle.text.isdecimal() and int(cycle.text):
            properties.append(f"INTERVAL := LTIME#{int(cycle.text)}us")
        if priority is not None and priority.text.isdecimal():
            properties.append(f"PRIORITY := {min(int(priority.text), LOWEST_PRIORITY)}")
        name = identifier(task.get("Name"))
        programs = [c for c in calls if re.fullmatch(r"\w+", c.text)]
        if not programs:
            return  # visualisations only
        self._text.made(f"CONFIGURATION {name}_Configuration\nTASK {name}({', '.join(properties)});\n", task.at)
        for call in programs:
            self._text.made(f"PROGRAM {call.text} WITH {name} : {call.text};\n", call.at)
        self._text.made("END_CONFIGURATION\n", task.at)


def identifier(name: str) -> str:
    """A name of the system, which may hold blanks, as one that the language has."""
    found = re.sub(r"\W", "_", name)
    return found if found and not found[0].isdecimal() else f"_{found}"
