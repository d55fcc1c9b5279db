"""An image with inputs and outputs says for which board it was described, if that is known."""

from __future__ import annotations

from pathlib import Path

import pytest
from io_support import configuration, messages

from plctool.compiler import IoFiles, compile_sources

PROGRAM = "PROGRAM Main\nVAR start : BOOL; END_VAR\nEND_PROGRAM\n"
DESCRIPTION = "[[sim]]\noptional = true\nin = { button = 'Main.start' }\n"
DEVICE = "name = 'IO-16'\ntarget = 'cortex-m3'\n"


def board_in(folder: Path, device: str, target: str | None, board: str | None) -> str:
    (folder / "main.st").write_text(PROGRAM)
    (folder / "main.io.toml").write_text(DESCRIPTION)
    (folder / "device.toml").write_text(device)
    io = IoFiles(device=folder / "device.toml" if device else None)
    return configuration(compile_sources([folder / "main.st"], io=io, target=target, board=board)).board


@pytest.mark.parametrize(
    ("device", "target", "board", "expected"),
    [
        ("", None, None, ""),
        ("", "cortex-m3", None, ""),
        ("", None, "mps2-an385/full", "MPS2 AN385"),
        ("", None, "plcrt", ""),  # a program, which runs on any board
        (DEVICE, None, None, "IO-16"),
        (DEVICE, "x86_64-linux", None, ""),  # for the simulator
        ("name = 'Press 4'", "x86_64-linux", None, "Press 4"),
        ("vendor = 'Acme'", None, None, ""),
        (DEVICE, None, "mps2-an385/full", "IO-16"),  # that of the description; the other one has the limits
    ],
)
def test_board_is_that_of_the_device_file_or_of_the_command_line(
    tmp_path: Path, device: str, target: str | None, board: str | None, expected: str
) -> None:
    assert board_in(tmp_path, device, target, board) == expected


@pytest.mark.parametrize("name", ["n" * 32, "Presse für Böden"])
def test_board_has_a_name_that_an_image_has_room_for(tmp_path: Path, name: str) -> None:
    said = "device.toml:1: name is what the firmware calls itself, at most 31 ASCII characters"
    assert messages(tmp_path, PROGRAM, DESCRIPTION, f"name = '{name}'")[0] == said
