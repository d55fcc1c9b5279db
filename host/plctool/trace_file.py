"""Values of variables over time, as a CSV file for spreadsheets and plots."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from math import ceil
from typing import TYPE_CHECKING, Any

from plctool.core import lib
from plctool.debug.variables import ClassType, Reading, Symbol

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
