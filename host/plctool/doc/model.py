"""What pages show of a program: its declarations with their comments, in the order of the sources."""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import takewhile

from plctool.compiler.base.nesting import NestingError, room_for_nesting
from plctool.compiler.base.source import Source
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.lexer import Token
from plctool.compiler.syntax.parser import parse_all
from plctool.doc.comments import Comments
from plctool.doc.markup import Markup, read_markup
from plctool.errors import UsageError

SHOWN = (ast.Section.VAR_INPUT, ast.Section.VAR_OUTPUT, ast.Section.VAR_IN_OUT)
_HIDDEN = frozenset((ast.Modifier.PRIVATE, ast.Modifier.INTERNAL))
_CLOSED = frozenset(("_SEMI", "_COLON", "_ASSIGN", "_END_VAR", "_END_TYPE", "$END"))
_OPENED = {"_LPAR": 1, "_LSQB": 1, "_RPAR": -1, "_RSQB": -1}


@dataclass(frozen=True)
class Variable:
    """A variable, a member of a structure, or a value of an enumeration, as written."""

    name: str
    type: str
    initial: str
    address: str
    section: str
    doc: Markup


@dataclass
class Item:
    """A declaration with a page of its own, or a method, property or action in that of its block (`members`)."""

    kind: str
    name: str
    file: str
    line: int
    doc: Markup
    head: str = ""
    result: str = ""
    bases: list[str] = field(default_factory=list)
    interfaces: list[str] = field(default_factory=list)
    variables: list[Variable] = field(default_factory=list)
    members: list[Item] = field(default_factory=list)

    def of(self, *sections: str) -> list[Variable]:
        """The variables of some sections."""
        return [variable for variable in self.variables if variable.section in sections]


def read_items(sources: Iterable[Source], *, private: bool = False) -> list[Item]:
    """The declarations of sources. `private`: also what only the program itself can use. Raises UsageError for a source
    with a syntax error."""
    return [item for source in sources for item in _Reader(source, private).items()]


