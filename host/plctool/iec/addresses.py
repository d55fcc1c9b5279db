"""Addresses such as %IX0.3. Words, double words ... are numbered, as CODESYS does it: %IW1 is bytes 2 and 3.

One such as %IX4.0.1 or %IW0.1 counts modules, their channels and so on: where that is only a description can say.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from plctool.iec.areas import Area
from plctool.iec.types import BOOL, ELEMENTARY, Elementary

AREAS = {"I": Area.INPUT, "Q": Area.OUTPUT, "M": Area.MEMORY}
_ADDRESS = re.compile(r"%([IQM])([XBWDL]?)(\d{1,6})(?:\.(\d{1,3}))?")
_IN_MODULE = re.compile(r"%([IQM])([XBWDL]?)\d{1,6}(?:\.\d{1,6})+")
_WIDTHS = {"X": 0, "": 0, "B": 8, "W": 16, "D": 32, "L": 64}
_TYPES: dict[int, Elementary] = {
    0: BOOL, 8: ELEMENTARY["BYTE"], 16: ELEMENTARY["WORD"], 32: ELEMENTARY["DWORD"], 64: ELEMENTARY["LWORD"],
}  # fmt: skip


@dataclass(frozen=True)
class Address:
    """`width` in bits, 0 for a single one; `offset` in bytes."""

    area: Area
    width: int
    offset: int
    bit: int

    @property
    def type(self) -> Elementary:
        """Of what is there when no declaration says otherwise."""
        return _TYPES[self.width]


@dataclass(frozen=True)
class ModuleAddress:
    """`text` in capitals; `width` in bits, 0 for a single one."""

    text: str
    area: Area
    width: int

    @property
    def type(self) -> Elementary:
        """Of what is there when no declaration says otherwise."""
        return _TYPES[self.width]

    @property
    def numbered(self) -> str:
        """An address that counts bytes or words and looks alike."""
        return self.text.partition(".")[0] + (".0" if self.width == 0 else "")


def parse_module_address(text: str) -> ModuleAddress | None:
    """What `%IX4.0.1` or `%IW0.1` means; None when the text is no such address. `%IX0.9` is none: it lacks a bit."""
    match = _IN_MODULE.fullmatch(text.upper())
    if match is None:
        return None
    width = _WIDTHS[match[2]]
    return ModuleAddress(match[0], AREAS[match[1]], width) if width or match[0].count(".") > 1 else None


def parse_address(text: str) -> Address | None:
    """What `%IW2` means; None when the text is no address."""
    match = _ADDRESS.fullmatch(text.upper())
    if match is None:
        return None
    letter, size, first, second = match.groups()
    width, number = _WIDTHS[size], int(first)
    if second is not None and (width or int(second) > 7):
        return None
    if width:
        return Address(AREAS[letter], width, number * width // 8, 0)
    byte, bit = (number, int(second)) if second is not None else divmod(number, 8)
    return Address(AREAS[letter], 0, byte, bit)
