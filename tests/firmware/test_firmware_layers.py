"""The sources of the firmware stand on each other in one direction.

A module is a C source with the headers that declare its functions. It knows those whose headers it includes, and stands
on those of which it uses a function, also by way of a macro or of a header that another one brings.
"""

from __future__ import annotations

import re
from functools import cache
from graphlib import TopologicalSorter
from itertools import groupby
from pathlib import Path

import pytest

FIRMWARE = Path(__file__).parents[2] / "firmware"
SOURCE = FIRMWARE / "src"
PORT = FIRMWARE / "port"
PORTS = sorted({path.parent for path in PORT.rglob("*.c")})
FLOORS = ["core", "sys", "modbus", "canopen", "cycle", "load", "app", "can", "io", "comm"]

# Two sources with the same functions, of which a firmware has one.
INSTEAD_OF = {"CmpScheduleEmbedded": "CmpScheduleTimer"}

# What every component is, and with it the functions of the manager that calls them.
EVERY_COMPONENT = "CmpItf.h"

DEFINITION = re.compile(r"^(?!static\b|typedef\b|else\b)[A-Za-z_][\w *]*?\b(\w+)\([^;{}]*\)\n\{", re.MULTILINE)
DECLARATION = re.compile(r"^(?!static\b|typedef\b|#)[A-Za-z_][\w *]*?\b(\w+)\([^;{}]*\)[^;{}]*;", re.MULTILINE)
MACRO = re.compile(r"^#define (\w+)\(((?:\\.|[^\n\\])*)", re.MULTILINE | re.DOTALL)
NOT_CODE = re.compile(r'/\*.*?\*/|"(?:\\.|[^"\\\n])*"', re.DOTALL)
INCLUDE = re.compile(r'^#include "(?:\.\./\w+/)?([^"]+)"', re.MULTILINE)


@cache
def _code(path: Path) -> str:
    """A source without comments and strings; also without the lines that include."""
    return NOT_CODE.sub(" ", path.read_text())


MODULES = {path.stem: path for path in sorted(SOURCE.rglob("*.c"))}
HEADERS = {path.name: path for path in [*(FIRMWARE / "include").glob("*.h"), *SOURCE.rglob("*.h")]}
DEFINED = {name: set(DEFINITION.findall(_code(path))) for name, path in MODULES.items()}
DECLARED = {name: set(DECLARATION.findall(_code(path))) for name, path in HEADERS.items()}
MACROS = [found for path in HEADERS.values() for found in MACRO.findall(_code(path))]
HOOKS = {f"{name}_Hook" for name in MODULES} | {"CmpScheduleTimer_Hook"}


def _floor(path: Path) -> str:
    return path.relative_to(SOURCE).parts[0]


def _words(text: str) -> set[str]:
    """The names in a piece of code, and those that its macros bring."""
    words: set[str] = set()
    new = set(re.findall(r"[A-Za-z_]\w*", text))
    while new:
        words |= new
        new = {w for name, body in MACROS if name in new for w in re.findall(r"[A-Za-z_]\w*", body)} - words
    return words


def _included(path: Path) -> set[str]:
    """The headers that a source has, also by way of others."""
    found: set[str] = set()
    new = set(INCLUDE.findall(path.read_text()))
    while new:
        found |= new
        new = {h for name in new & HEADERS.keys() for h in INCLUDE.findall(HEADERS[name].read_text())} - found
    return found


def stands_on(module: str) -> set[str]:
    """The modules whose functions a module uses."""
    used = _words(_code(MODULES[module])) & {name for header in _included(MODULES[module]) & HEADERS.keys()
                                             for name in DECLARED[header]}  # fmt: skip
    return {
        other for other, functions in DEFINED.items() if other != module and used & functions - DEFINED[module] - HOOKS
    }


def _stands_on_in_port(folder: Path) -> dict[str, set[str]]:
    """The sources of a port by those of the same folder that they use. Other folders are other ports; what a board and
    the common sources have of each other is in headers for both, such as BareMetal.h."""
    code = {path.stem: _code(path) for path in folder.glob("*.c")}
    defined = {name: set(DEFINITION.findall(text)) for name, text in code.items()}
    shared = [*DECLARED.values(), *(set(DECLARATION.findall(_code(path))) for path in folder.glob("*.h"))]
    words = {name: _words(text) & set().union(*shared) for name, text in code.items()}
    return {
        name: {other for other in code if other != name and (words[name] - defined[name]) & defined[other]}
        for name in code
    }


