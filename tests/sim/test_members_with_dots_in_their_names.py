"""What a base and methods keep for themselves is found by the names that are listed."""

from __future__ import annotations

from pathlib import Path

from plctool import Simulator

PROGRAM = """
TYPE Pair : STRUCT one, two : INT; END_STRUCT; END_TYPE
FUNCTION_BLOCK A
VAR PRIVATE x : INT := 5; list : ARRAY[0..1] OF Pair; END_VAR
METHOD Run : INT
VAR_INST s : INT := 3; p : Pair; END_VAR
s := s + 1; p.two := s; Run := s;
END_METHOD
END_FUNCTION_BLOCK
FUNCTION_BLOCK B EXTENDS A
VAR x : INT := 7; list : INT := 8; END_VAR
END_FUNCTION_BLOCK
PROGRAM Main VAR b : B; r : INT; END_VAR
r := b.Run();
END_PROGRAM
"""


def test_each_is_read_and_written_by_its_name(tmp_path: Path) -> None:
    (tmp_path / "main.st").write_text(PROGRAM)
    with Simulator.from_sources(tmp_path / "main.st") as plc:
        plc.run_cycles(1)
        listed = plc.read("Main.b.*")
        assert listed["Main.b.A.x"] == 5
        for name, value in listed.items():
            assert plc.read(name) == value
            assert plc.read(name.upper()) == value
        assert plc.read("Main.b.run.p.two") == plc.read("Main.b.Run.s") == 4
        plc.write({"Main.b.A.list[1].two": 9, "Main.b.x": 6})
        assert (plc.read("Main.b.a.list[1].two"), plc.read("Main.b.A.x"), plc.read("Main.b.x")) == (9, 5, 6)
