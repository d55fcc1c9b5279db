"""`check --missing`: one table of the names that a program needs of libraries of other systems."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from plctool.compiler.sources.stand_ins import stand_ins
from plctool.compiler.syntax.library import standard_library

PROGRAM = """PROGRAM Main
VAR blink : BLINK; second : Util.Blink; pid : INT; axis : AXIS_REF; power : MC_Power; a, b : INT; x : Whatever;
    list : ARRAY[0..1] OF PID;
END_VAR
blink();
pid := 3;
MEMCPY(ADR(a), ADR(b), 2);
Tc2_System.MEMCPY(ADR(a), ADR(b), 2);   (* MEMSET( *)
MC_Power(a);
a := 'x';
END_PROGRAM
"""


def rows(document: Any) -> dict[str, tuple[str, int, int, bool]]:
    """Library, uses, first line and whether there is a stand-in, by name."""
    return {m["name"]: (m["library"], m["count"], m["line"], m["stand_in"]) for m in document["missing"]}


def test_names_have_their_library_their_uses_and_whether_there_is_a_stand_in(tool: Any, scratch: Path) -> None:
    (scratch / "main.st").write_text(PROGRAM)
    done = tool("check", "main.st", "--missing", "--json")
    motion = "Tc2_MC2 or SM3_Basic (motion)"
    assert done.status == 2
    assert rows(done.json) == {
        "MC_Power": (motion, 2, 2, False),
        "AXIS_REF": (motion, 1, 2, False),
        "Whatever": ("", 1, 2, False),
        "BLINK": ("Util of CODESYS", 2, 2, True),
        "PID": ("Util of CODESYS", 1, 3, True),
        "MEMCPY": ("Tc2_System", 2, 7, True),
    }
    assert done.json["other_errors"] == 1
    lines = tool("check", "main.st", "--missing").out.splitlines()
    assert lines[0].split() == ["name", "library", "uses", "stand-in", "first", "at"]
    assert lines[1].split() == ["MC_Power", *motion.split(), "2", "no", "main.st:2"]
    assert len([line for line in lines if " yes " in line]) == 3
    assert lines[7] == "3 names are missing, of which 2 seem to be of 1 libraries; 3 have a stand-in."
    assert lines[9] == "Errors about other things: 1; 'plctool check' shows them."


def test_what_computes_has_a_stand_in_and_what_reaches_the_system_has_none(tool: Any, scratch: Path) -> None:
    variables = "id : T_AmsNetId; t : TIMESTRUCT; clock : FB_LocalSystemTime; s : STRING; p : Util.PID;"
    text = f"PROGRAM Main\nVAR {variables} END_VAR\ns := DWORD_TO_HEXSTR(1, 2, FALSE);\nclock();\nEND_PROGRAM\n"
    (scratch / "main.st").write_text(text)
    assert rows(tool("check", "main.st", "--missing", "--json").json) == {
        "FB_LocalSystemTime": ("Tc2_Utilities", 1, 2, False),
        "T_AmsNetId": ("Tc2_System", 1, 2, True),
        "TIMESTRUCT": ("Tc2_Utilities", 1, 2, True),
        "DWORD_TO_HEXSTR": ("Tc2_Utilities", 1, 3, True),
        "PID": ("Util of CODESYS", 1, 2, True),
    }


def test_a_name_is_known_whatever_stands_in_front_of_it(tool: Any, scratch: Path) -> None:
    (scratch / "a.st").write_text("PROGRAM Main VAR a : Acme.FB_MBReadCoils; END_VAR a(); END_PROGRAM")
    missing = tool("check", "--missing", "a.st", "--json").json["missing"]
    assert [(m["name"], m["library"]) for m in missing] == [("Acme.FB_MBReadCoils", "Tc2_ModbusSrv or ModbusFB")]


def test_own_names_are_not_those_of_libraries(tool: Any, scratch: Path) -> None:
    own = "FUNCTION_BLOCK BLINK\nEND_FUNCTION_BLOCK\nTYPE PID : STRUCT MEMCPY : INT; END_STRUCT; END_TYPE\n"
    text = "PROGRAM Main\nVAR b : BLINK; p : PID; x : INT; END_VAR\nb();\nx := p.MEMCPY;\nEND_PROGRAM\n"
    (scratch / "main.st").write_text(own + text)
    done = tool("check", "main.st", "--missing")
    assert (done.status, done.out) == (0, "0 names are missing; 0 have a stand-in.\n")


def test_names_of_a_library_that_is_given_are_not_missing(tool: Any, scratch: Path) -> None:
    (scratch / "main.st").write_text("PROGRAM Main\nVAR p : MC_Power; END_VAR\np();\nEND_PROGRAM\n")
    assert tool("check", "main.st", "--missing").status == 2
    (scratch / "Motion").mkdir()
    (scratch / "Motion/library.toml").write_text('name = "Motion"\nversion = "1"\n')
    (scratch / "Motion/power.st").write_text("FUNCTION_BLOCK MC_Power\nEND_FUNCTION_BLOCK\n")
    assert tool("check", "main.st", "--missing", "--library", "Motion").status == 0


def test_project_with_descriptions_and_broken_files_is_looked_through(tool: Any, scratch: Path) -> None:
    (scratch / "plc.toml").write_text("")
    (scratch / "main.io.toml").write_text('[[sim]]\nname = "MEMCPY"\n[sim.in]\n"a(" = "Main.n"\n')
    (scratch / "main.st").write_text("PROGRAM Main\nVAR n : INT; p : MC_Power; END_VAR\np();\nEND_PROGRAM\n")
    (scratch / "broken.st").write_text("FUNCTION_BLOCK Broken\nVAR b : BLINK; a : ; END_VAR\nEND_FUNCTION_BLOCK\n")
    assert set(rows(tool("check", "--missing", "--json").json)) == {"MC_Power", "BLINK"}


def test_stand_ins_are_known_with_the_library_in_front(tool: Any, scratch: Path) -> None:
    calls = "SysMem.SysMemSet(ADR(n), 0, 2);\nTc2_System.MEMSET(ADR(n), 0, 2);\nb();\n"
    (scratch / "main.st").write_text(f"PROGRAM Main\nVAR n : INT; b : Util.BLINK; END_VAR\n{calls}END_PROGRAM\n")
    done = tool("check", "main.st", "--missing", "--json")
    assert (done.status, done.json["other_errors"]) == (0, 0)
    assert set(rows(done.json)) == {"SysMemSet", "MEMSET", "BLINK"}


@pytest.mark.parametrize("name", sorted(stand_ins()))
def test_stand_ins_are_in_the_standard_library(name: str) -> None:
    assert name in {known.casefold() for known in standard_library().names()}
