"""Source files as they come: encodings, and the XML of TwinCAT 3."""

from __future__ import annotations

from pathlib import Path

import pytest

from plctool.compiler import compile_sources, load_sources
from plctool.compiler.formats.twincat import read_object
from plctool.compiler.front import check_sources
from plctool.compiler.syntax.diagnostics import render, render_all
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


def test_every_line_of_a_twincat_file_is_found_again() -> None:
    source = read_object("FB_Counter.TcPOU", BLOCK)
    at = 0
    found = 0
    for line in source.text.splitlines(keepends=True):
        pos = source.pos(at)
        at += len(line)
        if not line.startswith(("END_", "ACTION", "GET")) or line == "END_VAR\n":
            assert source.line_text(pos.line)[pos.column - 1 :].startswith(line.strip("\n")) or not line.strip()
            found += bool(line.strip())
    assert found > 20


def test_a_chart_of_twincat_is_named_and_the_rest_is_checked(tmp_path: Path) -> None:
    (tmp_path / "FB_Chart.TcPOU").write_text(
        xml("""  <POU Name="FB_Chart"><Declaration><![CDATA[FUNCTION_BLOCK FB_Chart
VAR_OUTPUT ready : BOOL; END_VAR]]></Declaration>
    <Implementation><CFC><XmlArchive/></CFC></Implementation></POU>""")
    )
    (tmp_path / "MAIN.st").write_text(
        "PROGRAM MAIN\nVAR f : FB_Chart; b : BOOL; END_VAR\nf();\nb := f.redy;\nEND_PROGRAM"
    )
    found = [d for d in check_sources(load_sources([tmp_path])).diagnostics if d.severity == "error"]
    assert [(d.line, d.code) for d in found] == [(5, "language"), (4, "unknown")]
    assert found[0].message == "FB_Chart is written in CFC; only Structured Text can be compiled"


def test_all_diagrams_are_listed_however_many_there_are(tmp_path: Path) -> None:
    for i in range(30):
        (tmp_path / f"P{i}.TcPOU").write_text(
            MAIN.replace("MAIN", f"P{i}").replace("<ST>", "<NWL>").replace("</ST>", "</NWL>")
        )
    result = check_sources(load_sources([tmp_path]))
    assert sum(d.code == "language" for d in result.diagnostics) == 30
    assert not result.ok


def test_a_cut_off_twincat_file_is_an_error_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "MAIN.TcPOU"
    path.write_text(MAIN[: MAIN.index("</POU>")])
    (found,) = [d for d in check_sources(load_sources([path])).diagnostics if d.severity == "error"]
    assert found.code == "xml"
    assert found.line == len(path.read_text().splitlines())


TASK = xml("""  <Task Name="Fast Task" Id="{1}">
    <!--CycleTime in micro seconds.-->
    <CycleTime>2000</CycleTime>
    <Priority>20</Priority>
    <PouCall>
      <Name>MAIN</Name>
    </PouCall>
    <PouCall>
      <Name>VisuElems.Visu_Prg</Name>
    </PouCall>
  </Task>""")
COUNTING = MAIN.replace("counter : FB_Counter;\n    ", "").replace(
    "counter();\nsum := counter.Add(GVL_Limits.highest);\nwidth := counter.Step;", "sum := sum + 1;"
)


def test_a_task_of_twincat_has_its_cycle_time_and_programs(tmp_path: Path) -> None:
    (tmp_path / "MAIN.TcPOU").write_text(COUNTING)
    (tmp_path / "Fast.TcTTO").write_text(TASK)
    program = check_sources(load_sources([tmp_path])).program
    assert program is not None
    (task,) = program.tasks
    assert (task.name, task.interval_us, task.priority) == ("Fast_Task", 2000, 20)
    with started(tmp_path) as plc:
        plc.run_cycles(3)
        assert plc.read("MAIN.sum") == 3


