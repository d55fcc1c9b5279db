"""Completion: what may stand at the cursor."""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain

from lsprotocol import types as lsp

from plctool.compiler.sources.stand_ins import library_of_stand_in
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.lexer import Token
from plctool.lsp import describe
from plctool.lsp.grammar import Grammar
from plctool.lsp.items import BODIES, CLASSES, TYPES, VALUES, Item, Kind
from plctool.lsp.names import ELEMENTARY_NAMES, STANDARD, Names, Shape
from plctool.lsp.outline import SECTIONS, top_block
from plctool.lsp.session import Place, Session
from plctool.lsp.symbols import rank_of
from plctool.lsp.uses import Walk

MAX_ITEMS = 200
_WORD = re.compile(r"[A-Za-z_]\w*\Z")
_C = lsp.CompletionItemKind
_KINDS = {
    Kind.PROGRAM: _C.Module, Kind.FUNCTION: _C.Function, Kind.FUNCTION_BLOCK: _C.Class, Kind.INTERFACE: _C.Interface,
    Kind.METHOD: _C.Method, Kind.ACTION: _C.Method, Kind.PROPERTY: _C.Property, Kind.TYPE: _C.Class,
    Kind.STRUCT: _C.Struct, Kind.ENUM: _C.Enum, Kind.VALUE: _C.EnumMember, Kind.VARIABLE: _C.Variable,
    Kind.GLOBAL: _C.Variable, Kind.FIELD: _C.Field, Kind.STEP: _C.Variable, Kind.LIST: _C.Module,
    Kind.NAMESPACE: _C.Module, Kind.CONFIGURATION: _C.Module, Kind.TASK: _C.Event, Kind.INSTANCE: _C.Variable,
    Kind.TEST: _C.Function,
}  # fmt: skip
_STATEMENTS = {
    "IF": "IF ${1:condition} THEN\n    $0\nEND_IF;",
    "IF ELSE": "IF ${1:condition} THEN\n    $2\nELSE\n    $0\nEND_IF;",
    "CASE": "CASE ${1:selector} OF\n    ${2:1}:\n        $0\nEND_CASE;",
    "FOR": "FOR ${1:i} := ${2:0} TO ${3:9} DO\n    $0\nEND_FOR;",
    "WHILE": "WHILE ${1:condition} DO\n    $0\nEND_WHILE;",
    "REPEAT": "REPEAT\n    $0\nUNTIL ${1:condition}\nEND_REPEAT;",
    "RETURN": "RETURN;",
}
_IN_TESTS = {
    "ASSERT_EQ": "ASSERT_EQ(${1:actual}, ${2:expected});",
    "ASSERT_NEQ": "ASSERT_NEQ(${1:actual}, ${2:expected});",
    "ASSERT_NEAR": "ASSERT_NEAR(${1:actual}, ${2:expected}, ${3:tolerance});",
    "ASSERT_TRUE": "ASSERT_TRUE(${1:condition});",
    "ASSERT_FALSE": "ASSERT_FALSE(${1:condition});",
    "ADVANCE_TIME": "ADVANCE_TIME(${1:T#1s});",
    "FORCE": "FORCE(${1:variable}, ${2:value});",
    "UNFORCE": "UNFORCE(${1:variable});",
    "MOCK": "MOCK ${1:instance};",
    "MOCK_FUNCTION": "MOCK_FUNCTION ${1:Name} RETURNS ${2:0};",
}
_IN_LOOPS = {"EXIT": "EXIT;", "CONTINUE": "CONTINUE;"}
_UNITS = {
    "PROGRAM": "PROGRAM ${1:Main}\nVAR\n    $0\nEND_VAR\nEND_PROGRAM\n",
    "FUNCTION_BLOCK": "FUNCTION_BLOCK ${1:Name}\nVAR_INPUT\n    $0\nEND_VAR\nVAR_OUTPUT\nEND_VAR\nVAR\nEND_VAR\n"
    "END_FUNCTION_BLOCK\n",
    "FUNCTION": "FUNCTION ${1:Name} : ${2:INT}\nVAR_INPUT\n    $0\nEND_VAR\n${1:Name} := 0;\nEND_FUNCTION\n",
    "INTERFACE": "INTERFACE ${1:IName}\n$0\nEND_INTERFACE\n",
    "TYPE STRUCT": "TYPE ${1:Name} :\nSTRUCT\n    ${2:value} : ${3:INT};$0\nEND_STRUCT\nEND_TYPE\n",
    "TYPE ENUM": "TYPE ${1:Name} : (${2:First}, ${3:Second})$0;\nEND_TYPE\n",
    "VAR_GLOBAL": "VAR_GLOBAL\n    $0\nEND_VAR\n",
    "TEST": "TEST '${1:name}'\n    $0\nEND_TEST\n",
    "CONFIGURATION": "CONFIGURATION ${1:Config}\n    TASK ${2:Fast}(INTERVAL := T#10ms, PRIORITY := 1);\n"
    "    PROGRAM ${3:Instance} WITH ${2:Fast} : ${4:Main};$0\nEND_CONFIGURATION\n",
}
_SECTIONS = {
    word: f"{word}\n    $0\nEND_VAR" for word in ("VAR", "VAR_INPUT", "VAR_OUTPUT", "VAR_IN_OUT", "VAR_TEMP")
} | {"VAR CONSTANT": "VAR CONSTANT\n    $0\nEND_VAR"}
_MEMBERS = {
    "METHOD": "METHOD ${1:Name} : ${2:BOOL}\nVAR_INPUT\n    $0\nEND_VAR\nEND_METHOD",
    "PROPERTY": "PROPERTY ${1:Name} : ${2:INT}\nGET\n    $0\nEND_GET\nEND_PROPERTY",
    "ACTION": "ACTION ${1:Name}\n    $0\nEND_ACTION",
}
_VALUE_WORDS = ("TRUE", "FALSE", "NOT")
_OPERATORS = ("AND", "OR", "XOR", "MOD", "AND_THEN", "OR_ELSE")
_TYPE_SNIPPETS = {
    "ARRAY": "ARRAY[${1:0}..${2:9}] OF ${3:INT}",
    "POINTER TO": "POINTER TO ${1:INT}",
    "REFERENCE TO": "REFERENCE TO ${1:INT}",
    "STRING[n]": "STRING[${1:80}]",
}
_VALUE_ENDS = frozenset(("IDENT", "NUMBER", "STRING", "TYPED", "_RPAR", "_RSQB", "_CARET", "TRUE", "FALSE", "DIRECT"))
_STATEMENT_BEGINS = frozenset(("_SEMI", "_THEN", "_ELSE", "_DO", "REPEAT", "_COLON", "TRY", "_FINALLY", "$BEGIN"))
_FOLLOWS = {
    "IF": "THEN", "_ELSIF": "THEN", "WHILE": "DO", "_UNTIL": "", "CASE": "OF",
}  # fmt: skip
_PLACEHOLDER = re.compile(r"\$\{\d+:([^}]*)\}|\$\d+")


