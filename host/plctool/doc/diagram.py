"""The picture of a block as SVG: a box with its inputs to the left and its outputs to the right."""

from __future__ import annotations

from html import escape

from plctool.doc.model import Item, Variable

_ROW = 22  # pixels
_CHARACTER = 7.3  # width of one in the font
_WIRE = 24
_PAD = 10
_LONGEST = 40  # characters of a type; longer ones are cut
KINDS = ("FUNCTION", "FUNCTION_BLOCK", "PROGRAM", "CLASS", "METHOD")


def has_diagram(item: Item) -> bool:
    """True for what has inputs or outputs."""
    return item.kind in KINDS and bool(item.variables or item.result)


def diagram(item: Item) -> str:
    """Returns the SVG, which takes its colours from the page."""
    left = [*item.of("VAR_INPUT"), *item.of("VAR_IN_OUT")]
    right = [("", item.result)] if item.result else []
    right += [(v.name, v.type) for v in item.of("VAR_OUTPUT")]
    inner = max([width_of(item.name), *(width_of(v.name) for v in left), *(width_of(name) for name, _ in right)])
    both = max((width_of(v.name) for v in left), default=0) + max((width_of(name) for name, _ in right), default=0)
    box = max(inner, both) + 4 * _PAD
    before = max((width_of(_cut(v.type)) for v in left), default=0)
    after = max((width_of(_cut(type_)) for _, type_ in right), default=0)
    x = before + _WIRE + _PAD
    height = _ROW * (max(len(left), len(right)) + 1) + _PAD
    width = x + box + _WIRE + _PAD + after
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" class="diagram" width="{width:.0f}" height="{height + 2}" '
        f'viewBox="0 0 {width:.0f} {height + 2}" role="img" aria-label="{escape(_spoken(item), quote=True)}" '
        'font-family="monospace" font-size="12" fill="currentColor" stroke="none">',
        f'<rect x="{x:.0f}" y="1" width="{box:.0f}" height="{height}" fill="none" stroke="currentColor"/>',
        text_at(x + box / 2, _ROW - 6, item.name, "middle", 'font-weight="bold"'),
    ]
    for row, variable in enumerate(left, 1):
        parts += _input(variable, x, row)
    for row, (name, type_) in enumerate(right, 1):
        parts += _output(name, type_, x + box, row)
    return "\n".join([*parts, "</svg>"])


def width_of(text: str) -> float:
    """Returns the width of a text, pixels."""
    return len(text) * _CHARACTER


def _cut(type_: str) -> str:
    return type_ if len(type_) <= _LONGEST else type_[: _LONGEST - 1] + "…"


def _spoken(item: Item) -> str:
    sides = [("inputs", item.of("VAR_INPUT")), ("in-outs", item.of("VAR_IN_OUT")), ("outputs", item.of("VAR_OUTPUT"))]
    said = [f"{side} {', '.join(v.name for v in variables)}" for side, variables in sides if variables]
    return "; ".join([item.name, *said])


def text_at(x: float, y: float, text: str, anchor: str, more: str = "") -> str:
    """Returns a text of a picture."""
    return f'<text x="{x:.0f}" y="{y:.0f}" text-anchor="{anchor}" {more}>{escape(text)}</text>'


def _input(variable: Variable, x: float, row: int) -> list[str]:
    y = row * _ROW + _ROW / 2
    ends = "" if variable.section == "VAR_INPUT" else ' stroke-dasharray="4 2"'  # an in-out is read and written
    return [
        f'<path d="M{x - _WIRE:.0f} {y:.0f}H{x:.0f}" stroke="currentColor"{ends}/>',
        text_at(x - _WIRE - 4, y + 4, _cut(variable.type), "end", 'opacity="0.7"'),
        text_at(x + _PAD, y + 4, variable.name, "start"),
    ]


def _output(name: str, type_: str, x: float, row: int) -> list[str]:
    y = row * _ROW + _ROW / 2
    return [
        f'<path d="M{x:.0f} {y:.0f}H{x + _WIRE:.0f}" stroke="currentColor"/>',
        text_at(x + _WIRE + 4, y + 4, _cut(type_), "start", 'opacity="0.7"'),
        text_at(x - _PAD, y + 4, name, "end"),
    ]
