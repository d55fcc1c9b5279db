"""Sequential Function Charts as SVG: steps below each other, transitions between them, a jump where a line leads back.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterator
from html import escape

from plctool.compiler.syntax import ast
from plctool.doc.diagram import text_at, width_of
from plctool.doc.drawn import ChartBody
from plctool.doc.monitor import Monitor

_STEP = 30  # height of a step
_LINE = 18  # of an action
_GAP = 80  # between two rows of steps
_BETWEEN = 40  # between columns
_MARGIN = 20
_BAR = 12  # half of the bar of a transition


class ChartPicture:
    """The picture of a chart."""

    def __init__(self, body: ChartBody, monitor: Monitor) -> None:
        self._body = body
        self._monitor = monitor
        self._steps = {s.name.casefold(): s for s in body.chart.steps}
        self._row = self._rows()
        self._x: dict[str, float] = {}
        self._y: dict[str, float] = {}
        self.width = self.height = 0.0
        self._place()

    def _rows(self) -> dict[str, int]:
        """The row of each step: one after the nearest step before it."""
        first = [key for key, step in self._steps.items() if step.initial] or list(self._steps)[:1]
        rows, waiting = dict.fromkeys(first, 0), list(first)
        for key in waiting:
            for transition in self._body.chart.transitions:
                if key in _keys(transition.sources):
                    for target in _keys(transition.targets):
                        if target in self._steps and target not in rows:
                            rows[target] = rows[key] + 1
                            waiting.append(target)
        last = max(rows.values(), default=0) + 1
        return rows | {key: last for key in self._steps if key not in rows}

    def _place(self) -> None:
        y = float(_MARGIN)
        for row in range(max(self._row.values(), default=0) + 1):
            x, height = float(_MARGIN), float(_STEP)
            for key in [k for k in self._steps if self._row[k] == row]:
                self._x[key], self._y[key] = x, y
                x += self._width(key) + _BETWEEN
                height = max(height, _LINE * len(self._steps[key].actions))
            self.width = max(self.width, x)
            y += height + _GAP
        self.height = y

    def _own(self, key: str) -> list[tuple[ast.Transition, str]]:
        """The transitions that leave a step, of several sources the first; with their conditions."""
        pairs = zip(self._body.chart.transitions, self._body.conditions, strict=True)
        return [(t, text) for t, text in pairs if next(iter(_keys(t.sources)), "") == key]

    def _width(self, key: str) -> float:
        step = self._steps[key]
        actions = max((width_of(_action(a)) + 20 for a in step.actions), default=0)
        ways = sum(self._way_width(t, text) for t, text in self._own(key))
        return max(self._box(key) + actions, ways)

    def _box(self, key: str) -> float:
        return width_of(self._steps[key].name) + 30

    def _way_width(self, transition: ast.Transition, text: str) -> float:
        return max(width_of(text), width_of(" ".join(name for _, name in transition.targets))) + 2 * _BAR + 30

    def parts(self) -> Iterator[str]:
        """The elements."""
        for key in self._steps:
            yield from self._drawn_step(key)
            at = self._x[key] + self._box(key) / 2
            for transition, text in self._own(key):
                yield from self._transition(transition, text, at)
                at += self._way_width(transition, text)

    def _drawn_step(self, key: str) -> Iterator[str]:
        step, x, y, width = self._steps[key], self._x[key], self._y[key], self._box(key)
        name = self._monitor.names.get(("", step.name), "")
        live = f' class="step" data-variable="{escape(name, quote=True)}"' if name else ""
        active = self._monitor.values.get(name) == "TRUE"
        fill = ' fill="#3a3" fill-opacity="0.4"' if active else ' fill="none"'
        yield f'<rect x="{x:.0f}" y="{y:.0f}" width="{width:.0f}" height="{_STEP}" stroke="currentColor"{fill}{live}/>'
        if step.initial:
            inner = f'x="{x + 3:.0f}" y="{y + 3:.0f}" width="{width - 6:.0f}" height="{_STEP - 6}"'
            yield f'<rect {inner} fill="none" stroke="currentColor"/>'
        yield text_at(x + width / 2, y + _STEP / 2 + 4, step.name, "middle", 'font-weight="bold"')
        for number, action in enumerate(step.actions):
            yield text_at(x + width + 10, y + _LINE * number + 14, _action(action), "start")

    def _transition(self, transition: ast.Transition, text: str, x: float) -> Iterator[str]:
        sources = [key for key in _keys(transition.sources) if key in self._steps]
        bottom = max(self._y[key] for key in sources) + _STEP
        bar = bottom + 30
        for key in sources:
            middle = self._x[key] + self._box(key) / 2
            yield _line(f"M{middle:.0f} {self._y[key] + _STEP:.0f}V{bottom + 12:.0f}H{x:.0f}V{bar:.0f}")
        yield f'<path d="M{x - _BAR:.0f} {bar:.0f}h{2 * _BAR}" stroke="currentColor" stroke-width="3"/>'
        yield text_at(x + _BAR + 6, bar + 4, text, "start")
        row, back = max(self._row[key] for key in sources), []
        for _, name in transition.targets:
            key = name.casefold()
            if self._row.get(key) == row + 1:
                middle = self._x[key] + self._box(key) / 2
                yield _line(f"M{x:.0f} {bar:.0f}V{self._y[key] - 16:.0f}H{middle:.0f}V{self._y[key]:.0f}")
            else:
                back.append(name)
        if back:
            yield _line(f"M{x:.0f} {bar:.0f}v16")
            yield text_at(x, bar + 30, f"\N{RIGHTWARDS ARROW} {', '.join(back)}", "middle")


def _keys(steps: list[tuple[int, str]]) -> list[str]:
    return [name.casefold() for _, name in steps]


def _action(action: ast.StepAction) -> str:
    return f"{action.qualifier} {action.name}"


def _line(path: str) -> str:
    return f'<path d="{path}" fill="none" stroke="currentColor"/>'