def _owner(header: str) -> str | None:
    """The module that defines what a header declares; None: a port, or nothing is to be defined."""
    owners = [name for name, defined in DEFINED.items() if defined & DECLARED.get(header, set()) - HOOKS]
    return INSTEAD_OF.get(owners[0], owners[0]) if owners else None


OWNERS = {header: _owner(header) for header in HEADERS if header != EVERY_COMPONENT}


def _knows(module: str) -> set[str]:
    """The modules whose headers a module includes, in its source or its own headers."""
    own = [MODULES[module], *(HEADERS[name] for name, owner in OWNERS.items() if owner == module)]
    headers = {header for path in own for header in INCLUDE.findall(path.read_text())}
    return {owner for header in headers if (owner := OWNERS.get(header))} - {module, INSTEAD_OF.get(module)}


def test_the_sources_are_read_as_meant() -> None:
    assert len(MODULES) > 40
    assert "LogAddEntry" in DEFINED["CmpLog"]
    assert {"SysFlashLog", "CmpLog"} <= stands_on("CmpRetain")
    assert {"SysFlashLog", "CmpLog", "IecCycle"} <= _knows("CmpRetain")


def test_no_modules_stand_on_each_other_in_a_circle() -> None:
    TopologicalSorter({name: stands_on(name) for name in MODULES}).prepare()  # raises CycleError, which names it


def test_no_modules_include_the_headers_of_each_other_in_a_circle() -> None:
    TopologicalSorter({name: _knows(name) for name in MODULES}).prepare()


@pytest.mark.parametrize("folder", PORTS, ids=lambda path: str(path.relative_to(PORT)))
def test_no_sources_of_a_port_stand_on_each_other_in_a_circle(folder: Path) -> None:
    TopologicalSorter(_stands_on_in_port(folder)).prepare()


def test_sources_of_ports_are_read_as_meant() -> None:
    assert len(PORTS) > 10
    assert "IecStack" in _stands_on_in_port(PORT / "linux")["SysExcept"]
    assert "SimModbus" in _stands_on_in_port(PORT / "sim")["SimWire"]


@pytest.mark.parametrize("floor", FLOORS)
def test_a_floor_knows_none_above_it(floor: str) -> None:
    above = FLOORS[FLOORS.index(floor) + 1 :]
    private = {path.name: _floor(path) for path in SOURCE.rglob("*.h")}
    of = {name: _floor(MODULES[name]) for name in MODULES} | private
    wrong = set()
    for path in [p for p in SOURCE.rglob("*.[ch]") if _floor(p) == floor]:
        for header in INCLUDE.findall(path.read_text()):
            at = of.get(header) or of.get(Path(header).stem)
            if at in above:
                wrong.add((path.name, header))
    assert wrong == set()


def test_every_source_lies_on_a_floor() -> None:
    assert {_floor(path) for path in MODULES.values()} == set(FLOORS)


def test_a_header_declares_the_functions_of_one_source() -> None:
    scattered = {}
    for header, functions in DECLARED.items():
        owners = {INSTEAD_OF.get(name, name) for name, defined in DEFINED.items() if defined & functions}
        if len(owners) > 1:
            scattered[header] = sorted(owners)
    assert scattered == {}


def test_outputs_are_cleared_on_the_one_way_into_the_safe_state() -> None:
    users = {name for name, path in MODULES.items() if "AppAreasClearOutputs" in _words(_code(path))}
    assert users == {"AppAreas", "CyclePhases"}


def test_a_function_is_declared_in_one_header() -> None:
    places = sorted((name, header) for header, functions in DECLARED.items() for name in functions)
    twice = {name: found for name, group in groupby(places, lambda place: place[0])
             if len(found := [header for _, header in group]) > 1}  # fmt: skip
    assert twice == {}


def test_every_function_that_is_not_static_is_declared_in_a_header() -> None:
    declared = set().union(*DECLARED.values())
    hidden = {(module, name) for module, names in DEFINED.items() for name in names - declared - HOOKS}
    assert hidden == set()
