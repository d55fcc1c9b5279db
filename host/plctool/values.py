"""Values of variables: bytes in memory <-> Python values <-> texts a person types.

TIME is shown as 'T#1s500ms', enums by name, REAL with the fewest digits that read back as the same number.
"""

from __future__ import annotations

import datetime
import math
import re
import struct
from typing import Any

from plctool.compiler.types import (
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
from plctool.errors import UsageError

_UNITS_NS = {"d": 86_400_000_000_000, "h": 3_600_000_000_000, "m": 60_000_000_000, "s": 1_000_000_000, "ms": 1_000_000,
             "us": 1_000, "ns": 1}  # fmt: skip
_DATE_UNITS_NS = {"DATE": 1_000_000_000, "DT": 1_000_000_000, "TOD": 1_000_000}
_EPOCH = datetime.date(1970, 1, 1)
_DAY = r"(?P<y>\d{4})-(?P<mo>\d{1,2})-(?P<d>\d{1,2})"
_CLOCK = r"(?P<h>\d{1,2}):(?P<mi>\d{1,2})(?::(?P<s>\d{1,2})(?:\.(?P<f>\d{1,9}))?)?"
_DATE_FORMS = {"DATE": re.compile(_DAY), "TOD": re.compile(_CLOCK), "DT": re.compile(f"{_DAY}-{_CLOCK}")}
_PART = re.compile(r"(\d+(?:\.\d+)?)(ms|us|ns|d|h|m|s)")
_TYPED = re.compile(r"^(?P<type>[A-Za-z]\w*)#(?P<rest>.+)$")


def _bad(text: object, t: Type, hint: str) -> UsageError:
    return UsageError(f"'{text}' is not a value of {t}; {hint}.", "bad-value")


# ---- bytes -> value ------------------------------------------------------------------------------------------------


def decode(t: Type, data: bytes) -> Any:
    """The value of `t` in memory as bool, int, float, str, list or dict, ready for JSON."""
    if isinstance(t, ArrayType):
        size = t.element.size
        items = [decode(t.element, data[i * size : (i + 1) * size]) for i in range(t.count)]
        return _nest(items, [high - low + 1 for low, high in t.bounds])
    if isinstance(t, StructType):
        return {f.name: decode(f.type, data[f.offset : f.offset + f.type.size]) for f in t.fields}
    if isinstance(t, StringType):
        return _decode_text(t, data)
    if isinstance(t, PointerType):
        return int.from_bytes(data[:8], "little")
    base = base_of(t)
    assert isinstance(base, Elementary)
    if base.kind is Kind.REAL:
        return _decode_real(base, data)
    number = int.from_bytes(data[: base.size], "little", signed=base.signed)
    if isinstance(t, EnumType):
        return next((name for name, value in t.values.items() if value == number), number)
    if base.kind is Kind.BOOL:
        return bool(number & 1)
    if base.kind is Kind.DATE:
        return format_date(number, base)
    if base.kind is Kind.CHAR:
        return chr(number) if number else ""
    return format_time(number, base) if base.kind is Kind.TIME else number


def _decode_text(t: StringType, data: bytes) -> str:
    if not t.wide:
        return data[: t.length].split(b"\0")[0].decode("latin-1")
    end = next((i for i in range(0, 2 * t.length, 2) if data[i : i + 2] in (b"\0\0", b"")), 2 * t.length)
    return data[:end].decode("utf-16-le", "replace")


def _nest(items: list[Any], counts: list[int]) -> list[Any]:
    """A flat list of elements as lists of lists, the last index running fastest."""
    for count in reversed(counts[1:]):
        items = [items[i : i + count] for i in range(0, len(items), count)]
    return items


def _decode_real(base: Elementary, data: bytes) -> float | str:
    value: float = struct.unpack("<f" if base.bits == 32 else "<d", data[: base.size])[0]
    if not math.isfinite(value):
        return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"
    if base.bits == 32:
        for digits in range(6, 10):
            short = float(f"{value:.{digits}g}")
            if struct.pack("<f", short) == data[:4]:
                return short
    return value


def format_time(value: int, t: Type) -> str:
    """'T#1h2m3s4ms' for TIME [ms], 'LTIME#...' for LTIME [ns]."""
    wide = base_of(t).size == 8
    prefix, left = ("LTIME#", abs(value)) if wide else ("T#", abs(value) * 1_000_000)
    text = ""
    for unit, size in _UNITS_NS.items():
        if left >= size:
            text += f"{left // size}{unit}"
            left %= size
    sign = "-" if value < 0 else ""
    return prefix + sign + (text or ("0ns" if wide else "0ms"))


def format_date(value: int, t: Type) -> str:
    """'D#2024-02-29', 'TOD#12:30:15.500', 'DT#2024-02-29-12:30:15'; LDATE#, LTOD#, LDT# for the types that count ns."""
    name = base_of(t).name
    kind = name.removeprefix("L")
    nanoseconds = value * _DATE_UNITS_NS.get(name, 1)
    days, in_day = divmod(nanoseconds, _UNITS_NS["d"])
    seconds, fraction = divmod(in_day, _UNITS_NS["s"])
    clock = f"{seconds // 3600:02}:{seconds // 60 % 60:02}:{seconds % 60:02}"
    if fraction:
        digits = f"{fraction:09}"
        clock += "." + (digits[:3] if digits.endswith("000000") else digits[:6] if digits.endswith("000") else digits)
    if kind == "TOD":
        return f"{name}#{clock}"
    day = (_EPOCH + datetime.timedelta(days)).isoformat()
    return f"D#{day}" if name == "DATE" else f"{name}#{day}" + (f"-{clock}" if kind == "DT" else "")


# ---- text -> value -------------------------------------------------------------------------------------------------


def parse_time(text: str, t: Type = ELEMENTARY["TIME"]) -> int:
    """A duration such as 'T#1.5s', 'LTIME#20us' or '80ms', in the unit of `t`: ms for TIME, ns for LTIME. Raises
    UsageError."""
    body = re.sub(r"(?i)^l?t(ime)?#", "", text.strip()).replace("_", "").lower()
    sign = -1 if body.startswith("-") else 1
    parts = body.removeprefix("-")
    matches = list(_PART.finditer(parts))
    if not matches or "".join(m.group(0) for m in matches) != parts:
        raise _bad(text, t, "write a duration such as T#1s500ms")
    nanoseconds = sum(_scaled(m.group(1), _UNITS_NS[m.group(2)]) for m in matches)
    return sign * (nanoseconds if base_of(t).size == 8 else nanoseconds // 1_000_000)


def parse_date(text: str, t: Type) -> int:
    """A date or time of day such as 'D#2024-02-29', '12:30:15.5' or 'LDT#2024-02-29-12:30:15', in the unit of `t`.
    Raises UsageError."""
    name = base_of(t).name
    kind = name.removeprefix("L")
    body = text.strip().rpartition("#")[2].replace("_", "")
    match = _DATE_FORMS[kind].fullmatch(body)
    example = {"DATE": "D#2024-02-29", "TOD": "TOD#12:30:15", "DT": "DT#2024-02-29-12:30:15"}[kind]
    if match is None:
        raise _bad(text, t, f"write {example}")
    part = match.groupdict(default="0")
    try:
        day = datetime.date(int(part["y"]), int(part["mo"]), int(part["d"])) if kind != "TOD" else _EPOCH
        clock = datetime.time(int(part["h"]), int(part["mi"]), int(part["s"])) if kind != "DATE" else datetime.time()
    except ValueError:
        raise _bad(text, t, f"there is no such day or time; write {example}") from None
    seconds = (clock.hour * 60 + clock.minute) * 60 + clock.second
    total = (day - _EPOCH).days * _UNITS_NS["d"] + seconds * _UNITS_NS["s"]
    total += int(part["f"].ljust(9, "0")) if kind != "DATE" else 0
    return total // _DATE_UNITS_NS.get(name, 1)


def _scaled(number: str, unit: int) -> int:
    whole, _, fraction = number.partition(".")
    return int(whole) * unit + (int(fraction) * unit // 10 ** len(fraction) if fraction else 0)


def parse_value(t: Type, text: str) -> Any:
    """What a person typed for a variable of type `t`. Raises UsageError."""
    text = text.strip()
    if isinstance(t, StringType):
        quoted = len(text) >= 2 and text[0] == text[-1] and text[0] in "'\""
        return text[1:-1] if quoted else text
    base = base_of(t)
    if not isinstance(base, Elementary):
        raise UsageError(f"A value of {t} cannot be written as a whole; write its parts.", "bad-value")
    if isinstance(t, EnumType):
        return _parse_enum(t, text)
    if base.kind is Kind.TIME:
        return parse_time(text, base)
    if base.kind is Kind.DATE:
        return parse_date(text, base)
    if base.kind is Kind.CHAR:
        return _parse_character(base, text)
    typed = _TYPED.match(text)
    if typed and typed["type"].upper() in ELEMENTARY:
        text = typed["rest"]
    if base.kind is Kind.BOOL:
        return _parse_bool(t, text)
    if base.kind is Kind.REAL:
        try:
            return float(text.replace("_", ""))
        except ValueError:
            raise _bad(text, t, "write a number such as 1.5 or -2e3") from None
    return _parse_integer(t, text)


def _parse_character(t: Type, text: str) -> int:
    text = text.rpartition("#")[2] if len(text) > 2 else text
    if len(text) == 3 and text[0] == text[-1] and text[0] in "'\"":
        text = text[1]
    if len(text) != 1:
        raise _bad(text, t, "write one character")
    return ord(text)


def _parse_bool(t: Type, text: str) -> bool:
    known = {"true": True, "1": True, "on": True, "false": False, "0": False, "off": False}
    if text.lower() not in known:
        raise _bad(text, t, "write TRUE or FALSE")
    return known[text.lower()]


def _parse_integer(t: Type, text: str) -> int:
    match = re.fullmatch(r"(-?)(?:(2|8|10|16)#)?([0-9A-Fa-f_]+)", text)
    try:
        if match is None:
            raise ValueError
        value = int(match[3].replace("_", ""), int(match[2] or 10))
    except ValueError:
        raise _bad(text, t, "write a whole number such as 42 or 16#2A") from None
    return -value if match[1] else value


def _parse_enum(t: EnumType, text: str) -> int:
    key = text.rpartition("#")[2].rpartition(".")[2].casefold()
    for name, value in t.values.items():
        if name.casefold() == key:
            return value
    if re.fullmatch(r"-?\d+", text):
        return int(text)
    raise _bad(text, t, f"choose one of {', '.join(t.values)}")


# ---- value -> bytes ------------------------------------------------------------------------------------------------


def encode(t: Type, value: Any) -> bytes:
    """The bytes of a Python value; for all but strings also of a text such as 'T#80ms' or '16#FF' (see `parse_value`).
    Raises UsageError when it does not fit the type."""
    if isinstance(t, ArrayType):
        return b"".join(encode(t.element, item) for item in _flat(t, value))
    if isinstance(t, StructType):
        return _encode_struct(t, value)
    if isinstance(t, StringType):
        return _encode_string(t, value)
    if isinstance(value, str):
        value = parse_value(t, value)
    base = base_of(t)
    if not isinstance(base, Elementary):
        raise UsageError(f"A value of {t} cannot be written.", "bad-value")
    if base.kind is Kind.REAL:
        return _encode_real(base, value)
    if isinstance(value, float) and not value.is_integer():
        raise _bad(value, t, "write a whole number")
    return _encode_integer(t, base, int(value))


def _flat(t: ArrayType, value: Any) -> list[Any]:
    items = [value]
    for low, high in t.bounds:
        if any(not isinstance(item, list | tuple) or len(item) != high - low + 1 for item in items):
            raise _bad(value, t, f"give a list with {high - low + 1} elements")
        items = [element for item in items for element in item]
    return items


def _encode_struct(t: StructType, value: Any) -> bytes:
    if not isinstance(value, dict):
        raise UsageError(f"A value of {t} cannot be written as a whole; write its members.", "bad-value")
    data = bytearray(t.size)
    for f in t.fields:
        if f.name not in value:
            raise _bad(value, t, f"the member {f.name} is missing")
        data[f.offset : f.offset + f.type.size] = encode(f.type, value[f.name])
    return bytes(data)


def _encode_string(t: StringType, value: Any) -> bytes:
    try:
        data = str(value).encode("utf-16-le" if t.wide else "latin-1")
    except UnicodeEncodeError:
        raise _bad(value, t, "use only characters of Latin-1") from None
    if len(data) > t.length * t.unit or "\0" in str(value):
        raise _bad(value, t, f"it holds at most {t.length} characters, none of them NUL")
    return data + bytes(t.size - len(data))


def _encode_real(base: Elementary, value: Any) -> bytes:
    try:
        return struct.pack("<f" if base.bits == 32 else "<d", float(value))
    except OverflowError:
        raise _bad(value, base, "it is too large") from None


def _encode_integer(t: Type, base: Elementary, value: int) -> bytes:
    low = -(1 << (base.bits - 1)) if base.signed else 0
    high = 1 if base.kind is Kind.BOOL else (1 << (base.bits - base.signed)) - 1
    if isinstance(t, SubrangeType):
        low, high = t.low, t.high
    if not low <= value <= high:
        raise _bad(value, t, f"it takes {low} to {high}")
    return value.to_bytes(base.size, "little", signed=base.signed)
