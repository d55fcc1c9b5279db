"""Values of variables as Structured Text writes them: what is shown to people, and what they may type.

`parse_value(t, literal(t, value))` is the value again. What is typed may be less formal: 80ms, abc, on.
"""

from __future__ import annotations

import datetime
import math
import re
from fractions import Fraction
from typing import Any

from plctool.errors import UsageError
from plctool.iec.literals import EPOCH, UNITS_NS, LiteralError, string
from plctool.iec.types import (
    ELEMENTARY,
    ArrayType,
    Elementary,
    EnumType,
    Kind,
    PointerType,
    StringType,
    StructType,
    SubrangeType,
    Type,
    base_of,
)

_DATE_UNITS_NS = {"DATE": 1_000_000_000, "DT": 1_000_000_000, "TOD": 1_000_000}
_UNIT_NAMES = {1_000_000_000: "seconds", 1_000_000: "milliseconds", 1: "nanoseconds"}
_DAY = r"(?P<y>\d{4})-(?P<mo>\d{1,2})-(?P<d>\d{1,2})"
_CLOCK = r"(?P<h>\d{1,2}):(?P<mi>\d{1,2})(?::(?P<s>\d{1,2})(?:\.(?P<f>\d{1,9}))?)?"
_DATE_FORMS = {"DATE": re.compile(_DAY), "TOD": re.compile(_CLOCK), "DT": re.compile(f"{_DAY}-{_CLOCK}")}
_PART = re.compile(r"(\d+(?:\.\d+)?)(ms|us|ns|d|h|m|s)")
_PUNCTUATION = re.compile(r"""'(?:\$.|[^$'])*'|"(?:\$.|[^$"])*"|[][(),]""")  # strings hide what is in them
_REPEATED = re.compile(r"(?P<count>\d+)\s*\((?P<items>.*)\)", re.DOTALL)
_LONGEST = 300  # characters of a number, date or duration that is typed
_TYPED = re.compile(r"^(?P<type>[A-Za-z]\w*)#(?P<rest>.+)$")


def bad_value(text: object, t: Type, hint: str) -> UsageError:
    """The error about a value that does not fit its type."""
    return UsageError(f"'{text}' is not a value of {t}; {hint}.", "bad-value")


def limits(t: Type) -> tuple[int, int]:
    """The least and the largest value of a type that counts."""
    if isinstance(t, SubrangeType):
        return t.low, t.high
    base = base_of(t)
    assert isinstance(base, Elementary)
    high = 1 if base.kind is Kind.BOOL else (1 << (base.bits - base.signed)) - 1
    return -(1 << (base.bits - 1)) if base.signed else 0, high


def limits_text(t: Type) -> str:
    """The end of a sentence about a value that is outside."""
    base = base_of(t)
    low, high = limits(t)
    if base.name == "TOD":  # it counts further than a day
        high = UNITS_NS["d"] // _DATE_UNITS_NS["TOD"] - 1
    return f"it takes {decoded(base, low)} to {decoded(base, high)}"


def decoded(base: Type, number: int) -> Any:
    """What is shown for a number in memory."""
    assert isinstance(base, Elementary)
    if base.kind is Kind.DATE:
        return format_date(number, base)
    return format_time(number, base) if base.kind is Kind.TIME else number


def _units(text: object, t: Type, nanoseconds: Fraction) -> int:
    """In the unit of a type. Raises UsageError for what is finer, or outside of the type."""
    base = base_of(t)
    unit = 1 if base.size == 8 else _DATE_UNITS_NS.get(base.name, 1_000_000)
    units = nanoseconds / unit
    if units.denominator != 1:
        shorter = "" if base.size == 8 else f", L{base.name} shorter ones"
        raise bad_value(text, t, f"it takes a whole number of {_UNIT_NAMES[unit]}{shorter}")
    low, high = limits(t)
    if not low <= units <= high:
        raise bad_value(text, t, limits_text(t))
    return int(units)


# ---- value -> text -------------------------------------------------------------------------------------------------


def literal(t: Type, value: Any) -> str:
    """A value, as `values.decode` gives it, the way ST writes it."""
    if isinstance(t, Elementary):
        return _elementary(t, value)
    if isinstance(t, ArrayType):
        return _list(t, value)
    if isinstance(t, StructType):
        shown = [f for f in t.fields if not f.hidden]
        return "(" + ", ".join(f"{f.name} := {literal(f.type, value[f.name])}" for f in shown) + ")"
    if isinstance(t, StringType):
        return quoted(value, t.wide)
    if isinstance(t, PointerType):
        return "NULL" if value is None else f"16#{value:X}"
    if isinstance(t, EnumType) and isinstance(value, str):  # the name of a value; others are numbers
        return value
    base = base_of(t)
    assert isinstance(base, Elementary)
    return _elementary(base, value)


