"""The C header of a board, from its `device.toml`: the names of lines, channels and parameters have one definition."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from plctool.files import Pos
from plctool.iec.types import StringType
from plctool.io.device_file import IO_LIMITS, DeviceFile, Module
from plctool.io.mistakes import Mistakes

_INT_MAX = 0x7FFF_FFFF


@dataclass(frozen=True)
class _Definition:
    """A name of the header: of a macro, or with `enum` of an enumerator. `pos`: of what it is made."""

    name: str
    value: str
    pos: Pos
    comment: str = ""
    enum: bool = False

    def __str__(self) -> str:
        comment = f" /* {self.comment} */" if self.comment else ""
        return (
            f"    {self.name} = {self.value},{comment}" if self.enum else f"#define {self.name} {self.value}{comment}"
        )


_Line = _Definition | str


def board_header(device: DeviceFile) -> tuple[str, str]:
    """Name and text of the header."""
    name, guard = _names(device)
    head = [
        "/*",
        f" * {name} - inputs and outputs of {_comment(device.title)}.",
        " *",
        " * Written by 'plctool export-itf --device': do not change it, export it again.",
        " */",
        f"#ifndef {guard}",
        f"#define {guard}",
        "",
    ]
    return name, "\n".join([*head, *map(str, _lines(device)), "#endif", ""])


def check_names(device: DeviceFile, mistakes: Mistakes) -> None:
    """Reports what would have a name in the header that something else has."""
    _, guard = _names(device)
    seen = {guard: Pos(device.path, 1, 1)}
    for line in _lines(device):
        if not isinstance(line, _Definition):
            continue
        if line.name in seen:
            where = f"in line {seen[line.name].line}"
            message = f"this is {line.name} in the C header, as what is {where}; choose another name"
            mistakes.error(line.pos, message)
        seen[line.name] = line.pos


def _names(device: DeviceFile) -> tuple[str, str]:
    """That of the file, and of its include guard."""
    name = f"{_c_name(device.name) or 'Board'}Io.h"
    guard = _c_name(name).upper()
    return name, guard if not guard[0].isdigit() else f"BOARD_{guard}"


def _lines(device: DeviceFile) -> Iterator[_Line]:
    if device.name:
        comment = "images with inputs and outputs of another board are refused"
        yield _Definition("BOARD_DEVICE_NAME", _string(device.name), Pos(device.path, 1, 1), comment)
        yield ""
    if device.id:
        comment = "images for another device are refused"
        yield _Definition("BOARD_DEVICE_ID", f"0x{device.id:08X}", Pos(device.path, 1, 1), comment)
        if device.vendor:
            yield _Definition("BOARD_VENDOR_NAME", _string(device.vendor), Pos(device.path, 1, 1), "as scan shows it")
        yield ""
    if device.lines:
        yield "/* Lines, by the names that SysGpio gets. */"
        for line in device.lines.values():
            comment = f"{'output' if line.output else 'input'}{_also(line.text)}"
            yield _Definition(f"IO_LINE_{line.name}", _string(line.line), line.pos, comment)
        yield ""
    for module in device.modules.values():
        yield from _module(module)
        yield ""
    limits = {name: value for name, value in device.limits.items() if name in IO_LIMITS}
    for limit, value in limits.items():
        yield _Definition(f"IO_LIMIT_{limit.upper()}", str(value), Pos(device.path, 1, 1))
    if limits:
        yield ""


def _module(module: Module) -> Iterator[_Line]:
    prefix = module.name.upper()
    yield _Definition(f"{prefix}_DRIVER", _string(module.driver), module.pos)
    if module.channels:
        yield "/* Channels: the parameter that has each, and its first bit there. */"
        yield "enum {"
        for c in module.channels.values():
            yield _Definition(f"{prefix}_{c.name}", str(c.parameter), c.pos, f"{c.type}{_also(c.text)}", True)
            yield _Definition(f"{prefix}_{c.name}_BIT", str(c.bit), c.pos, enum=True)
        yield "};"
    if module.parameters:
        yield "/* Parameters that an engineer may set. */"
        yield "enum {"
        for p in module.parameters.values():
            yield _Definition(f"{prefix}_{p.name}", str(p.id), p.pos, f"{p.type}{_also(p.text)}", True)
        choices = list(_choices(module))
        yield from (d for d in choices if d.enum)
        yield "};"
        yield from (d for d in choices if not d.enum)


def _choices(module: Module) -> Iterator[_Definition]:
    """What the words of numbers stand for; an enumerator is an int."""
    for p in module.parameters.values():
        for word, value in p.choices.items():
            if isinstance(p.type, StringType) or type(value) is not int:
                continue
            name = f"{module.name.upper()}_{p.name}_{_c_name(word)}"
            is_int = -_INT_MAX <= value <= _INT_MAX
            yield _Definition(name, str(value) if is_int else _long(value), p.pos, enum=is_int)


def _long(value: int) -> str:
    """A constant that no int may have."""
    if value < 0:
        return f"({value + 1}ll - 1)"
    return f"{value}ull"


def _c_name(text: str) -> str:
    return re.sub(r"\W", "_", text, flags=re.ASCII)


def _string(text: str) -> str:
    """A string of C; two ? could be a trigraph."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"').replace("?", "\\?") + '"'


def _also(text: str) -> str:
    return f", {_comment(text)}" if text else ""


def _comment(text: str) -> str:
    """What a comment may have: ASCII, not the signs of another one, and no trigraph."""
    plain = text.encode("ascii", "replace").decode()
    return re.sub(r"(?<=\?)\?|(?<=\*)/|(?<=/)\*", r" \g<0>", plain)
