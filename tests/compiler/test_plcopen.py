"""PLCopen XML: declarations, tasks, what CODESYS adds, and what is said of files that cannot be read."""

from __future__ import annotations

from pathlib import Path

import pytest
from plcopen_support import data, errors, pou, project, st, started, variable, variables, written

from plctool.compiler import load_sources
from plctool.compiler.front import check_sources

COUNTING = st("n := n + 1;\nIF n > 2 AND n < 4 THEN\n    b := TRUE;\nEND_IF;")
COUNTER = pou("Main", COUNTING, variables("localVars", "n:INT:=1", "b:BOOL"))
TASKS = """<configuration name="Config0"><resource name="Res0">
<globalVars><variable name="g" address="%QW0"><type><INT/></type></variable></globalVars>
<task name="fast" priority="2" interval="T#5ms"><pouInstance name="one" typeName="Main"/></task>
<task name="slow" priority="3" interval="PT0.02S"><pouInstance name="two" typeName="Main"/></task>
</resource></configuration>"""


def test_a_program_in_structured_text_runs(tmp_path: Path) -> None:
    with started(tmp_path, project(COUNTER)) as plc:
        plc.run_cycles(2)
        assert plc.read("Main.n") == 3
        assert plc.read("Main.b") is True


def test_errors_have_the_line_and_column_of_the_xml(tmp_path: Path) -> None:
    text = project(COUNTER.replace("b := TRUE", "c := TRUE").replace("&lt; 4", "&lt; nn"))
    found = [d for d in check_sources(load_sources([written(tmp_path, text)])).diagnostics if d.severity == "error"]
    lines = text.splitlines()
    assert [lines[d.line - 1][d.column - 1 :][:2] for d in found] == ["nn", "c "]


def test_an_unknown_type_is_reported_where_the_variable_is(tmp_path: Path) -> None:
    text = project(COUNTER.replace("<BOOL/>", '<derived name="Missing"/>'))
    (found, *_) = errors(tmp_path, text)
    assert "Missing" in text.splitlines()[found[0] - 1]


def test_tasks_have_their_programs_and_intervals(tmp_path: Path) -> None:
    text = project(COUNTER, instances=TASKS)
    program = check_sources(load_sources([written(tmp_path, text)])).program
    assert program is not None
    assert [(t.name, t.interval_us, t.priority) for t in program.tasks] == [("fast", 5000, 2), ("slow", 20000, 3)]
    assert [p.name for t in program.tasks for p in t.programs] == ["one", "two"]


APPLICATION = data(
    "application",
    '<resource name="Application"><task name="MainTask" interval="PT0.03S" priority="1">'
    '<pouInstance name="Main" typeName=""/><addData>'
    + data("tasksettings", '<TaskSettings KindOfTask="Cyclic" Interval="t#30ms" IntervalUnit="ms"/>')
    + '</addData></task><task name="Visu" interval="PT0.1S"><pouInstance name="VisuElems.Visu_Prg" typeName=""/></task>'
    '<task name="Idle" priority="9"><pouInstance name="Other" typeName=""/><addData>'
    + data("tasksettings", '<TaskSettings KindOfTask="Freewheeling"/>')
    + "</addData></task><addData>"
    + data("pou", COUNTER)
    + data("pou", COUNTER.replace("Main", "Other"))
    + "</addData></resource>",
)


def test_an_application_of_codesys_has_its_tasks_and_units(tmp_path: Path) -> None:
    program = check_sources(load_sources([written(tmp_path, project(added=APPLICATION))])).program
    assert program is not None
    assert [(t.name, t.interval_us, [p.name for p in t.programs]) for t in program.tasks] == [
        ("MainTask", 30_000, ["Main"]),
        ("Idle", 0, ["Other"]),
    ]


TYPES = """
<dataType name="State"><baseType><enum><values>
  <value name="Idle"/><value name="Busy" value="5"/></values></enum></baseType></dataType>
<dataType name="Row"><baseType><array><dimension lower="1" upper="3"/><baseType><INT/></baseType></array></baseType>
  <initialValue><arrayValue><value repetitionValue="2"><simpleValue value="7"/></value>
  <value><simpleValue value="9"/></value></arrayValue></initialValue></dataType>
<dataType name="Point"><baseType><struct>
  <variable name="x"><type><INT/></type><initialValue><simpleValue value="3"/></initialValue></variable>
  <variable name="name"><type><string length="5"/></type></variable></struct></baseType></dataType>
<dataType name="Small"><baseType><subrangeSigned><range lower="-5" upper="5"/><baseType><INT/></baseType>
  </subrangeSigned></baseType></dataType>"""