@dataclass
class _Found:
    """Items with the order in which they are shown: those that fit best first."""

    label: str
    rank: str
    kind: lsp.CompletionItemKind
    detail: str = ""
    insert: str = ""
    snippet: bool = False
    item: Item | None = None
    origin: str = ""


def completion(session: Session, place: Place) -> lsp.CompletionList:
    """Returns what may stand at a position. At most MAX_ITEMS; with the letters before the cursor others are found."""
    tree, offset = place.tree, place.offset
    text = tree.source.text
    if tree.is_in_comment(offset):
        return lsp.CompletionList(False, [])
    match = _WORD.search(text, max(0, offset - 100), offset)
    typed = match.group() if match else ""
    begin = offset - len(typed)
    tokens = _tokens_to(place, begin)
    walk = Walk(tree, place.project.names)
    walk.run(tokens)
    grammar = Grammar(tokens)
    found = []
    seen: set[str] = set()
    wanted = typed.casefold()
    keywords = (_Found(word, "9", _C.Keyword) for word in grammar.keywords())
    for each in chain(_Choices(walk, place, begin).all(), keywords):
        rank = rank_of(wanted, each.label) if wanted else 0
        if rank >= 0 and each.label.casefold() not in seen and grammar.takes(plain(each.insert or each.label)):
            seen.add(each.label.casefold())
            each.rank = f"{rank}{each.rank}"
            found.append(each)
    found.sort(key=lambda f: (f.rank, f.label.casefold()))
    items = [_item(session, place, each, begin, offset) for each in found[:MAX_ITEMS]]
    return lsp.CompletionList(len(found) > MAX_ITEMS, items)


