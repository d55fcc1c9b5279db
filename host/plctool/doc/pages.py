"""The pages: one for each declaration, and an index."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import PurePath

from plctool.doc.diagram import diagram, has_diagram
from plctool.doc.links import Links, anchor
from plctool.doc.model import Item, Variable
from plctool.doc.writers import Html, Markdown

FORMATS = ("html", "markdown")
_GROUPS = (
    ("Function blocks and classes", ("FUNCTION_BLOCK", "CLASS")),
    ("Functions", ("FUNCTION",)),
    ("Interfaces", ("INTERFACE",)),
    ("Types", ("TYPE",)),
    ("Programs", ("PROGRAM",)),
    ("Global variables", ("VAR_GLOBAL",)),
)
_SECTIONS = (
    ("Inputs", ("VAR_INPUT",)),
    ("In-outs", ("VAR_IN_OUT",)),
    ("Outputs", ("VAR_OUTPUT",)),
    ("Members", ("member",)),
    ("Values", ("value",)),
    ("Variables", ("VAR_GLOBAL",)),
)


@dataclass(frozen=True)
class Title:
    """What the first page says above its lists."""

    name: str
    version: str = ""
    description: str = ""


def pages(items: Sequence[Item], title: Title, form: str) -> dict[str, str]:
    """The files of a documentation by their names."""
    items = _merged(items)
    return dict((_html_pages if form == "html" else _markdown_pages)(items, title))


def _merged(items: Sequence[Item]) -> list[Item]:
    """Global variables of one file are one item."""
    found: list[Item] = []
    lists: dict[tuple[str, str], Item] = {}
    for item in items:
        key = (item.file, item.name)
        if item.kind.startswith("VAR_GLOBAL") and key in lists:
            lists[key].variables += item.variables
            continue
        if item.kind.startswith("VAR_GLOBAL"):
            item.kind = "VAR_GLOBAL"
            lists[key] = item
        found.append(item)
    return found


def _grouped(items: Sequence[Item]) -> Iterator[tuple[str, list[Item]]]:
    by_kind: defaultdict[str, list[Item]] = defaultdict(list)
    for item in items:
        by_kind[item.kind].append(item)
    for name, kinds in _GROUPS:
        if members := [item for kind in kinds for item in by_kind[kind]]:
            yield name, sorted(members, key=lambda item: item.name.casefold())


def _used_by(items: Sequence[Item], links: Links) -> dict[int, list[Item]]:
    """Which declarations name each one as a type, base or interface."""
    by_page = {links.page(item): item for item in items}
    found: defaultdict[int, list[Item]] = defaultdict(list)
    for item in items:
        texts = [
            text
            for part in (item, *item.members)
            for text in (part.result, *part.bases, *part.interfaces, *(v.type for v in part.variables))
        ]
        targets = [target for text in texts for target in links.targets(text)]
        for target in dict.fromkeys(targets):
            other = by_page.get(target.partition("#")[0])
            if other is not None and other is not item:
                found[id(other)].append(item)
    return found


def signature(item: Item) -> str:
    """The head of a declaration, as ST writes it."""
    words = [item.kind, item.head] if item.kind not in ("TYPE", "PROPERTY", "VAR_GLOBAL") else [item.kind]
    text = " ".join([*filter(None, words), item.name])
    if item.result:
        text += f" : {item.result}"
    elif item.kind == "TYPE":
        text += f" : {item.head}"
    if item.kind == "PROPERTY":
        text += f" ({item.head})"
    if item.bases:
        text += f" EXTENDS {', '.join(item.bases)}"
    return text + (f" IMPLEMENTS {', '.join(item.interfaces)}" if item.interfaces else "")


# ---- HTML ----

STYLE = """\
:root { color-scheme: light dark; --line: #8884; --faint: #8882; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 0 auto; padding: 1rem; }
nav { font-size: .9rem; } h1, h2, h3 { line-height: 1.2; } h2 { border-bottom: 1px solid var(--line); }
code, pre, .signature { font-family: ui-monospace, monospace; font-size: .9em; }
pre, .signature { background: var(--faint); padding: .6rem; overflow-x: auto; }
table { border-collapse: collapse; width: 100%; } td, th { border: 1px solid var(--line); padding: .3rem .6rem;
text-align: left; vertical-align: top; } td p { margin: 0; } .note { border-left: 4px solid #48f; padding: .2rem 1rem;
background: var(--faint); } .warning, .danger, .caution, .attention { border-color: #f80; } .place { opacity: .7; }
svg.diagram { max-width: 100%; height: auto; }
"""
_POLICY = "default-src 'none'; style-src 'self'; img-src 'self'"


def _html_pages(items: Sequence[Item], title: Title) -> Iterator[tuple[str, str]]:
    links = Links(items, ".html")
    writer = Html(links)
    used = _used_by(items, links)
    yield "style.css", STYLE
    yield "index.html", _html_page(title.name, "", _html_index(items, title, links, writer))
    for item in items:
        yield links.page(item), _html_page(item.name, title.name, _html_item(item, writer, used[id(item)]))


def _html_page(name: str, top: str, body: str) -> str:
    nav = f'<nav><a href="index.html">{escape(top)}</a></nav>\n' if top else ""
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(name)}</title>\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<link rel="stylesheet" href="style.css"></head>\n<body>\n{nav}<main>\n{body}</main>\n</body></html>\n'
    )


def _html_index(items: Sequence[Item], title: Title, links: Links, writer: Html) -> str:
    version = f" {title.version}" if title.version else ""
    parts = [f"<h1>{escape(title.name)}{escape(version)}</h1>\n"]
    if title.description:
        parts.append(f"<p>{escape(title.description)}</p>\n")
    for name, members in _grouped(items):
        rows = "".join(
            f"<tr><td>{writer.link(item.name, links.page(item))}</td><td>{escape(item.doc.summary)}</td></tr>\n"
            for item in members
        )
        parts.append(f"<h2>{name}</h2>\n<table>\n{rows}</table>\n")
    return "".join(parts)


def _html_item(item: Item, writer: Html, used: Sequence[Item]) -> str:
    parts = [f"<h1>{escape(item.name)}</h1>\n", *_html_parts(item, writer)]
    for member in item.members:
        parts.append(f'<h2 id="{escape(anchor(member.name))}">{escape(member.name)}</h2>\n')
        parts += _html_parts(member, writer)
    if used:
        names = ", ".join(writer.link(other.name, writer.links.page(other)) for other in used)
        parts.append(f"<h2>Used by</h2>\n<p>{names}</p>\n")
    parts.append(f'<p class="place">{escape(PurePath(item.file).name)}, line {item.line}</p>\n')
    return "".join(parts)


def _html_parts(item: Item, writer: Html) -> Iterator[str]:
    yield f'<p class="signature">{writer.links.linked(signature(item), writer.text, writer.link)}</p>\n'
    yield writer.write(item.doc.body)
    if has_diagram(item):
        yield f"{diagram(item)}\n"
    for name, sections in _SECTIONS:
        if rows := item.of(*sections):
            yield f"<h3>{name}</h3>\n{_html_table(rows, writer)}"
    if item.doc.result:
        yield f"<h3>Returns</h3>\n{writer.write(item.doc.result)}"


def _html_table(rows: Sequence[Variable], writer: Html) -> str:
    head, *cells = _columns(rows, writer.typed, lambda v: writer.write(v.doc.body))
    lines = ["".join(f"<th>{name}</th>" for name in head), *("".join(f"<td>{c}</td>" for c in row) for row in cells)]
    return "<table>\n" + "".join(f"<tr>{line}</tr>\n" for line in lines) + "</table>\n"


def _columns(
    rows: Sequence[Variable], typed: Callable[[str], str], said: Callable[[Variable], str]
) -> Iterator[list[str]]:
    """The cells of a table, of which only those columns are there that something stands in."""
    columns: list[tuple[str, list[str]]] = [
        ("Name", [typed(v.name) for v in rows]),
        ("Type", [typed(v.type) for v in rows]),
        ("Initial value", [typed(v.initial) for v in rows]),
        ("Address", [typed(v.address) for v in rows]),
        ("Comment", [said(v) for v in rows]),
    ]
    filled = [(name, cells) for name, cells in columns if any(cells)]
    yield [name for name, _ in filled]
    yield from map(list, zip(*(cells for _, cells in filled), strict=True))


# ---- Markdown ----


def _markdown_pages(items: Sequence[Item], title: Title) -> Iterator[tuple[str, str]]:
    links = Links(items, ".md")
    writer = Markdown(links)
    used = _used_by(items, links)
    yield "index.md", _markdown_index(items, title, links, writer)
    for item in items:
        yield links.page(item), _markdown_item(item, writer, used[id(item)])
        for part, name in _with_diagrams(item, links):
            yield name, diagram(part).replace("currentColor", "#666") + "\n"


def _with_diagrams(item: Item, links: Links) -> Iterator[tuple[Item, str]]:
    stem = links.stem(item)
    if has_diagram(item):
        yield item, f"{stem}.svg"
    for member in item.members:
        if has_diagram(member):
            yield member, f"{stem}.{anchor(member.name)}.svg"


def _markdown_index(items: Sequence[Item], title: Title, links: Links, writer: Markdown) -> str:
    version = f" {title.version}" if title.version else ""
    parts = [f"# {writer.text(title.name + version)}\n"]
    if title.description:
        parts.append(f"{writer.text(title.description)}\n")
    for name, members in _grouped(items):
        rows = "\n".join(
            f"| {writer.link(item.name, links.page(item))} | {writer.cell(writer.text(item.doc.summary))} |"
            for item in members
        )
        parts.append(f"## {name}\n\n| | |\n|---|---|\n{rows}\n")
    return "\n".join(parts)


def _markdown_item(item: Item, writer: Markdown, used: Sequence[Item]) -> str:
    drawn = {id(part): name for part, name in _with_diagrams(item, writer.links)}
    parts = [f"# {writer.text(item.name)}\n\n", *_markdown_parts(item, writer, drawn)]
    for member in item.members:
        parts.append(f'<a id="{escape(anchor(member.name))}"></a>\n\n## {writer.text(member.name)}\n\n')
        parts += _markdown_parts(member, writer, drawn)
    if used:
        names = ", ".join(writer.link(other.name, writer.links.page(other)) for other in used)
        parts.append(f"## Used by\n\n{names}\n\n")
    parts.append(f"*{writer.text(PurePath(item.file).name)}, line {item.line}*\n")
    return "".join(parts)


def _markdown_parts(item: Item, writer: Markdown, drawn: dict[int, str]) -> Iterator[str]:
    yield f"{writer.code(signature(item))}\n\n"
    yield writer.write(item.doc.body)
    if id(item) in drawn:
        yield f"![{writer.text(item.name)}](<{drawn[id(item)]}>)\n\n"
    for name, sections in _SECTIONS:
        if rows := item.of(*sections):
            head, *cells = _columns(rows, writer.typed, lambda v: writer.write(v.doc.body))
            lines = [head, ["---"] * len(head), *([writer.cell(cell) for cell in row] for row in cells)]
            yield f"### {name}\n\n" + "".join(f"| {' | '.join(line)} |\n" for line in lines) + "\n"
    if item.doc.result:
        yield f"### Returns\n\n{writer.write(item.doc.result)}"