def test_types_of_the_project_are_read(tmp_path: Path) -> None:
    body = st("sum := r[1] + r[3] + p.x + q.x; s := State#Busy; p.name := 'abcdefg'; l := LEN(p.name); z := 4;")
    local = variables("localVars", "r:Row", "p:Point", "s:State", "sum:INT", "l:INT", "z:Small").replace(
        "</localVars>",
        '<variable name="q"><type><derived name="Point"/></type><initialValue><structValue><value member="x">'
        '<simpleValue value="10"/></value></structValue></initialValue></variable></localVars>',
    )
    with started(tmp_path, project(pou("Main", body, local), TYPES)) as plc:
        plc.run_cycles(1)
        assert plc.read("Main.sum") == 29
        assert plc.read("Main.l") == 5
        assert plc.read("Main.s") in (5, "Busy")


def test_a_union_stands_beside_the_types_of_the_standard(tmp_path: Path) -> None:
    union = '<union name="Pair"><variable name="w"><type><WORD/></type></variable>' + variable("b:Bytes") + "</union>"
    bounds = '<dimension lower="0" upper="1"/>'
    array = f'<dataType name="Bytes"><baseType><array>{bounds}<baseType><BYTE/></baseType></array>'
    body = st("p.b[0] := 16#34; p.b[1] := 16#12; n := p.w;")
    main = pou("Main", body, variables("localVars", "p:Pair", "n:WORD"))
    text = project(main, f"{array}</baseType></dataType>", added=data("union", union))
    with started(tmp_path, text) as plc:
        plc.run_cycles(1)
        assert plc.read("Main.n") == 0x1234
    assert errors(tmp_path, text.replace("n := p.w", "n := p.x"))[0][1].startswith("Pair has no member x")


GLOBALS = data("globalvars", '<globalVars name="GVL" constant="true">' + variable("limit:INT:=4") + "</globalVars>")
MIXED = data(
    "globalvars",
    '<globalVars name="Mixed">' + variable("a:INT:=1") + variable("k:INT:=2") + "<addData>"
    + data("mixedattrsvarlist", "<MixedAttrsVarList>"
        + '<globalVars name="Mixed">' + variable("a:INT:=1") + "</globalVars>"
        + '<globalVars name="Mixed" constant="true">' + variable("k:INT:=2") + "</globalVars></MixedAttrsVarList>")
    + data("attributes", '<Attributes><Attribute Name="qualified_only" Value=""/></Attributes>')
    + "</addData></globalVars>",
)  # fmt: skip


def test_lists_of_globals_have_their_names_and_qualifiers(tmp_path: Path) -> None:
    main = pou("Main", st("Mixed.a := GVL.limit + Mixed.k;"), variables("localVars", "n:INT"))
    with started(tmp_path, project(main, added=GLOBALS + MIXED)) as plc:
        plc.run_cycles(1)
        assert plc.read("Mixed.a") == 6
    main = pou("Main", st("GVL.limit := 1;\nMixed.k := 1;\na := 1;"), variables("localVars", "n:INT"))
    found = errors(tmp_path, project(main, added=GLOBALS + MIXED))
    assert len(found) == 3


METHODS = data(
    "method",
    '<Method name="Add"><interface><returnType><INT/></returnType>'
    + variables("inputVars", "by:INT")
    + f"</interface><body>{st('total := total + by; Add := total;')}</body></Method>",
) + data(
    "property",
    '<Property name="Double"><interface><returnType><INT/></returnType></interface>'
    f"<SetAccessor><interface/><body>{st('total := Double / 2;')}</body></SetAccessor>"
    f"<GetAccessor><interface/><body>{st('Double := total * 2;')}</body></GetAccessor></Property>",
)
BLOCK = pou(
    "Counter",
    st("total := total + 1;"),
    variables("localVars", "total:INT"),
    "functionBlock",
    f'<actions><action name="Clear"><body>{st("total := 0;")}</body></action></actions><addData>{METHODS}</addData>',
)
USER = pou(
    "Main",
    st("c(); sum := c.Add(4); d := c.Double; c.Clear(); c.Double := 20; e := c.Double;"),
    variables("localVars", "c:Counter", "sum:INT", "d:INT", "e:INT"),
)


def test_methods_properties_and_actions_run(tmp_path: Path) -> None:
    with started(tmp_path, project(BLOCK + USER)) as plc:
        plc.run_cycles(1)
        assert [plc.read(f"Main.{name}") for name in ("sum", "d", "e")] == [5, 10, 20]


