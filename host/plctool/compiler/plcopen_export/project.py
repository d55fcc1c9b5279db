"""PLCopen XML (TC6 2.01) out: a whole program as one file that CODESYS, TwinCAT, OpenPLC Editor and Beremiz read.

Every declaration is there twice: in the elements of the standard, and as plain text in an addition of CODESYS, which
keeps comments, pragmas and what the standard has no element for. Readers that know the addition take the text. Methods,
properties and interfaces are additions of CODESYS. A file with something that has no place at all is an addition of our
own, as it is, which no other system reads; nothing is left out without a word.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Literal
from xml.etree import ElementTree

from plctool.compiler.base.source import Source
from plctool.compiler.plcopen_export.chart import ChartWriter
from plctool.compiler.plcopen_export.declarations import Declarations
from plctool.compiler.plcopen_export.elements import (
    TC6,
    Xml,
    attributes,
    child,
    data,
    documentation,
    plain,
    shared_list,
    source_text,
    text_in,
)
from plctool.compiler.plcopen_export.outline import UNITS, Outline, Part, outline, type_end
from plctool.compiler.syntax.diagnostics import Diagnostic
from plctool.compiler.syntax.lexer import Lexer, Token
from plctool.compiler.typed.nodes import Pos
from plctool.iec.tasks import LOWEST_PRIORITY
from plctool.version import plctool_version

_KINDS = {"FUNCTION": "function", "FUNCTION_BLOCK": "functionBlock", "PROGRAM": "program"}
_MEMBERS = frozenset(("METHOD", "PROPERTY", "PROPERTY_GET", "PROPERTY_SET", "ACTION"))
_TESTS = frozenset(("TEST", "SETUP", "TEARDOWN"))
_UNWRITABLE = re.compile("[^\t\n\r -\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_DEFINES = re.compile(r"\{\s*(?:un)?define\b", re.IGNORECASE)
_NO_PLACE = {
    "NAMESPACE": ("namespaces", "make a library of its own of it, or take its units out of it"),
    "USING": ("namespaces", "write the whole names"),
    "CLASS": ("CLASS", "write FUNCTION_BLOCK"),
    "ACCESS": ("VAR_ACCESS by itself", "put it into a PROGRAM or the CONFIGURATION"),
}


@dataclass
class Written:
    """`text`: the file, without a meaning when there are errors among the `diagnostics`."""

    text: str
    diagnostics: list[Diagnostic] = field(default_factory=list)

    @property
    def ok(self) -> bool:
        """Whether everything has its place."""
        return not any(d.severity == "error" for d in self.diagnostics)


def write_project(sources: Sequence[Source], name: str, declared: frozenset[str], seconds: int = 0) -> Written:
    """A program without errors as PLCopen XML. `declared`: what {IF defined(pou: NAME)} finds; `seconds`: when it was
    written, since 1970."""
    project = _Project(name, declared, seconds)
    as_text = project.write(sources, {})
    if as_text:
        project = _Project(name, declared, seconds)
        project.write(sources, as_text)
    ElementTree.indent(project.root)
    text = ElementTree.tostring(project.root, "unicode")
    return Written(f'<?xml version="1.0" encoding="utf-8"?>\n{text}\n', project.diagnostics)


class _Project:
    """The elements that hold units, types and lists."""

    def __init__(self, name: str, declared: frozenset[str], seconds: int) -> None:
        self.declared = declared
        self.diagnostics: list[Diagnostic] = []
        self.root = ElementTree.Element("project", {"xmlns": TC6})
        at = datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%dT%H:%M:%S")
        maker = {"companyName": "", "productName": "plctool", "productVersion": plctool_version()}
        child(self.root, "fileHeader", **maker, creationDateTime=at)
        content = child(self.root, "contentHeader", name=name)
        scales = child(content, "coordinateInfo")
        for language in ("fbd", "ld", "sfc"):
            child(child(scales, language), "scaling", x="1", y="1")
        types = child(self.root, "types")
        self.types = child(types, "dataTypes")
        self.pous = child(types, "pous")
        self.configurations = child(child(self.root, "instances"), "configurations")
        self.lists: list[Xml] = []  # of globals, until there is a resource for them

    def write(self, sources: Sequence[Source], as_text: Mapping[int, list[Diagnostic]]) -> dict[int, list[Diagnostic]]:
        """All files; the result says which have something without a place, by their index. `as_text`: the same, of
        those that are written as they are."""
        without_place: dict[int, list[Diagnostic]] = {}
        for index, source in enumerate(sources):
            self._look_at_characters(source)
            if index in as_text:
                self.diagnostics += as_text[index]
                source_text(self.root, source.stem, source.text)
            elif reasons := _File(self, source).write():
                without_place[index] = reasons
        self._place_lists()
        return without_place

    def say(self, pos: Pos, severity: Literal["error", "warning"], code: str, message: str) -> None:
        """What a user should know."""
        found = Diagnostic(pos.file, pos.line, pos.column, severity, code, message)
        if found not in self.diagnostics:
            self.diagnostics.append(found)

    def _look_at_characters(self, source: Source) -> None:
        for match in _UNWRITABLE.finditer(source.text):
            message = f"XML has no character {ord(match.group())}; write it as $xx in a string"
            self.say(source.pos(match.start()), "error", "format", message)

    def _place_lists(self) -> None:
        """Puts lists of globals where the standard has them: into a resource."""
        if not self.lists:
            return
        resource = self.configurations.find("configuration/resource")
        if resource is None:
            resource = child(child(self.configurations, "configuration", name="Config"), "resource", name="Resource")
        at = next((i for i, e in enumerate(resource) if e.tag not in ("task", "globalVars")), len(resource))
        resource[at:at] = self.lists


class _File:
    """One source."""

    def __init__(self, project: _Project, source: Source) -> None:
        self._project = project
        self._source = source
        self._outline: Outline = outline(source, project.declared)
        self._declarations = Declarations(source.text, self._outline.attributes, self._only_text)
        self._last: tuple[Xml, Part] | None = None  # the unit that members without one belong to
        self._without_place: list[Diagnostic] = []

    def write(self) -> list[Diagnostic]:
        """All that it holds; the result names what has no place."""
        text = self._source.text
        for match in _DEFINES.finditer(text):
            self._no_place(match.start(), "order in which a definition holds", "write out what is meant")
        comment = self._outline.rest.strip()
        if comment:
            self._balanced(self._outline.rest, len(text) - len(self._outline.rest))
        for part in self._outline.parts:
            self._part(part)
        tests = [part for part in self._outline.parts if part.kind in _TESTS]
        if tests:
            message = f"PLCopen XML has no place for unit tests: those in this file are left out ({len(tests)})"
            self._project.say(self._source.pos(tests[0].pos), "warning", "left-out", message)
        if comment and self._project.pous.findall("pou"):
            documentation(self._project.pous.findall("pou")[-1], comment)
        elif comment:
            documentation(self._project.root, comment)
        return self._without_place

    def _no_place(self, offset: int, lacks: str, hint: str) -> None:
        """`lacks`: what PLCopen XML has not; `hint`: what to write for other systems."""
        pos = self._source.pos(offset)
        message = f"PLCopen XML has no {lacks}: it holds this file as text, which only plctool reads; otherwise {hint}"
        if all(message != reason.message for reason in self._without_place):
            self._without_place.append(Diagnostic(pos.file, pos.line, pos.column, "warning", "left-out", message))

    def _only_text(self, offset: int, what: str) -> None:
        message = (
            f"{what} is in the plain text only, which CODESYS and TwinCAT read; for other systems write it otherwise"
        )
        self._project.say(self._source.pos(offset), "warning", "left-out", message)

    def _balanced(self, text: str, offset: int) -> str:
        """The text, which may be read by itself: no conditional pragma begins or ends elsewhere."""
        said: list[str] = []
        for _ in Lexer(text, lambda _at, code, _message: said.append(code), 0, None, self._project.declared):
            pass
        if "pragma" in said:
            self._no_place(
                offset, "place for a condition around several declarations or bodies", "write one around each"
            )
        return text

    # ---- what stands for itself ----

    def _part(self, part: Part) -> None:
        if part.kind in UNITS:
            self._unit(part)
        elif part.kind in _MEMBERS:
            if self._last is not None:
                self._member(*self._last, part)
        elif part.kind == "TYPE":
            self._types(part)
        elif part.kind in ("GLOBAL", "CONFIG"):
            self._globals(part)
        elif part.kind == "CONFIGURATION":
            self._configuration(part)
        elif part.kind not in _TESTS:
            self._no_place(part.pos, *_NO_PLACE[part.kind])

    def _types(self, part: Part) -> None:
        tokens = part.tokens[1:-1]
        start, end, gap = 0, part.tokens[0].end, part.gap
        common = self._outline.attributes.get(part.pos, {})
        while start < len(tokens):
            stop = _type_stop(tokens, start)
            text = self._source.text[end : tokens[stop - 1].end]
            self._type(tokens[start:stop], f"{gap}TYPE{text}", part, common)
            gap = "".join(_pragma(*found) for found in common.items())
            start, end = stop, tokens[stop - 1].end

    def _type(self, tokens: list[Token], text: str, part: Part, common: dict[str, str]) -> None:
        """One type. `text` begins with TYPE; `common`: attributes of all types of a TYPE."""
        at = next(i for i, t in enumerate(tokens) if t.type == "IDENT")
        written = child(self._project.types, "dataType", name=tokens[at].text)
        colon = next(i for i, t in enumerate(tokens) if t.type == "_COLON")
        end = type_end(tokens, colon + 1)
        self._declarations.type(child(written, "baseType"), tokens[colon + 1 : end])
        if end < len(tokens) and tokens[end].type == "_ASSIGN":
            value = tokens[end + 1 :]
            value = value[:-1] if value[-1].type == "_SEMI" else value
            self._declarations.value(child(written, "initialValue"), value)
        attributes(written, {**common, **self._outline.attributes.get(tokens[0].pos, {})})
        if tokens[at + 1].type == "_EXTENDS":
            base = self._declarations.slice(tokens[at + 2 : colon])
            child(child(data(written, "datatypeinheritance"), "Inheritance"), "Extends").text = base
        plain(written, self._balanced(f"{text}\nEND_TYPE", part.pos))

    def _globals(self, part: Part) -> None:
        holder = ElementTree.Element("holder")
        written = self._declarations.section(holder, part, name=self._source.stem)
        if written is None:  # VAR_CONFIG
            written = child(holder, "globalVars", name=self._source.stem)
        if self._source.shared or any(p.kind not in ("GLOBAL", "CONFIG", *_TESTS) for p in self._outline.parts):
            shared_list(written)
        attributes(written, self._outline.attributes.get(part.pos, {}))
        plain(written, self._balanced(part.text, part.pos))
        self._project.lists.append(written)

    # ---- units ----

    def _unit(self, part: Part) -> None:
        if part.kind == "INTERFACE":
            unit = child(data(self._project.root, "interface"), "Interface", name=part.name)
        else:
            unit = child(self._project.pous, "pou", name=part.name, pouType=_KINDS[part.kind])
        self._last = (unit, part)
        self._interface(unit, part)
        if part.kind != "INTERFACE":
            if any(member.kind == "ACTION" for member in part.members):
                child(unit, "actions")
            self._body(unit, part)
        for member in part.members:
            self._member(unit, part, member)

    def _interface(self, unit: Xml, part: Part) -> None:
        """The declaration of a unit or member."""
        interface = child(unit, "interface")
        tokens = part.tokens
        start = next(i for i, t in enumerate(tokens) if t.type == "IDENT")
        words = [t.text.capitalize() for t in tokens[:start] if t.type == "MODIFIER"]
        at = start + 1
        bases: dict[str, list[str]] = {}
        while tokens[at].type in ("_EXTENDS", "_IMPLEMENTS"):
            stop = at + 2
            while tokens[stop].type in ("_DOT", "_COMMA"):
                stop += 2
            names = self._declarations.slice(tokens[at + 1 : stop]).replace(" ", "").split(",")
            bases[tokens[at].type.removeprefix("_").capitalize()] = names
            at = stop
        if tokens[at].type == "_COLON" and part.kind != "ACTION":
            self._declarations.type(child(interface, "returnType"), tokens[at + 1 : type_end(tokens, at + 1)])
        for section in part.variables:
            self._declarations.section(interface, section)
        if words:
            child(data(interface, "accessmodifiers"), "AccessModifiers", **dict.fromkeys(words, "true"))
        if bases:
            inheritance = child(data(interface, "inheritance"), "Inheritance")
            for tag, names in bases.items():
                for name in names:
                    child(inheritance, tag).text = name
        attributes(interface, self._outline.attributes.get(part.pos, {}))
        plain(interface, self._balanced(part.declaration, part.pos))

    def _body(self, unit: Xml, part: Part) -> None:
        body = child(unit, "body")
        if part.chart:
            ChartWriter(body, part.chart, self._declarations, self._no_place).write()
            for step in part.chart:
                self._balanced(step.gap, step.pos)
            documentation(body, self._balanced(part.body, part.pos).strip())
        elif part.instructions:
            text_in(child(body, "IL"), part.instructions.strip("\r\n"))
        else:
            text_in(child(body, "ST"), self._balanced(part.body, part.pos).strip("\r\n"))

    # ---- members ----

    def _member(self, unit: Xml, owner: Part, part: Part) -> None:
        if part.kind == "ACTION":
            self._action(unit, part)
        elif part.kind == "METHOD":
            method = child(data(unit, "method"), "Method", name=part.name)
            self._interface(method, part)
            if owner.kind != "INTERFACE":
                self._body(method, part)
        elif part.kind in _MEMBERS:
            self._property(unit, owner, part)
        else:
            self._no_place(part.pos, *_NO_PLACE[part.kind])

    def _action(self, unit: Xml, part: Part) -> None:
        actions = unit.find("actions")
        if actions is None:
            actions = ElementTree.Element("actions")
            unit.insert(1, actions)
        action = child(actions, "action", name=part.name)
        self._body(action, part)
        if part.gap.strip():
            plain(action, self._balanced(part.declaration, part.pos))

    def _property(self, unit: Xml, owner: Part, part: Part) -> None:
        written = child(data(unit, "property"), "Property", name=part.name)
        accessors = part.members
        if part.kind != "PROPERTY":  # PROPERTY_GET and PROPERTY_SET, each by itself
            head = part.head.removeprefix(part.gap)
            part.head = part.gap + re.sub(r"_[GS]ET\b", "", head, count=1, flags=re.IGNORECASE)
            single = Part(
                part.kind.removeprefix("PROPERTY_"),
                part.tokens,
                "",
                "",
                "",
                part.body,
                part.instructions,
                part.variables,
            )
            part.variables, accessors = [], [single]
        self._interface(written, part)
        for accessor in accessors:
            got = child(written, f"{accessor.kind.capitalize()}Accessor")
            interface = child(got, "interface")
            for section in accessor.variables:
                self._declarations.section(interface, section)
            declared = re.sub(r"\b[GS]ET\b", "", accessor.head.removeprefix(accessor.gap), count=1, flags=re.IGNORECASE)
            declared = accessor.gap + declared + "".join(section.text for section in accessor.variables)
            if declared.strip():
                plain(interface, self._balanced(declared, accessor.pos))
            if owner.kind != "INTERFACE":
                self._body(got, accessor)

    # ---- configurations ----

    def _configuration(self, part: Part) -> None:
        written = child(self._project.configurations, "configuration", name=part.name)
        resource: Xml | None = None
        tasks: dict[str, Xml] = {}
        instances: list[list[Token]] = []
        sections: list[Part] = []
        for item in _items(part.tokens[2:-1]):
            kind = item[0].type
            if kind == "RESOURCE":
                resource = child(written, "resource", name=item[1].text)
                continue
            if resource is None:
                resource = child(written, "resource", name="Resource")
            if kind == "TASK":
                tasks[item[1].text.casefold()] = self._task(resource, item)
            elif kind == "PROGRAM":
                instances.append(item)
            else:
                sections.append(Part(kind, item, "", ""))
        if resource is None:
            resource = child(written, "resource", name="Resource")
        for section in sections:
            self._declarations.section(resource, section)
        for instance in instances:
            self._instance(resource, tasks, instance)
        plain(written, self._balanced(part.text, part.pos))

    def _instance(self, resource: Xml, tasks: dict[str, Xml], tokens: list[Token]) -> None:
        at = 1
        if tokens[at].type == "QUALIFIER":
            self._only_text(tokens[at].pos, f"{tokens[at].text.upper()} of an instance")
            at += 1
        name, owner = tokens[at].text, resource
        if tokens[at + 1].type == "_WITH":
            owner = tasks.get(tokens[at + 2].text.casefold(), resource)
            at += 2
        child(owner, "pouInstance", name=name, typeName=tokens[at + 2].text)
        if len(tokens) > at + 3:
            self._only_text(tokens[at + 3].pos, "what is connected to an instance")

    def _task(self, resource: Xml, tokens: list[Token]) -> Xml:
        task = child(resource, "task", name=tokens[1].text)
        inside = tokens[3:-1]
        starts = [i for i in range(len(inside)) if i + 1 < len(inside) and inside[i + 1].type == "_ASSIGN"]
        for start, stop in zip(starts, [*starts[1:], len(inside)], strict=True):
            name = inside[start].text.lower()
            value = [t for t in inside[start + 2 : stop] if not (t is inside[stop - 1] and t.type == "_COMMA")]
            if name in ("priority", "interval", "single"):
                task.set(name, self._declarations.slice(value))
            else:
                self._only_text(inside[start].pos, f"{inside[start].text} of a task")
        if not task.get("priority", "").isdecimal():  # the name of a constant, or none: then it is the lowest here
            if task.get("priority") is not None:
                self._only_text(tokens[1].pos, "a PRIORITY that is not a number")
            task.set("priority", str(LOWEST_PRIORITY))
        return task


def _pragma(name: str, value: str) -> str:
    return f"{{attribute '{name}' := '{value}'}} " if value else f"{{attribute '{name}'}} "


def _items(tokens: list[Token]) -> Iterator[list[Token]]:
    """What a configuration is made of: of a resource the first words, then what is in it."""
    at = 0
    while at < len(tokens):
        kind = tokens[at].type
        if kind == "RESOURCE":
            yield tokens[at : at + 4]
            at += 4
        elif kind in ("TASK", "PROGRAM", "GLOBAL", "CONFIG", "ACCESS"):
            ends = "_SEMI" if kind in ("TASK", "PROGRAM") else "_END_VAR"
            end = next(i for i in range(at, len(tokens)) if tokens[i].type == ends)
            yield tokens[at : end + (ends == "_END_VAR")]
            at = end + 1
        else:
            at += 1


def _type_stop(tokens: list[Token], start: int) -> int:
    """The end of the type that begins at an index, with its semicolon; it may have none."""
    colon = next(i for i in range(start, len(tokens)) if tokens[i].type == "_COLON")
    at = type_end(tokens, colon + 1)
    while at < len(tokens) and tokens[at].type == "_ASSIGN":
        at = next((i for i in range(at, len(tokens)) if tokens[i].type == "_SEMI"), len(tokens))
    while at < len(tokens) and tokens[at].type == "_SEMI":
        at += 1
    return at
