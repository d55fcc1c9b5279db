"""Channels lead to numbers, strings, arrays, structures, and to parts of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from io_support import build, messages

from plctool.sim import Simulator

PROGRAM = """\
TYPE Point : STRUCT x : INT; y : DINT; on : BOOL; END_STRUCT; END_TYPE
TYPE Mode : (Off, Manual, Automatic); END_TYPE
PROGRAM Main
VAR
    b : BOOL; n : LINT; r : LREAL; t : TIME; s : STRING[9]; m : Mode; d : DATE;
    list : ARRAY[0..3] OF INT; bits : ARRAY[1..2] OF BOOL; p : Point; grid : ARRAY[0..1, 0..2] OF Point;
    b2 : BOOL; n2 : LINT; r2 : LREAL; t2 : TIME; s2 : STRING[9]; m2 : Mode; d2 : DATE;
    list2 : ARRAY[0..3] OF INT; bits2 : ARRAY[1..2] OF BOOL; p2 : Point; grid2 : ARRAY[0..1, 0..2] OF Point;
END_VAR
b2 := b; n2 := n; r2 := r; t2 := t; s2 := s; m2 := m; d2 := d; list2 := list; bits2 := bits; p2 := p; grid2 := grid;
END_PROGRAM
"""
VALUES = {
    "b": True, "n": -(1 << 40), "r": 2.5, "t": "T#80ms", "s": "abc", "m": "Manual", "d": "D#2024-02-29",
    "list": [1, -2, 3, 4], "list[2]": 77, "bits[2]": True, "p": {"x": 1, "y": 2, "on": True}, "p.y": 5,
    "grid[1,2].on": True, "grid[0,1]": {"x": 3, "y": 4, "on": False},
}  # fmt: skip


@pytest.mark.parametrize("name", VALUES)
def test_value_goes_from_the_input_to_the_output(tmp_path: Path, name: str) -> None:
    value: Any = VALUES[name]
    root = name.replace("[", ".").split(".")[0]
    copy = root + "2" + name[len(root) :]
    built = build(tmp_path, PROGRAM, f"[sim]\nin = {{ i = 'Main.{name}' }}\nout = {{ o = 'Main.{copy}' }}")
    assert [w.message for w in built.warnings] == []
    with Simulator(built.image, built.symbols) as plc:
        plc.set_input("i", value)
        plc.run_cycles(1)
        assert plc.output("o") == value
        assert plc.read(f"Main.{copy}") == value


def test_device_must_not_have_the_name_of_a_program(tmp_path: Path) -> None:
    found = messages(tmp_path, PROGRAM, "[sim]\nname = 'Main'\nin = { i = 'Main.b' }")
    assert "2: the program has a Main already; give the device another name" in found
    found = messages(tmp_path, PROGRAM, "[sim]\nname = 'Point'")
    assert "2: the program has a Point already; give the device another name" in found