def as_text(declaration: str) -> str:
    """A declaration as plain text."""
    inner = f"<InterfaceAsPlainText><xhtml>{declaration}</xhtml></InterfaceAsPlainText>"
    return f"<addData>{data('interfaceasplaintext', inner)}</addData>"


def test_a_declaration_as_plain_text_is_taken_as_it_is(tmp_path: Path) -> None:
    plain = "{attribute 'hide'}\nFUNCTION_BLOCK Base\nVAR\n    total : INT := 5;  // from here\nEND_VAR"
    text = as_text(plain)
    derived = as_text("PROGRAM Main VAR b : Base; t : INT; END_VAR")
    base = pou("Base", st("total := total + 1;"), "", "functionBlock", text)
    main = pou("Main", st("b(); t := t + 1;"), "", more=derived)
    with started(tmp_path, project(base + main)) as plc:
        plc.run_cycles(3)
        assert plc.read("Main.b.total") == 8


def test_a_block_may_extend_one_and_implement_an_interface(tmp_path: Path) -> None:
    inheritance = data(
        "pouinheritance", "<Inheritance><Extends>Counter</Extends><Implements>I_Add</Implements></Inheritance>"
    )
    derived = pou("More", st("SUPER^();"), f"<addData>{inheritance}</addData>", "functionBlock")
    interface = data(
        "interface",
        '<Interface name="I_Add"><Methods><Method name="Add"><interface><returnType><INT/></returnType>'
        + variables("inputVars", "by:INT")
        + "</interface></Method></Methods></Interface>",
    )
    with started(tmp_path, project(BLOCK + derived + USER.replace("Counter", "More"), added=interface)) as plc:
        plc.run_cycles(1)
        assert plc.read("Main.sum") == 5


def test_a_diagram_that_is_not_read_is_named_and_the_rest_is_checked(tmp_path: Path) -> None:
    drawn = pou("Drawn", "<CFC><vendorElement localId='1'/></CFC>", variables("outputVars", "q:BOOL"), "functionBlock")
    listed = pou("Listed", "<IL><xhtml>\nADD a</xhtml></IL>", "", "functionBlock")
    main = pou("Main", st("d();\nb := d.q;\nb := d.r;"), variables("localVars", "d:Drawn", "b:BOOL"))
    found = errors(tmp_path, project(drawn + listed + main))
    assert [message.partition(" cannot")[0] for _, message in found[:2]] == [
        "the diagram Drawn (CFC)",
        "ADD needs a result, and nothing is loaded here; begin with LD",
    ]
    assert found[2][1].startswith("Drawn has no variable r")


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ('<?xml version="1.0"?>\n<!DOCTYPE a [<!ENTITY x "y">]>\n<project/>', 2, "document type"),
        ("<project>\n<types>\n</project>", 3, "not well-formed XML: mismatched tag"),
        ("", 1, "not well-formed XML: no element found"),
        ("<a>" * 1000, 1, "more than 200 elements stand in each other"),
        ("<ExportFile/>", 1, "<ExportFile> is not PLCopen XML"),
        (project(pou("X", "", kind="macro")), 7, "X is a macro"),
    ],
)
def test_what_is_no_project_is_an_error_with_a_line(tmp_path: Path, text: str, line: int, message: str) -> None:
    ((found, said), *_) = errors(tmp_path, text)
    assert message in said
    assert abs(found - line) <= 1


def test_other_xml_files_in_a_folder_are_left_out(tmp_path: Path) -> None:
    written(tmp_path, project(COUNTER))
    (tmp_path / "settings.xml").write_text("<settings/>")
    (tmp_path / "build").mkdir()
    (tmp_path / "build" / "generated_plc.st").write_text("PROGRAM Main END_PROGRAM")
    assert {Path(s.path).name for s in load_sources([tmp_path])} == {"plc.xml"}


@pytest.mark.parametrize(("interval", "microseconds"), [("00:00:00.100000", 100_000), ("00:01:01", 61_000_000)])
def test_an_interval_may_be_a_time_of_day(tmp_path: Path, interval: str, microseconds: int) -> None:
    task = f'<task name="T" priority="0" interval="{interval}"><pouInstance name="I" typeName="Main"/></task>'
    resource = f'<configuration name="C"><resource name="R">{task}</resource></configuration>'
    path = written(tmp_path, project(pou("Main", st("n := n + 1;"), variables("localVars", "n:INT")), "", resource))
    program = check_sources(load_sources([path])).program
    assert program is not None
    assert [t.interval_us for t in program.tasks] == [microseconds]
