"""Formats of messages use the conversions that CMUtils.h has; others end a message where they stand."""

from __future__ import annotations

import re
from pathlib import Path

FIRMWARE = Path(__file__).resolve().parents[2] / "firmware"
# Who formats by CMUtlvsnprintf: functions with RTS_FORMAT, and macros that call them.
FORMATTERS = (
    "LogAdd", "LogAddEntry", "CMUtlsnprintf", "APP_REFUSE", "AppRefuse", "refuse", "IoMgrConfigRefuse", "MODBUS_REFUSE",
    "print", "print_part",
)  # fmt: skip
CALL = re.compile(rf"\b(?:{'|'.join(FORMATTERS)})\(((?:[^;\"]|\"(?:\\.|[^\"\\])*\")*)\);")
LITERAL = re.compile(r'"((?:\\.|[^"\\])*)"')
CONVERSION = re.compile(r"%(?![sduXx%])(?<!%%)[^%]?")
BY_THE_LIBRARY = {"PortReason", "PortPrint", "put"}  # of the Linux port, format by vsnprintf
WITHOUT = ("port/linux", "port/sim")  # parts that have the C library's formats: only calls of LogAdd count there


def conversions(text: str) -> set[str]:
    """Conversions in a format that CMUtils.h does not have."""
    return set(CONVERSION.findall(text.replace("%%", "")))


def calls(path: Path) -> list[str]:
    text = re.sub(r"/\*.*?\*/", "", path.read_text(), flags=re.DOTALL)
    found = CALL.finditer(text)
    if any(part in str(path) for part in WITHOUT):
        found = (
            call for call in found if call[0].startswith(("LogAdd", "IoMgrConfigRefuse", "APP_REFUSE", "AppRefuse"))
        )
    return [call[1] for call in found]


def test_every_format_has_the_conversions_of_the_runtime() -> None:
    seen = 0
    for path in sorted(FIRMWARE.rglob("*.c")):
        for arguments in calls(path):
            for literal in LITERAL.findall(arguments):
                seen += "%" in literal
                assert not conversions(literal), f"{path.relative_to(FIRMWARE)}: {literal}"
    assert seen > 100


def test_all_functions_with_a_format_are_looked_at() -> None:
    declared = re.compile(r"(\w+)\([^()]*const char \*format, \.\.\.\)")
    found = {name for path in FIRMWARE.rglob("*.[ch]") for name in declared.findall(path.read_text())}
    assert found - BY_THE_LIBRARY <= set(FORMATTERS), found


def test_conversions_of_the_c_library_are_noticed() -> None:
    assert conversions("%s %d %u %X %x 100%%") == set()
    assert all(conversions(text) for text in ("%ld", "%5d", "%llu", "%c", "%02X", "%p", "%"))
