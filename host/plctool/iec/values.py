"""Values of variables: bytes in memory <-> Python values.

TIME and dates are strings such as 'T#1s500ms', those of TIME with a `timedelta` for Python; values of enumerations are
their names, a REAL is the number with the fewest digits that reads back as the same. How strings look is in
`value_texts`.
"""

from __future__ import annotations

import math
import struct
from datetime import date, time, timedelta
from typing import Any, SupportsFloat, SupportsIndex

from plctool.errors import UsageError
from plctool.iec.types import (
    ArrayType,
    Elementary,
    EnumType,
    Field,
    Kind,
    PointerType,
    StringType,
    StructType,
    Type,
    base_of,
)
from plctool.iec.value_texts import bad_value, decoded, limits, limits_text, parse_value, units_of

# ---- bytes -> value ------------------------------------------------------------------------------------------------


def decode(t: Type, data: bytes) -> Any:
    """The value of `t` in memory as bool, int, float, str, list or dict."""
    if isinstance(t, Elementary):
        return _decode_elementary(t, data)
    if isinstance(t, ArrayType):
        size = t.element.size
        items = [decode(t.element, data[i * size : (i + 1) * size]) for i in range(t.count)]
        return _nest(items, [high - low + 1 for low, high in t.bounds])
    if isinstance(t, StructType):
        return {f.name: _decode_member(f, data) for f in t.fields if not f.hidden}
    if isinstance(t, StringType):
        return _decode_text(t, data)
    if isinstance(t, PointerType):
        return int.from_bytes(data[: t.size], "little") or None
    base = base_of(t)
    assert isinstance(base, Elementary)
    number = _decode_elementary(base, data)
    if isinstance(t, EnumType):
        return next((name for name, value in t.values.items() if value == number), number)
    return number


def _decode_elementary(t: Elementary, data: bytes) -> Any:
    kind = t.kind
    if kind is Kind.REAL:
        return _decode_real(t, data)
    number = int.from_bytes(data[: t.size], "little", signed=t.signed)
    if kind is Kind.INT or kind is Kind.BIT:
        return number
    if kind is Kind.BOOL:
        return number != 0
    if kind is Kind.CHAR:
        return chr(number) if number else ""
    return decoded(t, number)


def _decode_member(f: Field, data: bytes) -> Any:
    if f.bit is not None:
        return bool(data[f.offset] >> f.bit & 1)
    return decode(f.type, data[f.offset : f.offset + f.type.size])


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


def _decode_real(base: Elementary, data: bytes) -> float:
    value: float = struct.unpack("<f" if base.bits == 32 else "<d", data[: base.size])[0]
    if base.bits == 32 and math.isfinite(value):
        for digits in range(6, 10):
            short = float(f"{value:.{digits}g}")
            if struct.pack("<f", short) == data[:4]:
                return short
    return value


# ---- value -> bytes ------------------------------------------------------------------------------------------------


def encode(t: Type, value: Any) -> bytes:
    """The bytes of a Python value; for all but STRINGs also of 'T#80ms' or '16#FF' (see `parse_value`), for durations
    also of a timedelta, for DATE, TOD and DT of a date, time and datetime. Raises UsageError when it does not fit the
    type."""
    if isinstance(t, ArrayType):
        return b"".join(encode(t.element, item) for item in _flat(t, value))
    if isinstance(t, StructType):
        return _encode_struct(t, value)
    if isinstance(t, StringType):
        return _encode_string(t, value)
    if isinstance(value, str):
        value = parse_value(t, value)
    if isinstance(t, PointerType):
        if value is not None:
            raise bad_value(
                value, t, "only the program can take an address; write NULL, or write the variable it leads to"
            )
        return bytes(t.size)
    base = base_of(t)
    assert isinstance(base, Elementary)
    if (base.kind is Kind.TIME and isinstance(value, timedelta)) or (
        base.kind is Kind.DATE and isinstance(value, date | time)
    ):
        value = units_of(t, value)
    if not _is_number(value):
        raise bad_value(value, t, "give True or False" if base.kind is Kind.BOOL else "give a number")
    if base.kind is Kind.REAL:
        return _encode_real(base, value)
    if isinstance(value, float) and not value.is_integer():
        raise bad_value(value, t, "write a whole number")
    return _encode_integer(t, base, int(value))


def _is_number(value: Any) -> bool:
    """Also those of other packages; complex numbers are none."""
    return isinstance(value, SupportsFloat | SupportsIndex)


def _flat(t: ArrayType, value: Any) -> list[Any]:
    items = [value]
    for low, high in t.bounds:
        if any(not isinstance(item, list | tuple) or len(item) != high - low + 1 for item in items):
            raise bad_value(value, t, f"give a list with {high - low + 1} elements")
        items = [element for item in items for element in item]
    return items


def _encode_struct(t: StructType, value: Any) -> bytes:
    if not isinstance(value, dict):
        raise UsageError(f"A value of {t} cannot be written as a whole; write its members.", "bad-value")
    if t.union or any(f.hidden for f in t.fields):
        raise UsageError(f"A value of {t} cannot be written as a whole; write its members one by one.", "bad-value")
    data = bytearray(t.size)
    for f in t.fields:
        if f.name not in value:
            hint = "supply every member, or write members individually"
            raise UsageError(f"The member {f.name} of {t} has no value; {hint}.", "bad-value")
        encoded = encode(f.type, value[f.name])
        if f.bit is None:
            data[f.offset : f.offset + f.type.size] = encoded
        else:
            data[f.offset] |= encoded[0] << f.bit
    return bytes(data)


def _encode_string(t: StringType, value: Any) -> bytes:
    try:
        data = str(value).encode(*(("utf-16-le", "surrogatepass") if t.wide else ("latin-1",)))
    except UnicodeEncodeError:
        raise bad_value(value, t, "use only characters of Latin-1") from None
    if len(data) > t.length * t.unit or "\0" in str(value):
        raise bad_value(value, t, f"it holds at most {t.length} characters, none of them NUL")
    return data + bytes(t.size - len(data))


def _encode_real(base: Elementary, value: Any) -> bytes:
    try:
        return struct.pack("<f" if base.bits == 32 else "<d", float(value))
    except OverflowError:
        raise bad_value(value, base, "it is too large") from None


def _encode_integer(t: Type, base: Elementary, value: int) -> bytes:
    low, high = limits(t)
    if isinstance(t, EnumType) and value not in t.values.values():
        raise bad_value(value, t, f"choose one of {t.choices}")
    if not low <= value <= high:
        raise bad_value(value, t, limits_text(t))
    return value.to_bytes(base.size, "little", signed=base.signed)