def test_a_program_that_a_task_of_twincat_misses_is_reported_in_the_task_file(tmp_path: Path) -> None:
    (tmp_path / "MAIN.TcPOU").write_text(COUNTING)
    (tmp_path / "Fast.TcTTO").write_text(TASK.replace("MAIN", "MIAN"))
    (found,) = [d for d in check_sources(load_sources([tmp_path])).diagnostics if d.severity == "error"]
    assert Path(found.file).name == "Fast.TcTTO"
    assert "MIAN" in TASK.splitlines()[found.line] or "PouCall" in TASK.splitlines()[found.line]


PROJECT = """<Project>
  <ItemGroup>
    <Compile Include="POUs\\Main.TcPOU"><SubType>Code</SubType></Compile>
    <Compile Include="Old.TcPOU"><ExcludeFromBuild>true</ExcludeFromBuild></Compile>
  </ItemGroup>
</Project>
"""


def test_the_project_file_of_twincat_says_which_files_belong(tmp_path: Path) -> None:
    (tmp_path / "pous").mkdir()
    (tmp_path / "pous" / "MAIN.TcPOU").write_text(COUNTING)
    (tmp_path / "Old.TcPOU").write_text("garbage")
    (tmp_path / "Forgotten.TcPOU").write_text("garbage")
    project = tmp_path / "plant.plcproj"
    project.write_text(PROJECT)
    assert [Path(s.path).name for s in load_sources([tmp_path])] == ["MAIN.TcPOU"]
    assert [Path(s.path).name for s in load_sources([project])] == ["MAIN.TcPOU"]
    solution = tmp_path / "plant.tsproj"
    solution.write_text('<TcSmProject><Project PrjFilePath="plant.plcproj"/></TcSmProject>')
    assert [Path(s.path).name for s in load_sources([solution])] == ["MAIN.TcPOU"]


def project_of(*names: str) -> str:
    """A PLC project with these files."""
    files = "".join(f'<Compile Include="{name}"/>' for name in names)
    return f"<Project><ItemGroup>{files}</ItemGroup></Project>"


def write_plant(folder: Path, project: str = PROJECT) -> Path:
    """A PLC project with a program, in a folder of its own."""
    (folder / "plant" / "POUs").mkdir(parents=True)
    (folder / "plant" / "POUs" / "Main.TcPOU").write_text(COUNTING)
    path = folder / "plant" / "plant.plcproj"
    path.write_text(project)
    return path


def names_of(path: Path) -> list[str]:
    return [Path(s.path).name for s in load_sources([path])]


def found_in(path: Path) -> list[tuple[str, str]]:
    """File and message of each error."""
    found = check_sources(load_sources([path])).diagnostics
    return [(Path(d.file).name, d.message) for d in found if d.severity == "error"]


def test_missing_files_of_a_twincat_project_are_one_error_and_the_others_are_checked(tmp_path: Path) -> None:
    project = write_plant(tmp_path, project_of(r"POUs\Main.TcPOU", r"POUs\Pump.TcPOU", "GVL.TcGVL"))
    main = project.parent / "POUs" / "Main.TcPOU"
    used = "sum := GVL.total;\npump();\nsum := 'a';\nother();"
    main.write_text(COUNTING.replace("sum := sum + 1;", used).replace("sum,", "pump : Pump; sum,"))
    assigned, unknown, missing = sorted(found_in(project))
    assert missing == (
        "plant.plcproj",
        r"POUs\Pump.TcPOU, GVL.TcGVL belong to the project but are missing; "
        "restore what is missing, or remove it from the project",
    )
    assert "STRING" in assigned[1]
    assert "other" in unknown[1]
    assert sorted(found_in(tmp_path)) == [assigned, unknown, missing]


def test_so_many_missing_files_that_no_message_has_room_for_them_are_counted(tmp_path: Path) -> None:
    names = [f"POUs\\Unit{i}.TcPOU" for i in range(100)]
    project = write_plant(tmp_path, project_of(r"POUs\Main.TcPOU", *names))
    ((_, message),) = found_in(project)
    assert r"POUs\Unit0.TcPOU, POUs\Unit1.TcPOU, " in message
    assert " more belong to the project but are missing; restore" in message


