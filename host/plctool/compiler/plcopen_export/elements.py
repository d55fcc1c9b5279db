"""Elements of PLCopen XML, what CODESYS adds to them, and our own addition: a file as it is.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from xml.etree import ElementTree

Xml = ElementTree.Element

TC6 = "http://www.plcopen.org/xml/tc6_0201"
XHTML = "http://www.w3.org/1999/xhtml"
CODESYS = "http://www.3s-software.com/plcopenxml/"


def child(parent: Xml, tag: str, **attributes: str) -> Xml:
    """A new last element in another one."""
    return ElementTree.SubElement(parent, tag, attributes)


def text_in(parent: Xml, text: str) -> None:
    """Text as PLCopen XML has it. Ends of lines are those of XML."""
    ElementTree.SubElement(parent, "xhtml", {"xmlns": XHTML}).text = text.replace("\r\n", "\n")


def data(parent: Xml, name: str) -> Xml:
    """A new addition to an element, by a name of CODESYS."""
    return _added(parent, f"{CODESYS}{name}", "implementation")


def _added(parent: Xml, name: str, unknown: str) -> Xml:
    """`unknown`: what others do with it."""
    added = parent.find("addData")
    if added is None:
        added = child(parent, "addData")
    return child(added, "data", name=name, handleUnknown=unknown)


def plain(parent: Xml, text: str) -> None:
    """A declaration as text."""
    text_in(child(data(parent, "interfaceasplaintext"), "InterfaceAsPlainText"), text.lstrip("\r\n"))


def attributes(parent: Xml, found: dict[str, str]) -> None:
    """The attributes of a declaration."""
    if not found:
        return
    listed = child(data(parent, "attributes"), "Attributes")
    for name, value in found.items():
        child(listed, "Attribute", Name=name, Value=value)


def documentation(parent: Xml, text: str) -> None:
    """A comment, without its marks."""
    if text:
        text_in(child(parent, "documentation"), text)


def shared_list(globals_: Xml) -> None:
    """Notes that the file of these globals has more than globals, so that its name is no part of theirs."""
    child(_added(globals_, "plctool/sharedlist", "discard"), "SharedList")


def source_text(root: Xml, name: str, text: str) -> None:
    """A file as it is. `name`: what the list of globals in it is called."""
    text_in(child(_added(root, "plctool/sourcetext", "discard"), "SourceText", name=name), text)
