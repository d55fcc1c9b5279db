"""Definition, type definition, implementation, references, highlights and rename."""

from __future__ import annotations

import re
from collections.abc import Iterator

from lsprotocol import types as lsp

from plctool.compiler.semantics.rules.builtin import is_built_in
from plctool.compiler.syntax.lexer import KEYWORDS
from plctool.iec.types import ELEMENTARY
from plctool.lsp.items import BODIES, Item, Kind
from plctool.lsp.names import Names, Shape
from plctool.lsp.project import Project
from plctool.lsp.session import Place, Refused, Session
from plctool.lsp.tree import Tree
from plctool.lsp.uses import Use

_NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)


def definition(session: Session, place: Place) -> lsp.Location | None:
    """Returns where what the word stands for is declared."""
    item = place.item()
    return None if item is None else session.location_of(item)


def type_definition(session: Session, place: Place) -> lsp.Location | None:
    """Returns where the type of the word is declared; of an array or pointer, that of what is in it."""
    item, names = place.item(), place.project.names
    shape = None if item is None else names.shape(item)
    while shape is not None and shape.item is None:
        shape = _inner(names, shape)
    return None if shape is None or shape.item is None else session.location_of(shape.item)


def _inner(names: Names, shape: Shape) -> Shape | None:
    element = names.element(shape)
    return element if element is not None else names.pointed_to(shape)


def implementation(session: Session, place: Place) -> list[lsp.Location]:
    """Returns the blocks that implement an interface or extend a block, or their methods of that name."""
    item, names = place.item(), place.project.names
    if item is None:
        return []
    if item.kind in BODIES and item.owner is not None:
        found = [
            d.inner[item.name.casefold()] for d in _all_derived(item.owner, names) if item.name.casefold() in d.inner
        ]
    else:
        shape = names.dereferenced(names.shape(item))
        base = shape.item if shape is not None and shape.item is not None else item
        found = list(_all_derived(base, names))
    return [where for each in found or [item] if (where := session.location_of(each)) is not None]


def _all_derived(item: Item, names: Names) -> Iterator[Item]:
    seen = {item.key}
    waiting = names.derived(item)[:]
    while waiting:
        each = waiting.pop(0)
        if each.key not in seen:
            seen.add(each.key)
            yield each
            waiting += names.derived(each)


# ---- references ----


def uses_of_item(project: Project, key: str) -> Iterator[tuple[Tree, Use]]:
    """Returns all words that stand for an item."""
    word = key.rpartition(".")[2]
    for tree in project.trees:
        if word in tree.source.text.casefold():
            for use in project.walk(tree).uses:
                if use.key == key:
                    yield tree, use


def references(session: Session, place: Place, *, declaration: bool) -> list[lsp.Location]:
    """Returns where what the word stands for is used."""
    use = place.use()
    if use is None:
        return []
    item = place.project.names.by_key(use.key)
    found = [
        session.location(tree.source, u.offset, u.length)
        for tree, u in uses_of_item(place.project, use.key)
        if declaration or not u.declares
    ]
    if declaration and item is not None and item.library and (where := session.location_of(item)) is not None:
        found.append(where)
    return found


def highlights(session: Session, place: Place) -> list[lsp.DocumentHighlight]:
    """Returns the same word in this text."""
    use = place.use()
    if use is None:
        return []
    kinds = lsp.DocumentHighlightKind
    return [
        lsp.DocumentHighlight(
            session.range(place.tree.source, u.offset, u.length), kinds.Write if u.writes else kinds.Read
        )
        for u in place.project.walk(place.tree).uses
        if u.key == use.key
    ]


# ---- rename ----


def prepare_rename(session: Session, place: Place) -> lsp.Range:
    """Returns the word that would be renamed. Raises Refused."""
    use, item = _renamed(place)
    _check_sources(place, item)
    return session.range(place.tree.source, use.offset, use.length)


def rename(session: Session, place: Place, name: str) -> lsp.WorkspaceEdit:
    """Returns the changes that give an item another name. Raises Refused if the program would be another one."""
    _, item = _renamed(place)
    changes: dict[str, list[lsp.TextEdit]] = {}
    for each in _family(item, place.project.names):
        _check_name(name, each, place)
        for tree, use in _check_sources(place, each):
            where = session.location(tree.source, use.offset, use.length)
            changes.setdefault(where.uri, []).append(lsp.TextEdit(where.range, name))
    return lsp.WorkspaceEdit(changes=changes)


