"""--dialect of the commands, and `dialect` of plc.toml."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

MIXED = "TYPE Mode : (off, on); END_TYPE\nPROGRAM Main\nVAR m : Mode; n : INT; END_VAR\nm := n;\nEND_PROGRAM\n"
HALF = "PROGRAM Main\nVAR x : REAL := 2.5; b : BYTE; END_VAR\nb := REAL_TO_BYTE(x);\nEND_PROGRAM\n"
TEST = "TEST 'halves'\nVAR x : REAL := 2.5; END_VAR\nASSERT_EQ(REAL_TO_BYTE(x), BYTE#3);\nEND_TEST\n"


@pytest.mark.parametrize("words", [["check"], ["build"], ["test"], ["export", "-o", "out/m.xml"], ["export-itf"]])
def test_commands_take_it_and_refuse_unknown_ones(tool: Any, scratch: Path, words: list[str]) -> None:
    (scratch / "out").mkdir()
    in_c = "{attribute 'external' := 'in_c'}\nFUNCTION InC : INT\nEND_FUNCTION\n"
    (scratch / "m.st").write_text(MIXED + in_c + "TEST 'nothing'\nASSERT_TRUE(TRUE);\nEND_TEST\n")
    assert tool(*words, "m.st").status == 0
    done = tool(*words, "m.st", "--dialect", "iec")
    assert done.status != 0 and "error in the dialect iec" in done.out + done.err
    done = tool(*words, "m.st", "--dialect", "codesis")
    assert done.status == 2 and "did you mean codesys" in done.err


def test_project_says_it_and_the_command_line_holds_before_it(tool: Any, scratch: Path) -> None:
    (scratch / "m.st").write_text(HALF + TEST)
    (scratch / "plc.toml").write_text('[options]\ndialect = "twincat"\n')
    assert "Main.b = 16#03" in tool("run", "--cycles", "1", "--get", "Main.b").out
    assert tool("test").status == 0
    assert tool("test", "--dialect", "iec").status != 0
    (scratch / "plc.toml").write_text('[options]\ndialect = "codesis"\n')
    done = tool("check")
    assert done.status != 0 and "did you mean codesys" in done.out + done.err
