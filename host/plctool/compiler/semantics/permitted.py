"""What may stand with a declaration: the sections of a unit, the qualifiers of a section, the modifiers of a unit.

The tables say what does something; whatever else the grammar takes is reported here, so that nothing is passed over
without a word.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Container, Iterable
from enum import StrEnum

from plctool.compiler.base.source import Source
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.ast import ACCESS, Modifier, Section
from plctool.compiler.syntax.diagnostics import Diagnostics
from plctool.errors import listed, with_article


class Kind(StrEnum):
    """What holds declarations, as messages call it."""

    FUNCTION = "FUNCTION"
    FUNCTION_BLOCK = "FUNCTION_BLOCK"
    CLASS = "CLASS"
    PROGRAM = "PROGRAM"
    METHOD = "METHOD"
    INTERFACE_METHOD = "method of an INTERFACE"
    PROPERTY = "PROPERTY"
    INTERFACE_PROPERTY = "property of an INTERFACE"
    ACTION = "ACTION"
    CONFIGURATION = "CONFIGURATION"
    FILE = "file"
    TEST = "TEST"
    SETUP = "SETUP"
    TEARDOWN = "TEARDOWN"
    INTERFACE = "INTERFACE"
    TYPE = "TYPE"


_IN_INTERFACE = {
    Kind.METHOD: Kind.INTERFACE_METHOD,
    Kind.PROPERTY: Kind.INTERFACE_PROPERTY,
}
_OF_TESTS = (Kind.TEST, Kind.SETUP, Kind.TEARDOWN)
_BLOCKS = (Kind.PROGRAM, Kind.FUNCTION_BLOCK, Kind.CLASS)

_OF_INTERFACE = "what an INTERFACE declares is PUBLIC and to be implemented"

_WITHOUT_EFFECT = frozenset((Modifier.FINAL, Modifier.INTERNAL, Modifier.PROTECTED))  # in an INTERFACE
KEEPING = frozenset((Modifier.RETAIN, Modifier.NON_RETAIN, Modifier.PERSISTENT))
_CONSTANT = frozenset((Modifier.CONSTANT,))
_NONE = frozenset[Modifier]()

_CALL = {  # what lives for one call, and what does not
    Section.VAR: _CONSTANT,
    Section.VAR_TEMP: _CONSTANT,
    Section.VAR_STAT: _CONSTANT | KEEPING,
    Section.VAR_EXTERNAL: _CONSTANT,
}
_PARAMETERS = {Section.VAR_INPUT: _CONSTANT, Section.VAR_OUTPUT: _NONE, Section.VAR_IN_OUT: _CONSTANT}
_LASTING = {**_CALL, Section.VAR_INPUT: _CONSTANT | KEEPING, Section.VAR_OUTPUT: KEEPING, Section.VAR_IN_OUT: _CONSTANT}
_TEST = {Section.VAR: _CONSTANT, Section.VAR_TEMP: _CONSTANT, Section.VAR_EXTERNAL: _CONSTANT}

SECTIONS: dict[Kind, dict[Section, frozenset[Modifier]]] = {
    Kind.FUNCTION: {**_CALL, **_PARAMETERS},
    Kind.FUNCTION_BLOCK: {**_LASTING, Section.VAR: _CONSTANT | KEEPING | ACCESS, Section.VAR_GENERIC: _CONSTANT},
    Kind.CLASS: {**_CALL, Section.VAR: _CONSTANT | KEEPING | ACCESS},
    Kind.PROGRAM: {**_LASTING, Section.VAR: _CONSTANT | KEEPING | ACCESS},
    Kind.METHOD: {**_CALL, **_PARAMETERS, Section.VAR_INST: KEEPING},
    Kind.INTERFACE_METHOD: _PARAMETERS,
    Kind.PROPERTY: {**_CALL, Section.VAR_INST: KEEPING},
    Kind.INTERFACE_PROPERTY: {},
    Kind.ACTION: {},
    Kind.CONFIGURATION: {Section.VAR_GLOBAL: _CONSTANT | KEEPING},
    Kind.FILE: {Section.VAR_GLOBAL: _CONSTANT | KEEPING | {Modifier.PUBLIC, Modifier.INTERNAL}},
    Kind.TEST: _TEST,
    Kind.SETUP: _TEST,
    Kind.TEARDOWN: _TEST,
}
"""For each kind of unit its sections, and for each of those the qualifiers that do something there."""

_OBJECTS = ACCESS | {Modifier.FINAL, Modifier.ABSTRACT, Modifier.OVERRIDE}
MODIFIERS: dict[Kind, frozenset[Modifier]] = {
    Kind.FUNCTION: frozenset((Modifier.PUBLIC, Modifier.INTERNAL)),
    Kind.FUNCTION_BLOCK: frozenset((Modifier.PUBLIC, Modifier.INTERNAL, Modifier.ABSTRACT, Modifier.FINAL)),
    Kind.CLASS: frozenset((Modifier.PUBLIC, Modifier.INTERNAL, Modifier.ABSTRACT, Modifier.FINAL)),
    Kind.PROGRAM: frozenset((Modifier.PUBLIC, Modifier.INTERNAL)),
    Kind.INTERFACE: frozenset((Modifier.PUBLIC, Modifier.INTERNAL)),
    Kind.METHOD: _OBJECTS,
    Kind.PROPERTY: _OBJECTS,
    Kind.INTERFACE_METHOD: frozenset((Modifier.PUBLIC, Modifier.ABSTRACT)),
    Kind.INTERFACE_PROPERTY: frozenset((Modifier.PUBLIC, Modifier.ABSTRACT)),
    Kind.ACTION: _NONE,
    Kind.TYPE: frozenset((Modifier.PUBLIC, Modifier.INTERNAL)),
}
"""For each kind of unit the words that may stand before its name."""

_INSTEAD_OF_SECTION = {
    (Kind.FUNCTION, Section.VAR_INST): "VAR_STAT keeps a value from call to call",
    (Kind.FUNCTION_BLOCK, Section.VAR_INST): "VAR keeps its value from call to call",
    (Kind.PROGRAM, Section.VAR_INST): "VAR keeps its value from cycle to cycle",
    (Kind.CLASS, Section.VAR_INST): "VAR keeps its value",
    (Kind.CLASS, Section.VAR_INPUT): "nothing calls a CLASS itself; write VAR PUBLIC, or an input of a METHOD",
    (Kind.CLASS, Section.VAR_OUTPUT): "nothing calls a CLASS itself; write VAR PUBLIC, or an output of a METHOD",
    (Kind.CLASS, Section.VAR_IN_OUT): "nothing calls a CLASS itself; write it into a METHOD",
}


def check_declarations(declarations: Iterable[ast.Declaration], source: Source, diagnostics: Diagnostics) -> None:
    """Reports what stands in a file and does nothing, or contradicts itself."""
    check = _Check(source, diagnostics)
    for decl in declarations:
        check.declaration(decl)


class _Check:
    def __init__(self, source: Source, diagnostics: Diagnostics) -> None:
        self._source = source
        self._diagnostics = diagnostics

    def _error(self, offset: int, message: str) -> None:
        self._diagnostics.error(self._source.pos(offset), "qualifier", message)

    def _warning(self, offset: int, message: str) -> None:
        self._diagnostics.warning(self._source.pos(offset), "no-effect", message)

    def declaration(self, decl: ast.Declaration) -> None:
        if isinstance(decl, ast.PouDecl):
            self._unit(decl, _kind(decl))
        elif isinstance(decl, ast.TypeDecl):
            for word in sorted(decl.modifiers - MODIFIERS[Kind.TYPE]):
                self._error(decl.pos, _wrong_modifier(Kind.TYPE, word))
        elif isinstance(decl, ast.GlobalBlock):
            self._section(Kind.FILE, decl.block)
        elif isinstance(decl, ast.TestDecl):
            for block in decl.blocks:
                if block.keyword in SECTIONS[Kind(decl.keyword)]:  # others are refused where tests are declared
                    self._section(Kind(decl.keyword), block)
        elif isinstance(decl, ast.ConfigurationDecl):
            self._configuration(decl)

    def _configuration(self, decl: ast.ConfigurationDecl) -> None:
        for block in decl.globals:
            self._section(Kind.CONFIGURATION, block)
        for instance in decl.programs:
            for qualifier in instance.qualifiers - KEEPING:
                message = f"a program cannot be {qualifier}; RETAIN, NON_RETAIN or PERSISTENT may stand here"
                self._error(instance.pos, message)

    # ---- units ----

    def _unit(self, decl: ast.PouDecl, kind: Kind) -> None:
        self._modifiers(decl, kind)
        for block in decl.blocks[_given(decl) :]:
            self._section(kind, block)
        if "external" in decl.attributes and decl.keyword is ast.Unit.FUNCTION:
            self._external(decl, _PARAMETERS)
        elif "external" in decl.attributes and decl.keyword is ast.Unit.FUNCTION_BLOCK:
            self._external_block(decl)
        for member in decl.members:
            inside = _IN_INTERFACE.get(_kind(member)) if kind is Kind.INTERFACE else _kind(member)
            if inside is not None:
                self._unit(member, inside)
            else:
                self._error(member.pos, f"an INTERFACE has no {member.keyword}; it has METHOD and PROPERTY")

    def _external(self, decl: ast.PouDecl, allowed: Container[Section]) -> None:
        """What the C function does is not said here."""
        if decl.body:
            self._error(decl.body[0].pos, f"{decl.name} is written in C, so it has no statements here")
        elif decl.chart is not None:
            self._error(decl.pos, f"{decl.name} is written in C, so it has no chart here")
        for block in decl.blocks:
            if block.keyword not in allowed and block.decls:
                message = f"{decl.name} is written in C, so it has no {block.keyword} here"
                self._error(block.pos, message)

    def _external_block(self, decl: ast.PouDecl) -> None:
        """The C code knows the variables of an instance by a structure, which is the same in all programs."""
        self._external(decl, (*_PARAMETERS, Section.VAR))
        for line in (line for block in decl.blocks for line in block.decls):
            if line.edge is not None or line.location is not None:
                what = "an edge" if line.edge is not None else "an address"
                self._error(line.pos, f"{decl.name} is written in C, so its variables cannot have {what}")
        if decl.bases or decl.interfaces:
            offset, name = (*decl.bases, *decl.interfaces)[0]
            advice = "call it in a block that does"
            self._error(offset, f"{decl.name} is written in C, so it cannot extend or implement {name}; {advice}")
        if Modifier.ABSTRACT in decl.modifiers:
            self._error(decl.pos, f"{decl.name} is written in C, so it cannot be ABSTRACT")
        for member in decl.members:
            if member.keyword is ast.Unit.METHOD:
                self._external(member, _PARAMETERS)
            else:
                message = f"{decl.name} is written in C, so it has methods, but no {_kind(member)}; write a METHOD"
                self._error(member.pos, message)

    def _modifiers(self, decl: ast.PouDecl, kind: Kind) -> None:
        given = decl.modifiers - {Modifier.CLASS}
        without = given & _WITHOUT_EFFECT if kind in _IN_INTERFACE.values() else set()
        for word in sorted(without):
            self._warning(decl.pos, f"{_OF_INTERFACE}, so {word} has no effect here; leave it out")
        decl.modifiers -= without
        for word in sorted(given - without - MODIFIERS[kind]):
            self._error(decl.pos, _wrong_modifier(kind, word))
        access = sorted(given & ACCESS)
        if len(access) > 1:
            self._error(decl.pos, f"{decl.name} cannot be {' and '.join(access)}; choose one")
        for one, other in ((Modifier.ABSTRACT, Modifier.FINAL), (Modifier.ABSTRACT, Modifier.PRIVATE)):
            if {one, other} <= given:
                message = f"{decl.name} cannot be {one} and {other}: derived blocks complete what is {one}"
                self._error(decl.pos, message)

    # ---- sections ----

    def _section(self, kind: Kind, block: ast.VarBlock) -> None:
        keyword = block.keyword
        allowed = SECTIONS[kind].get(keyword)
        if allowed is None:
            empty = keyword == "VAR" and not block.decls and not block.qualifiers  # TwinCAT writes it into accessors
            if not (empty and kind in _IN_INTERFACE.values()):
                self._error(block.pos, _wrong_section(kind, keyword))
            return
        for word in sorted(block.qualifiers - allowed):
            self._error(block.pos, _wrong_qualifier(kind, keyword, word))
        self._combination(kind, block)
        for line in block.decls:
            self._line(block, line)

    def _combination(self, kind: Kind, block: ast.VarBlock) -> None:
        given = block.qualifiers
        keeps = sorted(given & {Modifier.RETAIN, Modifier.PERSISTENT})
        if keeps and Modifier.NON_RETAIN in given:
            self._error(block.pos, f"a variable cannot be {keeps[0]} and NON_RETAIN; choose one")
        access = sorted(given & ACCESS)
        if len(access) > 1:
            self._error(block.pos, f"a variable cannot be {' and '.join(access)}; choose one")
        if keeps and Modifier.CONSTANT in given:
            self._warning(block.pos, f"{keeps[0]} has no effect here: a constant never changes; leave it out")
        if kind is Kind.PROGRAM and access and access != [Modifier.PUBLIC]:
            message = f"{access[0]} has no effect in a PROGRAM: other POUs see its variables all the same; leave it out"
            self._warning(block.pos, message)

    def _line(self, block: ast.VarBlock, line: ast.VarDecl) -> None:
        name = line.names[0][1]
        if line.location is not None and Modifier.CONSTANT in block.qualifiers and block.keyword is Section.VAR_GLOBAL:
            self._error(line.location.pos, f"the constant {name} has no address; leave out CONSTANT or AT")
        if line.init is None:
            return
        if block.keyword is Section.VAR_EXTERNAL:
            message = f"this initial value has no effect: {name} gets the one of its VAR_GLOBAL; write it there"
            self._warning(line.pos, message)
        elif block.keyword is Section.VAR_IN_OUT:
            message = f"this initial value has no effect: each call gives {name} a variable; leave it out"
            self._warning(line.pos, message)


def _given(decl: ast.PouDecl) -> int:
    """How many sections at the start are not in the source: that of the value of a SET."""
    return int(decl.keyword is ast.Unit.SET)


def _kind(decl: ast.PouDecl) -> Kind:
    if Modifier.CLASS in decl.modifiers:
        return Kind.CLASS
    return Kind.PROPERTY if decl.is_property else Kind(decl.keyword)


def _wrong_section(kind: Kind, keyword: Section) -> str:
    advice = _INSTEAD_OF_SECTION.get((kind, keyword)) or f"it has {listed(SECTIONS[kind] or ['no variables'])}"
    return f"{with_article(kind)} has no {keyword}; {advice}"


def _wrong_modifier(kind: Kind, word: str) -> str:
    if kind in _IN_INTERFACE.values():
        return f"{_OF_INTERFACE}; leave out {word}"
    allowed = sorted(MODIFIERS[kind])
    return f"{with_article(kind)} cannot be {word}; it may be {listed(allowed, 'or')}"


def _wrong_qualifier(kind: Kind, keyword: Section, word: str) -> str:
    if word in (Modifier.FINAL, Modifier.ABSTRACT, Modifier.OVERRIDE):
        return f"{word} is for blocks and methods, not for variables; leave it out"
    if word in ACCESS:
        return _wrong_access(kind, keyword, word)
    if word == Modifier.CONSTANT:
        reason = "it is there to be written" if keyword is Section.VAR_OUTPUT else "a constant is written VAR CONSTANT"
        return f"a {keyword} cannot be CONSTANT: {reason}"
    return f"a {keyword} cannot be {word}: {_why_not_kept(kind, keyword)}"


def _wrong_access(kind: Kind, keyword: Section, word: str) -> str:
    if keyword in (Section.VAR_INPUT, Section.VAR_OUTPUT, Section.VAR_IN_OUT):
        return f"{word} is for VAR; a {keyword} is visible to all callers; leave it out"
    if keyword is Section.VAR_GLOBAL:
        return f"a VAR_GLOBAL may be PUBLIC or INTERNAL, not {word}"
    return (
        f"{word} is for the VAR of a FUNCTION_BLOCK or CLASS; only {with_article(kind)} itself sees this; leave it out"
    )


def _why_not_kept(kind: Kind, keyword: Section) -> str:
    if keyword is Section.VAR_IN_OUT:
        return "it is a variable of the caller; write it where that is declared"
    if keyword is Section.VAR_EXTERNAL:
        return "it only repeats a VAR_GLOBAL; write it there"
    if kind in _OF_TESTS:
        return "a test is initialised each time; leave it out"
    lasting = Section.VAR if kind in _BLOCKS else Section.VAR_STAT
    return f"it lives for one call; {lasting} RETAIN keeps a value"
