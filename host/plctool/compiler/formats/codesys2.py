"""Exports of CODESYS 2.3 and TwinCAT 2 (.EXP): units in Structured Text, and sections that describe the project.

LD and FBD become statements. Tasks become a CONFIGURATION and the names in the hardware configuration become globals at
their addresses. Libraries, visualisations and settings of the editor are left out and named. A body in another language
is refused by name.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property

from plctool.compiler.base.source import ElementName, Source
from plctool.compiler.formats import il_files
from plctool.compiler.formats.codesys2_networks import Line, read_networks
from plctool.compiler.formats.element_names import element_names
from plctool.compiler.formats.library_units import parameters, parameters_of
from plctool.compiler.formats.plcopen_body import Body, NotTranslatedError, Unit, declared
from plctool.compiler.formats.text import Findings, Part, Place, Text
from plctool.compiler.formats.tree_bodies import translate_networks, units_of
from plctool.compiler.formats.twincat import REFUSED
from plctool.compiler.formats.xml_tree import Element
from plctool.compiler.syntax import ast

_BLOCK_IN_ONE_WORD = "FUNCTIONBLOCK"  # in exports of some systems made from CODESYS 2.3
_ENDS = {
    _BLOCK_IN_ONE_WORD: "END_FUNCTION_BLOCK",
    "PROGRAM": "END_PROGRAM", "FUNCTION_BLOCK": "END_FUNCTION_BLOCK", "FUNCTION": "END_FUNCTION", "TYPE": "END_TYPE",
    "ACTION": "END_ACTION", "VAR_GLOBAL": "END_VAR", "VAR_CONFIG": "END_VAR", "CONFIGURATION": "END_CONFIGURATION",
    "INTERFACE": "END_INTERFACE", "METHOD": "END_METHOD",
}  # fmt: skip
_SECTIONS = frozenset(("LIBRARY", "VISUALISATION", "PLC_CONFIGURATION", "RESOURCE", "TASK", "TASK_CONFIGURATION"))
_TASKS = frozenset(("RESOURCE", "TASK", "TASK_CONFIGURATION"))

_WORD = re.compile(r"\s*(\w+)[ \t]*(\w*)")
_BODY_END = re.compile(r"^[ \t]*(?:END_)?ACTION\b", re.MULTILINE | re.IGNORECASE)
_ACTION = re.compile(r"\bACTION[ \t]+(\w+)[ \t]*:?", re.IGNORECASE)
_DECLARED = re.compile(r"\(\*\s*@END_DECLARATION")
_NETWORKS = frozenset(("LD", "FBD"))
_OUTSIDE = re.compile(r"\(\*|'(?:\$.|[^'$\n])*'|\"(?:\$.|[^\"$\n])*\"")
_INSIDE = re.compile(r"\(\*|\*\)")
_NESTED = re.compile(r"\(\*\s*@NESTEDCOMMENTS\s*:=\s*'(\w+)'\s*\*\)", re.IGNORECASE)
_DIAGRAM = re.compile(r"^[ \t]*_(LD|FBD|CFC|SFC)_?\w*[ \t]*\r?$", re.MULTILINE)
_TASK = re.compile(r"\bTASK\s+(\w+)\s*\(([^()]*)\)", re.IGNORECASE)
_PROPERTY = re.compile(r"(\w+)\s*:=\s*([^,()]+)")
_INSTANCE = re.compile(r"\bPROGRAM\s+(\w+)(?:\s+WITH\s+\w+)?\s*:\s*(\w+)", re.IGNORECASE)
_CALL = re.compile(r"^[ \t{]*([A-Za-z_]\w*)[ \t]*(?:\([^()\n]*\)[ \t]*;?|;)", re.MULTILINE)
_ENTRY = re.compile(r"^[ \t]*_(\w+)[ \t]*:?[ \t]*'?([^'\n\r]*)'?", re.MULTILINE)
_TYPES = {"X": "BOOL", "": "BOOL", "B": "BYTE", "W": "WORD", "D": "DWORD", "L": "LWORD"}
_ADDRESS = re.compile(r"%[IQM]([XBWDL]?)\d+(?:\.\d+)*", re.IGNORECASE)
_NAME = re.compile(r"[A-Za-z_]\w*")
_LIBRARY = re.compile(r"[\w.\- ]+\.lib\b", re.IGNORECASE)

_Edit = tuple[int, int, str | list[Part]]
"""From offset, to offset, what stands there instead."""


@dataclass
class _Span:
    """A part of the file: what it is, what it is called, and where it begins and ends."""

    kind: str
    name: str
    start: int
    end: int


def read_export(path: str, text: str) -> Source:
    """What a file holds."""
    return _Export(path, text).source()


def drawn_bodies(path: str, text: str) -> dict[str, Element]:
    """Returns the bodies in LD and FBD of a file, by the name of the unit, or UNIT.ACTION."""
    export = _Export(path, text, contacts=True)
    export.source()
    return export.drawn


class _Export:
    """`contacts`: as in Elements."""

    def __init__(self, path: str, text: str, *, contacts: bool = False) -> None:
        self._contacts = contacts
        self.drawn: dict[str, Element] = {}
        self._path = path
        self._text = text
        self._edits: list[_Edit] = []
        self._named: list[ElementName] = []
        self._findings = Findings()
        self._next_id = 1  # of networks, so that no two need variables of the same name
        self._masked, self._plain = self._without_comments()

    def source(self) -> Source:
        left_out: list[str] = []
        first: _Span | None = None
        for span in self._spans():
            if span.kind == _BLOCK_IN_ONE_WORD:
                self._edits.append((span.start, span.start + len(span.kind), "FUNCTION_BLOCK"))
            if span.kind in _ENDS:
                self._other_language(span)
                continue
            first = first or span
            made = self._instead_of(span)
            self._edits.append((span.start, span.end, made))
            if not made:
                left_out += self._names(span)
        if first is not None and left_out:
            message = f"left out: {', '.join(dict.fromkeys(left_out))}"
            self._findings.warning(self._place(first.start), "left-out", message)
        if not self._edits:
            return Source(self._path, self._text)
        made_text = Text()
        made_text.spliced(self._text, _apart(self._edits))
        made_text.named(self._named)
        return made_text.source(self._path, self._text, findings=self._findings.all)

    def _place(self, offset: int) -> Place:
        line = self._text.count("\n", 0, offset) + 1
        return Place(line, offset - self._text.rfind("\n", 0, offset))

    # ---- comments ----

    def _without_comments(self) -> tuple[str, str]:
        """The text with blanks for comments and strings, and the one that keeps strings. Where comments do not nest, a
        mark in one is left out."""
        parts: list[str] = []
        plain: list[str] = []
        at, nests = 0, True
        while (match := _OUTSIDE.search(self._text, at)) is not None:
            end = match.end()
            if match.group() == "(*":
                nests = self._nests(match.start(), nests)
                end = self._comment_end(end, nests=nests)
            found = self._text[match.start() : end]
            parts += [self._text[at : match.start()], _blank(found)]
            plain += [self._text[at : match.start()], _blank(found) if match.group() == "(*" else found]
            at = end
        return "".join([*parts, self._text[at:]]), "".join([*plain, self._text[at:]])

    def _comment_end(self, at: int, *, nests: bool) -> int:
        depth = 1
        for match in _INSIDE.finditer(self._text, at):
            if match.group() == "*)":
                depth -= 1
            elif nests:
                depth += 1
            else:
                self._edits.append((match.start(), match.end(), "  "))
            if depth == 0:
                return match.end()
        return len(self._text)

    def _nests(self, offset: int, before: bool) -> bool:
        match = _NESTED.match(self._text, offset)
        return before if match is None else match[1].lower() != "no"

    # ---- parts of the file ----

    def _spans(self) -> list[_Span]:
        """The units and sections, in order."""
        found: list[_Span] = []
        at = 0
        while at < len(self._masked):
            end_of_line = self._line_end(at)
            match = _WORD.match(self._masked, at, end_of_line)
            kind = match[1].upper() if match else ""
            if match is None or not (kind in _ENDS or kind in _SECTIONS or kind.startswith("_")):
                at = end_of_line
                continue
            end = self._unit_end(kind, match.end(1)) if kind in _ENDS else self._section_end(kind, end_of_line)
            found.append(_Span(kind, match[2], match.start(1), end))
            at = max(end, end_of_line) if kind in _ENDS else end
        return found

    def _line_end(self, at: int) -> int:
        end = self._masked.find("\n", at)
        return len(self._masked) if end < 0 else end + 1

    def _unit_end(self, kind: str, at: int) -> int:
        match = re.compile(rf"\b{_ENDS[kind]}\b", re.IGNORECASE).search(self._masked, at)
        return len(self._masked) if match is None else match.end()

    def _section_end(self, kind: str, at: int) -> int:
        """Its own end, or else the next unit or section."""
        name = kind.lstrip("_")
        ends = rf"END_{name}|_END_{name}|{kind}_END" + ("|PLC_END" if kind == "PLC_CONFIGURATION" else "")
        own = re.compile(rf"^[ \t]*(?:{ends})\b.*", re.MULTILINE | re.IGNORECASE).search(self._masked, at)
        if own is not None:
            return own.end()
        words = "|".join([*_ENDS, *(_SECTIONS - {kind, "TASK"})])
        other = re.compile(rf"^[ \t]*(?:{words})\b", re.MULTILINE | re.IGNORECASE)
        at_header = self._text.find("(* @NESTEDCOMMENTS", at)
        match = other.search(self._masked, at) if kind not in _TASKS else None
        ends_at = [end for end in (at_header, match.start() if match else -1) if end >= 0]
        return min(ends_at, default=len(self._masked))

    def _names(self, span: _Span) -> list[str]:
        """How what is left out is called."""
        if span.kind == "LIBRARY":
            libraries = _LIBRARY.findall(self._text[span.start + len("LIBRARY") : span.end])
            return [f"the library {name.strip()}" for name in libraries] or ["a library"]
        return [f"{span.kind} {span.name}".strip() if span.kind == "VISUALISATION" else span.kind]

    def _other_language(self, span: _Span) -> None:
        """Translates bodies that are networks or lists of instructions, and refuses other diagrams."""
        at, drawn = span.start, False
        while (match := _DIAGRAM.search(self._masked, at, span.end)) is not None:
            at, drawn = self._body_end(span, match.end()), True
            if match[1] in _NETWORKS:
                self._networks(span, match, at)
            else:
                self._findings.refuse(self._place(match.start(1) - 1), span.name or span.kind, match[1])
                self._edits.append((match.start(), at, "\n"))
        if drawn:
            return
        for start, end in il_files.bodies(self._plain, span.start, span.end):
            made = il_files.statements(self._text, self._plain, (start, end), self._place(start), self._findings)
            self._edits.append((start, end, made))

    def _body_end(self, span: _Span, at: int) -> int:
        """Where a body ends: before the next action, or the end of its own."""
        end = max(at, span.end - len(_ENDS[span.kind]))
        following = _BODY_END.search(self._masked, at, end)
        return end if following is None else following.start()

    # ---- networks ----

    def _networks(self, span: _Span, match: re.Match[str], end: int) -> None:
        """Writes LD or FBD as statements; a finding if they have no translation."""
        action = next(reversed(list(_ACTION.finditer(self._masked, span.start, match.start()))), None)
        name = span.name if action is None else f"{span.name}.{action[1]}"
        made, start = Body(), match.start()
        try:
            lines = self._lines(match.end(), end)
            body = read_networks(
                match[1], lines, self._parameters, contacts=self._contacts and match[1] == "LD", first=self._next_id
            )
            self._next_id = body.next_id
            self.drawn[name] = body.body
            self._named += element_names(name, body.body)
            keeps = span.kind in ("PROGRAM", "FUNCTION_BLOCK", _BLOCK_IN_ONE_WORD)
            unit = Unit(name, keeps, dict(self._results))
            translate_networks(body.body, unit, made)
        except NotTranslatedError as error:
            self._findings.add(error.at, "language", REFUSED.format(name, error))
            made = Body()
        self._edits.append((start, end, [("\n", self._place(start)), *made.parts]))
        if made.variables:
            section = _DECLARED.search(self._text, span.start, start)
            at = start if section is None else section.start()
            variables = made.variables.items()
            self._edits.append((at, at, [part for n, (spec, place) in variables for part in declared(n, spec, place)]))

    def _lines(self, start: int, end: int) -> list[Line]:
        first = self._place(start)
        found = []
        for number, whole in enumerate(self._plain[start:end].split("\n")):
            column = len(whole) - len(whole.lstrip()) + (first.column if number == 0 else 1)
            found.append(Line(whole.strip(), Place(first.line + number, column)))
        return found

    def _declarations(self, span: _Span) -> list[ast.PouDecl]:
        """The unit of a span, as far as it is declared."""
        declared = _DECLARED.search(self._text, span.start, span.end) or _DIAGRAM.search(
            self._masked, span.start, span.end
        )
        end = span.end if declared is None else declared.start()
        return units_of(f"{self._plain[span.start : end]}\n{_ENDS[span.kind]}")

    @cached_property
    def _units(self) -> dict[str, ast.PouDecl]:
        """All units of the file, by case-folded name."""
        spans = [span for span in self._spans() if span.kind in ("PROGRAM", "FUNCTION_BLOCK", "FUNCTION")]
        return {unit.name.casefold(): unit for span in spans for unit in self._declarations(span)}

    @cached_property
    def _results(self) -> dict[str, bool]:
        """As in Unit."""
        return {name: unit.result is not None for name, unit in self._units.items()}

    def _parameters(self, kind: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
        unit = self._units.get(kind.casefold())
        return parameters(kind) if unit is None else parameters_of(unit)

    # ---- what sections become ----

    def _instead_of(self, span: _Span) -> str:
        if span.kind in _TASKS:
            return self._tasks(span)
        if span.kind == "PLC_CONFIGURATION":
            return self._hardware(span)
        return ""

    def _tasks(self, span: _Span) -> str:
        text = self._masked[span.start : span.end]
        tasks = list(_TASK.finditer(text))
        lines = []
        starts = [task.start() for task in tasks]
        for task, end in zip(tasks, [*starts[1:], len(text)], strict=False):
            body = text[task.end() : end]
            properties = {m[1].upper(): m[2].strip() for m in _PROPERTY.finditer(task[2])}
            known = [f"{k} := {v}" for k, v in properties.items() if k in ("INTERVAL", "PRIORITY", "SINGLE") and v]
            programs = [(m[1], m[2]) for m in _INSTANCE.finditer(body)]
            programs = programs or [(m[1], m[1]) for m in _CALL.finditer(body) if not m[1].upper().startswith("END_")]
            if programs:
                lines.append(f"TASK {task[1]}({', '.join(known)});")
                lines += [f"PROGRAM {name} WITH {task[1]} : {program};" for name, program in programs]
        if not lines:
            return ""
        return "\n".join(["CONFIGURATION Tasks", *lines, "END_CONFIGURATION\n"])

    def _hardware(self, span: _Span) -> str:
        """Channels of modules that have a name and an address."""
        lines: list[str] = []
        name = address = section = ""
        for match in _ENTRY.finditer(self._text, span.start, span.end):
            key, value = match[1].upper(), match[2].strip()
            if key in ("CHANNEL", "MODULE") or key.startswith("END_"):
                name = address = section = ""
            elif key == "SECTION_NAME":
                section = value.lower()
            elif key == "SYMBOLIC_NAME":
                name = value
            elif key == "IECADR":
                address = value
            located = _ADDRESS.fullmatch(address)
            if located and _NAME.fullmatch(name):
                size = located[1].upper()
                spec = "REAL" if size == "D" and section.startswith(("float", "real")) else _TYPES[size]
                lines.append(f"    {name} AT {address} : {spec};")
                name = address = ""
        return "\n".join(["VAR_GLOBAL", *dict.fromkeys(lines), "END_VAR\n"]) if lines else ""


def _apart(edits: list[_Edit]) -> list[_Edit]:
    """In order, without those within another one: marks in comments of a section that is left out."""
    found: list[_Edit] = []
    for edit in sorted(edits, key=lambda e: (e[0], -e[1])):
        if not found or edit[0] >= found[-1][1]:
            found.append(edit)
    return found


def _blank(text: str) -> str:
    return re.sub(r"[^\n]", " ", text)