@pytest.mark.parametrize("name", [r"VISUs\Panel.TcVIS", "Texts.TcGTLO", "Cams.TcCD", "GlobalImages.TcGIPO", "x.tmc"])
def test_a_missing_file_that_is_not_compiled_does_not_matter(tmp_path: Path, name: str) -> None:
    assert names_of(write_plant(tmp_path, project_of(r"POUs\Main.TcPOU", name))) == ["Main.TcPOU"]


def test_escapes_in_the_names_of_a_twincat_project_are_decoded(tmp_path: Path) -> None:
    project = write_plant(tmp_path, project_of(r"POUs\Fill %28old%29 100%25.TcPOU"))
    (project.parent / "POUs" / "Main.TcPOU").rename(project.parent / "POUs" / "Fill (old) 100%.TcPOU")
    assert names_of(project) == ["Fill (old) 100%.TcPOU"]


DIRECT = r'<TcSmProject><Project><Plc><Project PrjFilePath="plant\plant.plcproj"/></Plc></Project></TcSmProject>'
INDEPENDENT = '<TcSmProject><Project><Plc><Project File="Plant &amp; Co.xti"/></Plc></Project></TcSmProject>'
ITEM = r'<TcSmItem><Project Name="plant" PrjFilePath="..\..\plant\plant.plcproj"/></TcSmItem>'
SOLUTION = """
Microsoft Visual Studio Solution File, Format Version 12.00
Project("{1}") = "Documents", "Documents", "{2}"
EndProject
Project("{3}") = "line", "Line\\line.TSPROJ", "{4}"
EndProject
"""


def write_independent(folder: Path) -> Path:
    """A TwinCAT project whose PLC project is in an independent project file."""
    write_plant(folder)
    (folder / "_Config" / "PLC").mkdir(parents=True)
    (folder / "_Config" / "PLC" / "plant & co.xti").write_text(ITEM)
    path = folder / "line.tsproj"
    path.write_text(INDEPENDENT)
    return path


def test_a_twincat_project_with_an_independent_project_file_leads_to_its_sources(tmp_path: Path) -> None:
    solution = write_independent(tmp_path)
    assert names_of(solution) == ["Main.TcPOU"]
    assert names_of(tmp_path / "_Config" / "PLC" / "plant & co.xti") == ["Main.TcPOU"]


@pytest.mark.parametrize("suffix", [".tsproj", ".tspproj", ".TsProj"])
def test_a_twincat_project_with_its_plc_project_in_it_leads_to_its_sources(tmp_path: Path, suffix: str) -> None:
    write_plant(tmp_path)
    (tmp_path / f"line{suffix}").write_text(DIRECT)
    assert names_of(tmp_path / f"line{suffix}") == ["Main.TcPOU"]


def test_a_solution_leads_to_the_sources_of_its_plc_project(tmp_path: Path) -> None:
    write_independent(tmp_path / "line")
    solution = tmp_path / "factory.sln"
    solution.write_text(SOLUTION, "utf-8-sig")
    assert names_of(solution) == ["Main.TcPOU"]


def test_a_solution_without_twincat_says_what_to_give(tmp_path: Path) -> None:
    solution = tmp_path / "factory.sln"
    solution.write_text('Project("{1}") = "tool", "tool\\tool.csproj", "{2}"\nEndProject\n')
    with pytest.raises(UsageError, match=r"factory.sln names no PLC project .* Give the sources or their folder"):
        load_sources([solution])


@pytest.mark.parametrize(
    ("removed", "named"),
    [("line/line.tsproj", "Line.line.TSPROJ"), ("line/_Config/PLC/plant & co.xti", "Plant & Co.xti"),
     ("line/plant/plant.plcproj", "plant.plant.plcproj")],
)  # fmt: skip
def test_a_solution_names_the_project_file_that_is_missing(tmp_path: Path, removed: str, named: str) -> None:
    write_independent(tmp_path / "line")
    (tmp_path / removed).unlink()
    solution = tmp_path / "factory.sln"
    solution.write_text(SOLUTION)
    with pytest.raises(UsageError, match=rf"names .*{named}, which is missing. Give the PLC project"):
        load_sources([solution])


