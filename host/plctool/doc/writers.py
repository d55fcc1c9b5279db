"""Comments as HTML and as Markdown. All text of sources is escaped: a comment cannot bring a script."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Iterable
from html import escape

from docutils import nodes

from plctool.doc.links import Links

_SAFE_URL = re.compile(r"(?:https?://|mailto:)", re.IGNORECASE)
_DROPPED = (nodes.system_message, nodes.comment, nodes.target, nodes.substitution_definition, nodes.Invisible)


class Writer(ABC):
    """Writes trees of docutils, of which a comment uses a part."""

    def __init__(self, links: Links) -> None:
        self.links = links

    def write(self, found: Iterable[nodes.Node]) -> str:
        """Writes nodes one after the other."""
        return "".join(self._one(node) for node in found)

    def _one(self, node: nodes.Node) -> str:
        if isinstance(node, nodes.Text):
            return self.text(str(node))
        if isinstance(node, _DROPPED):
            return ""
        method = getattr(self, f"on_{type(node).__name__}", None)
        if method is not None:
            return str(method(node))
        if isinstance(node, nodes.Admonition):
            return self.note(type(node).__name__, node)
        return self.write(node.children)

    @abstractmethod
    def text(self, text: str) -> str:
        """Plain text."""

    @abstractmethod
    def code(self, text: str) -> str:
        """A word in the font of programs."""

    @abstractmethod
    def link(self, text: str, target: str) -> str:
        """A link, whose text is plain."""

    @abstractmethod
    def note(self, kind: str, node: nodes.Node) -> str:
        """A note, warning or the like."""

    def typed(self, text: str) -> str:
        """A type or an initial value, with links."""
        return (
            self.links.linked(text, lambda part: self.code(part) if part.strip() else part, self.link) if text else ""
        )

    def on_literal(self, node: nodes.Node) -> str:
        name = node.astext()
        target = self.links.to(name)
        return self.code(name) if target is None else self.link(name, target)

    def on_title_reference(self, node: nodes.Node) -> str:
        """`name`, the default role."""
        return self.on_literal(node)

    def on_reference(self, node: nodes.Element) -> str:
        url = str(node.get("refuri", ""))
        return self.link(node.astext(), url) if _SAFE_URL.match(url) else self.text(node.astext())

    def on_image(self, node: nodes.Element) -> str:
        """Pictures are files of another place: only their text is shown."""
        return self.text(str(node.get("alt", "")))


class Html(Writer):
    """Writes HTML."""

    def text(self, text: str) -> str:
        return escape(text, quote=False)

    def code(self, text: str) -> str:
        return f"<code>{escape(text, quote=False)}</code>"

    def link(self, text: str, target: str) -> str:
        return f'<a href="{escape(target, quote=True)}">{escape(text, quote=False)}</a>'

    def note(self, kind: str, node: nodes.Node) -> str:
        return f'<div class="note {escape(kind)}"><b>{escape(kind.capitalize())}</b>{self.write(node.children)}</div>\n'

    def _in(self, tag: str, node: nodes.Node, end: str = "") -> str:
        return f"<{tag}>{self.write(node.children)}</{tag}>{end}"

    def on_paragraph(self, node: nodes.Node) -> str:
        return self._in("p", node, "\n")

    def on_strong(self, node: nodes.Node) -> str:
        return self._in("strong", node)

    def on_emphasis(self, node: nodes.Node) -> str:
        return self._in("em", node)

    def on_literal_block(self, node: nodes.Node) -> str:
        return f"<pre>{escape(node.astext(), quote=False)}</pre>\n"

    on_doctest_block = on_literal_block

    def on_bullet_list(self, node: nodes.Node) -> str:
        return self._in("ul", node, "\n")

    def on_enumerated_list(self, node: nodes.Node) -> str:
        return self._in("ol", node, "\n")

    def on_list_item(self, node: nodes.Node) -> str:
        return self._in("li", node, "\n")

    def on_definition_list(self, node: nodes.Node) -> str:
        return self._in("dl", node, "\n")

    on_field_list = on_definition_list

    def on_term(self, node: nodes.Node) -> str:
        return self._in("dt", node)

    on_field_name = on_term

    def on_definition(self, node: nodes.Node) -> str:
        return self._in("dd", node)

    on_field_body = on_definition

    def on_block_quote(self, node: nodes.Node) -> str:
        return self._in("blockquote", node, "\n")

    def on_title(self, node: nodes.Node) -> str:
        return self._in("h3", node, "\n")

    on_rubric = on_title
    on_subtitle = on_title

    def on_line(self, node: nodes.Node) -> str:
        return self.write(node.children) + "<br>\n"

    def on_transition(self, node: nodes.Node) -> str:
        return "<hr>\n"

    def on_table(self, node: nodes.Node) -> str:
        return self._in("table", node, "\n")

    def on_row(self, node: nodes.Node) -> str:
        return self._in("tr", node, "\n")

    def on_entry(self, node: nodes.Node) -> str:
        return self._in("th" if isinstance(node.parent.parent, nodes.thead) else "td", node)


class Markdown(Writer):
    """Writes Markdown, with tables as GitHub has them."""

    def text(self, text: str) -> str:
        return re.sub(r"([\\`*_\[\]<>|#])", r"\\\1", text)

    def code(self, text: str) -> str:
        fence = "`" * (1 + max((len(run) for run in re.findall(r"`+", text)), default=0))
        blank = " " if text.startswith("`") or text.endswith("`") else ""
        return f"{fence}{blank}{text}{blank}{fence}"

    def link(self, text: str, target: str) -> str:
        return f"[{self.text(text)}](<{target.replace('>', '%3E').replace('<', '%3C')}>)"

    def note(self, kind: str, node: nodes.Node) -> str:
        return self._quoted(f"**{self.text(kind.capitalize())}**\n\n{self.write(node.children)}")

    def cell(self, text: str) -> str:
        """A text for a cell of a table, which is one line."""
        return re.sub(r"(?<!\\)\|", r"\\|", re.sub(r"\s*\n\s*", " ", text.strip()))

    @staticmethod
    def _quoted(text: str) -> str:
        return "".join(f"> {line}".rstrip() + "\n" for line in text.strip().split("\n")) + "\n"

    def on_paragraph(self, node: nodes.Node) -> str:
        return self.write(node.children).strip() + "\n\n"

    def on_strong(self, node: nodes.Node) -> str:
        return f"**{self.write(node.children)}**"

    def on_emphasis(self, node: nodes.Node) -> str:
        return f"*{self.write(node.children)}*"

    def on_literal_block(self, node: nodes.Node) -> str:
        fence = "`" * max(3, 1 + max((len(run) for run in re.findall(r"`+", node.astext())), default=0))
        return f"{fence}\n{node.astext()}\n{fence}\n\n"

    on_doctest_block = on_literal_block

    def on_bullet_list(self, node: nodes.Node) -> str:
        return "".join(self._item("- ", item) for item in node.children) + "\n"

    def on_enumerated_list(self, node: nodes.Node) -> str:
        return "".join(self._item(f"{number}. ", item) for number, item in enumerate(node.children, 1)) + "\n"

    def _item(self, mark: str, node: nodes.Node) -> str:
        lines = self.write(node.children).strip().split("\n")
        return mark + f"\n{' ' * len(mark)}".join(lines) + "\n"

    def on_term(self, node: nodes.Node) -> str:
        return f"**{self.write(node.children)}**\n\n"

    on_field_name = on_term
    on_title = on_term
    on_rubric = on_term
    on_subtitle = on_term

    def on_block_quote(self, node: nodes.Node) -> str:
        return self._quoted(self.write(node.children))

    def on_line(self, node: nodes.Node) -> str:
        return self.write(node.children) + "  \n"

    def on_transition(self, node: nodes.Node) -> str:
        return "---\n\n"

    def on_table(self, node: nodes.Element) -> str:
        rows = [[self.cell(self.write(entry.children)) for entry in row.children] for row in node.findall(nodes.row)]
        width = max(map(len, rows), default=0)
        lines = [f"| {' | '.join(row + [''] * (width - len(row)))} |" for row in rows]
        lines.insert(1, "|" + "---|" * width)
        return "\n".join(lines) + "\n\n"
