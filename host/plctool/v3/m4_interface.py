"""Reads the interface (`CmpFooItf.m4`) and dependency files (`CmpFooDep.m4`) of CODESYS components.

They are C, with macros of CODESYS between, whose arguments are in the quotes of m4: `DEF_API(`void',`CDECL',`foo',
`(foo_struct *p)',1,0x184DFC0B,0x03040500)`. Other macros of m4 are refused: GNU m4 expands those before.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

from plctool.errors import UsageError, did_you_mean
from plctool.image.c_functions import version_text

_FUNCTIONS = frozenset(
    f"DEF_{kind}API"
    for kind in ("", "ITF_", "STATICITF_", "CREATEITF_", "HANDLEITF_", "CREATECLASSITF_", "CLASSITF_", "STATIC_")
)
_NAMES = frozenset(("SET_INTERFACE_NAME", "SET_COMPONENT_NAME"))
_ITF_LISTS = frozenset(("IMPLEMENT_ITF", "USE_ITF", "REF_ITF"))
_NUMBERS = frozenset(("COMPONENT_VERSION", "COMPONENT_VENDORID"))
_PASSED_OVER = frozenset(
    ("COMPONENT_SOURCES", "REQUIRED_IMPORTS", "OPTIONAL_IMPORTS", "ASSERT_ONE_OF", "SET_PLACEHOLDER_NAME")
)  # the linker finds what is missing
_MACROS = _FUNCTIONS | _NAMES | _ITF_LISTS | _NUMBERS | _PASSED_OVER

_TOKEN = re.compile(
    r"""(?P<dnl>\bdnl\b[^\n]*\n?)|(?P<text>/\*.*?\*/|//[^\n]*|"(?:[^"\\\n]|\\.)*"|'(?:[^'\\\n]|\\.)+')"""
    r"""|(?P<open>/\*)|(?P<call>\b[A-Za-z_]\w*)\((?=(?P<quoted>\s*`)?)""",
    re.DOTALL,
)
_IDENTIFIER = re.compile(r"[A-Za-z_]\w*", re.ASCII)
_SIGNATURE = re.compile(r"\(.*\)", re.DOTALL)


@dataclass(frozen=True)
class M4Function:
    """A DEF_..._API. `signature`: of the parameters in C, in parentheses; `for_programs`: programs call it; `checked`:
    its parameters are compared, as its checksum is not 0; `version`: as text, '1.0' without one."""

    line: int
    result: str
    name: str
    signature: str
    is_static: bool = False
    for_programs: bool = False
    checked: bool = True
    version: str = "1.0"


@dataclass
class M4File:
    """`name`: of interface or component; `parts`: C text and functions, in their order; `interfaces`: the headers that
    it includes; `numbers`: COMPONENT_..."""

    path: str
    name: str = ""
    parts: list[str | M4Function] = field(default_factory=list)
    interfaces: list[str] = field(default_factory=list)
    numbers: dict[str, int] = field(default_factory=dict)
    is_component: bool = False

    @property
    def functions(self) -> list[M4Function]:
        return [part for part in self.parts if isinstance(part, M4Function)]

    @property
    def text(self) -> str:
        """All of the C text."""
        return "".join(part for part in self.parts if isinstance(part, str))


def m4_error(path: str, line: int, message: str) -> UsageError:
    """An error in a file, with its line."""
    return UsageError(f"{path}:{line}: {message}", "m4")


