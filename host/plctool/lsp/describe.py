"""How an item is shown: its declaration as it is written, its comment, its type."""

from __future__ import annotations

from plctool.compiler.syntax import ast
from plctool.doc.comments import comments_in
from plctool.lsp.items import Item, Kind
from plctool.lsp.names import STANDARD, Names, expression, written

_MAX_PARAMETERS = 40
_MAX_VALUES = 30


def declaration(item: Item, names: Names) -> str:
    """Returns the declaration of an item as Structured Text."""
    if item.kind is Kind.VALUE:
        owner = item.owner.name if item.owner is not None else ""
        value = f" := {expression(item.decl)}" if item.decl is not None else ""
        return f"{owner}#{item.name}{value}" if owner else f"{item.name}{value}"
    if item.line is not None:
        return f"{_section(item)}\n    {_line(item)}" if item.section is not None else _line(item)
    if item.kind in (Kind.FUNCTION, Kind.FUNCTION_BLOCK, Kind.METHOD, Kind.PROGRAM):
        return _unit(item)
    if item.kind is Kind.ENUM and isinstance(item.spec, ast.EnumSpec):
        return f"TYPE {item.name} : {_values(item)}"
    if item.kind is Kind.STRUCT:
        word = "UNION" if isinstance(item.spec, ast.StructSpec) and item.spec.union else "STRUCT"
        fields = "\n".join(f"    {_line(f)}" for f in list(item.inner.values())[:_MAX_PARAMETERS])
        return f"TYPE {item.name} : {word}\n{fields}\nEND_{word}"
    if item.kind is Kind.TYPE and item.spec is not None:
        return f"TYPE {item.name} : {written(item.spec)}"
    result = f" : {written(item.spec)}" if item.spec is not None else ""
    return f"{item.kind.value} {item.name}{result}"


def _section(item: Item) -> str:
    assert item.section is not None
    words = sorted(q.value for q in item.qualifiers)
    return " ".join([item.section.value, *words])


def _line(item: Item) -> str:
    line = item.line
    assert line is not None
    place = f" AT {line.location.text}" if line.location is not None else ""
    value = f" := {_initial(line.init)}" if line.init is not None else ""
    return f"{item.name}{place} : {written(line.type)}{value};"


def _initial(value: ast.Init) -> str:
    if isinstance(value, ast.ArrayInit):
        return "[...]"
    return "(...)" if isinstance(value, ast.StructInit) else expression(value)


def _values(item: Item) -> str:
    assert isinstance(item.spec, ast.EnumSpec)
    shown = [
        name if value is None else f"{name} := {expression(value)}" for _, name, value in item.spec.values[:_MAX_VALUES]
    ]
    more = ", ..." if len(item.spec.values) > _MAX_VALUES else ""
    return f"({', '.join(shown)}{more}){f' {item.spec.base}' if item.spec.base else ''}"


def _unit(item: Item) -> str:
    decl = item.decl
    words = sorted(m.value for m in decl.modifiers) if isinstance(decl, ast.PouDecl) else []
    result = f" : {written(item.spec)}" if item.spec is not None else ""
    head = " ".join([item.kind.value, *words, item.name]) + result
    if isinstance(decl, ast.PouDecl):
        if decl.bases:
            head += f" EXTENDS {', '.join(name for _, name in decl.bases)}"
        if decl.interfaces:
            head += f" IMPLEMENTS {', '.join(name for _, name in decl.interfaces)}"
    lines = [head]
    section = None
    for parameter in item.parameters()[:_MAX_PARAMETERS]:
        if parameter.section is not section:
            lines += ["END_VAR"] * (section is not None)
            section = parameter.section
            lines.append(_section(parameter))
        lines.append(f"    {_line(parameter)}")
    if section is not None:
        lines.append("END_VAR")
    return "\n".join(lines)


def comment(item: Item) -> str:
    """Returns the comment about a declaration."""
    return comments_in(item.source.text).of_line(item.offset)


def detail(item: Item, names: Names) -> str:
    """Returns the type of an item, or its kind, in a few words."""
    if item.line is not None and item.spec is not None:
        return written(item.spec)
    if item.spec is not None and item.kind in (Kind.FUNCTION, Kind.METHOD, Kind.PROPERTY):
        return written(item.spec)
    if item.kind is Kind.VALUE and item.owner is not None:
        return item.owner.name
    return item.kind.value


def origin(item: Item) -> str:
    """Returns where an item is from, if it is not from the program itself."""
    if item.library == STANDARD:
        return "standard library"
    if item.library:
        return f"library {item.library}"
    if item.owner is not None and item.owner.name:
        return item.owner.full_name
    return ""