def _tokens_to(place: Place, begin: int) -> Sequence[Token]:
    """The tokens from the outermost block around the cursor to it."""
    tree = place.tree
    block = top_block(tree.blocks, tree.tokens, begin)
    first = 0 if block is None else block.first
    last = bisect_left(tree.starts, begin)
    if last < len(tree.tokens) and tree.tokens[last].type == "$END":
        last = min(last, len(tree.tokens) - 1)
    return tree.tokens[first:last]


def _item(session: Session, place: Place, each: _Found, begin: int, end: int) -> lsp.CompletionItem:
    insert = each.insert or each.label
    snippet = each.snippet and session.snippets
    if each.snippet and not session.snippets:
        insert = plain(insert)
    edit = lsp.TextEdit(session.range(place.tree.source, begin, end - begin), insert)
    data = None if each.item is None else {"key": each.item.key, "uri": place.tree.source.path}
    details = lsp.CompletionItemLabelDetails(description=each.origin) if each.origin else None
    return lsp.CompletionItem(
        each.label,
        label_details=details,
        kind=each.kind,
        detail=each.detail or None,
        sort_text=each.rank + each.label.casefold(),
        insert_text_format=lsp.InsertTextFormat.Snippet if snippet else lsp.InsertTextFormat.PlainText,
        text_edit=edit,
        data=data,
    )


def plain(snippet: str) -> str:
    """Returns a snippet as text, with the words of its placeholders."""
    return _PLACEHOLDER.sub(lambda m: m[1] or "", snippet)