def test_several_twincat_projects_in_a_folder_or_solution_are_named(tmp_path: Path) -> None:
    entries = ""
    for name in ("a", "b"):
        (tmp_path / f"{name}.plcproj").write_text(PROJECT)
        entries += f'Project("{{1}}") = "{name}", "{name}.plcproj", "{{2}}"\nEndProject\n'
    (tmp_path / "all.sln").write_text(entries)
    for path in (tmp_path, tmp_path / "all.sln"):
        with pytest.raises(UsageError, match=r"several PLC projects .* give one of them.*: .*a.plcproj, .*b.plcproj"):
            load_sources([path])


def test_a_twincat_project_beside_another_one_is_its_library_under_any_namespace(tmp_path: Path) -> None:
    program = write_plant(tmp_path / "program")
    main = program.parent / "POUs" / "Main.TcPOU"
    main.write_text(COUNTING.replace("sum,", "tank : Tanks.FB_Tank; sum,").replace("sum := sum + 1", "tank()"))
    library = write_plant(tmp_path / "library", project_of("FB_Tank.TcPOU"))
    (library.parent / "FB_Tank.TcPOU").write_text(
        BLOCK.replace("FB_Counter", "FB_Tank").replace("IMPLEMENTS I_Counter", "")
    )
    assert check_sources(load_sources([program, library])).ok
    assert [message for _, message in found_in(program)] == ["unknown type Tanks.FB_Tank"]


def test_a_folder_without_sources_says_what_sources_are(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("nothing")
    with pytest.raises(UsageError, match=r"no source file \(.st, .exp, .TcPOU"):
        load_sources([tmp_path])


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("plant.project", "export the units with Project, Export PLCopenXML"),
        ("plant.projectarchive", "export the units with Project, Export PLCopenXML"),
        ("plant.export", "export the units with Project, Export PLCopenXML"),
        ("Util.library", "give the sources of the library"),
        ("Util.compiled-library", "give the sources of the library"),
        ("plant.pro", "open it in CODESYS 2.3 and export it"),
        ("plant.tnzip", "give the folder of the PLC project in it"),
    ],
)
def test_a_file_without_text_says_what_to_export(tmp_path: Path, name: str, message: str) -> None:
    path = tmp_path / name
    path.write_bytes(b"PK\x03\x04\0\0\0\xff" * 30)
    (tmp_path / "main.st").write_text(PROGRAM.replace("LEN(text)", "k"))
    found = [d for d in check_sources(load_sources([path, tmp_path / "main.st"])).diagnostics if d.severity == "error"]
    assert {d.code for d in found} == {"unknown", "file"}
    assert message in next(d.message for d in found if d.code == "file")
    (tmp_path / "main.st").unlink()
    with pytest.raises(UsageError, match=f"has no source file .*{name} is not text: .*"):
        load_sources([tmp_path])


def test_a_binary_file_is_one_error_whatever_it_is_called(tmp_path: Path) -> None:
    path = tmp_path / "main.st"
    path.write_bytes(bytes(range(256)) * 4)
    sources = load_sources([path])
    (found,) = [d for d in check_sources(sources).diagnostics if d.severity == "error"]
    assert found.message.startswith("this is a binary file")
    assert render(found, sources) == f"{path}:1:1: error: {found.message}"  # without a line of nothing


@pytest.mark.parametrize("suffix", [".ST", ".iecst", ".scl"])
def test_other_suffixes_of_sources_are_taken_from_folders(tmp_path: Path, suffix: str) -> None:
    (tmp_path / f"main{suffix}").write_text(PROGRAM, "utf-8")
    with started(tmp_path) as plc:
        plc.run_cycles(1)
        assert plc.read("Main.n") == 5


