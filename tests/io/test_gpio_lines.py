"""More lines than one group has are on several devices, and no line is used twice."""

from __future__ import annotations

from pathlib import Path

import pytest
from io_support import build, configuration, messages

PROGRAM = "PROGRAM Main\nVAR a, b, c : BOOL; END_VAR\nc := a AND b;\nEND_PROGRAM\n"
LONG = "ABCDEFGHIJKLMNOPQRSTUVWXYZ12345"
DEVICE = "[gpio]\nin = { A = 'P1', B = 'P2' }\nout = { C = 'P3' }\n"


def test_lines_beyond_one_group_have_devices_whose_names_differ(tmp_path: Path) -> None:
    lines = "\n".join(f"L{i} = '%IX{i // 8}.{i % 8}'" for i in range(70))
    built = build(tmp_path, PROGRAM, f"[gpio]\nname = '{LONG}'\n[gpio.in]\n{lines}")
    names = [c.name for c in configuration(built).connectors]
    assert names == [LONG, f"{LONG[:29]}_2", f"{LONG[:29]}_3"]
    assert [d["name"] for d in built.symbols.io["devices"]] == names


def test_name_that_a_device_has_by_its_number_is_reported(tmp_path: Path) -> None:
    lines = "\n".join(f"L{i} = '%IX{i // 8}.{i % 8}'" for i in range(33))
    found = messages(tmp_path, PROGRAM, f"[[gpio]]\nname = 'G'\n[gpio.in]\n{lines}\n[[sim]]\nname = 'G_2'")
    assert "38: there is a device G_2 in line 2 already; give it another name" in found


@pytest.mark.parametrize("names", [("A", "B"), ("", "")])
@pytest.mark.parametrize("device", ["", DEVICE])
def test_line_of_two_tables_is_a_mistake(tmp_path: Path, names: tuple[str, str], device: str) -> None:
    first, second = (f"name = '{name}'" if name else "" for name in names)
    text = f"[[gpio]]\n{first}\nin = {{ A = 'Main.a' }}\n[[gpio]]\n{second}\nin = {{ B = 'Main.b', A = 'Main.b' }}\n"
    found = messages(tmp_path, PROGRAM, text, device)
    assert any(m.startswith(f"6: A is the line {'P1' if device else 'A'}, which") and "line 3" in m for m in found), (
        found
    )


def test_line_of_a_table_that_is_not_enabled_is_free(tmp_path: Path) -> None:
    text = "[[gpio]]\nname = 'X'\nenabled = false\nin = { A = 'Main.a' }\n[[gpio]]\nname = 'Y'\nin = { A = 'Main.b' }\n"
    assert messages(tmp_path, PROGRAM, text) == []
