"""Symbols of a file and of all programs, semantic tokens, folding ranges."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from lsprotocol import types as lsp

from plctool.compiler.syntax import ast
from plctool.compiler.syntax.lexer import KEYWORDS
from plctool.doc.comments import spans
from plctool.iec.types import ELEMENTARY
from plctool.lsp import describe
from plctool.lsp.items import Item, Kind
from plctool.lsp.names import STANDARD, Names
from plctool.lsp.outline import SECTIONS, UNITS, Block
from plctool.lsp.project import Project
from plctool.lsp.session import Session
from plctool.lsp.tree import Tree

_S = lsp.SymbolKind
SYMBOL_KINDS = {
    Kind.PROGRAM: _S.Module, Kind.FUNCTION: _S.Function, Kind.FUNCTION_BLOCK: _S.Class, Kind.INTERFACE: _S.Interface,
    Kind.METHOD: _S.Method, Kind.ACTION: _S.Method, Kind.PROPERTY: _S.Property, Kind.TYPE: _S.Class,
    Kind.STRUCT: _S.Struct, Kind.ENUM: _S.Enum, Kind.VALUE: _S.EnumMember, Kind.VARIABLE: _S.Variable,
    Kind.GLOBAL: _S.Variable, Kind.FIELD: _S.Field, Kind.STEP: _S.Event, Kind.LIST: _S.Namespace,
    Kind.NAMESPACE: _S.Namespace, Kind.CONFIGURATION: _S.Package, Kind.TASK: _S.Event, Kind.INSTANCE: _S.Object,
    Kind.TEST: _S.Function,
}  # fmt: skip
_MAX_FOUND = 500  # symbols of all programs that are shown for what was typed


def document_symbols(session: Session, project: Project, trees: Iterable[Tree]) -> list[lsp.DocumentSymbol]:
    """Returns what a file declares, members below their units."""
    found = []
    for tree in trees:
        ranges = _ranges(tree)
        outer: list[Item] = [*tree.items.units, *tree.items.others]
        if tree.items.list is not None:
            outer.append(tree.items.list)
        outer += [g for g in tree.items.globals if g.owner is None and not _is_in(g, tree.items.list)]
        own = [item for item in outer if item.source is tree.source]
        found += [_symbol(session, item, tree, ranges, project.names) for item in sorted(own, key=lambda i: i.offset)]
    return found


def _is_in(item: Item, group: Item | None) -> bool:
    return group is not None and group.inner.get(item.name.casefold()) is item


def _ranges(tree: Tree) -> dict[int, tuple[int, int]]:
    """The whole of each unit, by the offset of its name."""
    found: dict[int, tuple[int, int]] = {}
    tokens = tree.tokens
    for block in (
        b for top in tree.blocks for b in top.every() if b.kind in UNITS or b.kind in ("NAMESPACE", "GLOBAL")
    ):
        at = block.first + 1
        while at < block.last and tokens[at].type == "MODIFIER":
            at += 1
        whole = (tokens[block.first].pos, tokens[block.last].end)
        found[tokens[at].pos] = whole
        found[tokens[block.first].pos] = whole
    return found


def _symbol(
    session: Session, item: Item, tree: Tree, ranges: dict[int, tuple[int, int]], names: Names
) -> lsp.DocumentSymbol:
    source = tree.source
    length = len(item.name) if source.text.startswith(item.name, item.offset) else 0
    start, end = ranges.get(item.offset, (item.offset, item.offset + length))
    if item.kind is Kind.LIST:
        offsets = [i.offset for i in item.inner.values()]
        start, end = min([item.offset, *offsets]), max([item.offset, *offsets]) + 1
    selection = session.range(source, item.offset, length)
    whole = session.span(source, min(start, item.offset), max(end, item.offset + length))
    if not (whole.start <= selection.start and selection.end <= whole.end):
        whole = selection  # parts of the text are from other places of the file
    inner = [
        _symbol(session, i, tree, ranges, names)
        for i in sorted(item.inner.values(), key=lambda i: i.offset)
        if i.source is source
    ]
    constant = ast.Modifier.CONSTANT in item.qualifiers
    kind = _S.Constant if constant else SYMBOL_KINDS[item.kind]
    return lsp.DocumentSymbol(
        item.name or "(no name)", kind, whole, selection, describe.detail(item, names), None, None, inner
    )


def workspace_symbols(session: Session, projects: Iterable[Project], query: str) -> list[lsp.WorkspaceSymbol]:
    """Returns the items of all programs whose names have the letters of the query in their order."""
    wanted = query.casefold().replace(" ", "")
    found: list[tuple[int, str, Item]] = []
    for project in projects:
        for item in project.names.every():
            if item.library or item.kind in (Kind.LIST, Kind.NAMESPACE) or not item.name:
                continue
            rank = rank_of(wanted, item.name)
            if rank >= 0:
                found.append((rank + (item.owner is not None), item.name.casefold(), item))
    found.sort(key=lambda f: (f[0], f[1]))
    symbols = []
    for _, _, item in found[:_MAX_FOUND]:
        where = session.location_of(item)
        if where is not None:
            owner = item.owner.full_name if item.owner is not None else None
            symbols.append(lsp.WorkspaceSymbol(where, item.name, SYMBOL_KINDS[item.kind], container_name=owner))
    return symbols


def rank_of(wanted: str, name: str) -> int:
    """Returns how well a name fits what was typed: 0 begins with it, 2 contains it, 4 has its letters; -1 does not."""
    key = name.casefold()
    if key.startswith(wanted):
        return 0
    if wanted in key:
        return 2
    rest = iter(key)
    return 4 if all(letter in rest for letter in wanted) else -1


# ---- semantic tokens ----

TOKEN_TYPES = [
    "namespace", "class", "interface", "struct", "enum", "enumMember", "type", "function", "method", "property",
    "variable", "parameter", "keyword", "number", "string", "comment", "operator", "macro",
]  # fmt: skip
TOKEN_MODIFIERS = ["declaration", "readonly", "modification", "defaultLibrary", "static"]
_TYPE_OF_ITEM = {
    Kind.PROGRAM: "class", Kind.FUNCTION: "function", Kind.FUNCTION_BLOCK: "class", Kind.INTERFACE: "interface",
    Kind.METHOD: "method", Kind.ACTION: "method", Kind.PROPERTY: "property", Kind.TYPE: "type", Kind.STRUCT: "struct",
    Kind.ENUM: "enum", Kind.VALUE: "enumMember", Kind.VARIABLE: "variable", Kind.GLOBAL: "variable",
    Kind.FIELD: "property", Kind.STEP: "variable", Kind.LIST: "namespace", Kind.NAMESPACE: "namespace",
    Kind.CONFIGURATION: "namespace", Kind.TASK: "variable", Kind.INSTANCE: "variable", Kind.TEST: "function",
}  # fmt: skip
_OPERATORS = frozenset(("OP", "SIGN", "EQ", "_ASSIGN", "_ARROW", "ATTEMPT", "NOT"))
_LITERALS = {"NUMBER": "number", "DIRECT": "variable", "STRING": "string", "TYPED": "number"}


def semantic_tokens(session: Session, project: Project, trees: Iterable[Tree]) -> lsp.SemanticTokens:
    """Returns the kind of each word of a file."""
    found: list[tuple[int, int, int, int, int]] = []
    for tree in trees:
        for offset, length, kind, modifiers in _kinds(project, tree):
            if "\n" in tree.source.text[offset : offset + length] or not tree.source.is_copied(offset):
                continue
            where = session.range(tree.source, offset, length)
            width = where.end.character - where.start.character
            found.append((where.start.line, where.start.character, width, TOKEN_TYPES.index(kind), modifiers))
    data: list[int] = []
    line = column = 0
    for each in sorted(found):
        if each[0] != line:
            column = 0
        data += [each[0] - line, each[1] - column, *each[2:]]
        line, column = each[:2]
    return lsp.SemanticTokens(data)


def _kinds(project: Project, tree: Tree) -> Iterator[tuple[int, int, str, int]]:
    uses = {use.offset: use for use in project.walk(tree).uses}
    names = project.names
    for token in tree.tokens:
        use = uses.get(token.pos)
        if use is not None:
            item = names.by_key(use.key)
            if item is not None:
                modifiers = _modifiers(item, declares=use.declares, writes=use.writes)
                yield use.offset, use.length, _type_of(item), modifiers
            value = uses.get(token.pos + use.length + 1) if token.type == "TYPED" else None
            if value is not None:
                yield value.offset, value.length, "enumMember", 0
        elif token.type == "IDENT":
            if token.text.upper() in ELEMENTARY:
                yield token.pos, len(token.text), "type", 8
        elif token.type in _LITERALS:
            yield token.pos, len(token.text), _LITERALS[token.type], 0
        elif token.text.upper() in KEYWORDS:
            yield token.pos, len(token.text), "type" if token.type == "TEXT" else "keyword", 0
        elif token.type in _OPERATORS:
            yield token.pos, len(token.text), "operator", 0


def _type_of(item: Item) -> str:
    return "parameter" if item.is_parameter else _TYPE_OF_ITEM[item.kind]


def _modifiers(item: Item, *, declares: bool, writes: bool) -> int:
    constant = ast.Modifier.CONSTANT in item.qualifiers or item.kind is Kind.VALUE
    return declares * 1 + constant * 2 + writes * 4 + (item.library == STANDARD) * 8 + (item.kind is Kind.GLOBAL) * 16


# ---- folding ----


def folding(session: Session, trees: Iterable[Tree]) -> list[lsp.FoldingRange]:
    """Returns the lines of units, sections, statements and comments."""
    found: dict[tuple[int, int], lsp.FoldingRange] = {}
    for tree in trees:
        source, tokens = tree.source, tree.tokens
        for block in (b for top in tree.blocks for b in top.every()):
            first, last = source.pos(tokens[block.first].pos), source.pos(tokens[block.last].pos)
            end = last.line - (2 if block.closed else 1)
            if end > first.line - 1 and first.file == last.file:
                found.setdefault((first.line - 1, end), lsp.FoldingRange(first.line - 1, end, kind=_fold_kind(block)))
        if source.original is None:
            for start, end in _comment_lines(source.text):
                comment = lsp.FoldingRange(start, end, kind=lsp.FoldingRangeKind.Comment)
                found.setdefault((start, end), comment)
    return [found[key] for key in sorted(found)]


def _fold_kind(block: Block) -> lsp.FoldingRangeKind | None:
    return lsp.FoldingRangeKind.Region if block.kind in SECTIONS else None


def _comment_lines(text: str) -> Iterator[tuple[int, int]]:
    """The first and last lines of comments of several lines, and of line comments that follow each other."""
    run: list[int] = []
    line = at = 0
    for start, end in spans(text):
        line += text.count("\n", at, start)
        at = start
        lines = text.count("\n", start, end)
        alone = not text[text.rfind("\n", 0, at) + 1 : at].strip()
        if lines:
            yield line, line + lines
        elif alone and text.startswith("//", start):
            if run and run[1] == line - 1:
                run[1] = line
                continue
            if run and run[1] > run[0]:
                yield run[0], run[1]
            run = [line, line]
    if run and run[1] > run[0]:
        yield run[0], run[1]
