"""The layout of an operators' page: reads `page.toml`.

title = "Tanks"
operate = true                  # elements may write; without it the page shows only

[[element]]
kind = "bar"
variable = "Control.level2"
unit = "%"
low = 0
high = 100
colours = [{ above = 90, colour = "red" }]

docs/page.md lists all kinds and keys. Names of variables are checked by `operating.py`, which knows the program.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from plctool.errors import UsageError
from plctool.files import Pos, check_inside, read_regular, read_utf8
from plctool.io.tables import Table, each
from plctool.ui.messages import MAX_TEXT

ALARMS = "alarms"  # the kind of element, and the view that it shows
COLOURS = ("green", "red", "yellow", "blue", "grey")
PICTURES = {".png": "image/png", ".jpg": "image/jpeg", ".jpeg": "image/jpeg", ".svg": "image/svg+xml"}
MAX_ELEMENTS = 100
MAX_COLUMNS = 12
MAX_TRENDS = 6  # variables of a trend, as plot.js has colours
MAX_PICTURE = 8 << 20  # bytes
_COLUMNS = 4
_WIDE = 2  # columns of kinds that show several variables
_MAX_DECIMALS = 9
_SECONDS = 60
_MAX_SECONDS = 3600
_CODE = "page"
_NOWHERE = Pos("", 0, 0)
_CONDITIONS = ("is", "below", "above")


@dataclass(frozen=True)
class Rule:
    """The colour of a value that meets a condition: `is`, `below` or `above`."""

    condition: str
    value: float | str
    colour: str


@dataclass(frozen=True)
class Item:
    """One variable, and how its value is shown. `pos`: where its name is. `words`: what is shown for a value. `x`, `y`:
    place in a picture [%]."""

    variable: str
    pos: Pos
    text: str = ""
    unit: str = ""
    decimals: int | None = None
    words: tuple[tuple[str, str], ...] = ()
    colours: tuple[Rule, ...] = ()
    lamp: bool = False
    x: float = 0.0
    y: float = 0.0


@dataclass(frozen=True)
class Picture:
    """The content of a picture, with its media type."""

    media_type: str
    data: bytes


@dataclass(frozen=True)
class Element:
    """An element of the page. `low`, `high`, `step`: of a bar, a slider or a set point; `mode`, `value`: of a button;
    `value_pos`: where the value of a button is."""

    kind: str
    pos: Pos
    text: str
    width: int
    items: tuple[Item, ...]
    operates: bool = False
    low: float | None = None
    high: float | None = None
    step: float | None = None
    mode: str = ""
    value: str = ""
    value_pos: Pos = _NOWHERE
    only_true: bool = False
    seconds: int = _SECONDS
    picture: Picture | None = None


@dataclass(frozen=True)
class Layout:
    """A page. `path`, `source`: its file and the content, for messages."""

    path: Path
    source: str
    title: str
    columns: int
    elements: tuple[Element, ...]


def read_layout(path: Path) -> Layout:
    """Reads a file. Raises UsageError with all mistakes in it, each with its line."""
    from plctool.compiler.sources.toml_files import read_checked

    source = read_utf8(path, _CODE)
    return read_checked(str(path), source, "a page", lambda root: _Reader(path, root).layout(source))


class _Reader:
    """`operates`: whether elements may write that do not say; None if the page does not say either."""

    def __init__(self, path: Path, root: Table) -> None:
        self._path = path
        self._root = root
        own = root.flag("operate")
        self._operates = own if "operate" in root else None
        self._columns = _COLUMNS

    def layout(self, source: str) -> Layout:
        title = _words_of(self._root, "title") or ""
        self._columns = self._root.number("columns", 1, MAX_COLUMNS, _COLUMNS) or _COLUMNS
        tables = self._root.tables("element")
        if not self._root.raw("element"):
            self._root.error('a page needs elements: write for example [[element]], kind = "value"')
        if len(tables) > MAX_ELEMENTS:
            self._root.error(f"there are {len(tables)} elements; a page has at most {MAX_ELEMENTS}", "element")
            tables = tables[:MAX_ELEMENTS]
        return Layout(self._path, source, title, self._columns, tuple(each(tables, self._element)))

    def _element(self, table: Table) -> Element | None:
        kind = table.choice("kind", {name: name for name in _KINDS}, required=True)
        if kind is None:
            list(table.items())  # what else the table may have depends on its kind
            return None
        wide = kind in ("trend", "list", "picture", ALARMS)
        width = table.number("width", 1, self._columns, min(_WIDE if wide else 1, self._columns))
        found: dict[str, Any] = _KINDS[kind](self, table)
        text = _words_of(table, "text") or ""
        return Element(kind, table.pos, text, width or 1, found.pop("items"), **found)

    # ---- kinds ----

    def _value(self, table: Table) -> dict[str, Any]:
        return {"items": _one(table, lamp=False)}

    def _lamp(self, table: Table) -> dict[str, Any]:
        return {"items": _one(table, lamp=True)}

    def _bar(self, table: Table) -> dict[str, Any]:
        return {"items": _one(table), **_limits(table, needed=True)}

    def _slider(self, table: Table) -> dict[str, Any]:
        return {"items": _one(table), **_limits(table, needed=True), **self._step(table), **self._right(table)}

    def _setpoint(self, table: Table) -> dict[str, Any]:
        return {"items": _one(table), **_limits(table, needed=False), **self._step(table), **self._right(table)}

    def _button(self, table: Table) -> dict[str, Any]:
        mode = table.choice("mode", {name: name for name in ("press", "toggle", "set")}, "press")
        value = ""
        if mode == "set":
            raw = table.raw("value")
            if raw is None:
                table.error("a button that sets needs a value: write for example value = true")
            else:
                value = _literal(table, "value", raw) or ""
        else:
            table.belongs('only a button with mode = "set" has a value', "value")
        right = self._right(table)
        return {"items": _one(table), "mode": mode, "value": value, "value_pos": table.value_pos("value"), **right}

    def _trend(self, table: Table) -> dict[str, Any]:
        items = _several(table, "rows", _row)
        seconds = table.number("seconds", 5, _MAX_SECONDS, _SECONDS)
        return {"items": items, "seconds": seconds or _SECONDS}

    def _list(self, table: Table) -> dict[str, Any]:
        return {"only_true": table.flag("only_true"), "items": _several(table, "rows", _row)}

    def _alarms(self, table: Table) -> dict[str, Any]:
        return {"items": (), **self._right(table)}

    def _picture(self, table: Table) -> dict[str, Any]:
        name = table.text("file", required="plant.svg")
        picture = None if name is None else self._load(table, name)
        return {"picture": picture, "items": tuple(each(table.tables("places"), _place))}

    def _load(self, table: Table, name: str) -> Picture | None:
        folder = self._path.parent
        media_type = PICTURES.get(Path(name).suffix.lower())
        if media_type is None:
            table.error(f"'{name}' has to be a file with one of the endings {', '.join(PICTURES)}", "file")
            return None
        try:
            check_inside(folder / name, folder)
            return Picture(media_type, read_regular(folder / name, MAX_PICTURE))
        except UsageError:
            table.error(f"'{name}' is outside the folder of the page; copy the picture there", "file")
        except ValueError:
            table.error("file cannot be the path of a file", "file")
        except OSError as error:
            table.error(f"'{name}' cannot be read: {error.strerror}", "file")
        return None

    # ---- keys of several kinds ----

    def _right(self, table: Table) -> dict[str, Any]:
        own = table.flag("operate", self._operates or False)
        if own and self._operates is False:
            table.error(
                "the page says operate = false, so this element cannot operate; change one of the two", "operate"
            )
            own = False
        return {"operates": own}

    def _step(self, table: Table) -> dict[str, Any]:
        step = _number(table, "step")
        if step is not None and step <= 0:
            table.error("step has to be above 0", "step")
            step = None
        return {"step": step}


_KINDS: dict[str, Callable[[_Reader, Table], dict[str, Any]]] = {
    "value": _Reader._value,
    "bar": _Reader._bar,
    "lamp": _Reader._lamp,
    "button": _Reader._button,
    "slider": _Reader._slider,
    "setpoint": _Reader._setpoint,
    "trend": _Reader._trend,
    "list": _Reader._list,
    "picture": _Reader._picture,
    ALARMS: _Reader._alarms,
}


# ---- one variable ----------------------------------------------------------------------------------------------------


def _one(table: Table, lamp: bool = False) -> tuple[Item, ...]:
    return (_item(table, "", lamp),)


def _row(table: Table) -> Item:
    return _item(table, _words_of(table, "text") or "", lamp=False)


def _place(table: Table) -> Item:
    lamp = table.choice("kind", {"value": False, "lamp": True}, False) or False
    x, y = (_number(table, key, 0, 100, needed="50") or 0.0 for key in ("x", "y"))
    return _item(table, _words_of(table, "text") or "", lamp, x, y)


def _item(table: Table, text: str, lamp: bool, x: float = 0.0, y: float = 0.0) -> Item:
    return Item(
        _words_of(table, "variable", required="Main.speed") or "",
        table.value_pos("variable"),
        text,
        _words_of(table, "unit") or "",
        table.number("decimals", 0, _MAX_DECIMALS),
        _words(table),
        tuple(each(table.tables("colours"), _rule)),
        lamp,
        x,
        y,
    )


def _several(table: Table, key: str, read: Callable[[Table], Item]) -> tuple[Item, ...]:
    tables = table.tables(key)
    if not tables:
        table.error(f'a {table.raw("kind")} needs {key}: write for example {key} = [{{ variable = "Main.speed" }}]')
    return tuple(each(tables, read))


def _words(table: Table) -> tuple[tuple[str, str], ...]:
    inner = table.table("words")
    found = []
    for entry in inner.items() if inner is not None else ():
        if isinstance(entry.value, str):
            found.append((entry.key, entry.value))
        else:
            table.mistakes.error(entry.pos, f"the word for {entry.key} has to be a text in quotes")
    return tuple(found)


def _rule(table: Table) -> Rule | None:
    given = [name for name in _CONDITIONS if name in table]
    compared = {name: _condition(table, name) for name in _CONDITIONS}
    colour = table.choice("colour", {name: name for name in COLOURS}, required=True)
    if len(given) != 1:
        table.error('a colour needs one condition: write for example { above = 90, colour = "red" }')
        return None
    value = compared[given[0]]
    return None if value is None or colour is None else Rule(given[0], value, colour)


def _condition(table: Table, name: str) -> float | str | None:
    if name != "is":
        return _number(table, name)
    raw = table.raw(name)
    if isinstance(raw, int | float) and not isinstance(raw, bool):
        return _number(table, name)
    return None if raw is None else _literal(table, name, raw)


# ---- values ----------------------------------------------------------------------------------------------------------


def _literal(table: Table, key: str, raw: object) -> str | None:
    """Returns a TOML value as ST writes it; a text stands for itself."""
    if isinstance(raw, bool):
        return str(raw).upper()
    if isinstance(raw, int | float) and math.isfinite(raw):
        return str(raw)
    if isinstance(raw, str):
        return raw
    table.error(f"{key} has to be true, false, a number or a text in quotes", key)
    return None


def _limits(table: Table, needed: bool) -> dict[str, Any]:
    low = _number(table, "low", needed="0" if needed else "")
    high = _number(table, "high", needed="100" if needed else "")
    if low is not None and high is not None and low >= high:
        table.error(f"low is {low:g} and high is {high:g}; low has to be below high", "low")
    return {"low": low, "high": high}


def _number(
    table: Table, key: str, low: float = -math.inf, high: float = math.inf, needed: str = ""
) -> float | int | None:
    """Returns a number with or without a decimal point. `needed`: an example; without a value that is a mistake."""
    raw = table.raw(key)
    if raw is None:
        if needed:
            table.error(f"[{table.name}] needs {key}: write for example {key} = {needed}")
        return None
    if not isinstance(raw, int | float) or isinstance(raw, bool) or not math.isfinite(raw):
        table.error(f"{key} has to be a number", key)
        return None
    if not low <= raw <= high:
        table.error(f"{key} is {raw:g}; it can be {low:g} to {high:g}", key)
        return None
    return raw


def _words_of(table: Table, key: str, required: str = "") -> str | None:
    """Returns a text that is shown on one line."""
    found = table.text(key, required=required)
    if found is None:
        return None
    if len(found) > MAX_TEXT or not found.isprintable():
        table.error(f"{key} has to be one line of at most {MAX_TEXT} characters, without control characters", key)
        return None
    return found
