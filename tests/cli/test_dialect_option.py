"""--dialect of the commands, and `dialect` of plc.toml."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from plctool.compiler.sources.dialect_of_files import dialect_of_files

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


OBJECT = """<?xml version="1.0" encoding="utf-8"?>
<TcPlcObject><POU Name="MAIN"><Declaration><![CDATA[PROGRAM MAIN
VAR
    x : REAL := 2.5; b : BYTE;
END_VAR]]></Declaration><Implementation><ST><![CDATA[b := REAL_TO_BYTE(x);]]></ST></Implementation></POU></TcPlcObject>
"""
EXPORT = (
    "PROGRAM MAIN\nVAR\n x : REAL := 2.5; b : BYTE;\nEND_VAR\n(* @END_DECLARATION := '0' *)\nb := REAL_TO_BYTE(x);\n"
    "END_PROGRAM\n"
)
SAID = "makes this a program for --dialect"


def value_of_b(tool: Any, *options: str) -> tuple[str, str]:
    """What REAL_TO_BYTE(2.5) gives, and the line about the dialect."""
    done = tool("build", *options, "-o", "m.cdl")
    assert done.status == 0, done.err
    lines = [line for line in done.err.splitlines() if SAID in line]
    assert len(lines) <= 1
    shown = tool("run", "m.cdl", "--get", "MAIN.b").out.splitlines()
    (value,) = (line.split()[-1] for line in shown if line.startswith("MAIN.b "))
    return value, "".join(lines)


@pytest.mark.parametrize(
    ("name", "content", "dialect"),
    [("MAIN.TcPOU", OBJECT, "twincat"), ("main.EXP", EXPORT, "codesys"), ("main.st", HALF.replace("Main", "MAIN"), "")],
)
def test_files_of_a_system_choose_its_dialect_unless_one_is_given(
    tool: Any, scratch: Path, name: str, content: str, dialect: str
) -> None:
    (scratch / name).write_text(content)
    value, said = value_of_b(tool, name)
    assert value == ("16#03" if dialect else "16#02")
    assert said == (f"plctool: {name} {SAID} {dialect}." if dialect else "")
    assert value_of_b(tool, name, "--dialect", "iec") == ("16#02", "")
    (scratch / "plc.toml").write_text(f'sources = ["{name}"]\n[options]\ndialect = "iec"\n')
    assert value_of_b(tool) == ("16#02", "")


def test_files_of_two_systems_choose_no_dialect(tool: Any, scratch: Path) -> None:
    (scratch / "MAIN.TcPOU").write_text(OBJECT)
    (scratch / "other.EXP").write_text(EXPORT.replace("MAIN", "OTHER"))
    assert value_of_b(tool, "MAIN.TcPOU", "other.EXP") == ("16#02", "")
    (scratch / "some.st").write_text("FUNCTION f : INT\nf := 1;\nEND_FUNCTION\n")
    assert value_of_b(tool, "MAIN.TcPOU", "some.st")[0] == "16#03"


@pytest.mark.parametrize(("product", "dialect"), [("CODESYS", "codesys"), ("TwinCAT 3", "twincat"), ("Beremiz", None)])
def test_xml_has_the_dialect_of_the_product_that_wrote_it(tmp_path: Path, product: str, dialect: str | None) -> None:
    file = tmp_path / "m.xml"
    for encoding in ("utf-8", "utf-16"):
        file.write_text(f'<project><fileHeader companyName="" productName="{product}"/></project>', encoding=encoding)
        found = dialect_of_files([file])
        assert found == (None if dialect is None else (dialect, file))
