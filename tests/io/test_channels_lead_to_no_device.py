"""A channel leads to a variable of the program, not to what a device is or reports."""

from __future__ import annotations

from pathlib import Path

import pytest
from io_support import addresses, build, messages

PROGRAM = "PROGRAM Main VAR x : BOOL; END_VAR x := NOT x; END_PROGRAM\n"
OTHER = '[[sim]]\nname = "Other"\n[sim.in]\n'


@pytest.mark.parametrize(("channel", "message"), [
    ('in]\nlevel = "Bench"', "Bench is the device itself"),
    ('in]\n"Main.x" = "bench"', "bench is the device itself"),
    ('in]\nlevel = "Devices.Bench"', "Devices.Bench is the device itself"),
    ('in]\nlevel = "Bench.ok"', "Bench.ok is what a device reports"),
    ('out]\nlevel = "Bench.ok"', "Bench.ok is what a device reports"),
    ('in]\nlevel = "Other.ok"', "Other.ok is what a device reports"),
    ('out]\nlevel = "Other"', "Other is a device"),
])  # fmt: skip
def test_channel_that_leads_to_a_device_is_refused(tmp_path: Path, channel: str, message: str) -> None:
    description = f'[[sim]]\nname = "Bench"\n[sim.{channel}\n{OTHER}'
    assert messages(tmp_path, PROGRAM, description) == [f"4: {message}; name a variable such as Main.x"]


def test_device_that_the_program_declares_is_one_as_well(tmp_path: Path) -> None:
    program = f"VAR_GLOBAL Bench : IO_DEVICE; END_VAR\n{PROGRAM}"
    found = messages(tmp_path, program, '[[sim]]\nname = "Bench"\n[sim.in]\nlevel = "Bench"\n')
    assert found == ["4: Bench is the device itself; name a variable such as Main.x"]


def test_an_output_may_show_whether_another_device_is_well(tmp_path: Path) -> None:
    description = f'[[sim]]\nname = "Bench"\n[sim.out]\nlamp = "Other.ok"\n{OTHER}'
    assert addresses(build(tmp_path, PROGRAM, description))["Other.ok"].startswith("%QX")
