"""A recording as a plot of characters, for a terminal: a strip for each column, of dots in Braille characters."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import isfinite

from plctool.debug.recording import Column, Recording

_BLANK = 0x2800
_DOTS = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))  # by column and row of a character
_MARGIN = 11  # characters for the numbers on the left
_LEAST_WIDTH = 20
_HEIGHT = 5  # rows of a strip; of a BOOL 1


def plot(recording: Recording, width: int, height: int = 0) -> str:
    """Lines of at most `width` characters; with `height`, at most so many if that leaves a row for each column."""
    across = max(_LEAST_WIDTH, width - _MARGIN)
    count = sum(not column.is_bool for column in recording.columns)
    bools = len(recording.columns) - count
    rows = _HEIGHT
    if height and count:
        rows = min(_HEIGHT, max(1, (height - 2 * bools - count - 2) // count))
    lines: list[str] = []
    for column, values in zip(recording.columns, recording.values, strict=True):
        lines += _strip(column, values, recording.times_ms, across, 1 if column.is_bool else rows)
    return "\n".join([*lines, _axis(recording, across)])


def _strip(
    column: Column, values: Sequence[int | float], times: Sequence[float], width: int, rows: int
) -> Iterator[str]:
    """A line with the name and the newest value, and the plot."""
    finite = [v for v in values if isfinite(v)]
    low, high = (min(finite), max(finite)) if finite else (0.0, 0.0)
    if column.is_bool:
        low, high = 0, 1
    unit = f" [{column.unit}]" if column.unit else ""
    newest = column.text(values[-1]) if values else "-"
    yield f"{column.name}{unit} = {newest}"
    for row, line in enumerate(_dots(values, times, low, high, width, rows)):
        label = _label(high) if row == 0 and rows > 1 else _label(low) if row == rows - 1 and rows > 1 else ""
        yield f"{label:>{_MARGIN - 1}} {line}".rstrip()


def _dots(
    values: Sequence[int | float], times: Sequence[float], low: float, high: float, width: int, rows: int
) -> list[str]:
    cells = [[0] * width for _ in range(rows)]
    begin, span = (times[0], times[-1] - times[0]) if times else (0.0, 0.0)
    last = None
    for time, value in zip(times, values, strict=True):
        if not isfinite(value):
            last = None
            continue
        x = min(2 * width - 1, int((time - begin) / span * (2 * width - 1))) if span else 0
        share = (value / 2 - low / 2) / (high / 2 - low / 2) if high > low else 0.5  # halves: a range may be infinite
        y = 4 * rows - 1 - round(share * (4 * rows - 1))
        for px, py in _line(last, (x, y)):
            cells[py // 4][px // 2] |= _DOTS[px % 2][py % 4]
        last = (x, y)
    return ["".join(chr(_BLANK + cell) for cell in row) for row in cells]


def _line(begin: tuple[int, int] | None, end: tuple[int, int]) -> Iterator[tuple[int, int]]:
    """The dots from one to the other."""
    if begin is None:
        yield end
        return
    length = max(abs(end[0] - begin[0]), abs(end[1] - begin[1]), 1)
    for i in range(1, length + 1):
        yield tuple(round(a + (b - a) * i / length) for a, b in zip(begin, end, strict=True))  # type: ignore[misc]


def _label(number: float) -> str:
    return f"{number:.6g}"[: _MARGIN - 1]


def _axis(recording: Recording, width: int) -> str:
    times = recording.times_ms
    if not times:
        return f"{'':{_MARGIN}}no samples"
    begin, end = f"{times[0]:.6g} ms", f"{times[-1]:.6g} ms"
    return f"{'':{_MARGIN}}{begin}{end:>{max(1, width - len(begin))}}"
