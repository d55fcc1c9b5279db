"""What a controller does, as documents: for `--json` and for the page. Imports are late: each start is quick."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, Any

from plctool.errors import DeviceError

if TYPE_CHECKING:
    from plctool.controller import Controller, ExceptionInfo, PlcStatus

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


def tasks(plc: Controller) -> Document:
    """Statistics of the tasks."""
    return {"tasks": [vars(task) for task in plc.tasks()]}


def log(plc: Controller) -> Document:
    """The log; the exception that holds the program at present comes with its source line."""
    from plctool.core import lib

    names = {lib.LOG_INFO: "info", lib.LOG_WARNING: "warning", lib.LOG_ERROR: "error", lib.LOG_EXCEPTION: "exception",
             lib.LOG_DEBUG: "debug"}  # fmt: skip
    entries: list[Document] = [
        {
            "handle": entry.handle,
            "time_s": entry.time_ns / 1e9,
            "component": entry.component,
            "class": names.get(entry.log_class, f"0x{entry.log_class:X}"),
            "error": entry.error,
            "text": entry.text,
        }
        for entry in plc.log()
    ]
    exception = plc.status().exception
    last = next((e for e in reversed(entries) if e["class"] == "exception"), None)
    if exception and exception.file and last:
        known = exception_document(exception)
        last |= {name: known[name] for name in ("pou", "file", "line", "calls", "detail")}
    return {"entries": entries}
