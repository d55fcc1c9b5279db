"""Draws the pictures of docs/canopen.md: python docs/make_canopen_svg.py"""

from __future__ import annotations

from pathlib import Path
from xml.sax.saxutils import escape

FOLDER = Path(__file__).parent
STYLE = (
    "text{font:13px sans-serif;fill:#222}.s{font-size:11px;fill:#555}"
    "rect{fill:#f4f7fb;stroke:#456;rx:6}.own{fill:#dcecdc}path{stroke:#456;fill:none}.bus{stroke:#a52;stroke-width:4}"
)
ARROW = (
    '<marker id="a" orient="auto" markerWidth="8" markerHeight="8" refX="7" refY="3">'
    '<path d="M0,0L7,3L0,6z" style="fill:#456"/></marker>'
)


def box(x: int, y: int, width: int, title: str, lines: tuple[str, ...] = (), kind: str = "") -> str:
    """A rectangle with a title and smaller lines."""
    height = 26 + 15 * len(lines)
    texts = [f'<text x="{x + width // 2}" y="{y + 18}" text-anchor="middle">{escape(title)}</text>']
    texts += [
        f'<text class="s" x="{x + width // 2}" y="{y + 34 + 15 * n}" text-anchor="middle">{escape(line)}</text>'
        for n, line in enumerate(lines)
    ]
    return f'<rect class="{kind}" x="{x}" y="{y}" width="{width}" height="{height}"/>' + "".join(texts)


def arrow(path: str, text: str = "", x: int = 0, y: int = 0) -> str:
    """A line with a point, and a text beside it."""
    return f'<path d="{path}" marker-end="url(#a)"/><text class="s" x="{x}" y="{y}">{escape(text)}</text>'


def write(name: str, width: int, height: int, parts: list[str]) -> None:
    """A picture of a file."""
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}"><style>{STYLE}</style>'
    body = "\n".join([f"{head}<defs>{ARROW}</defs>", *parts, "</svg>", ""])
    (FOLDER / name).write_text(body)


def line() -> None:
    """The network of examples/canopen."""
    nodes = (
        ("Drive1, node 5", ("drive.eds", "position, target")), ("Drive2, node 6", ("drive.eds", "position, target")),
        ("Valves, node 9", ("valves.eds", "light barriers, lamp")), ("Panel, node 20", ("panel.eds", "run, speed")),
    )  # fmt: skip
    parts = [
        box(20, 10, 200, "Line, node 127", ("manager: line.st", "SYNC each 10 ms"), "own"),
        box(520, 10, 200, "plctool", ("flashes and watches both PLCs",)),
        '<path class="bus" d="M20,100H720"/><path d="M120,66V100M620,51V100"/>',
    ]
    for number, (title, lines) in enumerate(nodes):
        x = 20 + 180 * number
        parts += [f'<path d="M{x + 80},100V130"/>', box(x, 130, 160, title, lines, "own" if number == 3 else "")]
    write("canopen-line.svg", 740, 200, parts)


def states() -> None:
    """A node's life under the manager."""
    steps = (
        ("reset", ("NMT 82h, boot-up",)), ("identify", ("1000h, 1018h",)), ("configure", ("set, PDO mapping",)),
        ("start", ("NMT 01h",)), ("operational", ("PDOs, heartbeat",)),
    )  # fmt: skip
    parts = []
    for number, (title, lines) in enumerate(steps):
        x = 10 + 150 * number
        parts.append(box(x, 60, 120, title, lines, "own" if number == len(steps) - 1 else ""))
        parts += [arrow(f"M{x - 30},80H{x}")] if number else []
    parts += [
        arrow("M670,60V25H70V60", "lost: no heartbeat, PDO late, restarted", 270, 18),
        arrow("M220,101V140H70V101", "wrong or refused: again after 1, 2, 4, 8, 8 .. s", 80, 155),
        '<path d="M370,101V140H220"/>',
    ]
    write("canopen-states.svg", 740, 170, parts)


if __name__ == "__main__":
    line()
    states()