class _Choices:
    """What may stand where a walk has ended."""

    def __init__(self, walk: Walk, place: Place, begin: int) -> None:
        self.walk = walk
        self.names: Names = place.project.names
        self.tree = place.tree
        self.begin = begin
        at = bisect_left(self.tree.starts, begin) - 1
        self.previous = self.tree.tokens[at].type if at >= 0 else "$BEGIN"
        self.before = self.tree.tokens[at].text.upper() if at >= 0 else ""
        self.unit = walk.unit

    def all(self) -> Iterator[_Found]:
        """Returns all choices."""
        walk = self.walk
        if self.previous == "_DOT":
            yield from self._parts()
        elif walk.section == "TYPE" and not walk.frames and not walk.is_type:
            yield from self._words(("STRUCT", "UNION") if self.previous == "_COLON" else ())
        elif self.before in ("EXTENDS", "IMPLEMENTS"):
            yield from self._bases()
        elif walk.is_type and not any(f.kind == "_LSQB" for f in walk.frames):
            yield from self._types()
        elif walk.section:
            yield from self._in_section()
        elif self.unit is None:
            yield from self._outside()
        else:
            yield from self._in_body()

    # ---- kinds of places ----

    def _parts(self) -> Iterator[_Found]:
        walk = self.walk
        for member in self.names.parts(walk.shape).values() if walk.shape is not None else ():
            if self._is_visible(member):
                yield self._of_item(member, "1" if member.is_parameter else "2")
        shape = self.names.resolved(walk.shape)
        if walk.item is not None and walk.item.kind is Kind.STEP:
            yield _Found("X", "1", _C.Field, "BOOL")
            yield _Found("T", "1", _C.Field, "TIME")
        if shape is None and walk._lone_dot:
            yield from (self._of_item(item, "1") for item in self.names.globals.values())

    def _is_visible(self, member: Item) -> bool:
        """True unless a variable of an instance is only for the block itself, or a member is private."""
        owner, unit = member.owner, self.unit
        if owner is None or (unit is not None and unit.unit is owner.unit):
            return True
        if isinstance(member.decl, ast.PouDecl):
            return ast.Modifier.PRIVATE not in member.decl.modifiers
        if member.kind is Kind.VARIABLE and owner.kind in (Kind.FUNCTION_BLOCK, Kind.METHOD, Kind.FUNCTION):
            in_test = unit is not None and unit.kind is Kind.TEST
            return member.is_parameter or in_test
        return True

    def _types(self) -> Iterator[_Found]:
        for unit in self.names.units.values():
            if unit.kind in TYPES or unit.kind in (Kind.FUNCTION_BLOCK, Kind.INTERFACE):
                yield self._of_item(unit, "1")
        for name in ELEMENTARY_NAMES:
            yield _Found(name, "2", _C.Keyword, "elementary type")
        for label, text in _TYPE_SNIPPETS.items():
            yield _Found(label, "3", _C.Snippet, insert=text, snippet=True)
        yield from self._library(types=True)

    def _bases(self) -> Iterator[_Found]:
        kinds = (Kind.INTERFACE,) if self.before == "IMPLEMENTS" else (Kind.FUNCTION_BLOCK, Kind.INTERFACE, Kind.STRUCT)
        for unit in self.names.units.values():
            if unit.kind in kinds and unit is not self.unit:
                yield self._of_item(unit, "1")

    def _in_section(self) -> Iterator[_Found]:
        frame = self.walk.frames[-1] if self.walk.frames else None
        at_argument = frame is not None and frame.kind == "_LPAR" and self.previous in ("_LPAR", "_COMMA")
        if at_argument and frame is not None and frame.shape is not None:
            yield from self._parameters(self.names.parts(frame.shape).values())
        if self.previous in ("_ASSIGN", "_LPAR", "_LSQB", "_COMMA", "_DOTDOT", "OP", "SIGN"):
            if self.previous != "_COMMA" or frame is not None:
                yield from self._values(constants=True)
                yield from self._words(_VALUE_WORDS, "5")
        elif self.previous in ("_SEMI", "VAR", "GLOBAL", "QUALIFIER"):
            yield from self._words(("END_VAR",), "5")

    def _outside(self) -> Iterator[_Found]:
        units = _UNITS if self.previous.startswith("_END") or self.previous in ("$BEGIN", "$END", "_SEMI") else {}
        yield from self._snippets(units, "1")

    def _in_body(self) -> Iterator[_Found]:
        walk = self.walk
        frame = walk.frames[-1] if walk.frames else None
        at_argument = frame is not None and frame.kind == "_LPAR" and self.previous in ("_LPAR", "_COMMA")
        if at_argument and frame is not None and frame.callee is not None:
            yield from self._parameters(self.names.members(frame.callee).values())
        begins = frame is None and self._begins_statement()
        if begins:
            yield from self._statement()
        elif self.previous in _VALUE_ENDS:
            yield from self._after_value()
        else:
            yield from self._expected(walk.expected())
            yield from self._values()
            yield from self._words(_VALUE_WORDS, "5")

    def _begins_statement(self) -> bool:
        if self.previous in _STATEMENT_BEGINS or self.previous.startswith("_END"):
            return True
        # the header of a unit without variables, CASE x OF
        at = bisect_left(self.tree.starts, self.begin) - 1
        token = self.tree.tokens[at] if at >= 0 else None
        new_line = token is None or "\n" in self.tree.source.text[token.end : self.begin]
        return new_line and self.previous in (*_VALUE_ENDS, "_OF", "GET", "SET")

    def _statement(self) -> Iterator[_Found]:
        yield from self._values(statement=True)
        blocks = self._blocks()
        yield from self._snippets(_STATEMENTS, "4")
        if self.unit is not None and self.unit.kind is Kind.TEST:
            yield from self._snippets(_IN_TESTS, "2")
        if any(b in ("FOR", "WHILE", "REPEAT") for b in blocks):
            yield from self._snippets(_IN_LOOPS, "4")
        if blocks:
            inner = blocks[-1]
            words = {"IF": ("END_IF;", "ELSIF", "ELSE"), "CASE": ("END_CASE;", "ELSE"), "FOR": ("END_FOR;",)}
            words |= {"WHILE": ("END_WHILE;",), "REPEAT": ("UNTIL",)}
            yield from self._words(words.get(inner, ()), "3")
        if not blocks and self._only_declarations():
            yield from self._snippets(_SECTIONS, "3")
        if not blocks and self.unit is not None and self.unit.kind in CLASSES:
            yield from self._snippets(_MEMBERS, "5")

    def _blocks(self) -> list[str]:
        """The statements around the cursor."""
        found: list[str] = []
        blocks = self.tree.blocks
        tokens = self.tree.tokens
        while True:
            inner = next((b for b in blocks if tokens[b.first].end <= self.begin <= tokens[b.last].pos), None)
            if inner is None:
                return found
            if inner.kind in ("IF", "CASE", "FOR", "WHILE", "REPEAT"):
                found.append(inner.kind)
            blocks = inner.inner

    def _only_declarations(self) -> bool:
        """True if no statement stands between the head of the unit and the cursor."""
        at = bisect_left(self.tree.starts, self.begin) - 1
        depth_ended = False
        while at >= 0:
            kind = self.tree.tokens[at].type
            if kind == "_END_VAR":
                return True
            if kind in SECTIONS or kind in ("_SEMI", "_ASSIGN"):
                return depth_ended
            if kind in ("PROGRAM", "FUNCTION", "FUNCTION_BLOCK", "METHOD"):
                return True
            at -= 1
        return False

    def _after_value(self) -> Iterator[_Found]:
        yield from self._words(_OPERATORS, "2")
        at = bisect_left(self.tree.starts, self.begin) - 1
        while at >= 0:
            kind = self.tree.tokens[at].type
            if kind in ("_SEMI", "_THEN", "_ELSE", "_OF", "_DO"):
                return
            if kind in _FOLLOWS:
                yield from self._words((_FOLLOWS[kind],) if _FOLLOWS[kind] else (), "1")
                return
            if kind == "FOR":
                yield from self._words(("TO", "BY", "DO"), "1")
                return
            at -= 1

    # ---- what there is ----

    def _parameters(self, members: Iterable[Item]) -> Iterator[_Found]:
        frame = self.walk.frames[-1]
        given = {a.name.casefold() for a in frame.site.arguments} if frame.site is not None else set()
        for member in members:
            if member.name.casefold() in given:
                continue
            if member.is_parameter or member.kind is Kind.FIELD:
                output = member.section is ast.Section.VAR_OUTPUT
                sign = " => " if output else " := "
                detail = describe.detail(member, self.names)
                section = member.section.value if member.section is not None else ""
                rank = "0" + {"VAR_INPUT": "0", "VAR_IN_OUT": "1", "VAR_OUTPUT": "2"}.get(section, "0")
                yield _Found(
                    f"{member.name}{sign.rstrip()}", rank, _C.Property, detail, f"{member.name}{sign}", item=member
                )

    def _expected(self, shape: Shape | None) -> Iterator[_Found]:
        """The values of an enumeration, or TRUE and FALSE."""
        shape = self.names.dereferenced(shape)
        if shape is None:
            return
        owner = shape.item
        if owner is not None and isinstance(owner.spec, ast.EnumSpec):
            qualified = isinstance(owner.decl, ast.TypeDecl) and owner.decl.qualified
            for value in owner.inner.values():
                if value.kind is Kind.VALUE:
                    label = f"{owner.name}.{value.name}" if qualified else value.name
                    yield _Found(label, "00", _C.EnumMember, owner.name, item=value)
        elif isinstance(shape.spec, ast.NamedType) and shape.spec.name.upper() == "BOOL":
            yield from self._words(("TRUE", "FALSE"), "00")

    def _values(self, *, constants: bool = False, statement: bool = False) -> Iterator[_Found]:
        home = self.unit
        level = 0
        while home is not None:
            for member in self.names.members(home).values():
                if member.kind in VALUES or member.kind in BODIES:
                    if constants and ast.Modifier.CONSTANT not in member.qualifiers:
                        continue
                    yield self._of_item(member, f"1{level}", called=statement)
                if isinstance(member.spec, ast.EnumSpec):
                    yield from (self._of_item(v, "19") for v in member.inner.values() if v.kind is Kind.VALUE)
            home, level = home.owner, level + 1
        unit = self.unit
        has_result = unit is not None and unit.kind in (Kind.FUNCTION, Kind.METHOD, Kind.PROPERTY)
        if unit is not None and has_result and unit.spec is not None and not constants:
            yield _Found(unit.name, "10", _C.Variable, describe.detail(unit, self.names), item=unit)
        for item in self.names.globals.values():
            if not constants or ast.Modifier.CONSTANT in item.qualifiers:
                yield self._of_item(item, "2")
        if constants:
            return
        for item in (*self.names.instances.values(), *self.names.lists.values(), *self.names.spaces.values()):
            yield self._of_item(item, "3")
        for unit in self.names.units.values():
            if unit.kind is Kind.FUNCTION:
                yield self._of_item(unit, "3", called=True)
            elif unit.kind is Kind.PROGRAM or (unit.kind is Kind.ENUM and not statement):
                yield self._of_item(unit, "4")
        if not statement:
            for values in self.names.values.values():
                yield from (self._of_item(v, "4") for v in values)
        for name in self.names.built_in():
            yield _Found(name, "6", _C.Function, "built in")
        yield from self._library(types=False)

    def _library(self, *, types: bool) -> Iterator[_Found]:
        for name, library, is_type in self.names.library.listed():
            if is_type is types:
                origin = "standard library" if library == STANDARD else library
                origin = library_of_stand_in(name) or origin
                yield _Found(name, "7", _C.Class if is_type else _C.Function, "", origin=origin)

    def _of_item(self, item: Item, rank: str, *, called: bool = False) -> _Found:
        detail = describe.detail(item, self.names)
        kind = _C.Constant if ast.Modifier.CONSTANT in item.qualifiers else _KINDS[item.kind]
        return _Found(item.name, rank, kind, detail, item=item)

    def _words(self, words: Iterable[str], rank: str = "5") -> Iterator[_Found]:
        for word in words:
            yield _Found(word, rank, _C.Keyword)

    def _snippets(self, snippets: dict[str, str], rank: str) -> Iterator[_Found]:
        for label, text in snippets.items():
            yield _Found(label, rank, _C.Snippet, insert=text, snippet=True)


def resolve(item: lsp.CompletionItem, names: Names) -> lsp.CompletionItem:
    """Adds the comment of a declaration to an item that is looked at."""
    key = item.data.get("key") if isinstance(item.data, dict) else None
    found = names.by_key(str(key)) if key else names.library.standard(item.label.casefold())
    if found is not None:
        text = f"```iecst\n{describe.declaration(found, names)}\n```"
        if comment := describe.comment(found):
            text += f"\n\n{comment}"
        item.documentation = lsp.MarkupContent(lsp.MarkupKind.Markdown, text)
    return item