def _family(item: Item, names: Names) -> list[Item]:
    """Returns an item; of a method or property also those that it overrides or implements, and that do so."""
    owner, key = item.owner, item.name.casefold()
    if item.kind not in BODIES or owner is None:
        return [item]
    owners, waiting = {owner.key: owner}, [owner]
    while waiting:
        each = waiting.pop()
        for other in (*names.bases(each), *names.interfaces(each), *names.derived(each)):
            if other.key not in owners and names.member(other, key) is not None:
                owners[other.key] = other
                waiting.append(other)
    found = [own for each in owners.values() if (own := each.inner.get(key)) is not None]
    library = next((each for each in found if each.library), None)
    if library is not None:
        raise Refused(f"{item.name} is declared in a library as well, by {library.unit.name}; it keeps its name.")
    return found


def _renamed(place: Place) -> tuple[Use, Item]:
    use, item = place.use(), place.item()
    if use is None or item is None:
        raise Refused("This is not a name that the program declares.")
    if item.library:
        raise Refused(f"{item.name} is declared in a library; only names of the program itself can be renamed.")
    if item.kind in (Kind.LIST, Kind.NAMESPACE, Kind.TEST):
        raise Refused(f"{item.name} is a {item.kind.value}; rename its file or its declaration by hand.")
    return use, item


def _check_sources(place: Place, item: Item) -> list[tuple[Tree, Use]]:
    """Returns all uses. Raises Refused if some cannot be changed."""
    found = list(uses_of_item(place.project, item.key))
    for tree, use in found:
        if tree.source.original is not None:
            pos = tree.source.pos(use.offset)
            raise Refused(
                f"{item.name} is used in {pos.file} (line {pos.line}), which is not plain text; rename it in the "
                "system that wrote the file."
            )
    broken = next(
        (t for t in place.project.trees if t.has_errors and item.name.casefold() in t.source.text.casefold()), None
    )
    if broken is not None:
        raise Refused(f"{broken.source.path} has syntax errors; correct them first, so that no use is overlooked.")
    return found


def _check_name(name: str, item: Item, place: Place) -> None:
    if not _NAME.fullmatch(name):
        raise Refused(f"'{name}' is not a name: it has letters, digits and _, and does not begin with a digit.")
    if name.upper() in KEYWORDS or name.upper() in ELEMENTARY or is_built_in(name):
        raise Refused(f"{name} is a word of the language; choose another name.")
    if "__" in name or name.endswith("_"):
        raise Refused(f"'{name}' is not a name: _ stands alone, and not at the end.")
    if name.casefold() == item.name.casefold():
        return
    if other := _conflict(name.casefold(), item, place):
        raise Refused(f"{name} is declared already: {other}.")


def _conflict(key: str, item: Item, place: Place) -> str:
    """Says what has the name already, where the item is declared or used."""
    project, names = place.project, place.project.names
    owner = item.owner
    if owner is not None and (found := names.member(owner, key)) is not None:
        return f"{found.kind.value} {found.full_name}"
    for tree, use in uses_of_item(project, item.key):
        unit = names.by_key(use.unit) if use.unit else None
        text = tree.source.text
        qualified = text[: use.offset].rstrip().endswith(".") and not use.declares
        found = None if qualified else names.value(key, unit)
        if found is not None:
            return f"{found.kind.value} {found.full_name}"
    others = [] if owner is not None else project.trees
    for tree in others:  # names that would mean the renamed item then
        if any(u.key.rpartition(".")[2] == key and u.key.startswith("global") for u in project.walk(tree).uses):
            return f"used in {tree.source.path} for something else"
    return ""


def selection_ranges(session: Session, place: Place) -> lsp.SelectionRange:
    """Returns the word, and the blocks around it."""
    source = place.tree.source
    tokens = place.tree.tokens
    found: lsp.SelectionRange | None = None
    blocks = place.tree.blocks
    while True:
        inner = next((b for b in blocks if tokens[b.first].pos <= place.offset <= tokens[b.last].end), None)
        if inner is None:
            break
        found = lsp.SelectionRange(session.span(source, tokens[inner.first].pos, tokens[inner.last].end), found)
        blocks = inner.inner
    word = place.token
    start, length = (word.pos, len(word.text)) if word is not None else (place.offset, 0)
    return lsp.SelectionRange(session.range(source, start, length), found)