def test_variables_and_types_of_automation_studio_are_globals(tmp_path: Path) -> None:
    declared = "(* all *)\nVAR\n    speed : Level := 3;\nEND_VAR\nVAR CONSTANT\n    k : INT := 4;\nEND_VAR\n"
    (tmp_path / "Global.var").write_text(declared)
    (tmp_path / "Global.typ").write_text("TYPE\n    Level : INT;\nEND_TYPE\n")
    (tmp_path / "main.st").write_text("PROGRAM Main\nspeed := speed + k;\nEND_PROGRAM\n")
    with started(tmp_path) as plc:
        plc.run_cycles(1)
        assert plc.read("Global.speed") == 7


GENERATED = """FUNCTION_BLOCK LOGGER
  VAR_INPUT
    TRIG : BOOL;
  END_VAR
  IF TRIG THEN
  {{
   LogMessage(1);
  }}
  END_IF;
END_FUNCTION_BLOCK

FUNCTION_BLOCK python_eval
  VAR_INPUT
    TRIG : BOOL;
  END_VAR
  {extern void eval(int);eval(0);}
END_FUNCTION_BLOCK

FUNCTION_BLOCK python_gear
  VAR
    py_eval : python_eval;
  END_VAR
  py_eval(TRIG := TRUE);
END_FUNCTION_BLOCK

PROGRAM Main
  VAR
    n : INT;
  END_VAR
  n := n + 1;
END_PROGRAM
"""


def test_the_blocks_in_c_in_front_of_an_openplc_program_are_left_out(tmp_path: Path) -> None:
    path = tmp_path / "plc.st"
    path.write_text(GENERATED)
    with started(path) as plc:
        plc.run_cycles(2)
        assert plc.read("Main.n") == 2


def test_a_program_that_uses_a_block_in_c_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "plc.st"
    path.write_text(GENERATED.replace("n : INT;", "n : INT; log : LOGGER;"))
    found = [d for d in check_sources(load_sources([path])).diagnostics if d.severity == "error"]
    assert any("code in C cannot be compiled" in d.message for d in found)


UPLOADED = """PROGRAM Main
  VAR
    n : INT;
  END_VAR
  n := n + 1;
END_PROGRAM

CONFIGURATION Config0
  RESOURCE Res0 ON PLC
    TASK task0(INTERVAL := T#20ms,PRIORITY := 0);
    PROGRAM instance0 WITH task0 : Main;
  END_RESOURCE
END_CONFIGURATION
(*DBG:#include <stdbool.h>*)
(*DBG:void *place(size_t index) {*)
(*DBG:    switch (known[index].type) {*)
(*DBG:        case A: return (void *)&((__IEC_BOOL_t *) p)->value; /* (* */*)
(*DBG:    }*)
(*FILE:c_blocks.h extern void (*start)(void *); // it's*)
(*DBG:*)
"""


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_the_lines_of_c_after_a_program_of_openplc_editor_are_left_out(tmp_path: Path, newline: str) -> None:
    path = tmp_path / "program.st"
    path.write_bytes(UPLOADED.replace("\n", newline).encode())
    with started(path) as plc:
        plc.run_cycles(2)
        assert plc.read("instance0.n") == 2


def test_the_lines_of_c_after_a_program_hide_no_error_in_it_and_keep_its_lines(tmp_path: Path) -> None:
    path = tmp_path / "program.st"
    path.write_text(GENERATED + UPLOADED.replace("Main", "Other").replace("n + 1", "'a'"))
    (found,) = [d for d in check_sources(load_sources([path])).diagnostics if d.severity == "error"]
    assert path.read_text().splitlines()[found.line - 1] == "  n := 'a';"


