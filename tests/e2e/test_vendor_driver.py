"""A vendor's driver from the blank one, in a folder of its own, becomes a part of plcrt (docs/io-driver.md)."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

import plctool
from plctool.compiler import compile_sources
from plctool.errors import DeviceError
from plctool.link.services import AppState
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually

ROOT = Path(__file__).resolve().parents[2]
BLANK = ROOT / "firmware" / "port" / "baremetal" / "blank"
DEVICE = """
name = "Box"
[[module]]
name = "Analog"
driver = "IoDrvAcmeAdc"
in = { AI0 = { type = "INT", parameter = 1 } }
out = { AO0 = { type = "INT", parameter = 2 } }
[module.parameter]
range = { id = 100, type = "USINT", choices = { "0..10V" = 0, "4..20mA" = 1 }, default = "4..20mA" }
"""
DESCRIPTION = """
device = "device.toml"
[local.Analog]
name = "Analog"
in = { AI0 = "Main.level" }
out = { AO0 = "Main.out" }
"""
PROGRAM = """
PROGRAM Main
VAR level, out : INT; ok : BOOL; END_VAR
out := level + 1;
ok := Analog.ok;
END_PROGRAM
"""


def test_driver_of_a_vendor_runs_in_plcrt(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = (ROOT / "docs" / "io-driver.md").read_text()
    for name in ("IoDrvBlank.c", "IoDrvBlank.h"):
        (tmp_path / name).write_text((BLANK / name).read_text())
    for command in re.findall(r"^\$ (sed .*)$", text, re.MULTILINE):
        subprocess.run(command, shell=True, cwd=tmp_path, check=True, timeout=60)
    driver = tmp_path / "IoDrvAcmeAdc.c"
    fails = 'case CH_INIT2:\n        if (getenv("ACME_FAILS") != NULL)\n            return ERR_FAILED;\n'
    driver.write_text("#include <stdlib.h>\n" + driver.read_text().replace("case CH_INIT2:\n", fails))
    (option,) = re.findall(r"-Dplcrt_drivers=(?=\S*IoDrvAcmeAdc\.c)", text)
    build = tmp_path / "build"
    setup = ["setup", "-Dhost=false", f"{option}{tmp_path / 'IoDrvAcmeAdc.c'}", str(build), str(ROOT)]
    for work in (setup, ["compile", "-C", str(build), "plcrt"]):
        command_line = [sys.executable, "-m", "mesonbuild.mesonmain", *work]
        done = subprocess.run(command_line, capture_output=True, text=True, timeout=900, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    monkeypatch.setenv("PLCRT", str(build / "firmware" / "port" / "linux" / "plcrt"))
    program = tmp_path / "program"
    program.mkdir()
    for name, content in (("main.st", PROGRAM), ("main.io.toml", DESCRIPTION), ("device.toml", DEVICE)):
        (program / name).write_text(content)
    compile_sources([program / "main.st"]).write(program / "main.cdl")
    with Plcrt(tmp_path / "flash") as plcrt, plctool.connect(f"serial:{plcrt.port}") as plc:
        plc.flash(program / "main.cdl")
        eventually(lambda: plc.read("Main.out", "Main.ok") == {"Main.out": 1, "Main.ok": True})
        assert plc.io_device("Analog").driver == "IoDrvAcmeAdc"
    stays_without_program_when_the_driver_fails(tmp_path / "flash", program / "main.cdl", monkeypatch)


def stays_without_program_when_the_driver_fails(flash: Path, image: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ACME_FAILS", "1")
    with Plcrt(flash) as plcrt:
        link = f"serial:{plcrt.port}"
        (node,) = plctool.device.scan(link, gateway=False)
        assert node.left_out
        with plctool.connect(link, gateway=False) as plc:
            assert plc.status().state is AppState.NONE
            texts = [entry.text for entry in plc.log()]
            assert "Start of IoDrvAcmeAdc failed" in texts
            for refused in (lambda: plc.flash(image), lambda: plc.shell("reload")):
                with pytest.raises(DeviceError, match="a component of its firmware failed to start"):
                    refused()
    monkeypatch.delenv("ACME_FAILS")
    with Plcrt(flash) as plcrt, plctool.connect(f"serial:{plcrt.port}", gateway=False) as plc:
        eventually(lambda: plc.read("Main.ok") is True)  # the program was kept
