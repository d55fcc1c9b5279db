"""Alarms of a program: the instances of ALARM, found by the symbols, and their common history (stdlib/alarms.st).

A device knows nothing of alarms: they are read and acknowledged as variables.
"""

from __future__ import annotations

import fnmatch
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from plctool.debug.symbols import SymbolTable
from plctool.debug.variables import Symbol
from plctool.errors import UsageError
from plctool.iec.types import ArrayType, StructType, Type

HISTORY, RUN = "AlarmHistory", "AlarmRun__"  # what the alarms of a program share
NOW = "now"
CONFIRM = "Confirm__"  # a tool acknowledges with it
_READ = ("State", "Since", "Id__", "Class", "Text")
_MEMBERS = frozenset((*_READ, "Condition", "Active", CONFIRM))
_2000_NS = 946_684_800 * 10**9  # what is less counts from the start of the device
_WAITING = frozenset(("UNACKNOWLEDGED", "RETURNED"))
_CLOSED = frozenset(("NORMAL", "SUPPRESSED"))


@dataclass(frozen=True)
class Alarm:
    """An alarm as it is now. `state`: a name of ALARM_STATE. `since`: when it came into this state, if the program
    knows the time of day; `age_s`: how long it has been in it, None if that is unknown. `id`: as events name it."""

    name: str
    state: str
    text: str
    class_name: str
    priority: int
    since: datetime | None
    age_s: float | None
    id: int

    @property
    def is_open(self) -> bool:
        """True if it is active or waits for an acknowledgement."""
        return self.state not in _CLOSED

    @property
    def waits(self) -> bool:
        """True if it waits for an acknowledgement."""
        return self.state in _WAITING


@dataclass(frozen=True)
class AlarmEvent:
    """A change of state in the history. `name` is that of the alarm, "16#..." if the program has it no more. `start`:
    the number of the start of the program in which it happened; `at`: the time of day, or None; `time_s`: otherwise
    the seconds since the device had started."""

    name: str
    before: str
    state: str
    start: int
    at: datetime | None
    time_s: float


@dataclass(frozen=True)
class History:
    """The events that the controller still has, oldest first. `count`: of all that there have been."""

    events: list[AlarmEvent]
    count: int


def alarms_in(table: SymbolTable) -> dict[str, Symbol]:
    """The instances of ALARM, and of blocks that extend it, by their names."""
    known: dict[str, bool] = {}
    return {a.name: a for s in table.variables.values() if "%" not in s.name for a in _alarms(s, known)}


def _alarms(symbol: Symbol, known: dict[str, bool]) -> Iterator[Symbol]:
    t = symbol.type
    if not _has_alarms(t, known):
        return
    if _is_alarm(t):
        yield symbol
    parts = symbol.parts()
    if isinstance(t, StructType):
        parts = (symbol.member(f) for f in t.fields if _has_alarms(f.type, known))
    for part in parts:
        yield from _alarms(part, known)


def _has_alarms(t: Type, known: dict[str, bool]) -> bool:
    if isinstance(t, ArrayType):
        return _has_alarms(t.element, known)
    if not isinstance(t, StructType):
        return False
    if t.name not in known:
        known[t.name] = False  # of what contains itself by a pointer
        known[t.name] = _is_alarm(t) or any(_has_alarms(f.type, known) for f in t.fields)
    return known[t.name]


def _is_alarm(t: Type) -> bool:
    return isinstance(t, StructType) and {f.name for f in t.fields} >= _MEMBERS


def need_alarms(table: SymbolTable) -> dict[str, Symbol]:
    """The same. Raises UsageError if the program has none."""
    found = alarms_in(table)
    if not found:
        raise UsageError("The program has no instances of ALARM (docs/alarms.md).", "no-alarms")
    return found


def shared(table: SymbolTable, name: str) -> Symbol:
    """What all alarms share. If the program has a variable of its own with the name, it is called otherwise."""
    own = f"Standard.{name}"
    return table.variables[own] if own in table.variables else table.resolve(name)


def now_of(table: SymbolTable) -> Symbol:
    """The time of the last cycle with an alarm, in ns since the start of the device."""
    return member(shared(table, RUN), "Now")


def member(alarm: Symbol, name: str) -> Symbol:
    """A member of an instance of ALARM."""
    assert isinstance(alarm.type, StructType)
    field = alarm.type.member(name)
    assert field is not None
    return alarm.member(field)


def variables_of(alarms: Mapping[str, Symbol]) -> dict[str, Symbol]:
    """What is read of alarms: by the name of the alarm and the member."""
    return {f"{name}.{part}": member(alarm, part) for name, alarm in alarms.items() for part in _READ}


def alarm_of(name: str, values: Mapping[str, Any], now_ns: int) -> Alarm:
    """An alarm from the values of its variables. `now_ns`: what the controller has as NOW."""
    state, since, id, class_, text = (values[f"{name}.{part}"] for part in _READ)
    at = time_of(since)
    age = None if at is not None or since > now_ns else (now_ns - since) / 1e9
    return Alarm(name, str(state), text, class_["Name"], class_["Priority"], at, age, id)


def in_order(alarms: Sequence[Alarm]) -> list[Alarm]:
    """As operators want them: what waits first, then by priority and name."""
    return sorted(alarms, key=lambda alarm: (not alarm.is_open, not alarm.waits, alarm.priority, alarm.name))


def time_of(ns: int) -> datetime | None:
    """The time of day of an event; None if it counts from the start of the device."""
    return datetime.fromtimestamp(ns / 1e9, UTC).replace(tzinfo=None) if ns >= _2000_NS else None


def history_of(value: Mapping[str, Any], names: Mapping[int, str]) -> History:
    """The history from the value of AlarmHistory. `names`: of alarms by Id. The order is that of the events: the ring
    has another one when its size has changed."""
    count, entries = value["Count"], value["Events"]
    first = count % len(entries)
    ring = [entry for entry in entries[first:] + entries[:first] if entry["Start"]]
    ring.sort(key=lambda entry: (entry["Start"], entry["Time"]))
    return History([_event(entry, names) for entry in ring], count)


def _event(entry: Mapping[str, Any], names: Mapping[int, str]) -> AlarmEvent:
    name = names.get(entry["Id"], f"16#{entry['Id']:08X}")
    at = time_of(entry["Time"])
    return AlarmEvent(name, str(entry["Before"]), str(entry["State"]), entry["Start"], at, entry["Time"] / 1e9)


def chosen(names: Sequence[str], alarms: Mapping[str, Symbol]) -> list[str]:
    """The alarms of names and patterns. Raises UsageError for one that matches none."""
    found: dict[str, None] = {}
    for name in names:
        pattern = name.strip().casefold().replace("[", "[[]")
        matching = [alarm for alarm in alarms if fnmatch.fnmatchcase(alarm.casefold(), pattern)]
        if not matching:
            raise UsageError(f"There is no alarm {name}; 'plctool alarms --all' lists them.", "no-alarm")
        found |= dict.fromkeys(matching)
    return list(found)
