"""What a controller does, as documents: for `--json` and for the page. Imports are late: each start is quick."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from plctool.errors import DeviceError

if TYPE_CHECKING:
    from plctool.controller import Controller, ExceptionInfo, PlcStatus
    from plctool.debug.alarms import Alarm
    from plctool.link.services import LogEntry

Document = dict[str, Any]


def program_document(plc: Controller) -> Document | None:
    """Returns name and version of the program; None from a firmware without application information."""
    with suppress(DeviceError):
        info = plc.info()
        return {"name": info.get("project", ""), "version": info.get("version", "")}
    return None


def status_document(status: PlcStatus) -> Document:
    from plctool.link.services import AppState

    return {
        "state": str(status.state),
        "image_crc": None if status.state is AppState.NONE else f"{status.image_crc:08X}",
        "exception": None if status.exception is None else exception_document(status.exception),
        "forced": status.forced,
        "forbidden": status.forbidden,
    }


def exception_document(exception: ExceptionInfo) -> Document:
    """For machines."""
    return {**vars(exception), "calls": [vars(call) for call in exception.calls]}


def alarm_document(alarm: Alarm) -> Document:
    """For machines. `since`, `age_s`: None if unknown."""
    return {
        "name": alarm.name,
        "state": alarm.state,
        "class": alarm.class_name,
        "priority": alarm.priority,
        "text": alarm.text,
        "since": None if alarm.since is None else alarm.since.isoformat(" ", "milliseconds"),
        "age_s": None if alarm.age_s is None else round(alarm.age_s, 3),
    }


def alarms(plc: Controller, *, all: bool = False) -> Document:
    """The alarms that are active or wait for an acknowledgement, or all."""
    return {"alarms": [alarm_document(alarm) for alarm in plc.alarms(all=all)]}


def tasks(plc: Controller) -> Document:
    """Statistics of the tasks."""
    found = plc.tasks()
    loads = [task.load_percent for task in found if task.load_percent is not None]
    return {"tasks": [vars(task) for task in found], "load_percent": sum(loads) if loads else None}


LOG_CLASSES = ("debug", "info", "warning", "error", "exception")
"""Of log entries, the gravest last; those of LOG_DEBUG .. LOG_EXCEPTION (CmpLog.h)."""


def log(plc: Controller, *, kept: bool = False) -> Document:
    """The log, or the one that outlasts power-off; the exception that holds the program at present comes with its
    source line."""
    return {"entries": log_entries(plc, plc.log(kept=kept))}


def log_entries(plc: Controller, entries: Sequence[LogEntry]) -> list[Document]:
    """Entries of the log of a controller as documents."""
    from plctool.core import lib

    names = {int(getattr(lib, f"LOG_{name.upper()}")): name for name in LOG_CLASSES}
    documents: list[Document] = [
        {
            "handle": entry.handle,
            "time_s": entry.time_ns / 1e9,
            "component": entry.component,
            "class": names.get(entry.log_class, f"0x{entry.log_class:X}"),
            "error": entry.error,
            "text": entry.text,
            "utc": None if entry.utc_ns is None else utc_text(entry.utc_ns),
        }
        | ({} if entry.start is None else {"start": entry.start})
        for entry in entries
    ]
    last = next((e for e in reversed(documents) if e["class"] == "exception"), None)
    exception = plc.status().exception if last else None
    if exception and exception.file and last:
        known = exception_document(exception)
        last |= {name: known[name] for name in ("pou", "file", "line", "calls", "detail")}
    return documents


def utc_text(ns: int) -> str:
    """A moment as users read it, in UTC; `ns` since 1970-01-01."""
    from datetime import UTC, datetime, timedelta

    try:
        moment = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=ns // 1000)
    except OverflowError:  # a clock that was set to nonsense
        return f"{ns // 10**9} s after 1970"
    return moment.replace(tzinfo=None).isoformat(" ", "milliseconds")


def follow_log(plc: Controller, *, kept: bool = False) -> Iterator[list[LogEntry]]:
    """Yields the entries of the controller, then each time those that were added since, perhaps none. A controller
    that restarts begins a new log, which is noticed by its first entries."""
    last: LogEntry | None = None
    while True:
        entries = plc.log(last.handle - 1 if last else 0, kept=kept)
        if last is not None and entries and entries[0] == last:
            entries = entries[1:]
        elif last is not None and (not entries or entries[0].handle <= last.handle):
            entries = plc.log(kept=kept)
        last = entries[-1] if entries else last
        yield entries