class _Reader:
    """Reads one source."""

    def __init__(self, source: Source, private: bool) -> None:
        self._source = source
        self._private = private
        self._tokens: list[Token] = []
        self._declarations = _parsed(source, self._tokens)
        self._starts = [token.pos for token in self._tokens]
        self._comments = Comments(source.text)

    def items(self) -> Iterator[Item]:
        """The declarations that pages show: no tests, and no configuration."""
        for declaration in self._declarations:
            if isinstance(declaration, ast.TypeDecl):
                yield self._type(declaration)
            elif isinstance(declaration, ast.GlobalBlock):
                yield self._globals(declaration)
            elif isinstance(declaration, ast.PouDecl) and self._is_shown(declaration.modifiers):
                yield self._pou(declaration, self._with_namespace(declaration))

    def _is_shown(self, modifiers: set[ast.Modifier]) -> bool:
        return self._private or not modifiers & _HIDDEN

    @staticmethod
    def _with_namespace(declaration: ast.TypeDecl | ast.PouDecl) -> str:
        namespace = declaration.namespace.name if declaration.namespace else ""
        return f"{namespace}.{declaration.name}" if namespace else declaration.name

    def _made(self, kind: str, name: str, pos: int, comment: str) -> Item:
        place = self._source.pos(pos)
        return Item(kind, name, place.file, place.line, read_markup(comment))

    def _pou(self, pou: ast.PouDecl, name: str) -> Item:
        end = self._end_of_head(pou.pos)
        comment = self._comments.before(pou.pos) or self._comments.first_inside(end)
        kind = "CLASS" if ast.Modifier.CLASS in pou.modifiers else pou.keyword.value
        item = self._made(kind, name, pou.pos, comment)
        item.head = " ".join(sorted(m.value for m in pou.modifiers - {ast.Modifier.CLASS}))
        item.result = "" if pou.result is None else self._text_of(pou.result.pos)
        item.bases, item.interfaces = [n for _, n in pou.bases], [n for _, n in pou.interfaces]
        item.variables = [
            variable
            for block in pou.blocks
            if block.keyword in SHOWN
            for variable in self._variables(block.decls, block.keyword.value, item.doc)
        ]
        item.members = list(self._members(pou.members))
        return item

    def _members(self, members: Sequence[ast.PouDecl]) -> Iterator[Item]:
        """Methods, actions and properties; a property is its GET, its SET or both."""
        properties: dict[str, Item] = {}
        for member in members:
            if not self._is_shown(member.modifiers):
                continue
            if member.keyword not in (ast.Unit.GET, ast.Unit.SET):
                yield self._pou(member, member.name)
                continue
            known = properties.get(member.name.casefold())
            if known is None:
                known = properties[member.name.casefold()] = self._pou(member, member.name)
                known.kind, known.head = "PROPERTY", member.keyword.value
                yield known
            else:
                known.head = "GET, SET"

    def _type(self, declaration: ast.TypeDecl) -> Item:
        comment = self._comments.about(declaration.pos, self._end_of(declaration.pos))
        item = self._made("TYPE", self._with_namespace(declaration), declaration.pos, comment)
        spec = declaration.spec
        if isinstance(spec, ast.StructSpec):
            item.head = "UNION" if spec.union else "STRUCT"
            item.bases = [spec.base.name] if spec.base else []
            item.variables = list(self._variables(spec.fields, "member", item.doc))
            if not self._comments.before(declaration.pos):
                item.doc = read_markup(self._comments.after(self._after_word(spec.pos)))
        elif isinstance(spec, ast.EnumSpec):
            item.head, item.result = "enumeration", spec.base or ""
            item.variables = list(self._values(spec))
        else:
            item.result = self._text_of(spec.pos)
        return item

    def _after_word(self, pos: int) -> int:
        at = bisect_left(self._starts, pos)
        return self._tokens[at].end if at < len(self._tokens) else pos

    def _values(self, spec: ast.EnumSpec) -> Iterator[Variable]:
        for pos, name, _ in spec.values:
            end = self._end_of(pos, stop="_COMMA")
            initial = self._after(pos, end)
            doc = read_markup(self._comments.about(pos, end))
            yield Variable(name, "", initial, "", "value", doc)

    def _globals(self, declaration: ast.GlobalBlock) -> Item:
        block = declaration.block
        kind = " ".join([block.keyword.value, *sorted(q.value for q in block.qualifiers)])
        item = self._made(kind, self._source.stem, block.pos, self._comments.before(block.pos))
        item.variables = list(self._variables(block.decls, block.keyword.value, item.doc))
        return item

    def _variables(self, declarations: Sequence[ast.VarDecl], section: str, doc: Markup) -> Iterator[Variable]:
        """The variables of a block; what the comment of the POU says of one stands before its own."""
        for declaration in declarations:
            end = self._end_of(declaration.pos)
            own = read_markup(self._comments.about(declaration.pos, end))
            address = "" if declaration.location is None else self._word_at(declaration.location.pos)
            for pos, name in declaration.names:
                said = doc.parameters.get(name.casefold())
                shown = Markup([*said, *own.body]) if said else own
                type_ = self._text_of(declaration.type.pos)
                yield Variable(name, type_, self._initial(pos), address, section, shown)

    def _word_at(self, pos: int) -> str:
        at = bisect_left(self._starts, pos)
        return self._tokens[at].text if at < len(self._tokens) else ""

    # ---- strings between tokens ----

    def _walk(self, pos: int) -> Iterator[tuple[Token, int]]:
        """The tokens from one on, each with the depth of brackets around it."""
        depth = 0
        for at in range(bisect_left(self._starts, pos), len(self._tokens)):
            token = self._tokens[at]
            change = _OPENED.get(token.type, 0)
            depth += min(change, 0)
            yield token, depth
            depth += max(change, 0)

    def _end_of(self, pos: int, stop: str = "") -> int:
        """The offset past the declaration that begins at one: its semicolon, comma or last token."""
        last = pos
        for token, depth in self._walk(pos):
            if depth < 0 or token.type.startswith("_END_"):
                return last
            last = token.end
            if depth == 0 and token.type in ("_SEMI", stop):
                return last
        return last

    def _end_of_head(self, pos: int) -> int:
        """The offset past the first line of a POU."""
        end = self._source.text.find("\n", pos)
        last = pos
        for token, _ in self._walk(pos):
            if end >= 0 and token.pos > end:
                break
            last = token.end
        return last

    def _text_of(self, pos: int) -> str:
        """A type as written, without comments, on one line."""
        words: list[Token] = []
        for token, depth in self._walk(pos):
            if depth < 0 or (depth == 0 and token.type in _CLOSED) or (words and token.type in ("VAR", "EDGE")):
                break
            if words and token.type.startswith("_END_") and token.type not in ("_END_STRUCT", "_END_UNION"):
                break
            if words and depth == 0 and not _continues(words[-1], token):
                break
            words.append(token)
        return _spaced(words)

    def _initial(self, pos: int) -> str:
        for token, depth in self._walk(pos):
            if depth == 0 and token.type == "_SEMI":
                break
            if depth == 0 and token.type == "_ASSIGN":
                return _spaced(self._until_end(token.end))
        return ""

    def _until_end(self, pos: int) -> list[Token]:
        found: list[Token] = []
        for token, depth in self._walk(pos):
            if depth < 0 or (depth == 0 and token.type == "_SEMI"):
                break
            found.append(token)
        return found

    def _after(self, pos: int, end: int) -> str:
        words = [token for token, _ in takewhile(lambda found: found[0].end <= end, self._walk(pos))]
        assigned = next((at for at, token in enumerate(words) if token.type == "_ASSIGN"), None)
        return "" if assigned is None else _spaced([w for w in words[assigned + 1 :] if w.type != "_COMMA"])


_BLANKS = re.compile(r" ([,;)\]])|([(\[]) | (\.\.?) | (?=[(\[])(?<=\w )")
"""Blanks that are not usual: before a comma, inside brackets, around points, after a name before a bracket."""

_TYPE_WORDS = frozenset(("_OF", "_TO", "ARRAY", "POINTER", "REFERENCE", "REF_TO", "_DOT"))


def _continues(last: Token, token: Token) -> bool:
    """True if a token belongs to the type whose last token is another."""
    opens = token.type in ("_LPAR", "_LSQB", "_OF", "_TO", "_DOT")
    return opens or last.type in _TYPE_WORDS or token.type in ("_RPAR", "_RSQB")


def _spaced(tokens: Sequence[Token]) -> str:
    """Tokens on one line, with blanks where they are usual."""
    text = " ".join(token.text for token in tokens)
    return _BLANKS.sub(lambda match: match[1] or match[2] or match[3] or "", text)


def _parsed(source: Source, tokens: list[Token]) -> list[ast.Declaration]:
    errors: list[tuple[int, str]] = []
    try:
        with room_for_nesting():
            found = parse_all(source, lambda at, code, message: errors.append((at, message)), tokens=tokens)
    except (NestingError, RecursionError):
        raise UsageError(f"{source.path}: something is nested too deeply.", "syntax") from None
    if errors:
        at, message = min(errors)
        pos = source.pos(at)
        raise UsageError(f"{pos.file}:{pos.line}:{pos.column}: {message}. Correct this first.", "syntax")
    return found.declarations
