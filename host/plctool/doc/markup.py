"""What a comment says, as a tree of docutils: plain text and reStructuredText, as CODESYS and TwinCAT show it, and XML
(`<summary>`, `<param name="x">`)."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any
from xml.etree import ElementTree

from docutils import frontend, nodes, utils
from docutils.parsers.rst import Parser, roles

_XML = re.compile(r"\s*<(?:summary|remarks|param|returns|value|example|description|para)\b")
_SETTINGS = {
    "report_level": 5, "halt_level": 5, "raw_enabled": False, "file_insertion_enabled": False,
    "line_length_limit": 1_000_000,
}  # fmt: skip
_SEVERE = 3
_PARAMETERS = ("param", "parameter", "arg", "input", "output", "var")
_RETURNS = ("return", "returns")


@dataclass
class Markup:
    """A comment: its text, what it says of parameters by their names (case-folded), and of the result."""

    body: list[nodes.Node] = field(default_factory=list)
    parameters: dict[str, list[nodes.Node]] = field(default_factory=dict)
    result: list[nodes.Node] = field(default_factory=list)

    @property
    def summary(self) -> str:
        """The first sentence, as plain text."""
        first = next((node.astext() for node in self.body if isinstance(node, nodes.paragraph)), "")
        return re.split(r"(?<=[.!?])\s", " ".join(first.split()), maxsplit=1)[0]


def read_markup(comment: str) -> Markup:
    """Reads a comment; one that is neither XML nor reStructuredText is taken as it is written."""
    if _XML.match(comment) and (found := _xml(comment)) is not None:
        return found
    return _fields_of(_rst(comment))


# ---- reStructuredText ----


def _named(name: str) -> Any:
    """A role such as :ref: that only Sphinx knows: its text may name a declaration."""

    def role(_: str, __: str, text: str, *___: Any, **____: Any) -> tuple[list[nodes.Node], list[nodes.Node]]:
        return [nodes.literal(text, re.sub(r"\s*<[^>]*>$|^[~!]", "", text), classes=["name"])], []

    return role


for _role in ("ref", "doc", "any", "pou", "fb", "func", "meth", "class", "term", "prg", "gvl", "dut"):
    roles.register_local_role(_role, _named(_role))


def _rst(comment: str) -> list[nodes.Node]:
    settings = frontend.get_default_settings(Parser)
    for name, value in _SETTINGS.items():
        setattr(settings, name, value)
    document = utils.new_document("comment", settings)
    failed: list[int] = []
    document.reporter.attach_observer(lambda message: failed.append(int(message["level"])))
    Parser().parse(comment, document)
    if max(failed, default=0) >= _SEVERE:
        return [nodes.paragraph("", part) for part in re.split(r"\n\s*\n", comment)]
    return list(document.children)


def _fields_of(body: list[nodes.Node]) -> Markup:
    """Takes `:param x:` and `:return:` out of the text."""
    found = Markup()
    for node in body:
        if not isinstance(node, nodes.field_list):
            found.body.append(node)
            continue
        others = nodes.field_list()
        for entry in node.children:
            assert isinstance(entry, nodes.field)
            kind, *rest = entry.children[0].astext().split()
            content = list(entry.children[1].children)
            if kind in _PARAMETERS and rest:
                found.parameters[rest[-1].casefold()] = content
            elif kind in _RETURNS:
                found.result = content
            else:
                others += entry.deepcopy()
        if others.children:
            found.body.append(others)
    return found


# ---- XML ----


def _xml(comment: str) -> Markup | None:
    """A comment in XML; None if it is not well-formed. It has no declarations, so no entities grow in it."""
    if "<!" in comment:
        return None
    try:
        root = ElementTree.fromstring(f"<doc>{comment}</doc>")
    except ElementTree.ParseError:
        return None
    found = Markup()
    found.body += _paragraphs(root, own=True)
    for element in root:
        content = _paragraphs(element)
        if element.tag == "param":
            found.parameters[element.get("name", "").casefold()] = content
        elif element.tag in ("returns", "value"):
            found.result = content
        elif element.tag == "example":
            found.body += [nodes.paragraph("", "", nodes.strong("", "Example")), *content]
        else:
            found.body += content
    return found


_BLOCKS = ("para", "code", "list")


def _paragraphs(element: ElementTree.Element, *, own: bool = False) -> list[nodes.Node]:
    """The blocks in an element; `own`: only the text directly in it."""
    found: list[nodes.Node] = []
    inline: list[nodes.Node] = [*_text(element.text)]

    def close() -> None:
        if any(node.astext().strip() for node in inline):
            found.append(nodes.paragraph("", "", *inline))
        inline.clear()

    for child in [] if own else element:
        if child.tag in _BLOCKS:
            close()
            found += _block(child)
        else:
            inline += _inline(child)
        inline += _text(child.tail)
    for child in element if own else []:
        inline += _text(child.tail)
    close()
    return found


def _block(element: ElementTree.Element) -> list[nodes.Node]:
    if element.tag == "code":
        text = "".join(element.itertext()).strip("\n")
        return [nodes.literal_block(text, text)]
    if element.tag == "list":
        items = [nodes.list_item("", *_paragraphs(item)) for item in element.iter("item")]
        kind = nodes.enumerated_list if element.get("type") == "number" else nodes.bullet_list
        return [kind("", *items)]
    return _paragraphs(element)


def _inline(element: ElementTree.Element) -> Iterator[nodes.Node]:
    named = element.get("cref") or element.get("name")
    text = "".join(element.itertext()) or named or element.get("langword") or ""
    if element.tag in ("see", "seealso", "paramref", "c") and text:
        yield nodes.literal(text, text.rpartition(":")[2], classes=["name"])
    elif element.tag in ("b", "strong"):
        yield nodes.strong(text, text)
    elif element.tag in ("i", "em"):
        yield nodes.emphasis(text, text)
    elif element.tag == "br":
        yield nodes.Text(" ")
    else:
        yield nodes.Text(text)


def _text(text: str | None) -> list[nodes.Node]:
    return [nodes.Text(re.sub(r"\s+", " ", text))] if text else []