def test_structured_text_beside_a_twincat_project_belongs_to_it(tmp_path: Path) -> None:
    (tmp_path / "POUs").mkdir()
    (tmp_path / "POUs" / "MAIN.TcPOU").write_text(COUNTING)
    (tmp_path / "more.st").write_text("TYPE T : INT; END_TYPE")
    (tmp_path / "Forgotten.TcPOU").write_text("garbage")
    (tmp_path / "plant.plcproj").write_text(PROJECT)
    assert {Path(s.path).name for s in load_sources([tmp_path])} == {"MAIN.TcPOU", "more.st"}


def test_a_diagram_is_listed_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "A.TcPOU").write_text(MAIN.replace("<ST>", "<CFC>").replace("</ST>", "</CFC>"))
    sources = load_sources([tmp_path])
    listed = [text for text in render_all(check_sources(sources).diagnostics, sources) if "CFC" in text]
    assert [text.count("\n") for text in listed] == [0]


def test_a_list_of_globals_has_the_name_in_the_file_of_twincat(tmp_path: Path) -> None:
    (tmp_path / "Limits.TcGVL").write_text(GLOBALS)
    (tmp_path / "main.st").write_text("PROGRAM Main\nVAR n : INT; END_VAR\nn := GVL_Limits.highest;\nEND_PROGRAM\n")
    with started(tmp_path) as plc:
        plc.run_cycles(1)
        assert plc.read("Main.n") == 5


@pytest.mark.parametrize("tag", ["LD", "SFC"])
def test_a_diagram_of_twincat_says_how_it_can_be_read(tmp_path: Path, tag: str) -> None:
    path = tmp_path / "A.TcPOU"
    path.write_text(MAIN.replace("<ST>", f"<{tag}>").replace("</ST>", f"</{tag}>"))
    found = next(d for d in check_sources(load_sources([path])).diagnostics if d.code == "language")
    assert found.message.endswith("; export the project as PLCopen XML, of which SFC, LD and FBD are read")


def test_what_a_cut_off_file_declares_is_not_missing(tmp_path: Path) -> None:
    (tmp_path / "FB_Counter.TcPOU").write_text(BLOCK[: BLOCK.index("<Action")])
    (tmp_path / "MAIN.st").write_text("PROGRAM MAIN\nVAR f : FB_Counter; p : MC_Power; END_VAR\nf();\nEND_PROGRAM")
    errors = [d for d in check_sources(load_sources([tmp_path])).diagnostics if d.severity == "error"]
    assert [d.code for d in errors] == ["xml", "unknown"]
    assert errors[1].message == "unknown type MC_Power"


def test_scl_of_siemens_is_one_error_that_says_what_to_write(tmp_path: Path) -> None:
    (tmp_path / "main.st").write_text("PROGRAM Main\nVAR n : INT; END_VAR\nn := k;\nEND_PROGRAM\n")
    (tmp_path / "valve.scl").write_text(
        "// (* TIA Portal *)\nTYPE T : INT; END_TYPE\n"
        '  FUNCTION_BLOCK "Valve"\nVERSION : 0.1\nBEGIN\n#tmr(IN := #cmd);\nEND_FUNCTION_BLOCK\n'
    )
    sources = load_sources([tmp_path])
    found = [(d.file, d.line, d.column, d.message) for d in check_sources(sources).diagnostics if d.severity == "error"]
    assert [message for *_, message in found if "unknown name k" in message] and len(found) == 2
    ((_, line, column, message),) = [error for error in found if error[0].endswith(".scl")]
    assert (line, column) == (3, 3) and "names without # and quotes" in message


@pytest.mark.parametrize("text", ['(* as in\nFUNCTION "f" *)', 'VAR_GLOBAL w : WSTRING := "DATA_BLOCK x"; END_VAR'])
def test_a_text_that_only_mentions_units_of_siemens_is_none(tmp_path: Path, text: str) -> None:
    (tmp_path / "main.st").write_text(f"{text}\nPROGRAM Main\nEND_PROGRAM\n")
    assert check_sources(load_sources([tmp_path])).ok


