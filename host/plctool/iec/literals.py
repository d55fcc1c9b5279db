"""From the text of a literal to its value.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import datetime
import math
import re
from decimal import Decimal
from enum import Enum, auto

from plctool.iec.types import ELEMENTARY

Value = int | float | str

MAX_DIGITS = 400  # longer numbers fit no type; Python would take quadratic time over them

_REAL_TYPES = {"REAL", "LREAL"}
_TIME_TYPES = {"T": "TIME", "TIME": "TIME", "LT": "LTIME", "LTIME": "LTIME"}
_DATE_TYPES = {
    "D": "DATE", "DATE": "DATE", "LD": "LDATE", "LDATE": "LDATE", "TOD": "TOD", "TIME_OF_DAY": "TOD", "LTOD": "LTOD",
    "LTIME_OF_DAY": "LTOD", "DT": "DT", "DATE_AND_TIME": "DT", "LDT": "LDT", "LDATE_AND_TIME": "LDT",
}  # fmt: skip
_CALENDAR = re.compile(r"(\d{4})-(\d{1,2})-(\d{1,2})", re.ASCII)
_CLOCK = re.compile(r"(\d{1,2}):(\d{1,2})(?::(\d{1,2})(?:\.(\d{1,9}))?)?", re.ASCII)
EPOCH = datetime.date(1970, 1, 1)
_BASES = {"2": 2, "8": 8, "16": 16}

UNITS_NS = {"d": 86_400_000_000_000, "h": 3_600_000_000_000, "m": 60_000_000_000, "s": 1_000_000_000, "ms": 1_000_000,
            "us": 1_000, "ns": 1}  # fmt: skip
"""Nanoseconds of each unit of a duration, the longest first."""
_UNITS = list(UNITS_NS)
_TIME_PART = re.compile(r"(\d+(?:\.\d+)?)(d|h|ms|us|ns|m|s)", re.IGNORECASE | re.ASCII)
_NUMBER = re.compile(r"\d+(?:\.\d*)?(?:[eE][+-]?\d+)?\Z", re.ASCII)
_NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)
_NOT_ENUMS = {*ELEMENTARY, *_TIME_TYPES, *_DATE_TYPES, "STRING", "WSTRING"}
_UNDERSCORES = re.compile(r"_\Z|\A_|_\.|\._")
_ESCAPES = {"$": "$", "'": "'", '"': '"', "L": "\n", "N": "\n", "P": "\f", "R": "\r", "T": "\t"}
_ESCAPE = re.compile(r"\$([0-9A-Fa-f]{2}|[$'\"LNPRTlnprt]|.|\Z)", re.DOTALL)
_WIDE_ESCAPE = re.compile(r"\$([0-9A-Fa-f]{4}|[$'\"LNPRTlnprt]|.|\Z)", re.DOTALL)


class LiteralKind(Enum):
    """What sort of constant was written."""

    INT = auto()
    REAL = auto()
    BOOL = auto()
    TIME = auto()  # value in ns
    DATE = auto()  # value in ns since 1970 or midnight
    STRING = auto()
    WSTRING = auto()
    NULL = auto()
    BAD = auto()  # already reported


class BitPattern(int):
    """An integer written with a base. Its highest bit may be the sign of the type it goes to: 16#FFFF is -1 as INT."""


class LiteralError(Exception):
    """Not a valid literal; the message says why in one sentence."""


def unsigned(text: str) -> tuple[LiteralKind, Value]:
    """`12`, `1_000`, `16#FF`, `1.5e3`."""
    if not text:
        raise LiteralError("the value after # is missing")
    if len(text) > MAX_DIGITS:
        raise LiteralError("this number is too long")
    if _UNDERSCORES.search(text):
        raise LiteralError(f"{text} has an underscore that is not between two digits")
    text = text.replace("_", "")
    base, hash_sign, digits = text.partition("#")
    if hash_sign:
        return LiteralKind.INT, _based(base, digits)
    if not _NUMBER.match(text):
        raise LiteralError(f"{text} is not a number")
    if text.isdigit():
        return LiteralKind.INT, int(text)
    value = float(text)
    if math.isinf(value):
        raise LiteralError(f"{text} is too large for LREAL")
    return LiteralKind.REAL, value


def _based(base: str, digits: str) -> BitPattern:
    radix = _BASES.get(base)
    if radix is None:
        raise LiteralError(f"the base of a number is 2, 8 or 16, not {base}")
    try:
        return BitPattern(digits, radix)
    except ValueError:
        raise LiteralError(f"{digits} is not a number of base {base}") from None


def typed(text: str) -> tuple[LiteralKind, Value, str]:
    """`INT#5`, `DWORD#16#FF`, `REAL#-1.5e3`, `BOOL#1`, `T#1h30m`: kind, value and type name. None of these:
    LiteralError."""
    prefix, _, rest = text.partition("#")
    name = prefix.upper()
    if name in _TIME_TYPES:
        return LiteralKind.TIME, duration(rest), _TIME_TYPES[name]
    if name in ("S5T", "S5TIME"):
        raise LiteralError(f"a duration is written T#{rest}, not {text}")
    if name in _DATE_TYPES:
        return LiteralKind.DATE, date(name, rest), _DATE_TYPES[name]
    if name == "BOOL" and rest.upper() in ("TRUE", "FALSE", "1", "0"):
        return LiteralKind.BOOL, int(rest.upper() in ("TRUE", "1")), name
    kind, value = unsigned(rest[1:] if rest.startswith(("+", "-")) else rest)
    assert not isinstance(value, str)
    if name in _REAL_TYPES:
        kind, value = LiteralKind.REAL, float(value)
    return kind, -value if rest.startswith("-") else value, name