def read_m4(path: str, text: str) -> M4File:
    """Reads a file. Raises UsageError with the line of what is wrong."""
    file = M4File(path)
    text = text.replace("\r\n", "\n")
    end = 0
    for token in _tokens(text):
        if token.start() < end:
            continue
        line = text.count("\n", 0, token.start()) + 1
        if token["open"]:
            raise m4_error(path, line, "the comment has no end")
        if token["text"]:
            continue
        if token["dnl"]:
            file.parts.append(text[end : token.start()])
            end = token.end()
            continue
        if token["call"] not in _MACROS:
            if token["quoted"]:
                hint = did_you_mean(token["call"], sorted(_MACROS)) or "; expand it with GNU m4 before"
                raise m4_error(path, line, f"unknown macro {token['call']}{hint}")
            continue
        file.parts.append(text[end : token.start()])
        arguments, end = _arguments(path, text, token.end(), line)
        _take(file, token["call"], arguments, line)
    file.parts.append(text[end:])
    if not file.name:
        raise m4_error(path, 1, "SET_INTERFACE_NAME or SET_COMPONENT_NAME is missing, so the interface has no name")
    return file


def _tokens(text: str) -> Iterator[re.Match[str]]:
    return _TOKEN.finditer(text)


def _arguments(path: str, text: str, start: int, line: int) -> tuple[list[str], int]:
    """The arguments of a macro whose parenthesis is before `start`, without their outer quotes, and where it ends."""
    found, current, quotes, depth = list[str](), list[str](), 0, 0
    for at in range(start, len(text)):
        character = text[at]
        if character == "`":
            quotes += 1
        elif character == "'" and quotes:
            quotes -= 1
        elif not quotes and depth == 0 and character in ",)":
            found.append("".join(current).strip())
            current = []
            if character == ")":
                return found, at + 1
            continue
        elif not quotes:
            depth += {"(": 1, ")": -1}.get(character, 0)
        if character not in "`'":
            current.append(character)
    what = "the quote ` has no '" if quotes else "the parenthesis has no end"
    raise m4_error(path, line, f"{what}; write (`...',`...')")


def _take(file: M4File, macro: str, arguments: list[str], line: int) -> None:
    if macro in _FUNCTIONS:
        file.parts.append(_function(file.path, macro, arguments, line))
    elif macro in _NAMES:
        file.is_component = file.is_component or macro == "SET_COMPONENT_NAME"
        file.name = _name(file.path, arguments[0], line)
    elif macro in _ITF_LISTS:
        file.interfaces += [_header(file.path, argument, line) for argument in arguments]
    elif macro in _NUMBERS:
        file.numbers[macro] = _number(file.path, arguments[0], line)


def _function(path: str, macro: str, arguments: list[str], line: int) -> M4Function:
    if not 4 <= len(arguments) <= 7:
        wanted = "result, convention, name, parameters, and perhaps 1, checksum and version"
        raise m4_error(path, line, f"{macro} has {len(arguments)} arguments, not {wanted}")
    result, _, name, signature, *rest = arguments
    if not _SIGNATURE.fullmatch(signature):
        raise m4_error(path, line, f"the parameters of {name} are not in parentheses: {signature[:40]}")
    numbers = [_number(path, text, line) for text in rest]
    version = numbers[2] if len(numbers) > 2 else 0
    return M4Function(
        line,
        result,
        _name(path, name, line),
        signature,
        macro == "DEF_STATIC_API",
        bool(numbers and numbers[0]),
        len(numbers) < 2 or numbers[1] != 0,
        version_text(version) if version >> 24 else "1.0",
    )


def _name(path: str, text: str, line: int) -> str:
    if not _IDENTIFIER.fullmatch(text):
        raise m4_error(path, line, f"'{text[:40]}' is not a name of C")
    return text


def _header(path: str, text: str, line: int) -> str:
    """The header of an interface file, in the folder of the others."""
    name = re.split(r"[/\\]", text)[-1]
    if not name.endswith(".m4"):
        raise m4_error(path, line, f"'{text[:40]}' is not a file of an interface, such as CmpLogItf.m4")
    return f"{_name(path, name[:-3], line)}.h"


def _number(path: str, text: str, line: int) -> int:
    try:
        number = int(text, 0)
    except ValueError:
        raise m4_error(path, line, f"'{text[:40]}' is not a number") from None
    if not 0 <= number < 1 << 32:
        raise m4_error(path, line, f"'{text[:40]}' has more than 32 bits")
    return number
