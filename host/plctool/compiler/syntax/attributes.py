"""Attributes and other pragmas: which of them this compiler heeds, and what it says of those that it does not.

An attribute that would change what the program does in another system is a warning until it does so here. One about
documentation, visualisation, libraries or online change changes nothing, so nothing is said.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from difflib import get_close_matches
from typing import Protocol

Attributes = dict[int, dict[str, str]]
"""Attributes by the offset of what they stand before; name in lower case -> text."""
Repeated = dict[int, list[tuple[int, str, str]]]
"""The same in their order, with the offset of each: one that stands several times is there as often."""

HEEDED: dict[str, frozenset[str]] = {
    "qualified_only": frozenset(("VAR_GLOBAL", "enumeration")),
    "pack_mode": frozenset(("STRUCT",)),
    "pool": frozenset(("STRUCT", "FUNCTION_BLOCK", "TYPE", "enumeration")),
    "strict": frozenset(("enumeration",)),
    "to_string": frozenset(("enumeration",)),
    "call_after_init": frozenset(("FUNCTION_BLOCK", "METHOD")),
    "call_on": frozenset(("FUNCTION",)),
    "instance-path": frozenset(("variable",)),
    "external": frozenset(("FUNCTION", "FUNCTION_BLOCK")),
    "fault": frozenset(("TEST",)),
    "from_c": frozenset(("FUNCTION", "METHOD", "PROGRAM", "variable")),
    "version": frozenset(("FUNCTION", "FUNCTION_BLOCK")),
    "shared_output": frozenset(("variable",)),
}
"""What does something, and before what."""

OF_THE_LIBRARY = frozenset((
    "no_checks", "no_init", "by_reference", "cuts_result", "in_place", "alias", "extensible",
))  # fmt: skip
"""What the standard library promises of its units; nothing checks it, so programs cannot (docs/internals.md)."""

_NOT_IN_C = "only a FUNCTION or FUNCTION_BLOCK can be written in C"
REFUSED = {
    "external": _NOT_IN_C,
    "external_name": "the name of a function in C is written {attribute 'external' := 'name'}",
}
"""What leaves a unit without its code where it is not heeded."""

_LAYOUT = "members are at multiples of their size, or of 8 bytes"
_ALL_SYMBOLS = "plctool reads and writes every variable by name; a password limits who may write"
_CALL_IT = "call it in the first cycle, or do its work in FB_Init"
UNHEEDED = {
    "call_after_global_init_slot": _CALL_IT,
    "call_before_global_exit_slot": "write FB_Exit",
    "contextname": "inputs and outputs are those of the task whose programs use them",
    "global_init_slot": "variables get their initial values in the order of their declarations",
    "init_namespace": "give the string itself as the initial value",
    "initialize_on_call": "assign the inputs in the call",
    "is_connected": "add a BOOL input that the caller sets",
    "no-exit": "FB_Exit is called for every instance",
    "no_exit": "FB_Exit is called for every instance",
    "no-init": "every variable starts with its initial value",
    "noinit": "every variable starts with its initial value",
    "no_init": "every variable starts with its initial value",
    "no_assign": "instances are copied as structures are; do not assign them",
    "no_check": "--checks chooses which checks are compiled in",
    "no_virtual_actions": "actions of a derived block override those of its base",
    "c++_compatible": _LAYOUT,
    "parameterstringof": "give the string itself as an argument",
    "relative_offset": _LAYOUT,
    "subsequent": "write a STRUCT, whose members follow each other",
    "tccallafteroutputupdate": "inputs are read before the programs and outputs are written after them",
    "symbol": _ALL_SYMBOLS,
    "tccontextid": "inputs and outputs are those of the task whose programs use them",
    "tccontextname": "inputs and outputs are those of the task whose programs use them",
    "tcinitonreset": "every variable but RETAIN and PERSISTENT is initialised at a reset",
    "tcinitsymbol": "give the initial value in the declaration",
    "tclinkto": "write AT %I* or %Q*, and the address in VAR_CONFIG",
    "tcnodeid": "write AT %I* or %Q*, and the address in VAR_CONFIG",
    "tcnosymbol": _ALL_SYMBOLS,
    "tcpersistent": "write VAR PERSISTENT",
    "tcretain": "write VAR RETAIN",
    "tcignorepersistent": "every PERSISTENT variable is restored",
    "tcrpcenable": "only the program calls the method",
    "tcswapword": "the bytes stay as they are; exchange them in the program",
    "tcswapdword": "the bytes stay as they are; exchange them in the program",
    "tcswapbytes": "the bytes stay as they are; exchange them in the program",
}
"""What changes a program in other systems and not here, with what to do instead."""

SILENT = frozenset((
    "analysis", "analysis:report-multiple-instance-calls", "blobinit", "blobinitconst", "call_after_online_change_slot",
    "call_on_type_change", "conditionalshow", "conditionalshow_all_locals", "const_non_replaced", "const_replaced",
    "dataflow", "displaymode", "doc", "enable_dynamic_creation", "estimated-stack-usage", "expandfully",
    "generate_implicit_init_function", "global_init_on_onlchange", "guid", "hide", "hide_all_locals", "hide_subitems",
    "icon", "implicit", "init_on_onlchange", "io_function_block", "io_function_block_mapping", "libraryplaceholder",
    "library_license", "licensed", "linkalways", "max", "min", "monitoring", "monitoring_instead", "naming",
    "nameprefix", "namespace", "no_assign_warning", "no_copy", "no_explicit_call",
    "no_instance_in_retain", "no_override", "object_name", "obsolete",
    "pin_presentation_order_inputs", "pin_presentation_order_outputs", "pingroup", "processvalue", "pytmc",
    "reflection", "signature_flag", "sysobject", "tc2gvlvarnames",
    "tcdisplayscale", "tcdisplaytypeguid", "tcencapsulate",
    "tctypesystem", "unit", "usage", "warning",
))  # fmt: skip
"""What changes nothing that a program does."""

_NO_INIT = ("noinit", "no-init", "no_init")  # goes with instance-path: the initial value is the path

_READ_WRITE = "readwrite"  # {attribute 'symbol'} says what is so here
_WHEN_CALLED = re.compile(r"(call|run|execute)_(on|at|after|before|in)_\w+")
_TEXT_PRAGMA = re.compile(r"\{\s*(error|warning)\s+'([^']*)'\s*\}", re.IGNORECASE)
_IN_C = re.compile(r"\{\s*external\b[^{}]*\}", re.IGNORECASE)
_FLAG = re.compile(r"\{\s*flag\b[^{}]*\bnoinit\b[^{}]*\}", re.IGNORECASE)
_ATTRIBUTE = re.compile(r"\{\s*(?:attribute\b|at+r?i\w*\s*')", re.IGNORECASE)


class Reports(Protocol):
    """Where findings go."""

    def error(self, offset: int, code: str, message: str) -> None: ...

    def warning(self, offset: int, code: str, message: str) -> None: ...


def check_attributes(attributes: Attributes, places: Mapping[int, str], reports: Reports) -> None:
    """Reports the attributes of a program that do nothing where they stand, and takes those out that only the library
    has. `places`: what is declared at an offset."""
    for offset, given in attributes.items():
        place = places.get(offset, "")
        for name in list(given):
            if place in HEEDED.get(name, ()):
                if name == "version" and "external" not in given:
                    reports.warning(
                        offset, "no-effect", _no_effect(name, "it belongs to {attribute 'external' := 'name'}")
                    )
                continue
            _check(name, place, offset, given, reports)
            if name in OF_THE_LIBRARY:
                del given[name]


def _check(name: str, place: str, offset: int, given: Mapping[str, str], reports: Reports) -> None:
    if name in REFUSED:
        where = f", not a {place}" if name in HEEDED and place else ""
        reports.error(offset, "attribute", f"{REFUSED[name]}{where}")
    elif name in HEEDED:
        reports.warning(offset, "no-effect", _no_effect(name, f"it is written before {_listed(name)}"))
    elif name in UNHEEDED and not _is_so_here(name, given):
        reports.warning(offset, "no-effect", _no_effect(name, UNHEEDED[name]))
    elif name in OF_THE_LIBRARY:
        reports.warning(offset, "no-effect", _no_effect(name, "it is for the standard library"))
    elif name not in SILENT and name not in UNHEEDED:
        meant = get_close_matches(name, [*HEEDED, *UNHEEDED], n=1, cutoff=0.8)
        if meant:
            reports.warning(offset, "no-effect", _no_effect(name, f"did you mean '{meant[0]}'?"))
        elif _WHEN_CALLED.fullmatch(name):
            reports.warning(offset, "no-effect", _no_effect(name, _CALL_IT))


def _is_so_here(name: str, given: Mapping[str, str]) -> bool:
    """True if an attribute asks for what is done without it."""
    if name == "symbol":
        return given[name].strip().lower() == _READ_WRITE
    return name in _NO_INIT and "instance-path" in given


def _listed(name: str) -> str:
    words = sorted(HEEDED[name])
    return " or ".join(f"an {word}" if word == "enumeration" else f"a {word}" for word in words)


def _no_effect(name: str, advice: str) -> str:
    return f"{{attribute '{name}'}} has no effect here: {advice}"


def check_pragmas(pragmas: list[tuple[int, str]], reports: Reports) -> None:
    """Does what {error 'text'} and {warning 'text'} ask for, and reports what is not understood."""
    for offset, text in pragmas:
        said = _TEXT_PRAGMA.fullmatch(text)
        if said is not None:
            if said[1].lower() == "error":
                reports.error(offset, "pragma", said[2])
            else:
                reports.warning(offset, "pragma", said[2])
        elif _IN_C.fullmatch(text):
            reports.error(offset, "pragma", REFUSED["external_name"])
        elif _FLAG.fullmatch(text):
            advice = UNHEEDED["noinit"]
            reports.warning(offset, "no-effect", f"{{flag noinit}} has no effect here: {advice}")
        elif _ATTRIBUTE.match(text):
            message = "this attribute has no effect: it is written {attribute 'name'} or {attribute 'name' := 'text'}"
            reports.warning(offset, "no-effect", message)
