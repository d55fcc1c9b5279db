"""Call hierarchy, type hierarchy and inlay hints."""

from __future__ import annotations

from collections.abc import Iterable

from lsprotocol import types as lsp

from plctool.compiler.syntax import ast
from plctool.lsp import describe
from plctool.lsp.items import CALLED, Item, Kind
from plctool.lsp.project import Project
from plctool.lsp.session import Place, Session
from plctool.lsp.symbols import SYMBOL_KINDS
from plctool.lsp.tree import Tree

# ---- calls ----


def prepare_calls(session: Session, place: Place) -> list[lsp.CallHierarchyItem]:
    """Returns the unit that the word stands for, of an instance its block; else the unit around."""
    names, item = place.project.names, place.item()
    if item is not None and item.kind not in CALLED:
        shape = names.dereferenced(names.shape(item))
        item = shape.item if shape is not None else None
    if item is None or item.kind not in CALLED:
        use = [u for u in place.project.walk(place.tree).uses if u.offset <= place.offset]
        item = names.by_key(use[-1].unit) if use and use[-1].unit else None
    return [] if item is None else _call_items(session, item)


def _call_items(session: Session, item: Item) -> list[lsp.CallHierarchyItem]:
    where = session.location_of(item)
    if where is None:
        return []
    detail = describe.origin(item) or item.kind.value
    kind = SYMBOL_KINDS[item.kind]
    return [
        lsp.CallHierarchyItem(
            item.name, kind, where.uri, where.range, where.range, detail=detail, data={"key": item.key}
        )
    ]


def incoming(session: Session, project: Project, key: str) -> list[lsp.CallHierarchyIncomingCall]:
    """Returns the units that call a unit."""
    found: dict[str, list[lsp.Range]] = {}
    for tree in project.trees:
        for site in project.walk(tree).sites:
            if site.callee == key and site.unit:
                found.setdefault(site.unit, []).append(session.range(tree.source, site.opening, 1))
    calls = []
    for unit, ranges in found.items():
        item = project.names.by_key(unit)
        for shown in [] if item is None else _call_items(session, item):
            calls.append(lsp.CallHierarchyIncomingCall(shown, ranges))
    return calls


def outgoing(session: Session, project: Project, key: str) -> list[lsp.CallHierarchyOutgoingCall]:
    """Returns what a unit calls."""
    found: dict[str, list[lsp.Range]] = {}
    for tree in project.trees:
        for site in project.walk(tree).sites:
            if site.unit == key:
                found.setdefault(site.callee, []).append(session.range(tree.source, site.opening, 1))
    calls = []
    for callee, ranges in found.items():
        item = project.names.by_key(callee)
        for shown in [] if item is None else _call_items(session, item):
            calls.append(lsp.CallHierarchyOutgoingCall(shown, ranges))
    return calls


# ---- types ----

_TYPED = frozenset((Kind.FUNCTION_BLOCK, Kind.INTERFACE, Kind.STRUCT))


def prepare_types(session: Session, place: Place) -> list[lsp.TypeHierarchyItem]:
    """Returns the block, interface or structure that the word stands for or is an instance of."""
    names, item = place.project.names, place.item()
    if item is not None and item.kind not in _TYPED:
        shape = names.dereferenced(names.shape(item))
        item = shape.item if shape is not None else None
    return [] if item is None or item.kind not in _TYPED else _type_items(session, [item])


def _type_items(session: Session, items: Iterable[Item]) -> list[lsp.TypeHierarchyItem]:
    found = []
    for item in items:
        where = session.location_of(item)
        if where is not None:
            found.append(
                lsp.TypeHierarchyItem(
                    item.name,
                    SYMBOL_KINDS[item.kind],
                    where.uri,
                    where.range,
                    where.range,
                    detail=item.kind.value,
                    data={"key": item.key},
                )
            )
    return found


def supertypes(session: Session, project: Project, key: str) -> list[lsp.TypeHierarchyItem]:
    """Returns what a block, interface or structure extends and implements."""
    item = project.names.by_key(key)
    if item is None:
        return []
    return _type_items(session, [*project.names.bases(item), *project.names.interfaces(item)])


def subtypes(session: Session, project: Project, key: str) -> list[lsp.TypeHierarchyItem]:
    """Returns what extends or implements a block, interface or structure."""
    item = project.names.by_key(key)
    return [] if item is None else _type_items(session, project.names.derived(item))


# ---- inlay hints ----


def inlay_hints(session: Session, project: Project, tree: Tree, within: lsp.Range) -> list[lsp.InlayHint]:
    """Returns the names of parameters before arguments without one, and the tasks of programs after their names."""
    return [
        hint
        for hint in (*_parameter_hints(session, project, tree), *_task_hints(session, project, tree))
        if within.start.line <= hint.position.line <= within.end.line
    ]


def _parameter_hints(session: Session, project: Project, tree: Tree) -> list[lsp.InlayHint]:
    names, hints = project.names, []
    text = tree.source.text
    for site in project.walk(tree).sites:
        callee = names.by_key(site.callee)
        if callee is None or any(a.name for a in site.arguments):
            continue
        parameters = [m for m in names.members(callee).values() if m.is_parameter]
        if callee.kind is Kind.FUNCTION and len(parameters) < 2:
            continue  # SIN(x)
        for argument, parameter in zip(site.arguments, parameters, strict=False):
            if text[argument.offset :].casefold().startswith(parameter.name.casefold()):
                continue
            where = session.range(tree.source, argument.offset, 0).start
            label = f"{parameter.name} :="
            hints.append(lsp.InlayHint(where, label, lsp.InlayHintKind.Parameter, padding_right=True))
    return hints


def _task_hints(session: Session, project: Project, tree: Tree) -> list[lsp.InlayHint]:
    programs = [u for u in tree.items.units if u.kind is Kind.PROGRAM and u.source is tree.source]
    if not programs:
        return []
    tasks: dict[str, list[str]] = {}
    for configuration in (o for o in project.names.others if isinstance(o.decl, ast.ConfigurationDecl)):
        assert isinstance(configuration.decl, ast.ConfigurationDecl)
        for instance in configuration.decl.programs:
            if instance.task is not None:
                said = f"{instance.task[1]}{_interval(configuration.decl, instance.task[1])}"
                tasks.setdefault(instance.type_name.casefold(), []).append(said)
    hints = []
    for program in programs:
        if found := tasks.get(program.name.casefold()):
            end = session.range(tree.source, program.offset, len(program.name)).end
            label = f"task {', '.join(dict.fromkeys(found))}"
            hints.append(lsp.InlayHint(end, label, lsp.InlayHintKind.Type, padding_left=True))
    return hints


def _interval(configuration: ast.ConfigurationDecl, task: str) -> str:
    """The interval of a task as T#10ms, with a blank before it; "" for one that has none."""
    found = next((t for t in configuration.tasks if t.name.casefold() == task.casefold()), None)
    if found is None:
        return ""
    for _, name, value in found.properties:
        if name.upper() == "INTERVAL" and isinstance(value, ast.Literal) and isinstance(value.value, int):
            return f" every {value.value / 1e6:g} ms"
    return ""
