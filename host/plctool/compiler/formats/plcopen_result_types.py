"""PLCopen XML: types of what is drawn, as far as they are known before the program is checked; "" where they are not.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache

from plctool.compiler.formats.plcopen_body import Unit
from plctool.compiler.formats.xml_tree import Element
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import Diagnostics
from plctool.compiler.syntax.library import standard_library, without_library
from plctool.iec import literals
from plctool.iec.common_types import common_scalar
from plctool.iec.types import ELEMENTARY, Elementary, Kind
from plctool.iec.value_texts import limits

COMPARISONS = frozenset(("GT", "GE", "EQ", "LE", "LT", "NE"))
_OF_FIRST = frozenset(("MOVE", "ABS", "NOT", "SHL", "SHR", "ROL", "ROR", "SQRT"))
_LOGIC = frozenset(("AND", "OR", "XOR"))
_ARITHMETIC = frozenset(("ADD", "SUB", "MUL", "DIV", "MOD"))
_CHOOSERS = frozenset(("SEL", "MUX"))  # the first input says which of the others
_OF_ALL = _LOGIC | _ARITHMETIC | _CHOOSERS | {"MAX", "MIN", "LIMIT"}
_OPERATORS = COMPARISONS | _OF_FIRST | _OF_ALL
_PATH = re.compile(r"\w+(?:\[[^\[\]]*\])?(?:\.\w+(?:\[[^\[\]]*\])?)*")
_PART = re.compile(r"(\w+)(\[[^\[\]]*\])?(?:\.|$)")
_ARRAY = re.compile(r"ARRAY\[[^\[\]]*\] OF (.*)")
_SUBRANGE = re.compile(r" \(.*\)$")
_CONVERSION = re.compile(r"(?:\w+?_)?(?:TO|TRUNC|AS)_(\w+)")
_TO_BCD = re.compile(r"(?:([A-Z]+)_)?TO_BCD(?:_([A-Z]+))?")


@dataclass(frozen=True)
class Untyped:
    """A number without a type: it takes the one of what is beside it."""

    value: int | float

    def fits(self, t: Elementary) -> bool:
        """Whether it does, and leaves that as it is."""
        if t.kind in (Kind.REAL, Kind.TIME):
            return True
        low, high = limits(t) if t.kind in (Kind.INT, Kind.BIT) else (0, 1)
        return isinstance(self.value, int) and low <= self.value <= high


class ResultTypes:
    """The types in the networks of one body; `elements`: by local id."""

    def __init__(self, unit: Unit, elements: dict[str, Element]) -> None:
        self._unit = unit
        self._elements = elements
        self._busy: list[Element] = []

    def of_function(self, block: Element, depth: int = 0) -> str:
        """The type of the result of a function of the standard library, or as the file says it."""
        if block.get("resultType"):
            return block.get("resultType")
        name = without_library(block.get("typeName")).upper()
        if name in COMPARISONS:
            return "BOOL"
        if depth > 100:
            return ""
        inputs = [v for part in block.all("inputVariables") for v in part.all("variable")]
        inputs = [v for v in inputs if v.get("formalParameter").upper() != "EN"]
        self._busy.append(block)
        given = [self._of_input(v, depth + 1) for v in inputs[name in _CHOOSERS :]]
        self._busy.pop()
        known = [v for v in given if v is not None]
        if name in _OF_FIRST:
            return self._of_first(name, known)
        if name in _OF_ALL:
            return self._of_all(name, known)
        return self._declared(name, known) or self._converted(name)

    def undeclared(self, block: Element, depth: int = 0) -> str:
        """The type of an input, or of what leads there, that neither the file nor the library declares; else the
        function itself, unless the library has it. "" if all are declared."""
        inputs = [v for part in block.all("inputVariables") for v in part.all("variable")]
        for item in inputs if depth <= 100 else ():
            found = self._undeclared_input(item, depth + 1)
            if found:
                return found
        name = block.get("typeName")
        return "" if self._is_declared(name) else name

    def _undeclared_input(self, item: Element, depth: int) -> str:
        text = item.child("connectionPointIn", "expression")
        specs = [text.text] if text is not None else []
        for connection in item.every("connection"):
            element = self._elements.get(connection.get("refLocalId"))
            if element is not None and element.tag in ("inVariable", "inOutVariable"):
                specs.append((element.child("expression") or element).text)
            elif element is not None and element.tag == "block":
                found = self.undeclared(element, depth)
                if found:
                    return found
        first = (self._unit.types.get(re.split(r"[.\[]", spec)[0].casefold(), "") for spec in specs)
        return next((spec for spec in first if spec and not self._is_declared(spec)), "")

    def _is_declared(self, name: str) -> bool:
        known = self._elementary(name) is not None or name.casefold() in self._unit.blocks
        return known or not re.fullmatch(r"[\w.]+", name) or bool(declared(name))

    def _of_first(self, name: str, given: list[str | Untyped]) -> str:
        if not given or isinstance(given[0], Untyped):
            return ""
        t = self._elementary(given[0])
        if name == "SQRT" and (t is None or t.kind is not Kind.REAL):
            return ""
        return t.name if t is not None else given[0] if name == "MOVE" else ""

    def _of_all(self, name: str, given: list[str | Untyped]) -> str:
        specs = [v for v in given if isinstance(v, str)]
        types = [t for t in map(self._elementary, specs) if t is not None]
        if not specs or not all(specs):
            return ""
        if not types:
            same = len({v.casefold() for v in specs}) == 1 and len(specs) == len(given)
            return specs[0] if same and name not in _LOGIC | _ARITHMETIC else ""
        t = _common(name, types) if len(types) == len(specs) else None
        return t.name if t is not None and all(v.fits(t) for v in given if isinstance(v, Untyped)) else ""

    def _declared(self, name: str, given: list[str | Untyped]) -> str:
        """As the library declares it: for the type of the arguments, if it does so for several ones."""
        overloads = standard_library().overloads(name.casefold())
        results = {s for n in (name, *overloads) if (s := declared(n).get("", ""))}
        if len(results) < 2:
            return next(iter(results), "")
        first = given[0] if given and isinstance(given[0], str) else ""
        t = self._elementary(first)
        kind = t.name if t is not None else re.split(r"[\[(]", first)[0].upper()
        same = all(isinstance(v, str) and self._elementary(v) is t for v in given) or t is None
        return declared(name if kind == "STRING" else f"{name}__{kind}").get("", "") if same else ""

    def _converted(self, name: str) -> str:
        if bcd := _TO_BCD.fullmatch(name):
            source = ELEMENTARY.get(bcd[1] or "")
            bits = [t.name for t in ELEMENTARY.values() if t.kind is Kind.BIT and source and t.bits == source.bits]
            return bcd[2] or next(iter(bits), "")
        conversion = _CONVERSION.fullmatch(name)
        if conversion is None:
            return ""
        target = conversion[1]
        if target in ("STRING", "WSTRING"):
            return f"{target}[255]"
        return target if target in ELEMENTARY or target.casefold() in self._unit.blocks else ""

    # ---- what a function is given ----

    def _of_input(self, item: Element, depth: int) -> str | Untyped | None:
        """None for what is connected to nothing."""
        text = item.child("connectionPointIn", "expression")
        if text is not None and text.text:
            return self._of_expression(text.text)
        connections = list(item.every("connection"))
        if not connections:
            return None
        return self._of_connection(connections[0], depth) if len(connections) == 1 else "BOOL"

    def _of_connection(self, connection: Element, depth: int) -> str | Untyped | None:
        element = self._elements.get(connection.get("refLocalId"))
        if element is None:
            return ""
        if element.tag in ("contact", "coil", "leftPowerRail"):
            return "BOOL"
        if element.tag in ("inVariable", "inOutVariable"):
            return self._of_expression((element.child("expression") or element).text) or element.get("type")
        if element.tag == "connector":
            return self._of_input(element, depth + 1) if depth <= 100 else ""
        if element.tag != "block":
            return ""
        if any(busy is element for busy in self._busy):
            return None  # it feeds itself
        formal, kind = connection.get("formalParameter").casefold(), element.get("typeName")
        if formal == "eno":
            return "BOOL"
        own = self._unit.blocks.get(kind.casefold())
        if element.get("instanceName"):
            return (declared(kind) if own is None else own).get(formal, "")
        return own.get("", "") if own is not None else self.of_function(element, depth)

    def _of_expression(self, text: str) -> str | Untyped:
        if text.upper() in ("TRUE", "FALSE"):
            return "BOOL"
        try:
            if "#" in text and not text.removeprefix("-")[0].isdigit():
                prefix, _, rest = text.removeprefix("-").partition("#")
                return prefix if literals.is_enum_value(prefix, rest) else literals.typed(text.removeprefix("-"))[2]
            value = literals.unsigned(text.removeprefix("-"))[1]
            assert not isinstance(value, str)
            return Untyped(-value if text.startswith("-") else value)
        except literals.LiteralError:
            return self._of_variable(text.casefold())

    def _of_variable(self, text: str) -> str:
        """Of `x`, `x.member`, `x[1].member`."""
        if not _PATH.fullmatch(text):
            return ""
        spec = ""
        for i, (name, indices) in enumerate(_PART.findall(text)):
            if i:
                members = self._unit.blocks.get(spec.casefold())
                spec = (declared(spec) if members is None else members).get(name, "")
            else:
                spec = self._unit.types.get(name, "")
            if indices:
                array = _ARRAY.fullmatch(spec)
                spec = array[1] if array is not None else ""
        return spec

    def _elementary(self, spec: str) -> Elementary | None:
        """The scalar of a type, of a subrange its base."""
        for _ in range(100):
            found = ELEMENTARY.get(_SUBRANGE.sub("", spec).upper())
            if found is not None or not spec:
                return found
            spec = self._unit.blocks.get(spec.casefold(), {}).get("", "")
        return None


def _common(name: str, types: list[Elementary]) -> Elementary | None:
    """The type in which a function computes."""
    for kind in (Kind.DATE, Kind.TIME):  # what is added to them, or divides them, has another type
        moved = [t for t in types if t.kind is kind]
        if moved and name in _ARITHMETIC:
            if kind is Kind.DATE and len(moved) > 1:
                return None
            types = moved
            break
    if name in _LOGIC and len({t.kind for t in types}) > 1:
        return None
    result: Elementary | None = types[0]
    for t in types[1:]:
        result = None if result is None else common_scalar(result, t)
    return result


def is_operator(name: str) -> bool:
    """True if a function is one whose types follow from its arguments."""
    return name.upper() in _OPERATORS or _CONVERSION.fullmatch(name.upper()) is not None


@cache
def declared(name: str) -> dict[str, str]:
    """The types of inputs and outputs of a unit of the standard library, by case-folded name, and of its result: ""."""
    found: dict[str, str] = {}
    for unit in standard_library().parse(without_library(name).casefold(), Diagnostics()):
        if isinstance(unit, ast.PouDecl):
            for block in unit.blocks:
                if block.keyword in (ast.Section.VAR_INPUT, ast.Section.VAR_OUTPUT):
                    found |= {n.casefold(): _written(d.type) for d in block.decls for _, n in d.names}
            found[""] = _written(unit.result)
    return found


@cache
def parameters(name: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The names of inputs and outputs of a unit of the standard library, in order; () if it has none."""
    for unit in standard_library().parse(without_library(name).casefold(), Diagnostics()):
        if isinstance(unit, ast.PouDecl):
            return parameters_of(unit)
    return (), ()


def parameters_of(unit: ast.PouDecl) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The names of inputs and outputs of a unit, in order."""
    kinds = (ast.Section.VAR_INPUT, ast.Section.VAR_IN_OUT), (ast.Section.VAR_OUTPUT,)
    inputs, outputs = (
        tuple(n for b in unit.blocks if b.keyword in kind for d in b.decls for _, n in d.names) for kind in kinds
    )
    return inputs, outputs


def written_type(spec: ast.TypeSpec | None) -> str:
    """A type as networks need it; "" for what they do not use."""
    if isinstance(spec, ast.ArraySpec):
        return f"ARRAY[] OF {written_type(spec.element)}"
    return _written(spec)


def _written(spec: ast.TypeSpec | None) -> str:
    if not isinstance(spec, ast.NamedType):
        return ""
    return f"{spec.name}[{spec.length.value}]" if isinstance(spec.length, ast.Literal) else spec.name
