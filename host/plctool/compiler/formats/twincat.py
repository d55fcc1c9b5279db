"""TwinCAT 3: units, lists and types in XML, and tasks.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re

from plctool.compiler.base.source import Source
from plctool.compiler.formats.element_names import element_names
from plctool.compiler.formats.plcopen_body import Body, NotTranslatedError, Unit
from plctool.compiler.formats.text import Findings, Text
from plctool.compiler.formats.tree_bodies import translate_networks
from plctool.compiler.formats.twincat_networks import read_networks
from plctool.compiler.formats.units import unit_keyword
from plctool.compiler.formats.xml_tree import Element, XmlError, read_xml
from plctool.iec.tasks import LOWEST_PRIORITY

_TEXT = frozenset(("ST", "STNonEdit"))
_MEMBERS = {"Method": "METHOD", "Property": "PROPERTY", "Action": "ACTION"}
_DRAWN = frozenset(("SFC", "LD", "FBD"))
_EXPORT = "export the project as PLCopen XML, of which SFC, LD and FBD are read"
REFUSED = "the diagram {} cannot be compiled: {}"


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


def drawn_bodies(text: str) -> dict[str, Element]:
    """Returns the bodies in LD and FBD of a file, by the name of the unit, or UNIT.MEMBER. Raises XmlError and
    NotTranslatedError."""
    found, next_id = dict[str, Element](), 1
    for unit in read_xml(text).all("POU"):
        for part in sorted([unit, *unit.all("Action"), *unit.all("Method", "Property")], key=_order_of_ids):
            for archive in [nwl for implementation in part.all("Implementation") for nwl in implementation.all("NWL")]:
                name = unit.get("Name") if part is unit else f"{unit.get('Name')}.{part.get('Name')}"
                elements = read_networks(archive, contacts=True, first=next_id)
                found[name], next_id = elements.body, elements.next_id
    return found


def _order_of_ids(part: Element) -> int:
    """The order in which bodies get their local ids: the unit, its actions, what is declared in it."""
    return {"POU": 0, "Action": 1}.get(part.tag, 2)


class _Object:
    def __init__(self, text: Text, findings: Findings) -> None:
        self._text = text
        self._findings = findings
        self._next_id = 1  # of its networks, so that no two need variables of the same name

    def read(self, part: Element) -> None:
        if part.tag == "Task":
            self._task(part)
        elif part.tag in ("POU", "Itf", "GVL", "DUT"):
            self._unit(part)

    def _unit(self, part: Element) -> None:
        declaration = part.child("Declaration")
        if declaration is None:
            return
        keyword = unit_keyword("".join(chunk.text for chunk in declaration.chunks))
        keeps = keyword in ("FUNCTION_BLOCK", "PROGRAM")
        body = self._networks(part, part.get("Name"), keeps=keeps)
        actions = {
            id(action): self._networks(action, f"{part.get('Name')}.{action.get('Name')}", keeps=keeps)
            for action in part.all("Action")
        }
        self._text.copied(declaration.chunks)
        self._text.made("\n", part.at)
        for drawn in (body, *actions.values()):
            drawn.write_variables(self._text)
        self._body(part, part.get("Name"), body)
        for member in part.all(*_MEMBERS):
            self._member(member, part.get("Name"), actions.get(id(member)))
        if part.tag in ("POU", "Itf"):
            self._text.made(f"\nEND_{keyword}\n", part.at)

    def _member(self, member: Element, owner: str, action: Body | None) -> None:
        keyword, name = _MEMBERS[member.tag], f"{owner}.{member.get('Name')}"
        self._text.made("\n", member.at)
        if action is not None:
            self._text.made(f"ACTION {member.get('Name')}:\n", member.at)
            self._body(member, name, action)
        else:
            self._declared_body(member, name)
        for accessor in member.all("Get", "Set"):
            self._accessor(accessor, f"{name}.{accessor.tag}")
        self._text.made(f"\nEND_{keyword}\n", member.at)

    def _accessor(self, accessor: Element, name: str) -> None:
        keyword = accessor.tag.upper()
        self._text.made(f"{keyword}\n", accessor.at)
        self._declared_body(accessor, name)
        self._text.made(f"\nEND_{keyword}\n", accessor.at)

    def _declared_body(self, part: Element, name: str) -> None:
        """Declaration and body of a method, property or accessor."""
        declaration = part.child("Declaration")
        chunks = [] if declaration is None else declaration.chunks
        body = self._networks(part, name, keeps=False)
        if declaration is not None:
            self._text.copied(chunks)
            self._text.made("\n", part.at)
        body.write_variables(self._text)
        self._body(part, name, body)

    def _networks(self, part: Element, name: str, *, keeps: bool) -> Body:
        """The statements of LD and FBD; none, and a finding, if they have no translation."""
        made = Body()
        for archive in [nwl for implementation in part.all("Implementation") for nwl in implementation.all("NWL")]:
            try:
                elements = read_networks(archive, first=self._next_id)
                self._next_id = elements.next_id
                self._text.named(element_names(name, elements.body))
                translate_networks(elements.body, Unit(name, keeps, {}), made)
            except NotTranslatedError as error:
                self._findings.add(error.at, "language", REFUSED.format(name, error))
                return Body()
        return made

    def _body(self, part: Element, name: str, drawn: Body) -> None:
        drawn.write(self._text)
        for implementation in part.all("Implementation"):
            for body in implementation.children:
                if body.tag in _TEXT:
                    self._text.copied(body.chunks)
                elif body.tag in _DRAWN:
                    self._findings.refuse(body.at, name, body.tag, _EXPORT)
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
