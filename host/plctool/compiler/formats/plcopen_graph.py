"""PLCopen XML: networks of Function Block Diagram, Ladder Diagram and Continuous Function Chart, written as statements.

The order is that of OpenPLC Editor and Beremiz: elements with an execution number first; then coils and output
variables from top to bottom, each with all that it needs; then the blocks that nothing needed. An export without
positions (CODESYS, TwinCAT) is taken in the order of the file. A function is computed once, into a variable with the
type that the checker gives its call. With jumps or labels, what is connected is a network, and the networks run from
top to bottom. In a chart of CODESYS (CFC) all numbers hold: what an element needs of a later one is the value of the
cycle before.

What has no such order is refused, never guessed.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cmp_to_key

from plctool.compiler.formats.library_units import COMPARISONS, is_declared
from plctool.compiler.formats.plcopen_body import Body, NotTranslatedError, Unit, Written
from plctool.compiler.formats.xml_tree import Element

_SIMPLE = re.compile(r"[\w.#%\[\]^$:']+")
_SAME_ROW = 10  # units of the editor by which elements of one row may differ
_SINKS = frozenset(("outVariable", "inOutVariable", "coil", "return"))
_WAYS = frozenset(("jump", "label"))
_EXECUTED = _SINKS | _WAYS | {"block"}
RAILS = frozenset(("leftPowerRail", "rightPowerRail"))
_REFUSED = {"error": "an error block"}
_CALLS = frozenset(("", "operator", "function", "functionblock", "program"))  # call types of a CFC
_LABEL = re.compile(r"[^\W\d]\w*")
_MODIFIERS = {"negated": ("true",), "edge": ("rising", "falling"), "storage": ("set", "reset")}
_MODIFIED = {
    "contact": ("negated", "edge"), "coil": ("negated", "edge", "storage"),
    "return": (), "jump": ("negated",), "label": (),
    "inVariable": ("negated", "edge"), "outVariable": ("negated", "edge", "storage"),
    "inOutVariable": ("negatedIn", "negatedOut"),
    "inputVariables": ("negated", "edge"), "outputVariables": ("negated", "edge"), "inOutVariables": (),
}  # fmt: skip
"""What may stand at an element, or at a connection of a block."""

_EXECUTE = "EXECUTE"  # a box of CODESYS and OpenPLC Editor with Structured Text in it
_RESULT = re.compile(r"\b_TMP_\w+_OUT\b")
_TRIGGERS = {"rising": "R_TRIG", "falling": "F_TRIG"}


class Network:
    """The networks of one body. `inline`: they are one expression, so nothing in them may need a statement. `free`: it
    is a CFC. A block that is computed="here" is computed in its turn, even if nothing reads it."""

    def __init__(self, element: Element, unit: Unit, body: Body, *, inline: bool = False, free: bool = False) -> None:
        self._inline = inline
        self._free = free
        self._unit = unit
        self._body = body
        self._root = element
        self._elements = {e.get("localId"): e for e in element.children if e.get("localId")}
        self._order = list(self._elements.values())
        self._consumers: dict[str, list[Element]] = {}
        for consumer in self._order:
            for connection in consumer.every("connection"):
                self._consumers.setdefault(connection.get("refLocalId"), []).append(consumer)
        self._calls: dict[str, str] = {}  # of functions, by the variable with their result, in order
        self._done: dict[str, str] = {}  # results of functions, and "" for called blocks, by local id
        self._busy: set[str] = set()
        self._now = 0  # the execution number of the block whose inputs are evaluated

    # ---- all of it ----

    def translate(self) -> None:
        """Adds the statements of all networks. Raises NotTranslatedError."""
        for element in self._order:
            if element.tag in _REFUSED:
                raise NotTranslatedError(element.at, f"it has {_REFUSED[element.tag]}")
            if self._free and (element.tag == "vendorElement" or _call_type(element) not in _CALLS):
                raise NotTranslatedError(element.at, f"it has a {_call_type(element) or 'special element'}")
            _check_modifiers(element)
        for element in self._in_order():
            self._execute(element)
        self._declare_results()

    def _declare_results(self) -> None:
        """Declares the variables with the results of functions, each by what is declared before it."""
        later = dict(self._calls)
        for name, call in self._calls.items():
            del later[name]
            self._body.variables[name] = (type_of(_in_full(call, name, later)), self._body.variables[name][1])

    def expression(self, name: str) -> str:
        """Returns the value that goes to the coil or output variable with this name, or to the only one. Raises
        NotTranslatedError if the value is not one expression."""
        for element in self._order:
            if element.tag in _WAYS:
                self._needs_statement(element, f"a {element.tag}")
        sinks = [e for e in self._order if e.tag in ("coil", "outVariable")]
        chosen = [e for e in sinks if _target(e).casefold() == name.casefold()] or sinks
        if len(chosen) != 1:
            raise NotTranslatedError(self._root.at, f"no coil or output variable says what {name} is")
        _check_modifiers(chosen[0])
        if chosen[0].get("storage") in ("set", "reset"):
            raise NotTranslatedError(chosen[0].at, "a condition cannot be set or reset")
        value = self._edge(chosen[0], self._power(chosen[0]))
        return _negated(value, chosen[0]) if _is(chosen[0], "negated") else value

    def _needs_statement(self, element: Element, what: str) -> None:
        if self._inline:
            raise NotTranslatedError(element.at, f"its condition has {what}; compute it before, in a variable")

    def _number(self, element: Element) -> int:
        """The execution number, from 1; 0 for none."""
        text = element.get("executionOrderId")
        number = int(text) if text.isascii() and text.isdecimal() and len(text) < 10 else -1
        return number + 1 if self._free else max(number, 0)

    def _in_order(self) -> list[Element]:
        ways = [e for e in self._order if e.tag in _WAYS]
        if all(self._number(e) > 0 for e in ways):
            return self._ordered(self._order)
        return [e for network in networks(self._order) for e in self._ordered(network)]

    def _ordered(self, elements: list[Element]) -> list[Element]:
        """The elements that are executed, in order: those with numbers, sinks, blocks, jumps."""
        numbered = sorted((e for e in elements if self._number(e) > 0), key=self._number)
        rest = [e for e in elements if self._number(e) <= 0 and e.tag in _EXECUTED]
        if len({_position(e) for e in rest}) > 1:
            rest.sort(key=cmp_to_key(_by_position))
            rest.sort(key=lambda e: e.tag == "block")
        rest.sort(key=lambda e: e.tag == "jump")
        return [*numbered, *rest]

    def _execute(self, element: Element) -> None:
        self._now = self._number(element) if self._free else 0
        if element.tag == "block":
            self._called(element, wanted=element.get("computed") == "here")
        elif element.tag == "return":
            self._guarded(element, self._power(element), "RETURN;")
        elif element.tag in _WAYS:
            self._lead(element)
        elif element.tag == "coil":
            self._assign(element, _target(element), self._power(element))
        elif element.tag in _SINKS and (value := self.point(element.child("connectionPointIn"))) is not None:
            self._assign(element, _target(element), value)

    def _lead(self, element: Element) -> None:
        """A label or a jump."""
        name = element.get("label")
        if not _LABEL.fullmatch(name):
            raise NotTranslatedError(element.at, f"the name of a label is missing or not a name: {name!r}")
        if element.tag == "label":
            self._body.line(f"{name}:", element.at)
            return
        value = self.point(element.child("connectionPointIn")) or "TRUE"
        value = _negated(value, element) if _is(element, "negated") else value
        self._guarded(element, "" if value == "TRUE" else value, f"JMP {name};")

    def _assign(self, element: Element, target: str, value: str) -> None:
        if _is(element, "negatedIn" if element.tag == "inOutVariable" else "negated"):
            value = _negated(value, element)
        value = self._edge(element, value)
        storage = element.get("storage")
        if storage in ("set", "reset"):
            stored = "TRUE" if storage == "set" else "FALSE"
            self._guarded(element, value, f"{target} := {stored};")
        else:
            self._line(element, f"{target} := ", value, ";")

    def _line(self, element: Element, *pieces: str) -> None:
        self._body.line(Written.of(element.at, *pieces), element.at)

    def _guarded(self, element: Element, condition: str, *pieces: str) -> None:
        """Adds a statement that is executed under a condition, "" for none. All of the condition stands for the
        element: there a breakpoint stops."""
        self._line(element, *((f"IF {condition} THEN ", *pieces, " END_IF;") if condition else pieces))

    # ---- values ----

    def _power(self, element: Element) -> str:
        value = self.point(element.child("connectionPointIn"))
        if value is None:
            raise NotTranslatedError(element.at, "a part of it is connected to nothing")
        return value

    def point(self, point: Element | None) -> str | None:
        """The value at an input: all that is connected to it, in parallel. None for nothing."""
        if point is None:
            return None
        expression = point.child("expression")
        if expression is not None and expression.text:
            return _operand(expression.text, expression)
        values = [self._value(c, c.get("refLocalId"), c.get("formalParameter")) for c in point.all("connection")]
        if not values:
            return None
        if len(values) == 1 or "TRUE" in values:
            return values[0] if len(values) == 1 else "TRUE"
        return Written.of(point.at, "(", *_between(" OR ", values), ")")

    def _value(self, connection: Element, ref: str, formal: str) -> str:
        element = self._elements.get(ref)
        if element is None:
            raise NotTranslatedError(connection.at, f"a line comes from element {ref}, which does not exist")
        if element.tag == "leftPowerRail":
            return "TRUE"
        if element.tag in ("inVariable", "inOutVariable"):
            value = _operand((element.child("expression") or element).text, element)
            return self._modified(element, value, "negatedOut" if element.tag == "inOutVariable" else "negated")
        if element.tag == "block":
            return self._output(element, formal)
        if ref in self._busy:
            raise NotTranslatedError(element.at, "it has a loop without a function block")
        self._busy.add(ref)
        try:
            return self._passed(element)
        finally:
            self._busy.discard(ref)

    def _passed(self, element: Element) -> str:
        """The value that what only passes it on gets."""
        if element.tag == "contact":
            return self._contact(element)
        if element.tag in ("coil", "connector"):
            return self._power(element)
        if element.tag == "continuation":
            for other in self._order:
                if other.tag == "connector" and other.get("name") == element.get("name"):
                    return self._power(other)
        raise NotTranslatedError(element.at, f"a line comes from a {element.tag}")

    def _contact(self, contact: Element) -> str:
        name = _operand((contact.child("variable") or contact).text, contact)
        value = self._modified(contact, name)
        power = self._power(contact)
        return value if power == "TRUE" else Written.of(contact.at, "(", power, " AND ", value, ")")

    def _modified(self, element: Element, value: str, negated: str = "negated") -> str:
        value = self._edge(element, value)
        return _negated(value, element) if _is(element, negated) else value

    def _edge(self, element: Element, value: str) -> str:
        """The value, or whether it has an edge now."""
        trigger = _TRIGGERS.get(element.get("edge"))
        if trigger is None:
            return value
        self._needs_statement(element, "an edge")
        if not self._unit.keeps:
            raise NotTranslatedError(element.at, "it looks for an edge, but keeps nothing between its calls")
        name = f"_{trigger}{len(self._body.variables)}_{element.at.line}"
        key = f"{element.at.line}:{element.at.column}"
        if key not in self._done:
            self._body.variables[name] = (trigger, element.at)
            self._line(element, f"{name}(CLK := ", value, ");")
            self._done[key] = name
        return f"{self._done[key]}.Q"

    # ---- blocks ----

    def _output(self, block: Element, formal: str) -> str:
        output = next((v for v in _parameters(block, "outputVariables") if v.get("formalParameter") == formal), None)
        self._called(block, wanted=True)
        if formal.upper() == "ENO":
            if block.get("localId") not in self._done and _input(block, "EN") is not None:
                raise NotTranslatedError(block.at, "its ENO is needed before it is executed")
            value = self._done.get(f"{block.get('localId')}.EN", "TRUE")
        elif _instance(block):
            value = f"{_instance(block)}.{formal}"
        else:
            value = self._done.get(block.get("localId"), result_variable(block))
        return value if output is None else self._modified(output, value)

    def _called(self, block: Element, *, wanted: bool = False) -> None:
        """Sees to it that a block is executed before its outputs are read."""
        key, number = block.get("localId"), self._number(block)
        if key in self._done:
            return
        if key in self._busy or 0 < self._now < number:
            if _instance(block):
                return  # its outputs of the cycle before
            if self._free and self._is_kept(block):
                return
            why = "it has a loop without a function block" if key in self._busy else f"number {number} is needed before"
            raise NotTranslatedError(block.at, why)
        named = _named_outputs(block)
        self._busy.add(key)
        before, self._now = self._now, number or self._now
        if _instance(block):
            self._call_instance(block, key)
        elif wanted or named or number or self._may_act(block.get("typeName")):
            self._call_function(block, key)
        self._busy.discard(key)
        self._now = before
        enable = "" if _instance(block) else self._done.get(f"{key}.EN", "")
        for output, target in named:
            value = self._output(block, output.get("formalParameter"))
            when = enable if output.get("formalParameter").upper() != "ENO" else ""
            self._guarded(output, when, f"{target} := ", value, ";")

    def _is_kept(self, block: Element) -> bool:
        """Whether the result of a function is there in the next cycle."""
        return self._unit.keeps and self._unit.results.get(block.get("typeName").casefold(), True)

    def _may_act(self, name: str) -> bool:
        """Whether a function is called even if nothing reads its result."""
        return name.upper() == _EXECUTE or name.casefold() in self._unit.results or is_declared(name)

    def _inputs(self, block: Element, key: str) -> tuple[str, list[tuple[str, str]]]:
        """EN, "" without one, and the other inputs that are connected, with their values."""
        enable, found = "", list[tuple[str, str]]()
        for item in [*_parameters(block, "inputVariables"), *_parameters(block, "inOutVariables")]:
            value = self.point(item.child("connectionPointIn"))
            if value is None:
                continue
            value = Written.of(item.at, self._modified(item, value))
            if item.get("formalParameter").upper() != "EN":
                found.append((item.get("formalParameter"), value))
            elif value != "TRUE":
                self._needs_statement(block, f"{block.get('typeName')} with EN")
                enable = enable_variable(block)
                self._body.variables[enable] = ("BOOL", block.at)
                self._line(block, f"{enable} := ", value, ";")
                self._done[f"{key}.EN"] = enable
        return enable, found

    def _call_instance(self, block: Element, key: str) -> None:
        self._needs_statement(block, f"the function block {_instance(block)}")
        enable, inputs = self._inputs(block, key)
        named = [Written.of(block.at, f"{n} := ", v) for n, v in inputs]
        self._done[key] = ""
        self._guarded(block, enable, f"{_instance(block)}(", *_between(", ", named), ");")

    def _call_function(self, block: Element, key: str) -> None:
        name = block.get("typeName")
        enable, inputs = self._inputs(block, key)
        if self._inline and name.upper() != _EXECUTE:
            self._done[key] = Written.of(block.at, f"{name}(", *_between(", ", [value for _, value in inputs]), ")")
            return
        if name.upper() == _EXECUTE and block.child_data("stcode"):
            self._write_statements(block, key, enable)
            return
        used = {c.get("formalParameter").upper() for e in self._consumers.get(key, []) for c in e.every("connection")
                if c.get("refLocalId") == key}  # fmt: skip
        used |= {v.get("formalParameter").upper() for v, _ in _named_outputs(block)}
        used.discard("ENO")
        outputs = [v.get("formalParameter").upper() for v in _parameters(block, "outputVariables")]
        if not used.isdisjoint([name for name in outputs if name != "ENO"][1:]):
            raise NotTranslatedError(block.at, f"more than one output of the function {name} is used")
        own = self._unit.results.get(name.casefold())
        given = [v if own is None else Written.of(block.at, f"{n} := ", v) for n, v in inputs]
        call: str = Written.of(block.at, f"{name}(", *_between(", ", given), ")")
        if own is False or not (used or own or is_declared(name)):
            self._guarded(block, enable, call, ";")
            self._done[key] = "FALSE"
            return
        result = result_variable(block)
        self._calls[result] = call
        self._body.variables[result] = ("", block.at)
        if enable and name.upper() in COMPARISONS and not _has_output(block, "ENO"):
            call, enable = Written.of(block.at, f"{enable} AND (", call, ")"), ""  # in a rung, as a contact
        self._guarded(block, enable, f"{result} := ", call, ";")
        self._done[key] = result

    def _write_statements(self, block: Element, key: str, enable: str) -> None:
        """Adds the statements of an EXECUTE box."""
        self._needs_statement(block, "statements")
        self._done[key] = ""
        if enable:
            self._body.line(f"IF {enable} THEN", block.at)
        self._body.parts += [chunk for data in block.child_data("stcode") for chunk in data.every_chunk()]
        self._body.line("\nEND_IF;" if enable else "", block.at)


def networks(order: list[Element]) -> list[list[Element]]:
    """Returns the elements that are connected to each other, but for power rails, from top to bottom."""
    elements = {e.get("localId"): e for e in order}
    of: dict[str, list[Element]] = {key: [e] for key, e in elements.items()}
    named: dict[str, str] = {}
    for key, element in elements.items():
        others = [c.get("refLocalId") for c in element.every("connection")]
        if element.tag in ("connector", "continuation") and element.get("name"):
            others.append(named.setdefault(element.get("name"), key))
        for other in others:
            if (
                RAILS.isdisjoint((element.tag, elements.get(other, element).tag))
                and of.get(other, of[key]) is not of[key]
            ):
                of[other] += of[key]
                of.update(dict.fromkeys([e.get("localId") for e in of[key]], of[other]))
    places = {id(e): number for number, e in enumerate(order)}
    found = list({id(network): sorted(network, key=lambda e: places[id(e)]) for network in of.values()}.values())
    found.sort(key=lambda network: places[id(network[0])])
    executed = [[_position(e) for e in network if e.tag in _EXECUTED] for network in found]
    if len({position for network in executed for position in network}) > 1:
        found.sort(key=lambda network: min((_position(e) for e in network if e.tag in _EXECUTED), default=(0, 0)))
    return found


def _target(sink: Element) -> str:
    """Returns the variable of a coil or output variable."""
    return (sink.child("variable" if sink.tag == "coil" else "expression") or sink).text


def _parameters(block: Element, which: str) -> list[Element]:
    return [v for part in block.all(which) for v in part.all("variable")]


def result_variable(block: Element) -> str:
    """The variable with the result of a function."""
    return f"_TMP_{block.get('typeName').rpartition('.')[2]}{block.get('localId')}_OUT"


def type_of(call: str) -> str:
    """The type of what a call returns, for a declaration."""
    if not isinstance(call, Written):
        return f"@type({call})"
    return Written.of(call.parts[0][1], "@type(", call, ")")


def _in_full(call: str, own: str, later: Mapping[str, str]) -> str:
    """A call whose results of the cycle before, which are declared `later`, are written as the calls that they come
    from; 0 for what leads back to its `own` result, or was written before."""
    waiting = dict(later)

    def written(name: re.Match[str]) -> str:
        if name[0] not in later and name[0] != own:
            return name[0]
        text = waiting.pop(name[0], "0")
        return f"({_RESULT.sub(written, text)})"

    if not isinstance(call, Written):
        return _RESULT.sub(written, call)
    return Written.of(call.parts[0][1], *(Written.of(at, _RESULT.sub(written, text)) for text, at in call.parts))


def _between(sign: str, values: Sequence[str]) -> list[str]:
    """The values with a sign between them."""
    return [piece for value in values for piece in (sign, value)][1:]


def enable_variable(block: Element) -> str:
    """The variable with the EN of a block."""
    return f"_TMP_EN{block.get('localId')}"


def _call_type(block: Element) -> str:
    """What a block of a CFC is; "" if that is not said."""
    return next((data.text.lower() for data in block.child_data("cfccalltype")), "")


def _instance(block: Element) -> str:
    """The instance that a block calls, or the program; "" for a function."""
    return block.get("instanceName") or (block.get("typeName") if _call_type(block) == "program" else "")


def _named_outputs(block: Element) -> list[tuple[Element, str]]:
    """Those that name the variable they go to."""
    points = [(v, v.child("connectionPointOut", "expression")) for v in _parameters(block, "outputVariables")]
    return [(v, e.text) for v, e in points if e is not None and e.text]


def _check_modifiers(element: Element) -> None:
    """None is passed over without a word."""
    parts = [(element, element.tag)]
    if element.tag == "block":
        parts = [(v, p.tag) for p in element.children if p.tag in _MODIFIED for v in p.all("variable")]
    for part, where in parts:
        for kind, values in _MODIFIERS.items():
            for name in (kind, f"{kind}In", f"{kind}Out"):
                value = part.get(name)
                if value in ("", "none", "false", "0") or where not in _MODIFIED:
                    continue
                if name not in _MODIFIED[where] or value not in values:
                    raise NotTranslatedError(part.at, f'{name}="{value}" has no translation here')


def _has_output(block: Element, name: str) -> bool:
    return any(v.get("formalParameter").upper() == name for v in _parameters(block, "outputVariables"))


def _input(block: Element, name: str) -> Element | None:
    """What is connected to an input, and where."""
    found = next((v for v in _parameters(block, "inputVariables") if v.get("formalParameter").upper() == name), None)
    return None if found is None else next(found.every("connection"), None)


def _position(element: Element) -> tuple[float, float]:
    """Row and column."""
    position = element.child("position")
    try:
        return (0.0, 0.0) if position is None else (float(position.get("y", "0")), float(position.get("x", "0")))
    except ValueError:
        return 0.0, 0.0


def _by_position(a: Element, b: Element) -> int:
    (row, column), (other_row, other_column) = _position(a), _position(b)
    first, second = (column, other_column) if abs(row - other_row) < _SAME_ROW else (row, other_row)
    return (first > second) - (first < second)


def _is(element: Element, attribute: str) -> bool:
    return element.get(attribute) == "true"


def _operand(text: str, element: Element) -> str:
    """The text of an element as an operand."""
    end = "\n" * ("//" in text)  # the comment ends there
    return Written.of(element.at, text if _SIMPLE.fullmatch(text) else f"({text}{end})")


def _negated(value: str, element: Element) -> str:
    opening, closing = ("", "") if _SIMPLE.fullmatch(value) else ("(", ")")
    return Written.of(element.at, f"NOT {opening}", value, closing)