def _elementary(t: Elementary, value: Any) -> str:
    kind = t.kind
    if kind is Kind.INT:
        return str(value)
    if kind is Kind.BOOL:
        return "TRUE" if value else "FALSE"
    if kind is Kind.CHAR:
        return quoted(value or "\0", t.size == 2)
    if kind is Kind.REAL:
        return real_text(value)
    return f"16#{value:0{2 * t.size}X}" if kind is Kind.BIT else str(value)


def real_text(value: float) -> str:
    """A REAL or LREAL; one that is not a number, or infinite, in words that `float` reads again."""
    if math.isfinite(value):
        return str(value)
    return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"


def _list(t: ArrayType, value: Any) -> str:
    def nested(item: Any, depth: int) -> str:
        if depth == len(t.bounds):
            return literal(t.element, item)
        return "[" + ", ".join(nested(part, depth + 1) for part in item) + "]"

    return nested(value, 0)


def quoted(text: str, wide: bool) -> str:
    """A STRING or WSTRING literal, with $ escapes for what cannot be seen."""
    quote = '"' if wide else "'"

    def shown(c: str) -> str:
        if c in ("$", quote):
            return f"${c}"
        if c.isprintable():
            return c
        digits = c.encode("utf-16-be", "surrogatepass").hex().upper() if wide else f"{ord(c):02X}"
        return re.sub("..(..)?", r"$\g<0>", digits)  # one escape for each character in memory

    return quote + "".join(map(shown, text)) + quote


