"""Recipes: files of values by name, which are checked against a program before any is written.

A recipe is JSON or CSV, by the suffix of its file (docs/recipes.md). A value is what ST writes: T#2s, 'abc', 16#FF.
"""

from __future__ import annotations

import csv
import fnmatch
import io
import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from plctool.debug.symbols import SymbolTable, is_pattern
from plctool.debug.variables import Change, ClassType, Symbol
from plctool.errors import DeviceError, UsageError
from plctool.files import read_utf8, write_atomically
from plctool.iec.areas import Area
from plctool.iec.types import EnumType, PointerType, StringType, base_of

SUFFIXES = (".json", ".csv")
_COLUMNS = ("name", "type", "value")
_BAD = "bad-recipe"
_SHOWN = 8  # mistakes in one message


@dataclass(frozen=True)
class Value:
    """A value of a recipe: what ST writes, and the type of its variable; "" leaves the type unchecked. `place`: the
    line of a CSV file, for messages."""

    text: str
    type: str = ""
    place: str = ""


@dataclass(frozen=True)
class Recipe:
    """Values by the names of variables. `source`: what messages call the recipe."""

    values: dict[str, Value]
    source: str = "The recipe"

    @property
    def texts(self) -> dict[str, str]:
        """The values as ST writes them."""
        return {name: value.text for name, value in self.values.items()}

    def only(self, patterns: Sequence[str]) -> Recipe:
        """The values whose names match one of the patterns with * and ?; all without patterns. Raises UsageError for a
        pattern that matches none."""
        if not patterns:
            return self
        found: set[str] = set()
        for pattern in patterns:
            matching = {name for name in self.values if _matches(name, pattern)}
            if not matching:
                raise UsageError(f"{self.source} has no value for {pattern}; 'plctool recipe list' shows them.", _BAD)
            found |= matching
        return Recipe({name: value for name, value in self.values.items() if name in found}, self.source)


def _matches(name: str, pattern: str) -> bool:
    """Brackets are those of an index."""
    return fnmatch.fnmatchcase(name.casefold(), pattern.strip().casefold().replace("[", "[[]"))


@dataclass(frozen=True)
class Difference:
    """A variable whose value on the controller differs from that of the recipe, both as ST writes them."""

    name: str
    now: str
    recipe: str


@dataclass(frozen=True)
class Loaded:
    """What `load_recipe` did. `changed`: the variables that had another value before. `together`: the values went to
    the controller in one request, which no power cut divides."""

    values: int
    changed: list[Difference] = field(default_factory=list)
    together: bool = True


# ---- files -----------------------------------------------------------------------------------------------------------


def read_recipe(path: Path) -> Recipe:
    """Raises UsageError, with the line if that is known, for what is not a recipe."""
    read = _form(path)[0]
    text = read_utf8(path, _BAD)
    recipe = Recipe(read(text, str(path)), str(path))
    if not recipe.values:
        raise UsageError(f"{path} has no values; 'plctool recipe save' writes some.", _BAD)
    return recipe


def write_recipe(path: Path, recipe: Recipe) -> None:
    """Replaces the file as a whole. Raises UsageError if it cannot be written."""
    write_atomically(path, _form(path)[1](recipe).encode())


def check_suffix(path: Path) -> None:
    """Raises UsageError for a file that is neither JSON nor CSV by its name."""
    if path.suffix.lower() not in SUFFIXES:
        raise UsageError(f"{path} is neither .json nor .csv; name a recipe such as tea.json.", _BAD)


def _form(path: Path) -> tuple[Callable[[str, str], dict[str, Value]], Callable[[Recipe], str]]:
    check_suffix(path)
    return {".json": (_from_json, _to_json), ".csv": (_from_csv, _to_csv)}[path.suffix.lower()]


def _to_json(recipe: Recipe) -> str:
    lines = [
        f"    {json.dumps(name)}: {json.dumps({'type': value.type, 'value': value.text})}"
        for name, value in recipe.values.items()
    ]
    return '{\n  "recipe": {\n' + ",\n".join(lines) + "\n  }\n}\n"


