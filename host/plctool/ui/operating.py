"""An operators' page of a program: the elements of `page.toml` with the variables that they show and operate.

A browser names elements by number, never variables, so that it can write only what the page says.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from itertools import islice
from typing import Any

from plctool.controller import Controller
from plctool.debug.alarms import alarms_in
from plctool.debug.symbols import SymbolTable
from plctool.debug.variables import Symbol
from plctool.errors import UsageError
from plctool.files import Pos
from plctool.iec.types import BOOL, ArrayType
from plctool.io.mistakes import Mistake
from plctool.ui.layout import ALARMS, MAX_TRENDS, Element, Item, Layout, Picture
from plctool.ui.live import shown_symbol
from plctool.ui.messages import MAX_NAMES
from plctool.ui.variables import choices_of, is_number

ONLY_SHOWS = "This page shows and operates only what its page.toml lays out."
_PRESSED, _RELEASED = "TRUE", "FALSE"
_LIMITED = ("bar", "slider")  # kinds that need a number


@dataclass(frozen=True)
class OperatorPage:
    """A page whose names the program has. `choices`: of set points, by number of the element."""

    layout: Layout
    elements: tuple[Element, ...]
    choices: dict[int, tuple[str, ...]]

    @property
    def names(self) -> frozenset[str]:
        """All variables that are shown."""
        return frozenset(item.variable for element in self.elements for item in element.items)

    @property
    def views(self) -> frozenset[str]:
        """The views that are shown: that of the alarms."""
        return frozenset(element.kind for element in self.elements if element.kind == ALARMS)

    def picture(self, number: int) -> Picture | None:
        """Returns the picture of an element."""
        return self.elements[number].picture if number < len(self.elements) else None

    def document(self) -> dict[str, Any]:
        """Returns what the browser lays out."""
        elements = [self._element(number, element) for number, element in enumerate(self.elements)]
        return {"title": self.layout.title, "columns": self.layout.columns, "elements": elements}

    def _element(self, number: int, element: Element) -> dict[str, Any]:
        shown = asdict(replace(element, picture=None))
        for place in (shown, *shown["items"]):
            place.pop("pos")
        del shown["value_pos"], shown["picture"]
        return shown | {"choices": self.choices.get(number, ())}

    # ---- operation ----

    def operate(self, plc: Controller, number: int, text: str) -> None:
        """Writes what the operator has chosen, or acknowledges the alarm of this name. Raises UsageError for what the
        page does not let operate."""
        element = self._operated(number)
        if element.kind == ALARMS:
            plc.acknowledge([text])
            return
        name = element.items[0].variable
        symbol = plc.symbols().resolve(name)
        value = symbol.parse(text)
        _check_choice(element, symbol, value)
        plc.write({name: value})

    def holds(self, number: int, text: str) -> bool | None:
        """True if a button is pressed by this text, False if it is released; None for other elements."""
        element = self.elements[number] if number < len(self.elements) else None
        if element is None or element.mode != "press":
            return None
        return text.strip().upper() == _PRESSED

    def release(self, plc: Controller, number: int) -> None:
        """Releases a button whose browser has left."""
        self.operate(plc, number, _RELEASED)

    def _operated(self, number: int) -> Element:
        if number >= len(self.elements) or not self.elements[number].operates:
            raise UsageError("This element only shows; page.toml does not let it operate.", "not-operated")
        return self.elements[number]


def _check_choice(element: Element, symbol: Symbol, value: Any) -> None:
    if element.mode == "set" and value != symbol.parse(element.value):
        raise UsageError(f"This button writes {element.value} only.", "not-operated")
    if isinstance(value, float) and not math.isfinite(value):
        raise UsageError(f"{symbol.literal(value)} cannot be written here; write a number.", "limit")
    for limit, word in ((element.low, "below"), (element.high, "above")):
        if limit is not None and (value < limit if word == "below" else value > limit):
            raise UsageError(f"{symbol.literal(value)} is {word} {limit:g}, the limit here.", "limit")


# ---- names of the program --------------------------------------------------------------------------------------------


def operator_page(layout: Layout, table: SymbolTable) -> OperatorPage:
    """Looks up the names of a page. Raises UsageError with all that the program lacks or that do not fit, each with
    its line."""
    binder = _Binder(table)
    elements = tuple(binder.bound(number, element) for number, element in enumerate(layout.elements))
    page = OperatorPage(layout, elements, binder.choices)
    if len(page.names) > MAX_NAMES:
        message = f"the page shows {len(page.names)} variables; at most {MAX_NAMES} are possible"
        binder.mistakes.append(Mistake(Pos(str(layout.path), 1, 1), message))
    if binder.mistakes:
        from plctool.compiler.sources.toml_files import errors_at

        raise errors_at(binder.mistakes, str(layout.path), layout.source)
    return page


class _Binder:
    def __init__(self, table: SymbolTable) -> None:
        self._table = table
        self.mistakes: list[Mistake] = []
        self.choices: dict[int, tuple[str, ...]] = {}

    def bound(self, number: int, element: Element) -> Element:
        """Returns the element with the arrays of its rows as their elements."""
        if element.kind == ALARMS and not alarms_in(self._table):
            self.mistakes.append(Mistake(element.pos, "the program has no alarms: declare instances of ALARM"))
        items: list[Item] = []
        for item in element.items:
            for one in self._expanded(element, item):
                symbol = shown_symbol(self._table, one.variable)
                if isinstance(symbol, str):
                    self._error(item, symbol)
                    break
                self._check(element, one, symbol)
                items.append(one)
                if element.kind == "setpoint":
                    self.choices[number] = choices_of(symbol) or (("TRUE", "FALSE") if _is_bool(symbol) else ())
        if element.kind == "trend" and len(items) > MAX_TRENDS:
            self._error(element.items[-1], f"the trend has {len(items)} variables; it can have {MAX_TRENDS}")
        return replace(element, items=tuple(items))

    def _error(self, item: Item, message: str) -> None:
        begin = message.partition(" ")[0]
        message = message.removesuffix(".")
        if begin in ("The", "There"):  # not the name of a variable
            message = begin.lower() + message.removeprefix(begin)
        self.mistakes.append(Mistake(item.pos, message))

    def _expanded(self, element: Element, item: Item) -> Iterator[Item]:
        """An array in a row of a trend or list stands for its elements."""
        try:
            symbol = self._table.resolve(item.variable)
        except UsageError:  # reported with the variable
            yield item
            return
        if element.kind not in ("trend", "list") or not isinstance(symbol.type, ArrayType):
            yield item
            return
        for part in islice(symbol.parts(), MAX_NAMES + 1):
            text = f"{item.text}{part.name.removeprefix(symbol.name)}" if item.text else ""
            yield replace(item, variable=part.name, text=text)

    def _check(self, element: Element, item: Item, symbol: Symbol) -> None:
        numeric = is_number(symbol.type) or symbol.bit is not None
        boolean = _is_bool(symbol)
        what = f"{symbol.name} is {_type_of(symbol)}"
        if element.kind in _LIMITED and (not numeric or boolean):
            self._error(item, f"{what}; a {element.kind} needs a number")
        if element.kind == "trend" and not numeric:
            self._error(item, f"{what}; a trend needs numbers or BOOL")
        if item.lamp and not boolean and not item.colours:
            self._error(item, f"{what}; a lamp needs a BOOL, or colours")
        if element.only_true and not boolean:
            self._error(item, f"{what}; a list with only_true needs BOOL")
        if element.kind == "setpoint" and (element.low, element.high) != (None, None) and (not numeric or boolean):
            self._error(item, f"{what}; only a number has low and high")
        if element.operates:
            self._check_writable(element, item, symbol)
        self._check_button(element, item, symbol)

    def _check_writable(self, element: Element, item: Item, symbol: Symbol) -> None:
        try:
            symbol.check_writable(symbol.area)
        except UsageError as error:
            self._error(item, f"{error.message.removesuffix('.')}; write operate = false to show it only")

    def _check_button(self, element: Element, item: Item, symbol: Symbol) -> None:
        if element.mode in ("press", "toggle") and not _is_bool(symbol):
            self._error(
                item, f'{symbol.name} is {_type_of(symbol)}; a button needs a BOOL, or mode = "set" and a value'
            )
        if element.mode == "set":
            try:
                symbol.parse(element.value)
            except UsageError as error:
                self._error(replace(item, pos=element.value_pos), error.message)


def _is_bool(symbol: Symbol) -> bool:
    return symbol.bit is not None or symbol.type == BOOL


def _type_of(symbol: Symbol) -> str:
    return f"of type {'BOOL' if symbol.bit is not None else symbol.type}"
