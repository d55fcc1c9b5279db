"""PLCopen XML: types, values and variables, written as Structured Text.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re

from plctool.compiler.formats.text import Text
from plctool.compiler.formats.xml_tree import Element

SECTIONS = {
    "inputVars": "VAR_INPUT",
    "outputVars": "VAR_OUTPUT",
    "inOutVars": "VAR_IN_OUT",
    "localVars": "VAR",
    "tempVars": "VAR_TEMP",
    "externalVars": "VAR_EXTERNAL",
    "globalVars": "VAR_GLOBAL",
}
"""The lists of variables in an interface."""

_QUALIFIERS = {"constant": "CONSTANT", "retain": "RETAIN", "nonretain": "NON_RETAIN", "persistent": "PERSISTENT"}
_PLAIN = re.compile(r"[^'{}\n]*")


def type_of(element: Element | None) -> str:
    """The type in <type>, <baseType> or <returnType>; "" when there is none."""
    found = next((c for c in element.children if c.tag not in ("addData", "documentation")), None) if element else None
    return "" if found is None else _type(found)


def _type(found: Element) -> str:
    name = found.tag
    if name == "derived":
        return found.get("name")
    if name.lower() in ("string", "wstring"):
        return f"{name.upper()}({found.get('length')})" if found.get("length") else name.upper()
    if name == "array":
        bounds = ", ".join(f"{d.get('lower')}..{d.get('upper')}" for d in found.all("dimension"))
        return f"ARRAY[{bounds}] OF {type_of(found.child('baseType'))}"
    if name in ("pointer", "reference"):
        return f"{name.upper()} TO {type_of(found.child('baseType'))}"
    if name in ("subrangeSigned", "subrangeUnsigned"):
        low, high = (part.get(end) for part in found.all("range") for end in ("lower", "upper"))
        return f"{type_of(found.child('baseType'))} ({low}..{high})"
    if name == "enum":
        return _enumeration(found)
    if name == "struct":
        return f"STRUCT {' '.join(variable(v) for v in found.all('variable'))} END_STRUCT"
    return name.upper()


def union(element: Element) -> str:
    """A union, which the standard has not: CODESYS adds it beside the types."""
    return f"UNION {' '.join(variable(v) for v in element.all('variable'))} END_UNION"


def _enumeration(enum: Element) -> str:
    values = [v for part in enum.all("values") for v in part.all("value")]
    listed = ", ".join(f"{v.get('name')} := {v.get('value')}" if v.get("value") else v.get("name") for v in values)
    base = type_of(enum.child("baseType"))
    return f"({listed}) {base}".rstrip()


def value_of(element: Element | None) -> str:
    """The value in <initialValue> and the like; "" when there is none."""
    found = next((c for c in element.children if c.tag.endswith("Value")), None) if element else None
    if found is None:
        return ""
    if found.tag == "arrayValue":
        return f"[{', '.join(_repeated(v) for v in found.all('value'))}]"
    if found.tag == "structValue":
        members = [f"{v.get('member')} := {value_of(v)}" for v in found.all("value")]
        return f"({', '.join(members)})"
    return found.get("value")


def _repeated(value: Element) -> str:
    times = value.get("repetitionValue", "1")
    return value_of(value) if times in ("", "1") else f"{times}({value_of(value)})"


def attributes(element: Element) -> str:
    """The attributes that a CODESYS export has for an element, as pragmas."""
    found = []
    for data in element.child_data("attributes"):
        for attribute in data.every("Attribute"):
            name, value = attribute.get("Name"), attribute.get("Value")
            if name and _PLAIN.fullmatch(name) and _PLAIN.fullmatch(value):
                found.append(f"{{attribute '{name}' := '{value}'}} " if value else f"{{attribute '{name}'}} ")
    return "".join(found)


def variable(element: Element) -> str:
    """One declaration, with its semicolon."""
    address = f" AT {element.get('address')}" if element.get("address") else ""
    value = value_of(element.child("initialValue"))
    spec = type_of(element.child("type"))
    return f"{attributes(element)}{element.get('name')}{address} : {spec}{f' := {value}' if value else ''};"


def blocks(text: Text, interface: Element) -> None:
    """All VAR ... END_VAR of an interface."""
    for section in interface.all(*SECTIONS):
        block(text, section)


def block(text: Text, section: Element) -> None:
    """One list of variables; CODESYS splits one whose variables have several qualifiers."""
    split = [part for data in section.child_data("mixedattrsvarlist") for part in data.every(*SECTIONS)]
    for part in split or [section]:
        if not part.all("variable"):
            continue
        words = [word for name, word in _QUALIFIERS.items() if part.get(name) == "true"]
        text.made(" ".join([f"{attributes(part)}{SECTIONS[part.tag]}", *words]) + "\n", part.at)
        for item in part.all("variable"):
            text.made(f"    {variable(item)}\n", item.at)
        text.made("END_VAR\n", part.at)
