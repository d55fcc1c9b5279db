"""Writes the C side of a library: a header for its functions that are implemented in C, and a C file to fill in.

The header holds the types, the prototypes and the entries of the function table; it is written again whenever the
library changes. The C file is a component for the runtime's list (docs/porting.md); once written, it is the user's.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from plctool.compiler.semantics.declarations.functions import interface_text
from plctool.compiler.typed.nodes import Direction, Parameter, Pou
from plctool.errors import UsageError
from plctool.iec.types import (
    MAX_ALIGN,
    ArrayType,
    Elementary,
    EnumType,
    Field,
    Kind,
    PointerType,
    StringType,
    StructType,
    SubrangeType,
    Type,
    base_of,
    is_scalar,
)

_C_WORDS = frozenset((
    "auto", "break", "case", "char", "const", "continue", "default", "do", "double", "else", "enum", "extern", "float",
    "for", "goto", "if", "inline", "int", "long", "main", "register", "restrict", "return", "short", "signed", "sizeof",
    "static", "struct", "switch", "typedef", "union", "unsigned", "void", "volatile", "while",
))  # fmt: skip
_NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)
_WIDTH = 100  # columns of a prototype


@dataclass(frozen=True)
class Interface:
    """What is written. `header_name`, `source_name`: file names; `functions`: text, signature and version of each."""

    header_name: str
    header: str
    source_name: str
    source: str
    functions: list[tuple[str, int, int]]


def export_interface(library: str, functions: list[Pou]) -> Interface:
    """The C side of a library. `library`: its name; `functions`: those with an `external` part.

    Raises UsageError when something has no name in C.
    """
    name = re.sub(r"\W", "_", library, flags=re.ASCII)
    if not _NAME.fullmatch(name):
        name = f"_{name}"
    for pou in functions:
        if _external(pou) in _C_WORDS or not _NAME.fullmatch(_external(pou)):
            raise UsageError(f"'{_external(pou)}' cannot be the name of a function in C; choose another one.", "c-name")
    details = []
    for pou in functions:
        assert pou.external is not None
        details.append((interface_text(pou.external.name, pou), pou.external.signature, pou.external.version))
    header_name, source_name = f"{name}Itf.h", f"{name}.c"
    source = _source(name, header_name, functions)
    return Interface(header_name, _header(name, functions), source_name, source, details)


def _external(pou: Pou) -> str:
    assert pou.external is not None
    return pou.external.name


# ---- the header ------------------------------------------------------------------------------------------------------


def _header(name: str, functions: list[Pou]) -> str:
    guard = f"{name.upper()}ITF_H"
    lines = [
        "/*",
        f" * {name}Itf.h - the functions of the library {name} that are implemented in C.",
        " *",
        " * Written by 'plctool export-itf': do not change it, export it again.",
        " */",
        f"#ifndef {guard}",
        f"#define {guard}",
        "",
        '#include "CmpItf.h"',
        '#include "rts_config.h"',
        "",
        "/* The number of the component in log entries; any that no other component has. */",
        f"enum {{ CMPID_{name} = 0x{0x8000 | zlib.crc32(name.encode()) & 0x7FFF:04X} }};",
    ]
    for t in _named_types(functions):
        lines += ["", *_type_lines(t)]
    for pou in functions:
        assert pou.external is not None
        version = pou.external.version
        text = interface_text(pou.external.name, pou)
        place = f"{text}, version {version >> 16}.{version & 0xFFFF}"
        lines += ["", f"/* {place} */", f"{_prototype(pou)};"]
    lines += ["", "/* They have all rights of the runtime, also where the program that calls them has not. */"]
    lines += [f"APP_GATE({pou.external.name});" for pou in functions if pou.external is not None]
    lines += ["", "/* The entries of the table for CMRegisterExternal: name, signature, version, function. */"]
    entries = [_entry(pou) for pou in functions]
    lines.append(f"#define {name.upper()}_EXT_FUNCTIONS \\")
    lines += [f"    {entry}, \\" for entry in entries[:-1]] + [f"    {entry}" for entry in entries[-1:]]
    lines += ["", "#endif", ""]
    return "\n".join(lines)


def _entry(pou: Pou) -> str:
    external = pou.external
    assert external is not None
    function = f"(RTS_PFN)APP_GATED({external.name})"
    return f'{{"{external.name}", 0x{external.signature:08X}, 0x{external.version:08X}, {function}}}'


def _prototype(pou: Pou) -> str:
    """`RTS_I16 name(RTS_I16 a, const char *s, RTS_UI32 s_capacity)`"""
    words = list(_parameters(pou))
    result = "void"
    if pou.result is not None and is_scalar(pou.result.type):
        result = _value(pou.result.type)
    space = "" if result.endswith("*") else " "
    start = f"{result}{space}{_external(pou)}("
    line = f"{start}{', '.join(words) or 'void'})"
    if len(line) <= _WIDTH:
        return line
    return start + (",\n" + " " * len(start)).join(words) + ")"


def _parameters(pou: Pou) -> Iterator[str]:
    """The parameters in C. A result that is no scalar comes first, as an address."""
    if pou.result is not None and not is_scalar(pou.result.type):
        yield f"{_target(pou.result.type)}*result"
    names = {c_name(parameter.variable.name) for parameter in pou.parameters}
    for parameter in pou.parameters:
        yield from _parameter(parameter, names)


def _parameter(parameter: Parameter, names: set[str]) -> Iterator[str]:
    """`names`: of all parameters, among which the result has to find one of its own."""
    t, name = parameter.variable.type, c_name(parameter.variable.name)
    if name == "result":
        while name in names:
            name += "_"
    if is_scalar(t) and not parameter.by_reference:
        value = _value(t)
        yield f"{value}{name}" if value.endswith("*") else f"{value} {name}"
        return
    const = "const " if parameter.direction is Direction.INPUT else ""
    yield f"{const}{_target(t)}*{name}"
    if isinstance(t, StringType):
        yield f"RTS_UI32 {name}_capacity"


def c_name(name: str) -> str:
    """The name of a variable in C."""
    lower = "_".join(_NAME.findall(name.lower()))  # the bounds of an ARRAY[*] called a are %a.lower1, %a.upper1 ...
    return f"{lower}_" if lower in _C_WORDS else lower


# ---- types -----------------------------------------------------------------------------------------------------------


def _value(t: Type) -> str:
    """The C type of a scalar."""
    if isinstance(t, PointerType):
        return f"{_target(t.target)}*"
    if isinstance(t, EnumType) and _is_named(t):
        return _type_name(t)
    base = base_of(t)
    assert isinstance(base, Elementary), t
    if base.kind is Kind.REAL:
        return f"RTS_REAL{base.bits}"
    return f"RTS_{'I' if base.signed else 'UI'}{base.bits}"


def _target(t: Type) -> str:
    """What an address of a value points to, with a space after it."""
    while isinstance(t, ArrayType):
        t = t.element
    if isinstance(t, StringType):
        return f"{_character(t)} "
    if isinstance(t, StructType):
        return f"{_type_name(t)} "
    text = _value(t)
    return text if text.endswith("*") else f"{text} "


def _character(t: StringType) -> str:
    return "RTS_UI16" if t.wide else "char"


def _type_name(t: EnumType | StructType) -> str:
    """The name of a declared type in C: with its namespace, which keeps it apart from others."""
    return t.name.replace(".", "_")


def _is_named(t: EnumType | StructType) -> bool:
    return _NAME.fullmatch(_type_name(t)) is not None


def _named_types(functions: list[Pou]) -> list[EnumType | StructType]:
    """The enums and structs the functions need, each after what it consists of."""
    found: dict[EnumType | StructType, None] = {}

    def add(t: Type) -> None:
        if isinstance(t, ArrayType):
            add(t.element)
        elif isinstance(t, PointerType):
            add(t.target)
        elif isinstance(t, EnumType) and _is_named(t):
            found[t] = None
        elif isinstance(t, StructType) and t not in found:
            for f in t.fields:
                add(f.type)
            found[t] = None

    for pou in functions:
        for parameter in pou.parameters:
            add(parameter.variable.type)
        if pou.result is not None:
            add(pou.result.type)
    return list(found)


def _type_lines(t: EnumType | StructType) -> Iterable[str]:
    if isinstance(t, EnumType):
        values = ", ".join(f"{_type_name(t)}_{name} = {value}" for name, value in t.values.items())
        return [f"typedef {_value(t.base)} {_type_name(t)};", f"enum {{ {values} }};"]
    name, packed = _type_name(t), t.pack < MAX_ALIGN
    lines = [f"#pragma pack(push, {t.pack})"] if packed else []
    lines += ["typedef union {" if t.union else "typedef struct {"]
    lines += [f"    {_member(f)};" for f in t.fields]
    lines += [f"}} {name};", *(["#pragma pack(pop)"] if packed else [])]
    lines += [f"RTS_STATIC_ASSERT(sizeof({name}) == {t.size}, {name}_size);"]
    lines += [
        f"RTS_STATIC_ASSERT(offsetof({name}, {c_name(f.name)}) == {f.offset}, {name}_{c_name(f.name)});"
        for f in t.fields
        if f.bit is None
    ]
    return lines


def _member(f: Field) -> str:
    """A member of a struct; a BIT is a bit-field of a byte, which C99 leaves to the compiler."""
    text = _field(f.type, c_name(f.name))
    return text if f.bit is None else f"__extension__ {text} : 1"


def _field(t: Type, name: str) -> str:
    """A member of a struct. Pointers take 8 bytes on every target."""
    if isinstance(t, ArrayType):
        counts = "".join(f"[{high - low + 1}]" for low, high in t.bounds)
        return _field(t.element, name + counts)
    if isinstance(t, StringType):
        return f"{_character(t)} {name}[{t.length + 1}]"
    if isinstance(t, PointerType):
        return f"union {{ {_value(t)}address; RTS_UI64 bits; }} {name}"
    if isinstance(t, StructType):
        return f"{_type_name(t)} {name}"
    if isinstance(t, SubrangeType):
        t = t.base
    return f"{_value(t)} {name}"


# ---- the frame -------------------------------------------------------------------------------------------------------


def _source(name: str, header: str, functions: list[Pou]) -> str:
    lines = [
        "/*",
        f" * {name}.c - implements the library {name}.",
        " *",
        " * The functions run in the context of a task: no allocation, no waiting, no locks that main takes as well.",
        " */",
        f'#include "{header}"',
    ]
    for pou in functions:
        lines += ["", _prototype(pou), "{", *_body(pou), "}"]
    lines += [
        "",
        "static const CMP_EXT_FUNCTION functions[] = {",
        f"    {name.upper()}_EXT_FUNCTIONS",
        "};",
        "",
        f"/* Add the component to the port's cmp_list.c, with a number CMPID_{name}, and this file to its sources. */",
        f"RTS_RESULT {name}_Hook(CMP_HOOK hook);",
        f"RTS_RESULT {name}_Hook(CMP_HOOK hook)",
        "{",
        "    return hook == CH_INIT3 ? CMRegisterExternal(functions, RTS_COUNT(functions)) : ERR_OK;",
        "}",
        "",
    ]
    return "\n".join(lines)


def _body(pou: Pou) -> Iterator[str]:
    """A body that compiles and does nothing yet."""
    scalar = pou.result is not None and is_scalar(pou.result.type)
    if scalar:
        assert pou.result is not None
        value = _value(pou.result.type)
        yield f"    {value}{'' if value.endswith('*') else ' '}result = 0;"
        yield ""
    for word in _parameters(pou):
        yield f"    RTS_UNUSED({_NAME.findall(word)[-1]});"
    if scalar:
        yield "    return result;"
