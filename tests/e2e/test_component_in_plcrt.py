"""Components of a vendor in plcrt: one finds a function of the program by its name, one denies events."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parents[1]))

from vendor_component import cmp_list_of, door, relink, tank

from plctool.testing.plcrt import Plcrt, find_plcrt
from plctool.testing.waiting import eventually

NAME = "firmware/port/linux/plcrt"
BUILD = Path(find_plcrt()).resolve().parents[3]


pytestmark = pytest.mark.skipif(not (BUILD / "build.ninja").exists(), reason="this plcrt is not in its build folder")
PROGRAM = "PROGRAM Main VAR n : DINT; END_VAR n := n + 1; END_PROGRAM"
REFUSAL = "the door is open (ERR_OPERATION_DENIED)"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "product"
    folder.mkdir()
    shutil.copy(cmp_list_of(BUILD, NAME), folder)
    return folder


def test_a_component_calls_a_function_of_the_program(tool, tmp_path: Path, folder: Path, monkeypatch) -> None:
    source = tank(folder)
    monkeypatch.setenv("PLCRT", str(relink(BUILD, NAME, folder)))
    image = tool.build("tank", source + PROGRAM)
    with Plcrt(tmp_path / "plc.flash") as plcrt:
        link = ("--port", plcrt.port)
        tool.ok("flash", *link, str(image))
        eventually(lambda: "The level is above the limit" in tool("log", *link).out)
        assert tool.ok("read", *link, "level")["values"]["level"] == 52.5
        components = {c["name"]: c for c in tool.ok("info", *link)["components"]}
        assert components["AcmeTank"]["id"] == "0x8006"


def test_a_component_denies_start_and_download_with_its_words(tool, tmp_path: Path, folder: Path, monkeypatch) -> None:
    door(folder)
    switch = tmp_path / "open"
    monkeypatch.setenv("ACME_DOOR", str(switch))
    monkeypatch.setenv("PLCRT", str(relink(BUILD, NAME, folder)))
    first, second = tool.build("first", PROGRAM), tool.build("second", PROGRAM.replace("n + 1", "n + 2"))
    with Plcrt(tmp_path / "plc.flash") as plcrt:
        link = ("--port", plcrt.port)
        tool.ok("flash", *link, str(first))
        switch.touch()
        done = tool("flash", *link, str(second))
        assert (done.status, REFUSAL in done.err) == (1, True), done.err
        assert tool.ok("status", *link)["state"] == "run"
        tool.ok("stop", *link)
        done = tool("start", *link)
        assert (done.status, done.err) == (1, f"plctool: The device refused the start: {REFUSAL}.\n")
        tool.ok("reset", "origin", *link)
        assert REFUSAL in tool("flash", *link, str(second)).err
        switch.unlink()
        tool.ok("flash", *link, str(second))
        assert tool.ok("status", *link)["state"] == "run"
