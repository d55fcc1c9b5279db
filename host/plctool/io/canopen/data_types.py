"""The data types of CiA 301: names, sizes, and their values as bytes and as text."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from typing import Literal

from plctool.errors import did_you_mean

Kind = Literal["bool", "signed", "unsigned", "real", "string", "unicode", "bytes"]
Value = bool | int | float | str | bytes

_MAX_DIGITS = 80  # of a number that a user or a file gives


@dataclass(frozen=True)
class DataType:
    """A type by its index in the dictionary; `bits` is 0 if values have any length."""

    code: int
    name: str
    kind: Kind
    bits: int = 0

    @property
    def size(self) -> int:
        """Bytes of a value, 0 for any number."""
        return (self.bits + 7) // 8

    @property
    def is_whole(self) -> bool:
        """True for whole numbers and BOOLEAN."""
        return self.kind in ("bool", "signed", "unsigned")

    @property
    def limits(self) -> tuple[int, int]:
        """The lowest and the highest whole number."""
        if self.kind == "signed":
            return -(1 << self.bits - 1), (1 << self.bits - 1) - 1
        return 0, (1 << self.bits) - 1

    def decode(self, data: bytes) -> Value:
        """The value that a device sent. Raises ValueError if the bytes have another length than the type."""
        if self.bits and len(data) != self.size:
            raise ValueError(f"{self.name} has {self.size} bytes, not {len(data)}")
        if self.kind == "real":
            return float(struct.unpack("<f" if self.bits == 32 else "<d", data)[0])
        if self.kind == "bool":
            return data != b"\0"
        if self.is_whole:
            return int.from_bytes(data, "little", signed=self.kind == "signed")
        if self.kind == "string":
            return data.rstrip(b"\0").decode("latin-1")
        return data.decode("utf-16-le", "replace").rstrip("\0") if self.kind == "unicode" else data

    def encode(self, value: Value) -> bytes:
        """The bytes of a value that `parse` returned."""
        if isinstance(value, bytes):
            return value
        if isinstance(value, str):
            return value.encode("utf-16-le" if self.kind == "unicode" else "latin-1")
        if self.kind == "real":
            return struct.pack("<f" if self.bits == 32 else "<d", value)
        return int(value).to_bytes(self.size, "little", signed=self.kind == "signed")

    def parse(self, text: str) -> Value:
        """The value that a text means. Raises ValueError with what is wrong."""
        if self.kind == "string":
            return _latin(text)
        if self.kind == "unicode":
            return text
        if self.kind == "bytes":
            return self._parse_bytes(text)
        if self.kind == "real":
            return self._parse_real(text)
        if self.kind == "bool" and text.strip().lower() in ("true", "false"):
            return text.strip().lower() == "true"
        return self._checked(parse_whole(text))

    def _parse_bytes(self, text: str) -> bytes:
        try:
            data = bytes.fromhex(text.strip().removeprefix("0x"))
        except ValueError:
            raise ValueError(f"'{text[:40]}' is not a value of {self.name}; write pairs of hex digits") from None
        if self.bits and len(data) != self.size:
            raise ValueError(f"{self.name} has {self.size} bytes, not {len(data)}")
        return data

    def _parse_real(self, text: str) -> float:
        words = text.strip()
        if words.lower().startswith("0x") and len(words) == 2 + self.bits // 4:  # as some files write it
            with_sign = bytes.fromhex(words[2:])[::-1] if _is_hex(words[2:]) else b""
            if with_sign:
                return float(struct.unpack("<f" if self.bits == 32 else "<d", with_sign)[0])
        try:
            value = float(words)
        except ValueError:
            raise ValueError(f"'{text[:40]}' is not a number") from None
        if self.bits == 32 and math.isfinite(value) and abs(value) > 3.4028235677973366e38:
            raise ValueError(f"{words[:40]} is too large for {self.name}")
        return value

    def _checked(self, value: int) -> Value:
        low, high = self.limits
        if not low <= value <= high:
            raise ValueError(f"{value} is outside {self.name}, {low} to {high}")
        return bool(value) if self.kind == "bool" else value

    def text(self, value: Value) -> str:
        """A value as users read it, and `parse` takes it."""
        if isinstance(value, bytes):
            return value.hex(" ")
        if isinstance(value, bool):
            return "TRUE" if value else "FALSE"
        return str(value)


def _latin(text: str) -> str:
    try:
        text.encode("latin-1")
    except UnicodeEncodeError:
        raise ValueError(f"'{text[:40]}' has characters that a VISIBLE_STRING cannot have") from None
    return text


def _is_hex(text: str) -> bool:
    return all(c in "0123456789abcdefABCDEF" for c in text)


def parse_whole(text: str) -> int:
    """A whole number as CiA 306 writes it: decimal, 0x.., or octal with a leading 0. Raises ValueError."""
    words = text.strip()
    digits = words.removeprefix("-").lower()
    base = 16 if digits.startswith("0x") else 8 if digits.startswith("0") else 10
    allowed = "0123456789abcdef"[:base]
    number = digits[2:] if base == 16 else digits
    if not number or len(number) > _MAX_DIGITS or any(c not in allowed for c in number):
        hint = " (a number with a leading 0 is octal)" if base == 8 and number.isdecimal() else ""
        raise ValueError(f"'{words[:40]}' is not a number{hint}")
    return -int(number, base) if words.startswith("-") else int(number, base)


def _whole(kind: Kind, name: str, codes: dict[int, int]) -> list[DataType]:
    return [DataType(code, f"{name}{bits}", kind, bits) for bits, code in codes.items()]


_SIGNED = {8: 0x2, 16: 0x3, 32: 0x4, 24: 0x10, 40: 0x12, 48: 0x13, 56: 0x14, 64: 0x15}
_UNSIGNED = {8: 0x5, 16: 0x6, 32: 0x7, 24: 0x16, 40: 0x18, 48: 0x19, 56: 0x1A, 64: 0x1B}
_ALL = [
    DataType(0x1, "BOOLEAN", "bool", 1),
    *_whole("signed", "INTEGER", _SIGNED),
    *_whole("unsigned", "UNSIGNED", _UNSIGNED),
    DataType(0x8, "REAL32", "real", 32),
    DataType(0x11, "REAL64", "real", 64),
    DataType(0x9, "VISIBLE_STRING", "string"),
    DataType(0xA, "OCTET_STRING", "bytes"),
    DataType(0xB, "UNICODE_STRING", "unicode"),
    DataType(0xC, "TIME_OF_DAY", "bytes", 48),
    DataType(0xD, "TIME_DIFFERENCE", "bytes", 48),
    DataType(0xF, "DOMAIN", "bytes"),
]
DATA_TYPES = {t.code: t for t in _ALL}
DOMAIN, VISIBLE_STRING, UNSIGNED32, UNSIGNED16, UNSIGNED8 = (DATA_TYPES[code] for code in (0xF, 9, 7, 6, 5))
FIRST_COMPLEX = 0x20  # indices of records and of types that a manufacturer defines begin here

_IEC = {
    "BOOL": 1, "SINT": 2, "INT": 3, "DINT": 4, "LINT": 0x15, "USINT": 5, "UINT": 6, "UDINT": 7, "ULINT": 0x1B,
    "BYTE": 5, "WORD": 6, "DWORD": 7, "LWORD": 0x1B, "REAL": 8, "LREAL": 0x11, "STRING": 9, "WSTRING": 0xB,
}  # fmt: skip
_SHORT = {
    f"{letter}{bits}": code for letter, codes in (("I", _SIGNED), ("U", _UNSIGNED)) for bits, code in codes.items()
}
_NAMES = {**{t.name: t for t in _ALL}, **{n: DATA_TYPES[c] for n, c in {**_IEC, **_SHORT}.items()}}


def type_named(name: str) -> DataType:
    """The type of a name of CiA 301 (UNSIGNED16), of IEC 61131-3 (UINT), or a short one (U16). Raises ValueError."""
    found = _NAMES.get(name.strip().upper())
    if found is None:
        hint = did_you_mean(name.upper(), _NAMES) or "; use for example UNSIGNED16, U16, UINT, REAL32 or VISIBLE_STRING"
        raise ValueError(f"'{name}' is not a data type{hint}")
    return found
