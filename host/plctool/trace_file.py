"""Values of variables over time, as a file: CSV for spreadsheets, JSON, a page that opens offline, a picture."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator, Sequence
from importlib.resources import files
from math import ceil, isfinite, nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plctool.core import lib
from plctool.debug.recording import Recording, number_reader
from plctool.debug.variables import ClassType, Reading, Symbol
from plctool.errors import UsageError
from plctool.files import STDOUT
from plctool.link.traces import columns_of

if TYPE_CHECKING:
    from plctool.sim import Simulator

_STEP_MS = 10  # between two lines if the first task is not cyclic


def trace_csv(plc: Simulator, names: Sequence[str], cycles: int | None, time_ms: float | None) -> Iterator[str]:
    """Lets a program run, and gives the lines of the file: names, and after each cycle of the first task (with
    `time_ms`: of those in this time) the virtual time and the values. Structures and arrays have a column for
    each value, BOOL is 0 or 1, and what a pointer does not lead to is empty. Ends with the line after which the program
    has stopped with an exception."""
    table = plc.symbols()
    columns = table.scalars(names)
    yield csv_line(["time_ms", *columns])
    for _ in _cycles(plc, cycles or 1) if time_ms is None else _intervals(plc, time_ms):
        yield csv_line([f"{plc.now_ns / 1e6:.10g}", *csv_cells(plc.sample_symbols(table, columns))])
        if plc.raw_status().exception:
            return


def run_recorded(
    plc: Simulator, names: Sequence[str], cycles: int | None, time_ms: float | None, recording: Recording
) -> None:
    """The same for the other files: adds to a recording, which `recording_of` begins."""
    table = plc.symbols()
    symbols = {column.name: column.symbol for column in recording.columns if column.symbol}
    readers = [number_reader(column) for column in recording.columns]
    for _ in _cycles(plc, cycles or 1) if time_ms is None else _intervals(plc, time_ms):
        contents = plc.sample_symbols(table, symbols).contents
        recording.times_ns.append(plc.now_ns)
        for name, values, reader in zip(symbols, recording.values, readers, strict=True):
            content = contents[name]
            values.append(nan if content is None else reader(content))
        if plc.raw_status().exception:
            return
    recording.complete = True


def recording_of(plc: Simulator, names: Sequence[str]) -> Recording:
    """An empty one. Raises UsageError for what has no place in a plot, such as a string."""
    columns = columns_of(plc.symbols(), names)
    if any(column.symbol is None for column in columns):
        raise UsageError("The system values of tasks are for 'plctool trace'; name variables.", "usage")
    tasks = plc.tasks()
    name, interval_us = (tasks[0].name, tasks[0].interval_us) if tasks else ("", 0)
    return Recording(name, interval_us, columns, values=[[] for _ in columns])


# ---- files -----------------------------------------------------------------------------------------------------------

FORMATS = (".csv", ".json", ".html", ".png")


def check_format(path: Path) -> None:
    """Raises UsageError if no file of a trace has this name, or what makes it is not installed."""
    if path != STDOUT and path.suffix.lower() not in FORMATS:
        raise UsageError(f"{path} is no file of a trace: name it .csv, .json, .html or .png.", "bad-output")
    if path.suffix.lower() == ".png":
        try:
            import matplotlib  # noqa: F401
        except ImportError:
            raise UsageError(
                "PNG files need matplotlib. Name the file .html, which needs nothing, or install plctool with pip:"
                " pip install 'plctool[plot]'. The Debian package does not contain matplotlib.",
                "no-matplotlib",
            ) from None


def render(recording: Recording, path: Path) -> bytes:
    """The content of a file of a recording, by the end of its name; - is CSV."""
    suffix = path.suffix.lower()
    if suffix == ".json":
        return (json.dumps(finite_document(recording)) + "\n").encode()
    if suffix == ".html":
        return _html(recording).encode()
    if suffix == ".png":
        return _png(recording)
    head = csv_line(["time_ms", *recording.names])
    return "".join([head, *map(csv_line, recording.rows())]).encode()


def finite_document(recording: Recording) -> dict[str, Any]:
    """For machines, in JSON."""
    document: dict[str, Any] = _finite(recording.document())
    return document


def _finite(value: Any) -> Any:
    """JSON has no NAN and no infinity: null."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not isfinite(value) else value


def _html(recording: Recording) -> str:
    """One file with everything in it. No name of a variable can end the script that has it."""
    page = (files("plctool") / "trace_page" / "page.html").read_text(encoding="utf-8")
    data = json.dumps(finite_document(recording)).replace("<", "\\u003c")
    return page.replace("@DATA@", data)


def _png(recording: Recording) -> bytes:
    from matplotlib.figure import Figure

    count = len(recording.columns)
    figure = Figure(figsize=(10, 1.5 + 1.5 * count), layout="constrained")
    axes = figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0]
    for axis, column, values in zip(axes, recording.columns, recording.values, strict=True):
        axis.plot(recording.times_ms, values, drawstyle="steps-post" if column.is_bool else "default", linewidth=1)
        axis.set_title(column.name + (f" [{column.unit}]" if column.unit else ""), loc="left", fontsize="small")
        axis.grid(alpha=0.3)
        if recording.trigger is not None:
            axis.axvline(0, linestyle="--", linewidth=1, color="tab:orange")
    axes[-1].set_xlabel("ms")
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=100)
    return content.getvalue()


def _cycles(plc: Simulator, count: int) -> Iterator[None]:
    for _ in range(count):
        plc.run_cycles(1, check=False)
        yield


def _intervals(plc: Simulator, time_ms: float) -> Iterator[None]:
    end = plc.now_ns / 1e6 + time_ms
    first = plc.tasks()[:1]
    if first and first[0].kind == lib.KIND_CYCLIC:
        yield from _cycles(plc, ceil(time_ms * 1000 / first[0].interval_us))
        plc.run_for(max(0.0, end - plc.now_ns / 1e6), check=False)
        return
    while (left := end - plc.now_ns / 1e6) > 0:
        plc.run_for(min(_STEP_MS, left), check=False)
        yield


def csv_cells(reading: Reading) -> Iterator[str]:
    """Returns the values of a reading, a cell each."""
    parts = (reading.symbols, reading.contents, reading.values, reading.texts)
    return map(_cell, *(part.values() for part in parts))


def csv_line(cells: Sequence[str]) -> str:
    """Returns a line of a CSV file."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(cells)
    return text.getvalue()


def _cell(column: Symbol, content: bytes | None, value: Any, text: str) -> str:
    """Numbers as such, so that they can be plotted; all else as ST writes it. Only an interface variable that leads to
    nothing has a value, NULL."""
    if content is None and not isinstance(column.type, ClassType):
        return ""
    if isinstance(value, bool):
        return str(int(value))
    return str(value) if isinstance(value, int | str) else text