AUTOMATION_STUDIO = {
    "Lib.fun": """{REDUND_ERROR} FUNCTION_BLOCK Drive (*moves*)
    VAR_INPUT
        speed : {REDUND_UNREPLICABLE} REAL; (*of it*)
    END_VAR
    VAR
        twice : REAL;
    END_VAR
END_FUNCTION_BLOCK
FUNCTION Scale : REAL
    VAR_INPUT x : REAL; END_VAR
END_FUNCTION
FUNCTION Whole : INT
    VAR_INPUT x : INT; END_VAR
    Whole := x + 1;
END_FUNCTION
""",
    "Drive.st": "(* moves *)\nFUNCTION_BLOCK Drive\n    twice := Scale(speed);\nEND_FUNCTION_BLOCK\n",
    "Scale.st": "FUNCTION Scale Scale := x * 2.0; END_FUNCTION\n",
    "Main.st": "PROGRAM Main\nVAR d : Drive; n : INT; END_VAR\nd(speed := 1.5);\nn := Whole(6);\nEND_PROGRAM\n",
}


def in_files(folder: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        (folder / name).write_text(text)
    return folder


def test_bodies_of_automation_studio_find_their_declarations(tmp_path: Path) -> None:
    assert errors(in_files(tmp_path, AUTOMATION_STUDIO)) == []
    with started(tmp_path) as plc:
        plc.run_cycles(1)
        assert (plc.read("Main.d.twice"), plc.read("Main.n")) == (3.0, 7)


def test_errors_in_a_unit_of_automation_studio_are_in_the_file_that_has_them(tmp_path: Path) -> None:
    wrong = AUTOMATION_STUDIO | {
        "Lib.fun": AUTOMATION_STUDIO["Lib.fun"].replace("twice : REAL", "twice : REEL"),
        "Scale.st": "FUNCTION Scale Scale := y * 2.0; END_FUNCTION\n",
    }
    assert errors(in_files(tmp_path, wrong)) == [
        ("Lib.fun", 6, 17, "unknown type REEL; did you mean REAL?"),
        ("Scale.st", 1, 25, "unknown name y"),
    ]


def test_a_body_that_declares_something_is_another_unit(tmp_path: Path) -> None:
    own = AUTOMATION_STUDIO | {
        "Scale.st": "FUNCTION Scale : REAL VAR_INPUT x : REAL; END_VAR Scale := x; END_FUNCTION\n"
    }
    assert any("declared already" in message for *_, message in errors(in_files(tmp_path, own)))


def errors(folder: Path) -> list[tuple[str, int, int, str]]:
    found = check_sources(load_sources([folder])).diagnostics
    return [(Path(d.file).name, d.line, d.column, d.message) for d in found if d.severity == "error"]


@pytest.mark.parametrize(("name", "better"), [("main.txt", "main.st"), ("main.st.txt", "main.st"), ("A.TXT", "A.st")])
def test_text_with_another_name_is_named_in_a_folder_without_sources(tmp_path: Path, name: str, better: str) -> None:
    (tmp_path / name).write_text("(* blink *)\nPROGRAM Main\nEND_PROGRAM\n")
    with pytest.raises(UsageError, match=f"{name} seems to be one: rename it to {better}"):
        load_sources([tmp_path])


def test_text_that_is_no_program_is_not_named(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("A program for the pump.\n")
    with pytest.raises(UsageError, match=r"has no source file \(.st, .exp, .TcPOU ...\)\.$"):
        load_sources([tmp_path])


def test_current_folder_without_sources_is_named_in_words(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UsageError, match=r"^The current folder has no source file"):
        load_sources([Path(".")])


def test_several_programs_of_a_twincat_project_without_a_task_are_a_library(tmp_path: Path) -> None:
    for name in ("First", "Second"):
        (tmp_path / f"{name}.TcPOU").write_text(COUNTING.replace("MAIN", name))
    result = check_sources(load_sources([tmp_path]))
    assert result.ok
    assert [d.message for d in result.diagnostics if d.code == "no-program"] == [
        "several programs and no task, so nothing would run; write a CONFIGURATION that says what runs, "
        "unless this is a library"
    ]
