"""Writes the C side of a library: a header for its functions that are implemented in C, and a C file to fill in.

The header holds the types, the prototypes and the entries of the function table; it is written again whenever the
library changes. The C file is a component for the runtime's list (docs/porting.md); once written, it is the user's.

The body and the methods of a block get one structure each, as in CODESYS: with the instance, the parameters and the
result. The program calls them as it calls functions, so the header has a small function between the two.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from plctool.compiler.semantics.declarations.functions import interface_text
from plctool.compiler.typed.nodes import Direction, Export, Parameter, Pou, PouKind
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
from plctool.image.c_functions import version_text

_C_WORDS = frozenset((
    "auto", "break", "case", "char", "const", "continue", "default", "do", "double", "else", "enum", "extern", "float",
    "for", "goto", "if", "inline", "int", "long", "main", "register", "restrict", "return", "short", "signed", "sizeof",
    "static", "struct", "switch", "typedef", "union", "unsigned", "void", "volatile", "while",
))  # fmt: skip
_NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)
_WIDTH = 100  # columns of a prototype


@dataclass(frozen=True)
class Interface:
    """What is written. `header_name`, `source_name`: file names; `source`: "" if no function is in C; `functions`:
    text, signature and version of each."""

    header_name: str
    header: str
    source_name: str
    source: str
    functions: list[tuple[str, int, int]]


def export_interface(library: str, functions: list[Pou], exports: Sequence[Export] = ()) -> Interface:
    """The C side of a library. `library`: its name; `functions`: those with an `external` part; `exports`: what C calls
    and uses.

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
    source = _source(name, header_name, functions) if functions else ""
    return Interface(header_name, _header(name, functions, exports), source_name, source, details)


def _external(pou: Pou) -> str:
    assert pou.external is not None
    return pou.external.name


# ---- the header ------------------------------------------------------------------------------------------------------


def _header(name: str, functions: list[Pou], exports: Sequence[Export]) -> str:
    guard = f"{name.upper()}ITF_H"
    what = f"the functions of the library {name} that are implemented in C"
    lines = [
        "/*",
        f" * {name}Itf.h - {what if functions else f'what the program {name} offers to components in C'}.",
        " *",
        " * Written by 'plctool export-itf': do not change it, export it again.",
        " */",
        f"#ifndef {guard}",
        f"#define {guard}",
        "",
        *(['#include "AppByName.h"'] if exports else []),
        '#include "CmpItf.h"',
        '#include "rts_config.h"',
        "",
        "/* The number of the component in log entries; any that no other component has. */",
        f"enum {{ CMPID_{name} = 0x{0x8000 | zlib.crc32(name.encode()) & 0x7FFF:04X} }};",
    ]
    types = _named_types([*_types_of(functions), *_types_used(exports)])
    if any(isinstance(t, StructType) for t in types):
        lines.append("")
    lines += [f"typedef {_struct_word(t)} {_type_name(t)} {_type_name(t)};" for t in types if isinstance(t, StructType)]
    for t in types:
        lines += ["", *_type_lines(t)] if isinstance(t, EnumType) or t.fields else []
    for pou in functions:
        assert pou.external is not None
        text = interface_text(pou.external.name, pou)
        lines += ["", *(_call_structure(pou) if pou.instance is not None else [])]
        lines += [f"/* {text}, version {version_text(pou.external.version)} */", f"{_prototype(pou)};"]
    for pou in functions:
        lines += ["", *_wrapper(pou)] if pou.instance is not None else []
    lines += [*(_table_lines(name, functions) if functions else []), *_export_lines(exports)]
    return "\n".join([*lines, "", "#endif", ""])


def _table_lines(name: str, functions: list[Pou]) -> list[str]:
    lines = ["", "/* They have all rights of the runtime, also where the program that calls them has not. */"]
    lines += [f"APP_GATE({_called(pou)});" for pou in functions]
    lines += ["", "/* The entries of the table for CMRegisterExternal: name, signature, version, function. */"]
    entries = [_entry(pou) for pou in functions]
    lines.append(f"#define {name.upper()}_EXT_FUNCTIONS \\")
    return lines + [f"    {entry}, \\" for entry in entries[:-1]] + [f"    {entry}" for entry in entries[-1:]]


