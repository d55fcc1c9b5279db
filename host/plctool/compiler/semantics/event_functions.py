"""Functions with {attribute 'call_on' := 'EVT_...'}: the runtime calls them when the event happens (docs/events.md).

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterator

from plctool.compiler.semantics.symbols import ERROR, NOTHING, FunctionInfo, PouSymbol
from plctool.compiler.semantics.world import World
from plctool.compiler.syntax.diagnostics import did_you_mean
from plctool.compiler.typed.nodes import (
    Call,
    CallStatement,
    Const,
    Direction,
    EventFunction,
    Expr,
    Place,
    Pos,
    Pou,
    PouKind,
)  # fmt: skip
from plctool.core import lib
from plctool.iec.types import BOOL, DWORD

EVENTS = (
    "EVT_PrepareStart", "EVT_StartDone", "EVT_PrepareStop", "EVT_StopDone", "EVT_PrepareReset", "EVT_ResetDone",
    "EVT_PrepareDownload", "EVT_DownloadDone", "EVT_CreateBootprojectDone", "EVT_DenyStartBootproject",
    "EVT_PrepareStartBootproject", "EVT_StartBootprojectDone", "EVT_DenyStart", "EVT_DenyStop",
    "EVT_PrepareOnlineChange", "EVT_OnlineChangeDone", "EVT_TaskException",
)  # fmt: skip
"""Those of AppEventIds.h that happen while the program has its values."""

ALIASES = {
    "OnStart": "EVT_PrepareStart",
    "OnStop": "EVT_PrepareStop",
    "BeforeReset": "EVT_PrepareReset",
    "OnProgramChange": "EVT_PrepareDownload",
    "OnDownload": "EVT_PrepareDownload",
    "OnPowerOn": "EVT_PrepareStartBootproject",
}
"""Names in older systems."""

_EARLY = "it happens before the program has its initial values; write EVT_PrepareStartBootproject"
_NO_LOGIN = "no event says that a tool logs in or out"
NOT_CALLED = {
    "EVT_LoadBootprojectDone": _EARLY,
    "EVT_DenyLoadBootproject": _EARLY,
    "EVT_PrepareLoadBootproject": _EARLY,
    "EVT_AllBootprojectsLoaded": _EARLY,
    "EVT_PrepareExit": "write FB_Exit",
    "EVT_CmpApp_Exception": "a program that has failed is not called; write EVT_TaskException",
    "OnInit": "write FB_Init, or EVT_PrepareStart",
    "OnTimer": "write a TASK with an INTERVAL",
    "OnLogin": _NO_LOGIN,
    "OnLogout": _NO_LOGIN,
}
"""Why a program cannot have a function for an event, and what to write."""

_BY_KEY = {name.casefold(): name for name in (*EVENTS, *ALIASES, *NOT_CALLED)}


def declare_event_functions(world: World) -> list[EventFunction]:
    """Declares the functions that the program attaches to events, in the order of the program."""
    found: dict[str, EventFunction] = {}
    for symbol in world.names.functions():
        names = symbol.decl.attributes.get("call_on")
        info = None if names is None else _function(world, symbol)
        if names is None or info is None:
            continue
        for event in _events(world, symbol, names):
            other = found.get(event)
            if other is None:
                found[event] = EventFunction(int(getattr(lib, event)), symbol.decl.name, _caller(world, event, info))
            else:
                place = f"{other.pou.pos.file}, line {other.pou.pos.line}"
                _error(world, symbol, f"{event} calls {other.name} already ({place}); let that call {symbol.decl.name}")
    functions = [*found.values(), *_registered(world)]
    world.pous += [function.pou for function in functions]
    return functions


def number_of(name: str) -> int:
    """The number that INDEXOF gives for a function: an INT, the same after each change of the program."""
    return zlib.crc32(name.casefold().encode()) % 0x7FFF + 1


def may_be_registered(info: FunctionInfo) -> bool:
    """True if events can call the function: without parameters, or as CoDeSys 2.3 has them."""
    inputs = [v.type for v, direction in info.parameters if direction is Direction.INPUT]
    return len(inputs) == len(info.parameters) and inputs in ([], [DWORD] * 3) and info.result in _RESULTS[len(inputs)]


_RESULTS = {0: (None, BOOL, ERROR), 3: (None, DWORD, ERROR)}
_INDEXOF = re.compile(r"\bINDEXOF\s*\(\s*(\w+)\s*\)", re.IGNORECASE)


def indexed_names(world: World) -> set[str]:
    """What INDEXOF may name, in lower case; a comment may do so too."""
    sources = {s.path: s for s in (world.scope_of(symbol).source for symbol in world.names.pou_symbols())}
    return {name.casefold() for source in sources.values() for name in _INDEXOF.findall(source.text)}


def _registered(world: World) -> Iterator[EventFunction]:
    """The functions that INDEXOF names, so that the program can register them."""
    wanted = indexed_names(world)
    numbers = dict[int, str]()
    for symbol in world.names.functions() if wanted else ():
        name = symbol.decl.name
        info = world.declared.function(symbol, {}) if name.casefold() in wanted else None
        if info is None or not may_be_registered(info):
            continue  # INDEXOF says what is wrong
        number = number_of(name)
        if number in numbers:
            _error(world, symbol, f"{name} and {numbers[number]} have the same number; rename one of them")
        numbers[number] = name
        yield EventFunction(int(lib.IEC_CALLBACK) + number, name, _caller(world, f"INDEXOF_{name}", info))


def _error(world: World, symbol: PouSymbol, message: str) -> None:
    world.scope_of(symbol).error(symbol.decl.pos, "attribute", message)


def _function(world: World, symbol: PouSymbol) -> FunctionInfo | None:
    """The function if the runtime can call it."""
    info = world.declared.function(symbol, {})
    if info is None:
        return None
    if info.parameters:
        _error(world, symbol, f"{symbol.decl.name} is called by an event, so it has no inputs and outputs")
        return None
    if info.result not in (None, BOOL, ERROR):
        _error(world, symbol, f"{symbol.decl.name} is called by an event, so its result is a BOOL, or it has none")
        return None
    return info


def _events(world: World, symbol: PouSymbol, names: str) -> Iterator[str]:
    """The events that are listed, each once."""
    known = dict[str, None]()
    for name in (part.strip() for part in names.split(",")):
        written = _BY_KEY.get(name.casefold(), name)
        event = ALIASES.get(written, written)
        if event in EVENTS:
            known[event] = None
        elif event in NOT_CALLED:
            _error(world, symbol, f"no function is called on {event}: {NOT_CALLED[event]}")
        elif not name:
            _error(world, symbol, "name the event: {attribute 'call_on' := 'EVT_StartDone'}")
        else:
            hint = did_you_mean(name, [*EVENTS, *ALIASES])
            _error(world, symbol, f"'{name}' is not an event{hint or '; they are listed in docs/events.md'}")
    yield from known


def _caller(world: World, event: str, info: FunctionInfo) -> Pou:
    """The function that the runtime calls: it hands over the answer of the one in the program."""
    pos = info.pou.pos
    unit = "task_answer__" if event == "EVT_TaskException" else "event_answer__"
    answer = world.names.unit(unit, library=True)
    assert isinstance(answer, PouSymbol)
    answers = world.declared.function(answer, {})
    assert answers is not None
    pou = Pou(event, PouKind.FUNCTION, pos)
    called = Call(info.pou, _arguments(world, info, pos), info.result or NOTHING, pos)
    if info.result != BOOL:
        pou.body = [CallStatement(called, pos), _call(answers, Const(0, BOOL, pos), pos)]
    else:
        pou.body = [_call(answers, called, pos)]
    return pou


def _arguments(world: World, info: FunctionInfo, pos: Pos) -> list[Expr | Place | None]:
    """The event, a filter and an owner, for a function as in CoDeSys 2.3."""
    if not info.parameters:
        return []
    current = world.names.unit("event_current__", library=True)
    assert isinstance(current, PouSymbol)
    function = world.declared.function(current, {})
    assert function is not None
    return [Call(function.pou, [], DWORD, pos), Const(0, DWORD, pos), Const(0, DWORD, pos)]


def _call(answers: FunctionInfo, answer: Call | Const, pos: Pos) -> CallStatement:
    return CallStatement(Call(answers.pou, [answer], BOOL, pos), pos)
