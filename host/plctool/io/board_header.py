"""The C header of a board, from its `device.toml`: the names of lines, channels and parameters have one definition."""

from __future__ import annotations

import re
from collections.abc import Iterator

from plctool.iec.types import StringType
from plctool.io.device_file import IO_LIMITS, DeviceFile, Module


def board_header(device: DeviceFile) -> tuple[str, str]:
    """Name and text of the header."""
    name = f"{_c_name(device.name) or 'Board'}Io.h"
    guard = _c_name(name).upper()
    lines = [
        "/*",
        f" * {name} - inputs and outputs of {_comment(device.title)}.",
        " *",
        " * Written by 'plctool export-itf --device': do not change it, export it again.",
        " */",
        f"#ifndef {guard}",
        f"#define {guard}",
        "",
    ]
    if device.lines:
        lines += ["/* Lines, by the names that SysGpio gets. */"]
        for line in device.lines.values():
            text = f" /* {'output' if line.output else 'input'}{_also(line.text)} */"
            lines.append(f'#define IO_LINE_{line.name} "{line.line}"{text}')
        lines.append("")
    for module in device.modules.values():
        lines += [*_module(module), ""]
    limits = {name: value for name, value in device.limits.items() if name in IO_LIMITS}
    for limit, value in limits.items():
        lines.append(f"#define IO_LIMIT_{limit.upper()} {value}")
    lines += [""] * bool(limits) + ["#endif", ""]
    return name, "\n".join(lines)


def _module(module: Module) -> Iterator[str]:
    prefix = _c_name(module.name).upper()
    yield f'#define {prefix}_DRIVER "{module.driver}"'
    if module.channels:
        yield "/* Channels: the parameter that has each, and its first bit there. */"
        yield "enum {"
        for c in module.channels.values():
            yield f"    {prefix}_{c.name} = {c.parameter}, /* {c.type}{_also(c.text)} */"
            yield f"    {prefix}_{c.name}_BIT = {c.bit},"
        yield "};"
    if module.parameters:
        yield "/* Parameters that an engineer may set. */"
        yield "enum {"
        for p in module.parameters.values():
            yield f"    {prefix}_{p.name} = {p.id}, /* {p.type}{_also(p.text)} */"
            for word, value in p.choices.items():
                if not isinstance(p.type, StringType) and type(value) is int:
                    yield f"    {prefix}_{p.name}_{_c_name(word)} = {value},"
        yield "};"


def _c_name(text: str) -> str:
    return re.sub(r"\W", "_", text, flags=re.ASCII)


def _also(text: str) -> str:
    return f", {_comment(text)}" if text else ""


def _comment(text: str) -> str:
    return text.replace("*/", "* /").replace("\n", " ")
