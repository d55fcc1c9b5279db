"""`plctool canopen eds`: the EDS of this PLC."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from canopen_device_programs import write_device
from done import run_here


def test_eds_of_a_program_passes_the_check(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    image = tmp_path / "app.cdl"
    assert run_here(capsys, "build", str(write_device(tmp_path / "p")), "-o", str(image)).status == 0
    made = run_here(capsys, "canopen", "eds", str(image), "-o", "mixer.eds")
    assert (made.status, made.out) == (0, "mixer.eds written\n")
    checked = run_here(capsys, "canopen", "check", "mixer.eds")
    assert (checked.status, checked.out) == (
        0, "mixer.eds: Mixer, 52 objects, 4 RPDOs, 4 TPDOs; 0 errors, 0 warnings\n"
    )  # fmt: skip
    assert "ParameterName=Main.temps, element 3" in Path("mixer.eds").read_text()


def test_program_that_is_no_device_has_no_eds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "app.st").write_text("PROGRAM Main\nVAR n : INT; END_VAR\nn := n + 1;\nEND_PROGRAM\n")
    assert run_here(capsys, "build", str(tmp_path / "app.st"), "-o", str(tmp_path / "app.cdl")).status == 0
    refused = run_here(capsys, "canopen", "eds", str(tmp_path / "app.cdl"))
    assert refused.status == 2
    assert "write [[canopen_device]] in its .io.toml" in refused.err
