"""PLCopen XML out: types, values and lists of variables in the words of the standard.

A type for which it has none (REFERENCE TO, ARRAY[*], an instance with arguments) is written as the name of a derived
type; the plain text beside it has all of them.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from plctool.compiler.plcopen_export.elements import Xml, attributes, child, documentation
from plctool.compiler.plcopen_export.outline import Part, closed, type_end
from plctool.compiler.syntax.attributes import Attributes
from plctool.compiler.syntax.lexer import Token
from plctool.iec.types import ELEMENTARY

_SECTIONS = {
    "VAR": "localVars", "VAR_INPUT": "inputVars", "VAR_OUTPUT": "outputVars", "VAR_IN_OUT": "inOutVars",
    "VAR_TEMP": "tempVars", "VAR_EXTERNAL": "externalVars", "VAR_GLOBAL": "globalVars", "VAR_STAT": "localVars",
    "VAR_INST": "localVars",
}  # fmt: skip
_QUALIFIERS = {"CONSTANT": "constant", "RETAIN": "retain", "NON_RETAIN": "nonretain", "PERSISTENT": "persistent"}

Note = Callable[[int, str], None]  # offset, what there is


class Declarations:
    """Writes declarations of one text."""

    def __init__(self, text: str, found: Attributes, note: Note) -> None:
        """`note`: takes what only the plain text has."""
        self._text = text
        self._attributes = found
        self.note = note

    def slice(self, tokens: Sequence[Token]) -> str:
        """The text of tokens on one line, without comments."""
        parts, end = [], tokens[0].pos if tokens else 0
        for token in tokens:
            parts.append(" " * (token.pos > end) + token.text)
            end = token.end
        return "".join(parts)

    def written(self, tokens: Sequence[Token]) -> str:
        """The text of tokens as it is."""
        return self._text[tokens[0].pos : tokens[-1].end]

    def section(self, parent: Xml, part: Part, **more: str) -> Xml | None:
        """A list of variables, where the standard has one of its kind."""
        keyword = part.tokens[0].text.upper()
        tag = _SECTIONS.get(keyword)
        if tag is None or keyword in ("VAR_STAT", "VAR_INST"):
            self.note(part.pos, keyword)
        if tag is None:
            return None
        section = child(parent, tag, **more)
        at = 1
        while part.tokens[at].type in ("QUALIFIER", "MODIFIER"):
            word = part.tokens[at].text.upper()
            if word in _QUALIFIERS:
                section.set(_QUALIFIERS[word], "true")
            else:
                self.note(part.tokens[at].pos, f"{keyword} {word}")
            at += 1
        self.variables(section, part.tokens[at:-1])
        return section

    def variables(self, parent: Xml, tokens: list[Token]) -> None:
        """Declarations `names AT address : type := value;`."""
        at = 0
        while at < len(tokens):
            if tokens[at].type == "_SEMI":
                at += 1
                continue
            end = _semicolon(tokens, at)
            self._variable(parent, tokens[at:end])
            at = end + 1

    def _variable(self, parent: Xml, tokens: list[Token]) -> None:
        colon = next(i for i, token in enumerate(tokens) if token.type == "_COLON")
        names = [t.text for t in tokens[:colon] if t.type == "IDENT"]
        address = next((t.text for t in tokens[:colon] if t.type == "DIRECT"), "")
        end = type_end(tokens, colon + 1)
        value = next((i + 1 for i in range(end, len(tokens)) if tokens[i].type == "_ASSIGN"), len(tokens))
        for token in tokens[end:value]:
            if token.type in ("EDGE", "EQ"):
                self.note(token.pos, token.text.upper() if token.type == "EDGE" else "REF=")
        if not names:
            self.note(tokens[0].pos, "a variable without a name")
        for name in names:
            variable = child(parent, "variable", name=name, **({"address": address} if address else {}))
            self.type(child(variable, "type"), tokens[colon + 1 : end])
            if value < len(tokens):
                self.value(child(variable, "initialValue"), tokens[value:])
            attributes(variable, self._attributes.get(tokens[0].pos, {}))
            documentation(variable, _comment(self._text, tokens[-1].end))

    # ---- types ----

    def type(self, parent: Xml, tokens: list[Token]) -> None:
        """A type."""
        kind = tokens[0].type
        write = {
            "ARRAY": self._array, "POINTER": self._pointer, "STRUCT": self._structure, "UNION": self._structure,
            "_LPAR": self._enumeration, "TEXT": self._string,
        }.get(kind, self._named)  # fmt: skip
        write(parent, tokens)

    def _derived(self, parent: Xml, tokens: list[Token]) -> None:
        child(parent, "derived", name=self.slice(tokens))

    def _array(self, parent: Xml, tokens: list[Token]) -> None:
        last = closed(tokens, 1)
        bounds = [list(_split(b, "_DOTDOT")) for b in _split(tokens[2:last], "_COMMA")]
        if any(len(bound) != 2 for bound in bounds):
            self._derived(parent, tokens)
            return
        array = child(parent, "array")
        for low, high in bounds:
            child(array, "dimension", lower=self.slice(low), upper=self.slice(high))
        self.type(child(array, "baseType"), tokens[last + 2 :])

    def _pointer(self, parent: Xml, tokens: list[Token]) -> None:
        self.type(child(child(parent, "pointer"), "baseType"), tokens[2:])

    def _structure(self, parent: Xml, tokens: list[Token]) -> None:
        begin = 1 + (tokens[1].type == "OVERLAP")
        if tokens[0].type == "UNION" or begin > 1:
            self.note(tokens[0].pos, "UNION" if begin == 1 else "OVERLAP")
        self.variables(child(parent, "struct"), tokens[begin:-1])

    def _enumeration(self, parent: Xml, tokens: list[Token], base: list[Token] | None = None) -> None:
        last = closed(tokens, 0)
        enum = child(parent, "enum")
        values = child(enum, "values")
        for value in _split(tokens[1:last], "_COMMA"):
            more = {"value": self.slice(value[2:])} if len(value) > 2 else {}
            child(values, "value", name=value[0].text, **more)
        base = base or tokens[last + 1 :]
        if base:
            self.type(child(enum, "baseType"), base)

    def _string(self, parent: Xml, tokens: list[Token]) -> None:
        more = {"length": self.slice(tokens[2:-1])} if len(tokens) > 1 else {}
        child(parent, tokens[0].text.lower() if tokens[0].text.upper() == "STRING" else "wstring", **more)

    def _named(self, parent: Xml, tokens: list[Token]) -> None:
        name = tokens[0].text.upper()
        if len(tokens) == 1 and name in ELEMENTARY:
            child(parent, name)
        elif len(tokens) > 3 and tokens[1].type == "_LPAR" and tokens[0].text.upper() in ELEMENTARY:
            bounds = list(_split(tokens[2:-1], "_DOTDOT"))
            if len(bounds) == 2:
                sign = "subrangeUnsigned" if name.startswith("U") else "subrangeSigned"
                subrange = child(parent, sign)
                child(subrange, "range", lower=self.slice(bounds[0]), upper=self.slice(bounds[1]))
                child(child(subrange, "baseType"), name)
            else:
                self._enumeration(parent, tokens[1:], tokens[:1])
        else:
            self._derived(parent, tokens)

    # ---- values ----

    def value(self, parent: Xml, tokens: list[Token]) -> None:
        """An initial value."""
        items = list(_split(tokens, "_COMMA"))
        inside = tokens[1:-1] if closed(tokens, 0) == len(tokens) - 1 else []
        members = list(_split(inside, "_COMMA"))
        if len(items) > 1 or (tokens[0].type == "_LSQB" and members):
            array = child(parent, "arrayValue")
            for item in items if len(items) > 1 else members:
                self._item(array, item)
        elif members and all(len(m) > 2 and m[1].type == "_ASSIGN" for m in members):
            structure = child(parent, "structValue")
            for member in members:
                self.value(child(structure, "value", member=member[0].text), member[2:])
        else:
            child(parent, "simpleValue", value=self.slice(tokens))

    def _item(self, array: Xml, tokens: list[Token]) -> None:
        repeated = len(tokens) > 3 and tokens[0].type == "NUMBER" and tokens[1].type == "_LPAR"
        if repeated and len(list(_split(tokens[2:-1], "_COMMA"))) == 1:
            self.value(child(array, "value", repetitionValue=tokens[0].text), tokens[2:-1])
        else:
            self.value(child(array, "value"), tokens)


def _semicolon(tokens: list[Token], at: int) -> int:
    """The end of the declaration that begins at an index: its semicolon, not one in a structure."""
    depth = 0
    for index in range(at, len(tokens)):
        kind = tokens[index].type
        depth += (kind in ("STRUCT", "UNION")) - (kind in ("_END_STRUCT", "_END_UNION"))
        if kind == "_SEMI" and depth == 0:
            return index
    return len(tokens)


def _split(tokens: list[Token], kind: str) -> Iterator[list[Token]]:
    """The parts between tokens of a kind that are in no brackets."""
    depth, start = 0, 0
    for index, token in enumerate(tokens):
        depth += (token.type in ("_LPAR", "_LSQB")) - (token.type in ("_RPAR", "_RSQB"))
        if token.type == kind and depth == 0:
            yield tokens[start:index]
            start = index + 1
    if tokens[start:]:
        yield tokens[start:]


def _comment(text: str, at: int) -> str:
    """The comment on the rest of a line."""
    rest = text[at : text.find("\n", at) % (len(text) + 1)].strip().removeprefix(";").strip()
    if rest.startswith("//"):
        return rest.lstrip("/").strip()
    return rest[2:-2].strip() if rest.startswith("(*") and rest.find("*)") == len(rest) - 2 else ""