# ---- what C calls and uses ----


def _export_lines(exports: Sequence[Export]) -> Iterator[str]:
    """The name and signature of each for AppFindFunctionByName and AppFindVariableByName, and its structure or type."""
    done: set[str] = set()
    for export in exports:
        word = "_".join(_NAME.findall(export.name.replace("[", "_").lower()))
        yield from ("", f"/* {'variable' if export.caller is None else 'function'} {export.name} */")
        values = None if export.variable is None else _type_of_values(export)
        if export.caller is None:
            assert values is not None
            yield f"typedef {_field(values, f'{word}_value')};"
        elif isinstance(values, StructType) and values.name not in done:
            done.add(values.name)
            yield f"typedef struct {values.name} {values.name};"
            yield from _type_lines(values)
        yield f'#define {word.upper()}_NAME "{export.name}"'
        yield f"#define {word.upper()}_SIGNATURE 0x{export.signature:08X}u"


def _types_used(exports: Sequence[Export]) -> Iterator[Type]:
    """The types of variables, parameters and results."""
    for export in exports:
        if export.variable is not None:
            t = export.variable.type
            yield from (f.type for f in t.fields) if export.caller is not None and isinstance(t, StructType) else (t,)


def _type_of_values(export: Export) -> Type:
    """The type of a variable; the structure of a function by the name that it has in C."""
    assert export.variable is not None
    t = export.variable.type
    if export.caller is None or not isinstance(t, StructType):
        return t
    return replace(t, name="_".join((*_NAME.findall(t.name.rpartition(" ")[2].lower()), "call")))


def _entry(pou: Pou) -> str:
    external = pou.external
    assert external is not None
    function = f"(RTS_PFN)APP_GATED({_called(pou)})"
    return f'{{"{external.name}", 0x{external.signature:08X}, 0x{external.version:08X}, {function}}}'


def _prototype(pou: Pou) -> str:
    """`RTS_I16 name(RTS_I16 a, const char *s, RTS_UI32 s_capacity)`, or with the structure of a block or method."""
    if pou.instance is not None:
        return f"void {_external(pou)}({_structure_of(pou)} *p)"
    return _declaration(_result_of(pou), _external(pou), list(_parameters(pou)))


def _result_of(pou: Pou) -> str:
    """The C type that a function returns."""
    return _value(pou.result.type) if pou.result is not None and is_scalar(pou.result.type) else "void"


def result_type(pou: Pou) -> str:
    """The C type that a C function returns to a program, `void` also for a result that is no scalar."""
    return _result_of(pou)


def call_declaration(pou: Pou, name: str) -> str:
    """The first line of a static function `name` that programs call as they call that of `pou`."""
    return _declaration(f"static {_result_of(pou)}", name, list(_parameters(pou)))


def _declaration(result: str, name: str, words: list[str]) -> str:
    space = "" if result.endswith("*") else " "
    start = f"{result}{space}{name}("
    line = f"{start}{', '.join(words) or 'void'})"
    if len(line) <= _WIDTH:
        return line
    return start + (",\n" + " " * len(start)).join(words) + ")"


# ---- blocks and methods ----------------------------------------------------------------------------------------------


def _called(pou: Pou) -> str:
    """The C function that programs call."""
    return _external(pou) if pou.instance is None else f"{_external(pou)}_called"


def _block_name(pou: Pou) -> str:
    return _external(pou).rpartition("__")[0]


def _structure_of(pou: Pou) -> str:
    """The type of what a block or method gets: `acme_pid_main_struct`, as in CODESYS."""
    return "_".join((*_external(pou).rsplit("__", 1), "struct"))


def _members_of(pou: Pou) -> list[str]:
    """The parameters of a method, without the instance; those of a block are variables of it."""
    return list(_parameters(pou)) if pou.kind is PouKind.METHOD else []


