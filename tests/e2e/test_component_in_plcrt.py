"""A component of a vendor in plcrt finds a function of the program by its name."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parents[1]))

from vendor_component import cmp_list_of, relink, tank

from plctool.testing.plcrt import Plcrt, find_plcrt
from plctool.testing.waiting import eventually

NAME = "firmware/port/linux/plcrt"
BUILD = Path(find_plcrt()).resolve().parents[3]


@pytest.mark.skipif(not (BUILD / "build.ninja").exists(), reason="this plcrt is not in its build folder")
def test_a_component_calls_a_function_of_the_program(tool, tmp_path: Path, monkeypatch) -> None:
    folder = tmp_path / "product"
    folder.mkdir()
    shutil.copy(cmp_list_of(BUILD, NAME), folder)
    source = tank(folder)
    monkeypatch.setenv("PLCRT", str(relink(BUILD, NAME, folder)))
    image = tool.build("tank", source + "PROGRAM Main VAR n : DINT; END_VAR n := n + 1; END_PROGRAM")
    with Plcrt(tmp_path / "plc.flash") as plcrt:
        link = ("--port", plcrt.port)
        tool.ok("flash", *link, str(image))
        eventually(lambda: "The level is above the limit" in tool("log", *link).out)
        assert tool.ok("read", *link, "level")["values"]["level"] == 52.5
        components = {c["name"]: c for c in tool.ok("info", *link)["components"]}
        assert components["AcmeTank"]["id"] == "0x8006"
