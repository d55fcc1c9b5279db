"""What is initialised when: the first start, resets, power off and on."""

from __future__ import annotations

from pathlib import Path

import pytest

from plctool.compiler import compile_sources
from plctool.controller import ProgramStopped
from plctool.sim import Simulator

PROGRAM = """
FUNCTION_BLOCK Block
VAR fresh : BOOL; END_VAR
METHOD FB_Init : BOOL
VAR_INPUT bInitRetains, bInCopyCode : BOOL; END_VAR
    fresh := bInitRetains;
END_METHOD
END_FUNCTION_BLOCK
PROGRAM Main
VAR n : INT := 5; block : Block; END_VAR
VAR {retain} kept : INT := 7; END_VAR
n := n + 1;
kept := kept + 1;
END_PROGRAM
"""


def simulator(folder: Path, retain: str) -> Simulator:
    (folder / "main.st").write_text(PROGRAM.replace("{retain}", retain))
    built = compile_sources([folder / "main.st"])
    plc = Simulator(built.image, built.symbols)
    plc.run_cycles(1)
    return plc


NAMES = ["Main.n", "Main.kept", "Main.block.fresh"]


@pytest.mark.parametrize(
    ("event", "kept", "fresh"),
    [("download", 8, True), ("warm", 8, False), ("cold", 7, True), ("power", 9, False)],
)
def test_retain_variables_and_what_fb_init_gets(tmp_path: Path, event: str, kept: int, fresh: bool) -> None:
    with simulator(tmp_path, "RETAIN") as plc:
        bring_about(plc, event)
        n = 5 if event in ("warm", "cold") else 6  # stopped after a reset
        assert list(plc.read_all(NAMES).values()) == [n, kept, fresh]


@pytest.mark.parametrize(("event", "fresh"), [("download", True), ("warm", False), ("cold", True), ("power", True)])
def test_without_retain_variables_fb_init_learns_that_none_were_kept(tmp_path: Path, event: str, fresh: bool) -> None:
    with simulator(tmp_path, "") as plc:
        bring_about(plc, event)
        assert plc.read("Main.block.fresh") is fresh


def bring_about(plc: Simulator, event: str) -> None:
    if event == "power":
        plc.stop()
        plc.restart()
        plc.run_cycles(1)
    elif event != "download":
        plc.reset("warm" if event == "warm" else "cold")


def test_an_exception_in_initialisation_is_one_of_python_with_its_line(tmp_path: Path) -> None:
    (tmp_path / "main.st").write_text(
        "FUNCTION F : INT\nVAR_INPUT x : INT; END_VAR\nF := 10 / x;\nEND_FUNCTION\n"
        "PROGRAM Main VAR zero : INT; n : INT := F(zero); END_VAR END_PROGRAM"
    )
    with pytest.raises(ProgramStopped, match=r"DIVIDEBYZERO.*main\.st:3"):
        Simulator.from_sources(tmp_path)
