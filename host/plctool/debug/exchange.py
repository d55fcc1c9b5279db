"""An online change as the tool sees it: what the new program lacks, and why a controller refuses it."""

from __future__ import annotations

import re
from contextlib import suppress

from plctool.core import lib
from plctool.debug.forced import name_at
from plctool.debug.symbols import SymbolTable
from plctool.debug.variables import Symbol
from plctool.errors import DeviceError, UsageError
from plctool.iec.areas import Area
from plctool.image.file import image_crc, parse_image

_DANGLES = re.compile(r"pointer \(area (\d+), (\d+)\) leads to what is removed \(area (\d+), (\d+)\)")


def is_at(table: SymbolTable, name: str, place: object) -> bool:
    """True if a program has a variable of that name at that place."""
    with suppress(UsageError):
        return table.resolve(name).place == place
    return False


def other_tasks(had: SymbolTable, has: SymbolTable) -> set[int]:
    """The numbers of tasks that the new program does not have, or by which it has another one."""
    return {number for number, name in enumerate(had.tasks) if has.tasks[number : number + 1] != [name]}


def removed_variables(had: SymbolTable, has: SymbolTable) -> list[Symbol]:
    """The variables that the new program does not have, or has at another place."""
    places = {name.casefold(): symbol.place for name, symbol in has.variables.items()}
    return [s for name, s in had.variables.items() if places.get(name.casefold()) != s.place]


def check_base(data: bytes, running: int) -> None:
    """Raises UsageError for an image that cannot replace the program with the CRC `running`."""
    change = parse_image(data).change
    if change is None:
        raise UsageError("This image replaces no program that runs; build it with --base OLD.cdl.", "no-base")
    if running not in (change.base, image_crc(data)):
        raise UsageError(
            f"This image replaces the program with CRC {change.base:08X}, and {running:08X} runs; "
            "build it again with that as --base.",
            "other-base",
        )


def with_names(error: DeviceError, table: SymbolTable | None) -> DeviceError:
    """Returns the refusal of an online change with the names of the variables that it is about, if the symbols of the
    running program are known."""
    found = _DANGLES.search(error.message)
    if found is None or table is None:
        return error
    numbers = [int(number) for number in found.groups()]
    variables = list(table.variables.values())
    pointer = name_at(numbers[0], numbers[1], int(lib.APP_POINTER_SIZE), variables)
    gone = "the old code" if numbers[2] == Area.CODE.value else name_at(numbers[2], numbers[3], 1, variables)
    return DeviceError(
        f"No online change: {pointer} leads to {gone}, which is removed. Set {pointer} to another variable or to 0 "
        "first, or download the program with 'plctool flash'.",
        error.code,
    )
