"""PLCopen XML (TC6, IEC 61131-10): whole projects, as CODESYS 3, TwinCAT, OpenPLC Editor and Beremiz write them.

Declarations, types, globals, tasks and bodies become one text; a named list of globals is a source of its own. The
additions of CODESYS are read: methods, properties, interfaces, attributes, declarations as plain text. A body that has
no translation is named, and its unit stays, empty, so that all others are checked.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re

from plctool.compiler.base.source import Source
from plctool.compiler.formats import instruction_list
from plctool.compiler.formats import plcopen_types as types
from plctool.compiler.formats.element_names import element_names
from plctool.compiler.formats.plcopen_body import Body, NotTranslatedError, Unit
from plctool.compiler.formats.plcopen_chart import Chart
from plctool.compiler.formats.plcopen_graph import Network
from plctool.compiler.formats.plcopen_tasks import write_configuration
from plctool.compiler.formats.text import Chunk, Findings, Text
from plctool.compiler.formats.units import UNITS, tokens_of
from plctool.compiler.formats.xml_tree import Element, XmlError, read_xml

_KEYWORDS = {"function": "FUNCTION", "functionblock": "FUNCTION_BLOCK", "program": "PROGRAM", "interface": "INTERFACE"}
_MODIFIERS = ("Abstract", "Final", "Internal", "Private", "Protected", "Public")
_NAMESPACE = re.compile(r"plcopen\.org/xml/tc6|iec61131-10", re.IGNORECASE)
HEAD = 4096  # bytes in which the name space of a project stands


def is_project(text: str) -> bool:
    """Whether an XML file seems to be a project."""
    return _NAMESPACE.search(text, 0, HEAD) is not None


def read_project(path: str, text: str) -> list[Source]:
    """What a file holds."""
    findings = Findings()
    try:
        root = read_xml(text)
    except XmlError as error:
        findings.add(error.at, "xml", str(error))
        return [Text().source(path, text, findings=findings.all)]
    if root.tag != "project":
        message = f"<{root.tag}> is not PLCopen XML; in CODESYS and TwinCAT, export with Project, Export PLCopenXML"
        findings.add(root.at, "xml", message)
        return [Text().source(path, text, findings=findings.all)]
    project = _Project(findings)
    project.read(root)
    lists = [made.source(path, text, name=name, shared=name in project.shared) for name, made in project.lists.items()]
    files = [_source_text(element).source(path, text, name=element.get("name")) for element in _files(root)]
    return [project.text.source(path, text, findings=findings.all), *lists, *files]


def _files(root: Element) -> list[Element]:
    """The files that stand in a project as they are."""
    return [file for data in root.child_data("sourcetext") for file in data.all("SourceText")]


def _source_text(element: Element) -> Text:
    made = Text()
    made.copied(chunk for text in element.children for chunk in text.every_chunk())
    return made


class _Project:
    def __init__(self, findings: Findings) -> None:
        self.text = Text()
        self.lists: dict[str, Text] = {}
        self.shared: set[str] = set()  # those of files that have more than globals
        self._findings = findings
        self._results: dict[str, bool] = {}  # as in Unit
        self._programs: list[Element] = []

    def read(self, root: Element) -> None:
        for pou in root.every("pou"):
            self._results[pou.get("name").casefold()] = pou.child("interface", "returnType") is not None
        self._walk(root)
        for configuration in _configurations(root):
            plain = plain_text(configuration)
            if _begins_with(plain, {"CONFIGURATION"}):
                self.text.copied(plain)
                self.text.made("\n", configuration.at)
            else:
                write_configuration(self.text, configuration, self._findings)

    def _walk(self, element: Element) -> None:
        for child in element.children:
            if child.tag in ("dataType", "union"):
                self._data_type(child)
            elif child.tag in ("pou", "Interface"):
                self._unit(child)
            elif child.tag == "globalVars" and child.get("name"):
                self._global_list(child)
            elif child.tag not in ("configuration", "task", "globalVars") or child.tag == "configuration":
                self._walk(child)

    # ---- types and globals ----

    def _data_type(self, element: Element) -> None:
        plain = plain_text(element)
        if _begins_with(plain, {"TYPE"}):
            self.text.copied(plain)
            self.text.made("\n", element.at)
            return
        spec = types.union(element) if element.tag == "union" else types.type_of(element.child("baseType"))
        value = types.value_of(element.child("initialValue"))
        base = next((f" EXTENDS {e.text}" for data in element.all("addData") for e in data.every("Extends")), "")
        declared = f"{element.get('name')}{base} : {spec}{f' := {value}' if value else ''}"
        self.text.made(f"{types.attributes(element)}TYPE {declared}; END_TYPE\n", element.at)

    def _global_list(self, element: Element) -> None:
        made = self.lists.setdefault(element.get("name"), Text())
        if element.child_data("sharedlist"):
            self.shared.add(element.get("name"))
        plain = plain_text(element)
        if _begins_with(plain, {"GLOBAL", "CONFIG"}):
            made.copied(plain)
            made.made("\n", element.at)
        else:
            made.made(types.attributes(element), element.at)
            types.block(made, element)

    # ---- units ----

    def _unit(self, pou: Element) -> None:
        keyword = "INTERFACE" if pou.tag == "Interface" else _KEYWORDS.get(pou.get("pouType").lower(), "")
        if not keyword:
            message = f"{pou.get('name')} is a {pou.get('pouType') or 'unit without a kind'}, which is not known"
            self._findings.add(pou.at, "xml", message)
            return
        name = pou.get("name")
        unit = self._surroundings(pou, name, keeps=keyword in ("FUNCTION_BLOCK", "PROGRAM"))
        body = self._body(pou, unit)
        self._header(pou, keyword, UNITS)
        body.write_variables(self.text)
        body.write(self.text)
        self.text.made("\n", pou.at)
        self._inner_actions(body)
        self._members(pou, unit)
        self.text.made(f"END_{keyword}\n", pou.at)

    def _surroundings(self, pou: Element, name: str, *, keeps: bool) -> Unit:
        transitions = {t.get("name").casefold(): t for part in pou.all("transitions") for t in part.all("transition")}
        actions = frozenset(a.get("name").casefold() for part in pou.all("actions") for a in part.all("action"))
        return Unit(name, keeps, self._results, transitions, actions)

    def _header(self, element: Element, keyword: str, openings: frozenset[str]) -> None:
        """Declaration and variables."""
        plain = plain_text(element)
        if _begins_with(plain, openings):
            self.text.copied(plain)
            self.text.made("\n", element.at)
            return
        interface = element.child("interface") or Element("interface", {}, element.at)
        words = [m.upper() for a in interface.every("AccessModifiers") for m in _MODIFIERS if a.get(m) == "true"]
        bases = [e.text for e in interface.every("Extends") if e.text]
        implemented = [e.text for e in interface.every("Implements") if e.text]
        result = types.type_of(interface.child("returnType"))
        declared = " ".join([keyword, *words, element.get("name")])
        declared += f" EXTENDS {', '.join(bases)}" * bool(bases)
        declared += f" IMPLEMENTS {', '.join(implemented)}" * bool(implemented)
        declared += f" : {result}" * bool(result)
        pragmas = types.attributes(element) + types.attributes(interface)
        self.text.made(f"{pragmas}{declared}\n", element.at)
        types.blocks(self.text, interface)

    def _members(self, pou: Element, unit: Unit) -> None:
        for action in [a for part in pou.all("actions") for a in part.all("action")]:
            self._action(action, unit)
        for part in [*pou.all("addData"), *pou.all("Methods", "Properties")]:
            for member in part.every("Method", "Property", "Action"):
                if member.tag == "Method":
                    self._method(member, unit.name)
                elif member.tag == "Property":
                    self._property(member, unit.name)
                else:
                    self._action(member, unit)

    def _action(self, action: Element, unit: Unit) -> None:
        name = action.get("name")
        body = self._body(action, unit, f"{unit.name}.{name}")
        for variable, (spec, at) in body.all_variables().items():
            self._findings.add(at, "language", _REFUSED.format(f"{unit.name}.{name}", f"it needs {variable} : {spec}"))
        for inner, _, at in body.actions:
            message = f"its chart needs the action {inner}; move the chart into a POU"
            self._findings.add(at, "language", _REFUSED.format(f"{unit.name}.{name}", message))
        plain = plain_text(action)
        if _begins_with(plain, {"ACTION"}):
            self.text.copied(plain)
            self.text.made("\n", action.at)
        else:
            self.text.made(f"ACTION {name}:\n", action.at)
        if not body.variables and not body.actions:
            body.write(self.text)
        self.text.made("\nEND_ACTION\n", action.at)

    def _inner_actions(self, body: Body) -> None:
        for name, inner, at in body.actions:
            self.text.made(f"ACTION {name}:\n", at)
            inner.write(self.text)
            self.text.made("\nEND_ACTION\n", at)

    def _method(self, method: Element, owner: str) -> None:
        unit = self._surroundings(method, f"{owner}.{method.get('name')}", keeps=False)
        body = self._body(method, unit)
        self._header(method, "METHOD", frozenset(("METHOD",)))
        body.write_variables(self.text)
        body.write(self.text)
        self.text.made("\nEND_METHOD\n", method.at)

    def _property(self, element: Element, owner: str) -> None:
        name = f"{owner}.{element.get('name')}"
        self._header(element, "PROPERTY", frozenset(("PROPERTY",)))
        for tag, keyword in (("GetAccessor", "GET"), ("SetAccessor", "SET")):
            for accessor in element.all(tag):
                unit = self._surroundings(accessor, f"{name}.{keyword}", keeps=False)
                body = self._body(accessor, unit)
                self.text.made(f"{keyword}\n", accessor.at)
                plain = plain_text(accessor)
                if plain:
                    self.text.copied(plain)
                    self.text.made("\n", accessor.at)
                else:
                    types.blocks(self.text, accessor.child("interface") or Element("interface", {}, accessor.at))
                body.write_variables(self.text)
                body.write(self.text)
                self.text.made(f"\nEND_{keyword}\n", accessor.at)
        self.text.made("END_PROPERTY\n", element.at)

    # ---- bodies ----

    def _body(self, element: Element, unit: Unit, name: str = "") -> Body:
        """The statements of a body; none, and a finding, when it has no translation."""
        body = Body()
        name = name or unit.name
        for part in element.all("body"):
            drawn = next(part.every("CFC"), None)
            for written in [drawn] if drawn is not None else part.children:
                if written.tag in _DRAWN:
                    self.text.named(element_names(name, written))
                try:
                    _translate(written, unit, body)
                except NotTranslatedError as error:
                    message = str(error) if written.tag == "IL" else _REFUSED.format(f"{name} ({written.tag})", error)
                    self._findings.add(error.at, "language", message)
                    return Body()
                except RecursionError:
                    self._findings.add(
                        written.at, "language", _REFUSED.format(f"{name} ({written.tag})", "it is too deep")
                    )
                    return Body()
        return body


_DRAWN = frozenset(("FBD", "LD", "CFC", "SFC"))
_REFUSED = "the diagram {} cannot be compiled: {}"


def _translate(written: Element, unit: Unit, body: Body) -> None:
    if written.tag == "ST":
        body.parts += written.every_chunk()
    elif written.tag in ("FBD", "LD", "CFC"):
        Network(written, unit, body, free=written.tag == "CFC").translate()
    elif written.tag == "SFC":
        Chart(written, unit, body).translate()
    elif written.tag == "IL":
        instruction_list.translate(written.every_chunk(), body)


def plain_text(element: Element) -> list[Chunk]:
    """The declaration as text, where an export has it."""
    direct = element.child("InterfaceAsPlainText")
    added = [e for e in (element, element.child("interface")) if e is not None]
    found = [direct] if direct is not None else [
        text for e in added for data in e.child_data("interfaceasplaintext") for text in data.children
    ]  # fmt: skip
    return [chunk for text in found for chunk in text.every_chunk()]


def _begins_with(chunks: list[Chunk], openings: set[str] | frozenset[str]) -> bool:
    """Whether a plain text is the declaration, and not only a list of variables."""
    return bool(chunks) and next(tokens_of("".join(chunk.text for chunk in chunks))).type in openings


def _configurations(root: Element) -> list[Element]:
    """Where tasks are: the configurations of the standard, or an application of CODESYS."""
    inside = ("task", "pouInstance", "globalVars", "InterfaceAsPlainText")
    found = [e for e in root.every("configuration") if any(True for _ in e.every(*inside))]
    return found or [e for e in root.every("resource") if any(True for _ in e.every("task"))]