def _call_structure(pou: Pou) -> list[str]:
    """The type of the instance before the body of the block; what the body or a method gets."""
    assert pou.instance is not None
    block = f"{_block_name(pou)}_struct"
    lines = [f"typedef {_type_name(pou.instance)} {block};", ""] if pou.kind is PouKind.FUNCTION_BLOCK else []
    lines += ["typedef struct {", f"    {block} *pInstance;", *(f"    {word};" for word in _members_of(pou))]
    result = _result_of(pou)
    if result != "void":
        space = "" if result.endswith("*") else " "
        lines.append(f"    {result}{space}{_result_member(pou)};")
    return [*lines, f"}} {_structure_of(pou)};"]


def _result_member(pou: Pou) -> str:
    assert pou.result is not None
    return c_name(pou.result.name)


def _name_in(word: str) -> str:
    """The name that a parameter in C declares."""
    return str(_NAME.findall(word)[-1])


def _wrapper(pou: Pou) -> list[str]:
    """What programs call: it puts the parameters into the structure."""
    words = _members_of(pou)
    parameters = [f"{_block_name(pou)}_struct *instance", *words]
    values = ["instance", *map(_name_in, words)]
    if _result_of(pou) != "void":
        values.append("0")
    lines = [
        _declaration(f"static inline {_result_of(pou)}", _called(pou), parameters),
        "{",
        f"    {_structure_of(pou)} p = {{{', '.join(values)}}};",
        "",
        f"    {_external(pou)}(&p);",
    ]
    if _result_of(pou) != "void":
        lines.append(f"    return p.{_result_member(pou)};")
    return [*lines, "}"]


# ---- parameters ------------------------------------------------------------------------------------------------------


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
    if name in ("result", "instance", "p"):  # of ours
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


def _types_of(functions: list[Pou]) -> Iterator[Type]:
    for pou in functions:
        if pou.instance is not None:
            yield pou.instance
        for parameter in pou.parameters if pou.kind is not PouKind.FUNCTION_BLOCK else []:
            yield parameter.variable.type
        if pou.result is not None:
            yield pou.result.type


def _named_types(types: Iterable[Type]) -> list[EnumType | StructType]:
    """The enums and structs that are needed, each after what it consists of."""
    found: dict[EnumType | StructType, None] = {}
    pointed: list[Type] = []  # which are declared, but need not be complete before

    def add(t: Type) -> None:
        if isinstance(t, ArrayType):
            add(t.element)
        elif isinstance(t, PointerType):
            pointed.append(t.target)
        elif isinstance(t, EnumType) and _is_named(t):
            found[t] = None
        elif isinstance(t, StructType) and t not in found:
            for f in t.fields:
                add(f.type)
            found[t] = None

    for needed in types:
        add(needed)
    while pointed:
        add(pointed.pop())
    enums = [t for t in found if isinstance(t, EnumType)]
    return [*enums, *(t for t in found if isinstance(t, StructType))]


def _type_lines(t: EnumType | StructType) -> Iterable[str]:
    if isinstance(t, EnumType):
        values = ", ".join(f"{_type_name(t)}_{name} = {value}" for name, value in t.values.items())
        return [f"typedef {_value(t.base)} {_type_name(t)};", f"enum {{ {values} }};"]
    name, packed = _type_name(t), t.pack < MAX_ALIGN
    lines = [f"#pragma pack(push, {t.pack})"] if packed else []
    lines += [f"{_struct_word(t)} {name} {{"]
    lines += [f"    {_member(f)};" for f in t.fields]
    lines += ["};", *(["#pragma pack(pop)"] if packed else [])]
    lines += [f"RTS_STATIC_ASSERT(sizeof({name}) == {t.size}, {name}_size);"]
    lines += [
        f"RTS_STATIC_ASSERT(offsetof({name}, {c_name(f.name)}) == {f.offset}, {name}_{c_name(f.name)});"
        for f in t.fields
        if f.bit is None
    ]
    return lines


def _struct_word(t: StructType) -> str:
    return "union" if t.union else "struct"


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
    if pou.instance is not None:
        yield "    RTS_UNUSED(p);"
        return
    scalar = pou.result is not None and is_scalar(pou.result.type)
    if scalar:
        assert pou.result is not None
        value = _value(pou.result.type)
        yield f"    {value}{'' if value.endswith('*') else ' '}result = 0;"
        yield ""
    for word in _parameters(pou):
        yield f"    RTS_UNUSED({_name_in(word)});"
    if scalar:
        yield "    return result;"
