"""Flashing over a line that loses, doubles and flips one byte in a thousand: it succeeds, and what runs is what was
sent."""

import pytest

import plctool
from plctool.testing.line import Damage, SerialLine

TABLE = """
PROGRAM Main
VAR
    table : ARRAY[0..255] OF UDINT;
    i : UDINT;
    sum : UDINT;
END_VAR
{body}
    sum := 0;
    FOR i := 0 TO 255 DO
        sum := sum + table[i] * (i + 1);
    END_FOR;
END_PROGRAM
"""


def program() -> tuple[str, int]:
    """A program of some 8 KB whose result shows whether every statement arrived."""
    values = [(i * 2654435761 + 12345) % (1 << 32) for i in range(256)]
    body = "\n".join(f"table[{i}] := {value} + i * 0;" for i, value in enumerate(values))
    return TABLE.format(body=body), sum(v * (i + 1) for i, v in enumerate(values)) % (1 << 32)


@pytest.mark.parametrize(
    "damage",
    [
        Damage(lose=0.001, seed=1),
        Damage(double=0.001, seed=2),
        Damage(flip=0.001, seed=3),
        Damage(0.001, 0.001, 0.001, 4),
    ],
    ids=["lost", "doubled", "flipped", "all"],
)
def test_flash_over_a_line_with_damaged_bytes_runs_what_was_sent(tool, plcrt, eventually, damage):
    text, expected = program()
    image = tool.build("table", text)
    with SerialLine(plcrt.port, damage=damage) as line, plctool.connect(f"serial:{line.path}") as plc:
        plc.flash(image)
        assert int(plc.status().image_crc) == int.from_bytes(image.read_bytes()[100:104], "little")
        assert eventually(lambda: plc.read("Main.sum")) == expected
