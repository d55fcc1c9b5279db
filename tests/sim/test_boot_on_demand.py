"""A program that is flashed without becoming the boot project, in the simulator."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from plctool.compiler import compile_sources
from plctool.compiler.image.build import BuildResult
from plctool.sim import Simulator


def built(folder: Path, number: int) -> BuildResult:
    source = folder / f"{number}.st"
    source.write_text(f"PROGRAM Main VAR number : INT := {number}; n : INT; END_VAR n := n + 1; END_PROGRAM")
    return compile_sources([source])


@pytest.fixture
def plc(tmp_path: Path) -> Iterator[Simulator]:
    """The second program runs, the first one starts at power-up."""
    first, second = built(tmp_path, 1), built(tmp_path, 2)
    with Simulator(first.image) as plc:
        plc.run_for(seconds=6)
        plc.flash(second.image, boot=False)
        plc.add_symbols(first.symbols)
        plc.add_symbols(second.symbols)
        assert plc.read("Main.number") == 2
        yield plc


def test_program_on_trial_is_gone_after_power_was_off(plc: Simulator) -> None:
    plc.restart()
    assert plc.read("Main.number") == 1


def test_program_on_trial_becomes_the_boot_project(plc: Simulator) -> None:
    plc.create_boot_project()
    plc.restart()
    assert plc.read("Main.number") == 2


def test_setting_puts_each_download_on_trial(plc: Simulator, tmp_path: Path) -> None:
    plc.put_file("Settings.cfg", b"[CmpApp]\nCreateBootprojectOnDownload=no\n")
    plc.restart()
    plc.flash(built(tmp_path, 2).image)
    assert plc.read("Main.number") == 2 and not plc.status().boots
    plc.restart()
    assert plc.read("Main.number") == 1
    plc.flash(built(tmp_path, 2).image, boot=True)
    plc.restart()
    assert plc.read("Main.number") == 2