def _from_json(text: str, source: str) -> dict[str, Value]:
    try:
        document = json.loads(text, object_pairs_hook=_without_doubles)
    except json.JSONDecodeError as error:
        raise UsageError(f"{source}:{error.lineno}:{error.colno}: not JSON: {error.msg}.", _BAD) from None
    except (_DoubleError, RecursionError) as error:
        raise UsageError(f"{source}: {error}.", _BAD) from None
    entries = document.get("recipe") if isinstance(document, dict) else None
    if not isinstance(entries, dict):
        example = '{"recipe": {"Main.speed": {"type": "INT", "value": "5"}}}'
        raise UsageError(f"{source} is not a recipe; write {example}.", _BAD)
    return {name: _json_value(name, entry, source) for name, entry in entries.items()}


class _DoubleError(Exception):
    pass


def _without_doubles(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in pairs:
        if name in found:
            raise _DoubleError(f"{name} is there twice; leave one out")
        found[name] = value
    return found


def _json_value(name: str, entry: object, source: str) -> Value:
    """Also of a recipe written by hand: a number, true or false in place of what ST writes."""
    given = entry if isinstance(entry, dict) else {"value": entry}
    unknown = next((key for key in given if key not in ("type", "value")), None)
    if unknown is not None:
        raise UsageError(f"{source}: {name} has the unknown key {unknown}; there are type and value.", _BAD)
    kind, value = given.get("type", ""), given.get("value")
    if isinstance(value, bool):
        value = "TRUE" if value else "FALSE"
    elif isinstance(value, int | float):
        value = json.dumps(value)
    if not isinstance(value, str) or not isinstance(kind, str):
        raise UsageError(f'{source}: {name} has no value; write {{"type": "INT", "value": "5"}}.', _BAD)
    return Value(value, kind)


def _to_csv(recipe: Recipe) -> str:
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(_COLUMNS)
    writer.writerows((name, value.type, value.text) for name, value in recipe.values.items())
    return out.getvalue()


def _from_csv(text: str, source: str) -> dict[str, Value]:
    """Columns in any order, separated by commas or, as spreadsheets of some languages write them, semicolons."""
    head = text.partition("\n")[0]
    rows = csv.reader(io.StringIO(text, newline=""), delimiter=";" if ";" in head else ",", strict=True)
    found: dict[str, Value] = {}
    try:
        columns = [cell.strip().casefold() for cell in next(rows, [])]
        if len(columns) != len(set(columns)) or not {"name", "value"} <= set(columns) <= set(_COLUMNS):
            raise UsageError(f"{source}:1: the first line is not name,type,value; write it so.", _BAD)
        for row in rows:
            place = f"{source}:{rows.line_num}"
            if not any(cell.strip() for cell in row):
                continue
            if len(row) != len(columns):
                raise UsageError(f"{place}: {len(row)} cells, but {len(columns)} columns; quote commas.", _BAD)
            cells = dict(zip(columns, row, strict=True))
            name = cells["name"].strip()
            if name in found:
                raise UsageError(f"{place}: {name} is there twice; leave one out.", _BAD)
            found[name] = Value(cells["value"], cells.get("type", "").strip(), place)
    except csv.Error as error:
        raise UsageError(f"{source}:{rows.line_num}: not CSV: {error}.", _BAD) from None
    return found


# ---- against a program -----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Fitting:
    """A value of a recipe that fits the program."""

    name: str
    symbol: Symbol
    change: Change

    @property
    def text(self) -> str:
        """The value as ST writes it, so that 5 and 16#5 are the same."""
        return self.symbol.literal(self.symbol.decode(self._content))

    @property
    def _content(self) -> bytes:
        return bytes(self.change.offset) + self.change.data


def fit_recipe(table: SymbolTable, recipe: Recipe) -> list[Fitting]:
    """The values, each with its variable. Raises UsageError, which names all mistakes, if one of them has no variable
    in the program, another type, or a value outside of its range."""
    found: list[Fitting] = []
    mistakes: list[str] = []
    named: dict[tuple[object, int | None], str] = {}
    for name, value in recipe.values.items():
        try:
            fitting = _fitting(table, name, value)
            key = fitting.symbol.place, fitting.symbol.bit
            if key in named:
                raise UsageError(f"{name} and {named[key]} are the same variable; leave one out.")
            named[key] = name
            found.append(fitting)
        except UsageError as error:
            mistakes.append(f"{value.place}: {error.message}" if value.place else error.message)
    if mistakes:
        raise _does_not_fit(recipe, mistakes)
    return found


def _does_not_fit(recipe: Recipe, mistakes: Sequence[str]) -> UsageError:
    shown = mistakes[:_SHOWN]
    more = [f"And {len(mistakes) - _SHOWN} more."] if len(mistakes) > _SHOWN else []
    values = "1 value does" if len(mistakes) == 1 else f"{len(mistakes)} values do"
    return UsageError(f"{recipe.source}: {values} not fit the program. {' '.join([*shown, *more])}", _BAD)


def _fitting(table: SymbolTable, name: str, value: Value) -> Fitting:
    symbol = table.resolve(name)
    symbol.check_writable(symbol.area)
    kind = _type_name(symbol)
    given = re.split(r"[(\[]", value.type)[0].strip()
    if given and given.casefold() != kind.casefold():
        raise UsageError(f"{name} is {kind} in the program, {value.type} in the recipe.", _BAD)
    try:
        return Fitting(name, symbol, symbol.change(symbol.parse(value.text)))
    except UsageError as error:
        raise UsageError(f"{name}: {error.message}", error.code) from None


def _type_name(symbol: Symbol) -> str:
    """Without limits and lengths, which are checked by the value itself."""
    if symbol.bit is not None:
        return "BOOL"
    if isinstance(symbol.type, StringType):
        return symbol.type.keyword
    named = isinstance(symbol.type, EnumType) and not symbol.type.inline
    return symbol.type.name if named else base_of(symbol.type).name


def recipe_variables(table: SymbolTable, names: Sequence[str]) -> list[Symbol]:
    """The scalars and strings that names and patterns stand for, as far as they can be written. Raises UsageError for
    what is unknown, or alone cannot be written."""
    if not names:
        raise UsageError("Name what the recipe is to have, such as 'Main.recipe.*'.", "usage")
    found: dict[str, Symbol] = {}
    for name in names:
        leaves = table.scalars([name])
        writable = {leaf: symbol for leaf, symbol in leaves.items() if _is_value(symbol)}
        if not writable:
            for symbol in leaves.values() if not is_pattern(name) else ():
                symbol.check_writable(symbol.area)
            raise UsageError(f"{name} has no values that can be written; name variables.", _BAD)
        found |= writable
    return list(found.values())


def _is_value(symbol: Symbol) -> bool:
    return not (symbol.constant or symbol.area == Area.CODE.value or isinstance(symbol.type, PointerType | ClassType))


def recipe_of(values: Mapping[str, tuple[Symbol, bytes]], source: str) -> Recipe:
    """A recipe of what variables contain."""
    return Recipe(
        {
            name: Value(symbol.literal(symbol.decode(data)), _type_name(symbol))
            for name, (symbol, data) in values.items()
        },
        source,
    )


def differences(fittings: Iterable[Fitting], contents: Mapping[str, bytes | None]) -> list[Difference]:
    """The variables whose contents differ from the recipe."""
    found = []
    for fitting in fittings:
        content = contents[fitting.name]
        now = fitting.symbol.literal(None if content is None else fitting.symbol.decode(content))
        if now != fitting.text:
            found.append(Difference(fitting.name, now, fitting.text))
    return found


def not_kept(recipe: Recipe, others: Sequence[Difference]) -> DeviceError:
    """The error about values that are others after they were written."""
    shown = ", ".join(f"{other.name} = {other.now}, not {other.recipe}" for other in others[:_SHOWN])
    more = f" and {len(others) - _SHOWN} more" if len(others) > _SHOWN else ""
    return DeviceError(
        f"{recipe.source} was written, but then there was {shown}{more}: the program, a force or another tool has "
        "written there.",
        "recipe-not-kept",
    )
