"""The settings of a device: their list and the check of a text, both those of the firmware (CmpSettingNames.h)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from plctool.core import ffi, lib

FILE_NAME = "Settings.cfg"


@dataclass(frozen=True)
class Setting:
    """`option`: that of plcrt, which has it from `--config` only; "" for what all devices have. `standard`: what counts
    if nothing is written; "" for an option."""

    component: str
    key: str
    option: str
    standard: str
    sentence: str

    @property
    def name(self) -> str:
        return f"[{self.component}] {self.key}"


@dataclass(frozen=True)
class Fault:
    """A line that is not valid, and what to do about it."""

    line: int
    words: str


def _text(words: object) -> str:
    text: bytes = ffi.string(words)
    return text.decode("ascii")


def _standard(info: object) -> str:
    words = _text(info.words)  # type: ignore[attr-defined]
    number = info.type == lib.SETTING_IS_NUMBER  # type: ignore[attr-defined]
    return str(info.standard) if number else words.partition("|")[0]  # type: ignore[attr-defined]


def all_settings() -> Iterator[Setting]:
    """In the order of the list."""
    index = 0
    while (info := lib.SettingsInfo(index)) != ffi.NULL:
        yield Setting(_text(info.component), _text(info.key), _text(info.option), _standard(info), _text(info.sentence))
        index += 1


def faults(text: bytes) -> list[Fault]:
    """What plcrt would refuse to start with."""
    words = ffi.new("char[]", int(lib.SETTINGS_WORDS_SIZE))
    found: list[Fault] = []
    while line := lib.SettingsCheck(text, len(text), found[-1].line + 1 if found else 0, words):
        found.append(Fault(line, ffi.string(words).decode("latin-1")))
    return found


def values(text: bytes) -> dict[Setting, str]:
    """What a text has of valid settings, in the order of the list."""
    start, length = ffi.new("RTS_UI32 *"), ffi.new("RTS_UI32 *")
    return {
        setting: text[start[0] : start[0] + length[0]].decode("latin-1")
        for index, setting in enumerate(all_settings())
        if lib.SettingsValue(text, len(text), index, start, length)
    }
