"""Hover and signature help."""

from __future__ import annotations

from lsprotocol import types as lsp

from plctool.compiler.syntax import ast
from plctool.lsp import describe
from plctool.lsp.items import Item, Kind
from plctool.lsp.names import Names, written
from plctool.lsp.session import Place, Session
from plctool.lsp.uses import Site


def variable_at(place: Place) -> str:
    """Returns the name in the controller of the variable at a place; "" if the word is not one."""
    use, item = place.use(), place.item()
    is_variable = item is not None and item.kind in (Kind.VARIABLE, Kind.GLOBAL, Kind.FIELD)
    return _path(place, use.offset) if use is not None and is_variable else ""


def hover(session: Session, place: Place, value: str = "") -> lsp.Hover | None:
    """Returns the declaration of the word, its comment, its type and address. `value`: what is said of its value."""
    use = place.use()
    names = place.project.names
    item = None if use is None else names.by_key(use.key)
    if use is None or item is None:
        return _built_in(session, place)
    parts = [f"```iecst\n{describe.declaration(item, names)}\n```"]
    if comment := describe.comment(item):
        parts.append(_plain(comment))
    if facts := _facts(item, names):
        parts.append(_plain("\n".join(facts)))
    if value:
        parts.append(value)
    text = "\n\n".join(parts)
    found = session.range(place.tree.source, use.offset, use.length)
    return lsp.Hover(lsp.MarkupContent(lsp.MarkupKind.Markdown, text), found)


def _facts(item: Item, names: Names) -> list[str]:
    facts = []
    shape = names.shape(item)
    if item.line is not None and shape is not None and shape.item is not None:
        facts.append(f"Type: {shape.item.kind.value} {shape.item.name}")
    if item.line is not None and item.line.location is not None:
        facts.append(f"Address: {item.line.location.text}")
    if origin := describe.origin(item):
        facts.append(f"In: {origin}")
    return facts


def _path(place: Place, offset: int) -> str:
    """Returns the name of a variable with those before it, as in `Main.pump.speed`; "" for what has no such name."""
    uses = [u for u in place.project.walk(place.tree).uses if u.offset <= offset]
    at = len(uses) - 1
    text = place.tree.source.text
    words = [text[uses[at].offset : uses[at].offset + uses[at].length]]
    while at > 0 and text[uses[at - 1].offset + uses[at - 1].length : uses[at].offset].strip() == ".":
        at -= 1
        words.insert(0, text[uses[at].offset : uses[at].offset + uses[at].length])
    first = place.project.names.by_key(uses[at].key)
    if first is None:
        return ""
    if first.kind is Kind.GLOBAL:
        return ".".join(words)
    unit = first.unit
    return (
        ".".join([unit.name, *words])
        if unit.kind is Kind.PROGRAM and first.owner is unit
        else ".".join(words) * (first.kind in (Kind.PROGRAM, Kind.LIST))
    )


def _plain(text: str) -> str:
    """A comment as Markdown, with its own line breaks and without marks that mean something there."""
    escaped = text.replace("\\", "\\\\").replace("*", "\\*").replace("_", "\\_").replace("`", "\\`").replace("<", "\\<")
    return "  \n".join(line.strip() for line in escaped.split("\n"))


def _built_in(session: Session, place: Place) -> lsp.Hover | None:
    token = place.token
    if token is None or token.type != "IDENT" or token.text.upper() not in place.project.names.built_in():
        return None
    found = session.range(place.tree.source, token.pos, len(token.text))
    text = f"```iecst\n{token.text.upper()}(...)\n```\n\nA function that the compiler knows itself."
    return lsp.Hover(lsp.MarkupContent(lsp.MarkupKind.Markdown, text), found)


# ---- signature help ----


def signature(session: Session, place: Place) -> lsp.SignatureHelp | None:
    """Returns the parameters of the call that the position is in."""
    project, offset = place.project, place.offset
    text = place.tree.source.text
    sites = [s for s in project.walk(place.tree).sites if s.opening < offset and (s.closing < 0 or offset <= s.closing)]
    site = sites[-1] if sites else None
    if site is None or (site.closing < 0 and ";" in text[site.opening : offset]):
        return None
    callee = project.names.by_key(site.callee)
    if callee is None:
        return None
    parameters = _parameters(callee, project.names)
    shown = [lsp.ParameterInformation(_shown(p), describe.comment(p) or None) for p in parameters]
    result = f" : {describe.detail(callee, project.names)}" if callee.spec is not None else ""
    label = f"{callee.name}({', '.join(str(p.label) for p in shown)}){result}"
    active = _active(site, offset, parameters, text)
    comment = describe.comment(callee)
    return lsp.SignatureHelp([lsp.SignatureInformation(label, comment or None, shown)], 0, active)


def _parameters(callee: Item, names: Names) -> list[Item]:
    """The parameters of a callee, with those of what it extends."""
    return [m for m in names.members(callee).values() if m.is_parameter]


def _shown(parameter: Item) -> str:
    sign = "=>" if parameter.section is ast.Section.VAR_OUTPUT else ":="
    assert parameter.line is not None
    return f"{parameter.name} {sign} {written(parameter.line.type)}"


def _active(site: Site, offset: int, parameters: list[Item], text: str) -> int | None:
    """The index of the parameter that is written."""
    before = [a for a in site.arguments if a.offset <= offset]
    last = before[-1] if before else None
    since = last.offset if last is not None else site.opening + 1
    if last is not None and "," not in text[since:offset]:
        if last.name:
            keys = [p.name.casefold() for p in parameters]
            return keys.index(last.name.casefold()) if last.name.casefold() in keys else None
        return len(before) - 1
    if any(a.name for a in before):
        return None
    return len(before)
