"""Writes what a component of CODESYS needs here, from its interface and dependency files: headers with the macros of
static linking, declarations in Structured Text of what programs call, and a C file that makes it a component.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import PurePath

from plctool.compiler.base.source import Source
from plctool.compiler.export_itf import c_name, call_declaration, result_type
from plctool.compiler.front import check_sources
from plctool.compiler.syntax.diagnostics import CompileError
from plctool.compiler.typed.nodes import Pou
from plctool.errors import listed
from plctool.v3.m4_interface import M4File, M4Function, m4_error

_MEMBER = re.compile(
    r"(?:const\s+)?(?P<type>\w+)\s*(?P<pointer>\**)\s*(?P<name>\w+)\s*(?P<counts>(?:\[[^\]]*\]\s*)*);"
    r"[ \t]*(?:/\*(?P<comment>.*?)\*/)?",
    re.DOTALL,
)
_COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.DOTALL)
_COUNT = re.compile(r"\[\s*(\d{1,5})\s*\]")
_PARAMETER = re.compile(r"\(\s*(?:const\s+)?(?:struct\s+)?(\w+)\s*\*\s*\w*\s*\)", re.ASCII)
_SECTIONS = ("VAR_IN_OUT", "VAR_INPUT", "VAR_OUTPUT")
_ID = r"#[ \t]*define[ \t]+CMPID_{0}[ \t]+\(?(0[xX][0-9A-Fa-f]{{1,8}}|[1-9]\d{{0,8}})\)?(?=\s|$)"
_FIRST_OF_VENDORS = 0x2000  # among the numbers of components
_TYPES = frozenset((
    "BOOL", "BYTE", "WORD", "DWORD", "LWORD", "SINT", "INT", "DINT", "LINT", "USINT", "UINT", "UDINT", "ULINT", "REAL",
    "LREAL", "TIME", "LTIME", "DATE", "TOD", "DT",
))  # fmt: skip
_ALIASES = {"RESULT": "UDINT", "TIME_OF_DAY": "TOD", "DATE_AND_TIME": "DT"}
_OF_RUNTIME = frozenset(
    f"{name}Itf.h"
    for name in ("CMUtils", "CmpEventMgr", "CmpLog", "CmpMemPool", "CmpSettings", "SysExcept", "SysMem", "SysTime")
)  # what CmpV3.h has


@dataclass(frozen=True)
class _Member:
    """A member of the structure of a function. `section`: VAR_..., "" of the result; `capacity`: of a STRING in bytes;
    `count`: of an array."""

    name: str
    type: str
    section: str
    pointer: bool = False
    capacity: int = 0
    count: int = 0

    @property
    def in_st(self) -> str:
        """The type in Structured Text."""
        if self.capacity:
            return f"STRING[{self.capacity - 1}]"
        if self.count:
            return f"ARRAY[0..{self.count - 1}] OF {self.type}"
        return f"POINTER TO {self.type}" if self.pointer and self.section != "VAR_IN_OUT" else self.type


@dataclass(frozen=True)
class _Called:
    """A function that programs call: its structure ("" for none) and the members of that."""

    function: M4Function
    structure: str
    members: Sequence[_Member]


@dataclass(frozen=True)
class Component:
    """The files, by name, and the functions that programs call, with interface, signature and version."""

    files: dict[str, str]
    functions: list[Pou]


def export_component(files: Sequence[M4File]) -> Component:
    """What is written for an interface file, and perhaps the dependency file of its component.

    Raises UsageError, with the line, for what has no counterpart here.
    """
    called = [_called(file, f) for file in files for f in file.functions if f.for_programs and not f.is_static]
    name = next((file.name for file in files if file.is_component), files[0].name)
    written = {f"{PurePath(file.path).stem}.h": _header(file, files) for file in files}
    pous: list[Pou] = []
    if called:
        declarations = _declarations(name, files, called)
        pous = _checked(f"{name}.st", declarations)
        written[f"{name}.st"] = declarations
    written[f"{name}V3.c"] = _component(name, files, called, pous)
    return Component(written, pous)


# ---- headers ---------------------------------------------------------------------------------------------------------


def _header(file: M4File, files: Sequence[M4File]) -> str:
    stem = PurePath(file.path).stem
    guard = f"{stem.upper()}_H"
    ours = {f"{PurePath(other.path).stem}.h" for other in files}
    includes = dict.fromkeys(h for h in file.interfaces if h in ours or h not in _OF_RUNTIME)
    lines = [
        f"/* {stem}.h - written by 'plctool export-itf --from': do not change it, export it again. */",
        f"#ifndef {guard}",
        f"#define {guard}",
        "",
        '#include "CmpV3.h"',
        *(f'#include "{name}"' for name in includes),
    ]
    component = next((other for other in files if other.is_component), files[0])
    if file is component:
        lines += _component_macros(file, files)
    for part in file.parts:
        text = part if isinstance(part, str) else "\n".join(_macros(file.name, part))
        lines.append(re.sub(_ID.format(component.name), "", text).rstrip())
    return re.sub(r"\n{3,}", "\n\n", "\n".join([*lines, "", "#endif", ""]))


def _component_macros(file: M4File, files: Sequence[M4File]) -> list[str]:
    """What a dependency file defines. All that a component imports is linked, so there is nothing to do."""
    entry = f"{file.name}__Entry"
    number = [
        "",
        f"#define CMPID_{file.name} 0x{component_id(file, files):08X}",
        f"RTS_RESULT {file.name}_Hook(CMP_HOOK hook);",
    ]
    if not file.is_component:
        return number
    return [
        *number,
        "",
        f'#define COMPONENT_NAME "{file.name}"',
        f"#define COMPONENT_ID CMPID_{file.name}",
        f"#define CMP_VERSION 0x{file.numbers.get('COMPONENT_VERSION', 0x01000000):08X}u",
        f"#define COMPONENT_ENTRY {entry}",
        f"#define ComponentEntry {entry}",
        "#define USE_STMT",
        "#define IMPORT_STMT ((void)0)",
        "#define EXPORT_STMT ((void)0)",
        "",
        f"int {entry}(INIT_STRUCT *pInitStruct);",
    ]


def component_id(file: M4File, files: Sequence[M4File]) -> int:
    """The number of a component: the vendor in the upper half, in the lower one what a file defines, or one of its
    name. Raises UsageError for a number of the runtime."""
    text = "".join(part for other in files for part in other.parts if isinstance(part, str))
    defined = re.search(_ID.format(file.name), text)
    number = int(defined[1], 0) if defined is not None else 0x8000 | zlib.crc32(file.name.encode()) & 0x7FFF
    vendor = file.numbers.get("COMPONENT_VENDORID", 0)
    if not _FIRST_OF_VENDORS <= number <= 0xFFFF:
        message = f"CMPID_{file.name} is 0x{number:X}; a component of a vendor has one from 0x2000 to 0xFFFF"
        raise m4_error(file.path, 1, message)
    if vendor > 0x7FFF:
        raise m4_error(file.path, 1, f"COMPONENT_VENDORID is 0x{vendor:X}; it has at most 15 bits")
    return vendor << 16 | number


def _macros(interface: str, f: M4Function) -> Iterator[str]:
    """The prototype, the type of a pointer to it, and the macros of static linking."""
    name = f.name
    yield f"typedef {f.result} (CDECL *PF{name.upper()}){f.signature};"
    for macro in ("USE", "EXT"):
        yield f"#define {macro}_{name}"
    yield f"#define EXP_{name} ERR_OK"
    left_out = [f"defined({left.upper()}_NOTIMPLEMENTED)" for left in (interface, name)]
    yield f"#if {' || '.join(['1'] if f.is_static else left_out)}"
    yield f"#define GET_{name} ERR_NOTIMPLEMENTED"
    yield f"#define CAL_{name}(...) (({f.result})ERR_FAILED)"
    yield f"#define CHK_{name} 0"
    yield "#else"
    yield f"{f.result} CDECL {name}{f.signature};"
    yield f"#define GET_{name} ERR_OK"
    yield f"#define CAL_{name} {name}"
    yield f"#define CHK_{name} 1"
    yield "#endif"


# ---- what programs call ----------------------------------------------------------------------------------------------


def _called(file: M4File, f: M4Function) -> _Called:
    if "__" in f.name:
        message = f"{f.name} belongs to a function block; declare that in Structured Text, and export it from there"
        raise m4_error(file.path, f.line, message)
    if f.result != "void":
        raise m4_error(file.path, f.line, f"{f.name} returns {f.result}; for programs it is void, with a structure")
    if re.fullmatch(r"\(\s*(void)?\s*\)", f.signature):
        return _Called(f, "", [])
    parameter = _PARAMETER.fullmatch(f.signature)
    if parameter is None:
        message = f"{f.name} is for programs, so its one parameter is a structure such as ({f.name}_struct *p)"
        raise m4_error(file.path, f.line, message)
    body = _structure(file, parameter[1])
    if body is None:
        raise m4_error(file.path, f.line, f"the file does not define {parameter[1]}, which {f.name} gets")
    rest = _COMMENT.sub("", _MEMBER.sub("", body)).split()
    if rest:
        raise m4_error(file.path, f.line, f"{parameter[1]} has a member that is not a variable: {rest[0][:40]}")
    return _Called(f, parameter[1], [_member(file, f, found) for found in _MEMBER.finditer(body)])


def _structure(file: M4File, name: str) -> str | None:
    text = "".join(part for part in file.parts if isinstance(part, str))
    found = re.search(r"typedef\s+struct\s*\w*\s*\{([^{}]*)\}\s*" + re.escape(name) + r"\s*;", text)
    return found[1] if found else None


def _member(file: M4File, f: M4Function, found: re.Match[str]) -> _Member:
    name, given = found["name"], found["type"]
    is_result = name.casefold() == f.name.casefold()
    section = next((word for word in _SECTIONS if word in (found["comment"] or "")), "VAR_INPUT")
    where = f"the member {name} of the structure of {f.name}"
    counts = [int(count) for count in _COUNT.findall(found["counts"])]
    if len(found["pointer"]) > 1 or len(counts) > 1 or (found["counts"].strip() and not counts) or 0 in counts:
        raise m4_error(file.path, f.line, f"{where} is neither a value, a pointer to one nor an array of numbers")
    plain = given.removeprefix("RTS_IEC_")
    plain = _ALIASES.get(plain, plain)
    pointer = bool(found["pointer"])
    if plain == "HANDLE" or (pointer and plain not in _TYPES):
        plain, pointer = "BYTE", True
    if plain == "STRING" and len(counts) == 1 and not pointer:
        return _Member(name, plain, "" if is_result else section, capacity=counts[0])
    if plain not in _TYPES or not (pointer or given.startswith("RTS_IEC_")):
        known = listed(sorted(f"RTS_IEC_{known}" for known in _TYPES), "or")
        raise m4_error(file.path, f.line, f"{where} is a {given}; it can be {known}, RTS_IEC_STRING or a pointer")
    if section == "VAR_IN_OUT" and not pointer:
        raise m4_error(file.path, f.line, f"{where} is a VAR_IN_OUT, so it is a pointer")
    return _Member(name, plain, "" if is_result else section, pointer, count=counts[0] if counts else 0)


def _declarations(name: str, files: Sequence[M4File], called: Iterable[_Called]) -> str:
    """The functions in Structured Text."""
    sources = ", ".join(PurePath(file.path).name for file in files)
    lines = [f"(* {name}.st - written by 'plctool export-itf --from' from {sources}: export it again. *)"]
    for one in called:
        result = next((m for m in one.members if not m.section), None)
        title = one.function.name if result is None else result.name
        lines += [
            "",
            f"{{attribute 'external' := '{one.function.name.lower()}'}}",
            f"{{attribute 'version' := '{one.function.version}'}}",
            f"FUNCTION {title}" + ("" if result is None else f" : {result.in_st}"),
        ]
        for section in _SECTIONS:
            members = [m for m in one.members if m.section == section]
            if members:
                lines += [section, *(f"    {m.name} : {m.in_st};" for m in members), "END_VAR"]
        lines.append("END_FUNCTION")
    return "\n".join([*lines, ""])


def _checked(path: str, text: str) -> list[Pou]:
    """The declared functions, in their order."""
    sources = [Source(path, text)]
    found = check_sources(sources)
    if found.program is None:
        raise CompileError(found.diagnostics, sources)
    return found.program.externals


# ---- the component ---------------------------------------------------------------------------------------------------


def _component(name: str, files: Sequence[M4File], called: Sequence[_Called], pous: Sequence[Pou]) -> str:
    component = next((file for file in files if file.is_component), None)
    lines = [
        f"/* {name}V3.c - written by 'plctool export-itf --from': makes {name} a component. Do not change it. */",
        *(f'#include "{PurePath(file.path).stem}.h"' for file in files),
    ]
    for one, pou in zip(called, pous, strict=True):
        lines += ["", *_wrapper(one, pou)]
    if called:
        lines += ["", "static const CMP_EXT_FUNCTION functions[] = {"]
        for one, pou in zip(called, pous, strict=True):
            assert pou.external is not None
            signature = pou.external.signature if one.function.checked else 0
            function = f"(RTS_PFN)APP_GATED({pou.external.name}_called)"
            lines.append(f'    {{"{pou.external.name}", 0x{signature:08X}, 0x{pou.external.version:08X}, {function}}},')
        lines.append("};")
    table = "functions, RTS_COUNT(functions)" if called else "NULL, 0"
    entry = "NULL" if component is None else f"{component.name}__Entry"
    number, version = ("0", "0") if component is None else ("COMPONENT_ID", "CMP_VERSION")
    lines += [
        "",
        f"static const V3_COMPONENT component = {{{entry}, {number}, {version}, {table}}};",
        "static INIT_STRUCT entries;",
        "",
        f"RTS_RESULT {name}_Hook(CMP_HOOK hook)",
        "{",
        "    return V3Hook(&component, &entries, hook);",
        "}",
        "",
    ]
    return "\n".join(lines)


def _wrapper(one: _Called, pou: Pou) -> Iterator[str]:
    """What programs call: it puts the parameters into the structure."""
    assert pou.external is not None
    name = f"{pou.external.name}_called"
    yield call_declaration(pou, name)
    yield "{"
    if one.structure:
        yield f"    {one.structure} p;"
        yield ""
        yield "    memset(&p, 0, sizeof p);"
    for m in one.members:
        yield from _to_structure(m) if m.section in ("VAR_INPUT", "VAR_IN_OUT") else ()
    yield f"    {one.function.name}({'&p' if one.structure else ''});"
    for m in one.members:
        yield from _from_structure(m, c_name(m.name)) if m.section == "VAR_OUTPUT" else ()
    result = next((m for m in one.members if not m.section), None)
    if result is not None and result_type(pou) == "void":
        yield from _from_structure(result, "result")
    elif result is not None:
        yield f"    return p.{result.name};"
    yield "}"
    yield f"APP_GATE({name});"


def _to_structure(m: _Member) -> Iterator[str]:
    argument = c_name(m.name)
    if m.capacity:
        yield f"    V3CopyString(p.{m.name}, sizeof p.{m.name}, {argument});"
        yield f"    RTS_UNUSED({argument}_capacity);"
    elif m.count:
        yield f"    memcpy(p.{m.name}, {argument}, sizeof p.{m.name});"
    else:
        yield f"    p.{m.name} = {'(void *)' if m.pointer else ''}{argument};"


def _from_structure(m: _Member, target: str) -> Iterator[str]:
    if m.capacity:
        yield f"    V3CopyString({target}, sizeof p.{m.name}, p.{m.name});"
        if target != "result":
            yield f"    RTS_UNUSED({target}_capacity);"
    elif m.count:
        yield f"    memcpy({target}, p.{m.name}, sizeof p.{m.name});"
    else:
        yield f"    *{target} = {'(void *)' if m.pointer else ''}p.{m.name};"