class Duration(str):
    """A TIME or LTIME as ST writes it."""

    @property
    def timedelta(self) -> datetime.timedelta:
        """To compute with; of an LTIME the whole microseconds, rounded down."""
        return datetime.timedelta(microseconds=parse_time(self, ELEMENTARY["LTIME"]) // 1000)


def format_time(value: int, t: Type) -> Duration:
    """'T#1h2m3s4ms' for TIME [ms], 'LTIME#...' for LTIME [ns]."""
    wide = base_of(t).size == 8
    prefix, left = ("LTIME#", abs(value)) if wide else ("T#", abs(value) * 1_000_000)
    text = ""
    for unit, size in UNITS_NS.items():
        if left >= size:
            text += f"{left // size}{unit}"
            left %= size
    sign = "-" if value < 0 else ""
    return Duration(prefix + sign + (text or ("0ns" if wide else "0ms")))


def format_date(value: int, t: Type) -> str:
    """'D#2024-02-29', 'TOD#12:30:15.500', 'DT#2024-02-29-12:30:15'; LDATE#, LTOD#, LDT# for the types that count ns."""
    name = base_of(t).name
    kind = name.removeprefix("L")
    nanoseconds = value * _DATE_UNITS_NS.get(name, 1)
    days, in_day = divmod(nanoseconds, UNITS_NS["d"])
    seconds, fraction = divmod(in_day, UNITS_NS["s"])
    clock = f"{seconds // 3600:02}:{seconds // 60 % 60:02}:{seconds % 60:02}"
    if fraction:
        digits = f"{fraction:09}"
        clock += "." + (digits[:3] if digits.endswith("000000") else digits[:6] if digits.endswith("000") else digits)
    if kind == "TOD":
        return f"{name}#{clock}"
    day = (EPOCH + datetime.timedelta(days)).isoformat()
    return f"D#{day}" if name == "DATE" else f"{name}#{day}" + (f"-{clock}" if kind == "DT" else "")


# ---- text -> value -------------------------------------------------------------------------------------------------


def parse_time(text: str, t: Type = ELEMENTARY["TIME"]) -> int:
    """A duration such as 'T#1.5s', 'LTIME#20us' or '80ms', in the unit of `t`: ms for TIME, ns for LTIME. Raises
    UsageError, also if it does not fit."""
    return _units(text, t, _duration(text, t))


def parse_milliseconds(text: str) -> float:
    """A duration of any length. Raises UsageError."""
    return float(parse_nanoseconds(text) / UNITS_NS["ms"])


def parse_nanoseconds(text: str) -> Fraction:
    """A duration of any length. Raises UsageError."""
    return _duration(text, ELEMENTARY["TIME"])


def _duration(text: str, t: Type) -> Fraction:
    """In nanoseconds."""
    _check_length(text, t)
    body = re.sub(r"(?i)^l?t(ime)?#", "", text.strip()).replace("_", "").lower()
    sign = -1 if body.startswith("-") else 1
    parts = body.removeprefix("-")
    matches = list(_PART.finditer(parts))
    if not matches or "".join(m.group(0) for m in matches) != parts:
        raise bad_value(text, t, "write a duration such as T#1s500ms")
    return sign * sum((Fraction(m.group(1)) * UNITS_NS[m.group(2)] for m in matches), Fraction())


def parse_date(text: str, t: Type) -> int:
    """A date or time of day such as 'D#2024-02-29', '12:30:15.5' or 'LDT#2024-02-29-12:30:15', in the unit of `t`.
    Raises UsageError, also if it does not fit."""
    name = base_of(t).name
    kind = name.removeprefix("L")
    body = text.strip().rpartition("#")[2].replace("_", "")
    match = _DATE_FORMS[kind].fullmatch(body)
    example = {"DATE": "D#2024-02-29", "TOD": "TOD#12:30:15", "DT": "DT#2024-02-29-12:30:15"}[kind]
    if match is None:
        raise bad_value(text, t, f"write {example}")
    part = match.groupdict(default="0")
    try:
        day = datetime.date(int(part["y"]), int(part["mo"]), int(part["d"])) if kind != "TOD" else EPOCH
        clock = datetime.time(int(part["h"]), int(part["mi"]), int(part["s"])) if kind != "DATE" else datetime.time()
    except ValueError:
        raise bad_value(text, t, f"there is no such day or time; write {example}") from None
    seconds = (clock.hour * 60 + clock.minute) * 60 + clock.second
    total = (day - EPOCH).days * UNITS_NS["d"] + seconds * UNITS_NS["s"]
    total += int(part["f"].ljust(9, "0")) if kind != "DATE" else 0
    return _units(text, t, Fraction(total))


def units_of(t: Type, value: datetime.timedelta | datetime.date | datetime.time) -> int:
    """A duration, date or time of Python in the unit of a type. Raises UsageError unless it is exactly one of its
    values."""
    if isinstance(value, datetime.timedelta):
        return _units(value, t, Fraction(value // datetime.timedelta(microseconds=1)) * UNITS_NS["us"])
    kind = base_of(t).name.removeprefix("L")
    wanted = {"DATE": datetime.date, "TOD": datetime.time, "DT": datetime.datetime}[kind]
    if type(value) is not wanted or getattr(value, "tzinfo", None) is not None:
        raise bad_value(value, t, f"give a datetime.{wanted.__name__} without a time zone")
    if isinstance(value, datetime.time):
        return _units(value, t, Fraction(_clock_ns(value)))
    days = Fraction((value.toordinal() - EPOCH.toordinal()) * UNITS_NS["d"])
    return _units(value, t, days + (_clock_ns(value) if isinstance(value, datetime.datetime) else 0))


def _clock_ns(clock: datetime.time | datetime.datetime) -> int:
    return ((clock.hour * 60 + clock.minute) * 60 + clock.second) * UNITS_NS["s"] + clock.microsecond * UNITS_NS["us"]


def parse_value(t: Type, text: str) -> Any:
    """What a person typed for a variable of type `t`. Raises UsageError."""
    text = text.strip()
    if isinstance(t, StringType):
        return _parse_text(t, text, t.wide)
    if isinstance(t, ArrayType):
        return _parse_array(t, text)
    if isinstance(t, StructType):
        return _parse_struct(t, text)
    if isinstance(t, PointerType):
        if text.upper() not in ("NULL", "0"):
            raise bad_value(
                text, t, "only the program can take an address; write NULL, or write the variable it leads to"
            )
        return None
    base = base_of(t)
    assert isinstance(base, Elementary)
    if isinstance(t, EnumType):
        return _parse_enum(t, text)
    _check_length(text, t)
    if base.kind is Kind.TIME:
        return parse_time(text, t)
    if base.kind is Kind.DATE:
        return parse_date(text, t)
    if base.kind is Kind.CHAR:
        return _parse_character(base, text)
    typed = _TYPED.match(text)
    if typed and typed["type"].upper() in ELEMENTARY:
        text = typed["rest"]
    if base.kind is Kind.BOOL:
        return _parse_bool(t, text)
    if base.kind is Kind.REAL:
        try:
            value = float(text.replace("_", ""))
        except ValueError:
            raise bad_value(text, t, "write a number such as 1.5 or -2e3") from None
        if math.isinf(value) and any(map(str.isdigit, text)):
            raise bad_value(text, t, "it is too large")
        return value
    return _parse_integer(t, text)


def _check_length(text: str, t: Type) -> None:
    """None that is shown is longer, and Python does not convert those that are much longer."""
    if len(text) > _LONGEST:
        raise bad_value(f"{text[:20]}...", t, f"it has {len(text)} characters")


def _parse_text(t: Type, text: str, wide: bool) -> str:
    """A literal with its $ escapes, or just the characters."""
    if len(text) < 2 or text[0] != text[-1] or text[0] not in "'\"":
        return text
    quote = '"' if wide else "'"
    try:
        return string(quote + text[1:-1] + quote)
    except LiteralError as error:
        raise bad_value(text, t, str(error)) from None


def _parse_character(t: Type, text: str) -> int:
    typed = _TYPED.match(text)
    if typed and typed["type"].upper() in ("CHAR", "WCHAR"):
        text = typed["rest"]
    character = _parse_text(t, text, t.size == 2)
    if len(character) != 1:
        raise bad_value(text, t, "write one character")
    return ord(character)


def _parse_array(t: ArrayType, text: str, dimension: int = 0) -> list[Any]:
    """A list; of lists as long as there are more dimensions."""
    low, high = t.bounds[dimension]
    found = _parse_items(t, text, dimension)
    if len(found) != high - low + 1:
        raise bad_value(text, t, f"give a list with {high - low + 1} elements")
    return found


def _parse_items(t: ArrayType, text: str, dimension: int) -> list[Any]:
    found: list[Any] = []
    for item in _split(t, text, "[]"):
        if repeated := _REPEATED.fullmatch(item):
            items = _parse_items(t, f"[{repeated['items']}]", dimension)
            found += items * min(int(repeated["count"]), t.count + 1)
        elif dimension + 1 < len(t.bounds):
            found.append(_parse_array(t, item, dimension + 1))
        else:
            found.append(parse_value(t.element, item))
        if len(found) > t.count:
            raise bad_value(text, t, f"it has {t.count} elements")
    return found


def _parse_struct(t: StructType, text: str) -> dict[str, Any]:
    members = {}
    for item in _split(t, text, "()"):
        name, assigned, value = item.partition(":=")
        member = t.member(name.strip())
        if not assigned or member is None:
            raise bad_value(text, t, f"write its members as in ({t.fields[0].name} := ..., ...)")
        members[member.name] = parse_value(member.type, value)
    return members


def _split(t: Type, text: str, brackets: str) -> list[str]:
    """The items of a list in `brackets`."""
    if len(text) < 2 or text[0] + text[-1] != brackets:
        raise bad_value(text, t, f"write a list in {brackets[0]} {brackets[1]}")
    items, depth, begin = [], 0, 1
    for match in _PUNCTUATION.finditer(text, 1, len(text) - 1):
        depth += {"[": 1, "(": 1, "]": -1, ")": -1}.get(match[0], 0)
        if match[0] == "," and depth == 0:
            items.append(text[begin : match.start()].strip())
            begin = match.end()
    return [*items, text[begin:-1].strip()]


def _parse_bool(t: Type, text: str) -> bool:
    known = {"true": True, "1": True, "on": True, "false": False, "0": False, "off": False}
    if text.lower() not in known:
        raise bad_value(text, t, "write TRUE or FALSE")
    return known[text.lower()]


def _parse_integer(t: Type, text: str) -> int:
    match = re.fullmatch(r"(-?)(?:(2|8|10|16)#)?([0-9A-Fa-f_]+)", text)
    try:
        if match is None:
            raise ValueError
        value = int(match[3].replace("_", ""), int(match[2] or 10))
    except ValueError:
        raise bad_value(text, t, "write a whole number such as 42 or 16#2A") from None
    return -value if match[1] else value


def _parse_enum(t: EnumType, text: str) -> int:
    key = text.rpartition("#")[2].rpartition(".")[2].casefold()
    for name, value in t.values.items():
        if name.casefold() == key:
            return value
    if re.match(r"-?\d", text):
        return _parse_integer(t, text)
    raise bad_value(text, t, f"choose one of {t.choices}")