def _unit_hint(rest: str) -> str:
    if _NUMBER.match(rest) and rest.replace(".", "", 1).isdigit():
        return f"; {rest} has no unit, as in {rest}s"
    return "; its units are d, h, m, s, ms, us and ns"


def duration(text: str) -> int:
    """`1d2h3m4s5ms`, `-1.5s`: nanoseconds. Units come in falling order; only the last may have a fraction."""
    sign, body = (-1, text[1:]) if text.startswith("-") else (1, text.removeprefix("+"))
    body = body.replace("_", "")
    if len(body) > MAX_DIGITS:
        raise LiteralError("this duration is too long")
    at, last_unit, fraction, total = 0, -1, False, Decimal(0)
    while at < len(body):
        part = _TIME_PART.match(body, at)
        if part is None:
            raise LiteralError(f"{text} is not a duration such as 1h30m or 2.5s{_unit_hint(body[at:])}")
        number, unit = part.group(1), _UNITS.index(part.group(2).lower())
        if unit <= last_unit:
            raise LiteralError(f"the units of {text} are not in the order d, h, m, s, ms, us, ns")
        if fraction:
            raise LiteralError(f"only the last unit of {text} may have a fraction")
        last_unit, fraction, at = unit, "." in number, part.end()
        total += Decimal(number) * UNITS_NS[_UNITS[unit]]
    if last_unit < 0:
        raise LiteralError("a duration needs a number and a unit, such as T#10ms")
    return sign * int(total)


def date(name: str, text: str) -> int:
    """`2024-02-29`, `12:30:15.5`, `2024-02-29-12:30:15.5` for a type such as D, TOD, LDT: nanoseconds since 1970 or
    midnight."""
    kind = _DATE_TYPES[name].removeprefix("L")
    day, _, clock = text.replace("_", "").rpartition("-") if kind == "DT" else (text, "", text)
    total = 0
    if kind != "TOD":
        match = _CALENDAR.fullmatch(day)
        if match is None:
            form = "2024-02-29-12:30:15" if kind == "DT" else "2024-02-29"
            raise LiteralError(f"a date is written {name}#{form}, not {name}#{text}")
        try:
            days = (datetime.date(*(int(part) for part in match.groups())) - EPOCH).days
        except ValueError:
            raise LiteralError(f"there is no day {day}") from None
        if days < 0:
            raise LiteralError("dates begin with 1970-01-01")
        total = days * UNITS_NS["d"]
    return total if kind == "DATE" else total + _clock(name, clock)


def _clock(name: str, text: str) -> int:
    match = _CLOCK.fullmatch(text)
    if match is None:
        raise LiteralError(f"the time of {name}#... is written 12:30:15 or 12:30:15.5, not {text}")
    hours, minutes, seconds, fraction = match.groups()
    if int(hours) > 23 or int(minutes) > 59 or int(seconds or 0) > 59:
        raise LiteralError(f"there is no time {text}; the last of a day is 23:59:59.999")
    total = int(hours) * UNITS_NS["h"] + int(minutes) * UNITS_NS["m"] + int(seconds or 0) * UNITS_NS["s"]
    return total + int((fraction or "").ljust(9, "0"))


def string(text: str) -> str:
    """The characters of a quoted string with its $ escapes resolved: of a WSTRING as UTF-16 code units when the quotes
    are
    double."""
    wide = text.startswith('"')

    def replace(match: re.Match[str]) -> str:
        code = match.group(1)
        if len(code) in (2, 4):
            return chr(int(code, 16))
        if code.upper() in _ESCAPES:
            return _ESCAPES[code.upper()]
        raise LiteralError(f"${code} is not an escape; write $$ for a dollar sign")

    escape = _WIDE_ESCAPE if wide else _ESCAPE
    value = escape.sub(replace, text[1:-1]) if "$" in text else text[1:-1]
    if wide:
        units = value.encode("utf-16-le", "surrogatepass")
        return "".join(chr(units[i] | units[i + 1] << 8) for i in range(0, len(units), 2))
    return "".join(map(_one_byte, value))


def _one_byte(character: str) -> str:
    """The character of a STRING: what Windows-1252 has beyond Latin-1 (the euro sign, a dash) has its number there."""
    if ord(character) <= 255:
        return character
    try:
        return character.encode("cp1252").decode("latin-1")
    except UnicodeEncodeError:
        message = f"{character} is not a character of Windows-1252, so it does not fit a STRING"
        raise LiteralError(f'{message}; write a WSTRING: "..."') from None


def is_elementary(text: str) -> bool:
    """Whether `text` is a value with the name of an elementary type before it."""
    return text.partition("#")[0].upper() in _NOT_ENUMS


def is_enum_value(prefix: str, rest: str) -> bool:
    """Whether `prefix#rest` names a value of an enumeration."""
    name = prefix.upper()
    return name not in _NOT_ENUMS and _NAME.fullmatch(rest) is not None
