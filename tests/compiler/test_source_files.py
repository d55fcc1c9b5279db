"""Source files as they come: encodings, and the XML of TwinCAT 3."""

from __future__ import annotations

from pathlib import Path

import pytest

from plctool.compiler import compile_sources, load_sources
from plctool.compiler.front import check_sources
from plctool.compiler.source_files import structured_text
from plctool.errors import UsageError
from plctool.sim import Simulator

PROGRAM = "PROGRAM Main\nVAR\n    text : STRING := 'Größe';\n    n : INT;\nEND_VAR\nn := LEN(text);\nEND_PROGRAM\n"


def started(path: Path) -> Simulator:
    """The program of a file or folder, ready to run."""
    built = compile_sources([path])
    return Simulator(built.image, built.symbols)


def xml(body: str) -> str:
    """A file as TwinCAT writes it."""
    return f'<?xml version="1.0" encoding="utf-8"?>\n<TcPlcObject Version="1.1.0.1">\n{body}\n</TcPlcObject>\n'


BLOCK = xml("""  <POU Name="FB_Counter" Id="{1}" SpecialFunc="None">
    <Declaration><![CDATA[// a PROGRAM counts with it
{attribute 'reflection'}
FUNCTION_BLOCK FB_Counter IMPLEMENTS I_Counter
VAR_OUTPUT
    total : INT;
END_VAR
VAR
    width : INT := 1;
END_VAR
]]></Declaration>
    <Implementation>
      <ST><![CDATA[total := total + width;
double();]]></ST>
    </Implementation>
    <Folder Name="Internals" Id="{2}" />
    <Action Name="double" Id="{3}">
      <Implementation>
        <ST><![CDATA[total := total * 2;]]></ST>
      </Implementation>
    </Action>
    <Method Name="Add" Id="{4}">
      <Declaration><![CDATA[METHOD PUBLIC Add : INT
VAR_INPUT
    value : INT;
END_VAR]]></Declaration>
      <Implementation>
        <ST><![CDATA[total := total + value;
Add := total;]]></ST>
      </Implementation>
    </Method>
    <Property Name="Step" Id="{5}">
      <Declaration><![CDATA[PROPERTY PUBLIC Step : INT]]></Declaration>
      <Get Name="Get" Id="{6}">
        <Declaration><![CDATA[VAR
END_VAR
]]></Declaration>
        <Implementation>
          <ST><![CDATA[Step := THIS^.width;]]></ST>
        </Implementation>
      </Get>
    </Property>
  </POU>""")

INTERFACE = xml("""  <Itf Name="I_Counter" Id="{7}">
    <Declaration><![CDATA[INTERFACE I_Counter
]]></Declaration>
    <Method Name="Add" Id="{8}">
      <Declaration><![CDATA[METHOD Add : INT
VAR_INPUT
    value : INT;
END_VAR
]]></Declaration>
    </Method>
  </Itf>""")

GLOBALS = xml("""  <GVL Name="GVL_Limits" Id="{9}">
    <Declaration><![CDATA[{attribute 'qualified_only'}
VAR_GLOBAL
    highest : INT := 5;
END_VAR]]></Declaration>
  </GVL>""")

MAIN = xml("""  <POU Name="MAIN" Id="{10}" SpecialFunc="None">
    <Declaration><![CDATA[PROGRAM MAIN
VAR
    counter : FB_Counter;
    sum, width : INT;
END_VAR]]></Declaration>
    <Implementation>
      <ST><![CDATA[counter();
sum := counter.Add(GVL_Limits.highest);
width := counter.Step;]]></ST>
    </Implementation>
  </POU>""")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_a_file_may_have_any_usual_encoding(tmp_path: Path, encoding: str, newline: str) -> None:
    path = tmp_path / "main.st"
    path.write_bytes(PROGRAM.replace("\n", newline).encode(encoding))
    with started(path) as plc:
        plc.run_cycles(1)
        assert plc.read("Main.n") == 5
        assert plc.read("Main.text") == "Größe"


def test_folders_of_twincat_files_are_programs(tmp_path: Path) -> None:
    for name, text in (("FB_Counter.TcPOU", BLOCK), ("I_Counter.TcIO", INTERFACE), ("MAIN.TcPOU", MAIN)):
        (tmp_path / name).write_text(text, "utf-8-sig")
    (tmp_path / "lists").mkdir()
    (tmp_path / "lists" / "GVL_Limits.TcGVL").write_text(GLOBALS, "utf-8-sig")
    (tmp_path / "plant.tsproj").write_text("<no source/>", "utf-8")
    with started(tmp_path) as plc:
        plc.run_cycles(1)
        assert plc.read("MAIN.sum") == 7
        assert plc.read("MAIN.width") == 1


def test_errors_in_twincat_files_have_the_line_and_column_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / "MAIN.TcPOU"
    path.write_text(MAIN.replace("counter : FB_Counter;", "counter : FB_Missing;"), "utf-8")
    found = [d for d in check_sources(load_sources([path])).diagnostics if d.severity == "error"]
    line = path.read_text().splitlines()[found[0].line - 1]
    assert line[found[0].column - 1 :].startswith("FB_Missing")


def test_lines_of_twincat_files_stay_where_they_are() -> None:
    text = structured_text(BLOCK, Path("FB_Counter.TcPOU"))
    for number, line in enumerate(BLOCK.splitlines()):
        if "CDATA" not in line and "<" not in line:
            assert text.splitlines()[number] == line


def test_charts_and_diagrams_of_twincat_are_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "MAIN.TcPOU"
    path.write_text(MAIN.replace("<ST>", "<SFC>").replace("</ST>", "</SFC>"), "utf-8")
    with pytest.raises(UsageError, match="holds SFC; only Structured Text"):
        load_sources([path])


def test_a_folder_without_sources_says_what_sources_are(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("nothing")
    with pytest.raises(UsageError, match=r"no source file \(.st, .exp, .TcPOU"):
        load_sources([tmp_path])
