"""PLCopen XML out: what stands where in the file, and what is refused with its line."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest

from plctool.compiler.base.source import Source
from plctool.compiler.formats.plcopen import read_project
from plctool.compiler.front import check_sources
from plctool.compiler.plcopen_export.project import Written, write_project

NS = {"p": "http://www.plcopen.org/xml/tc6_0201", "x": "http://www.w3.org/1999/xhtml"}


def exported(text: str) -> Written:
    source = Source("GVL.st", text)
    result = check_sources([source])
    assert result.ok, result.diagnostics
    return write_project([source], "p", frozenset())


def tree(text: str) -> ElementTree.Element:
    written = exported(text)
    assert written.ok, written.diagnostics
    return ElementTree.fromstring(written.text)


def said(text: str) -> list[tuple[int, str]]:
    return [(d.line, d.message) for d in exported(text).diagnostics]


def test_variables_are_elements_of_the_standard_with_their_comments() -> None:
    root = tree(
        "PROGRAM Main\nVAR RETAIN\n"
        "  a : ARRAY[1..3] OF INT := [2(5), 1]; // the limits\n"
        "END_VAR\na[1] := 2;\nEND_PROGRAM\n"
    )
    section = root.find(".//p:pou[@name='Main']/p:interface/p:localVars", NS)
    assert section is not None
    assert section.get("retain") == "true"
    (variable,) = section.findall("p:variable", NS)
    assert variable.findtext(".//x:xhtml", namespaces=NS) == "the limits"
    dimension = variable.find(".//p:dimension", NS)
    assert dimension is not None
    assert (dimension.get("lower"), dimension.get("upper")) == ("1", "3")
    assert [v.get("repetitionValue") for v in variable.findall(".//p:arrayValue/p:value", NS)] == ["2", None]


def test_a_chart_is_steps_transitions_and_branches() -> None:
    text = """PROGRAM Main
VAR a : BOOL; END_VAR
INITIAL_STEP First: Act(N); END_STEP
STEP Left: END_STEP
STEP Right: END_STEP
TRANSITION FROM First TO (Left, Right) := a; END_TRANSITION
TRANSITION FROM (Left, Right) TO First := NOT a; END_TRANSITION
ACTION Act: a := NOT a; END_ACTION
END_PROGRAM
"""
    chart = tree(text).find(".//p:SFC", NS)
    assert chart is not None
    tags = [element.tag.partition("}")[2] for element in chart]
    assert {tag: tags.count(tag) for tag in tags} == {
        "step": 3, "actionBlock": 1, "transition": 2, "simultaneousConvergence": 1, "simultaneousDivergence": 1,
        "jumpStep": 1,
    }  # fmt: skip


def test_comments_and_signs_of_xml_come_back_as_they_were() -> None:
    text = (
        "(* head <&> *)\nPROGRAM Main\nVAR s : STRING; END_VAR\ns := ']]>  <b>&amp;'; // tail\nEND_PROGRAM\n// last\n"
    )
    written = exported(text)
    (source,) = read_project("p.xml", written.text)
    for part in ("(* head <&> *)", "']]>  <b>&amp;'; // tail"):
        assert part in source.text
    assert "// last" in ElementTree.tostring(ElementTree.fromstring(written.text), "unicode")


def test_a_list_of_globals_has_the_name_of_its_file_and_its_attributes() -> None:
    root = tree(
        "{attribute 'qualified_only'}\nVAR_GLOBAL\n  g AT %QW0 : INT;\nEND_VAR\nPROGRAM Main GVL.g := 1; END_PROGRAM\n"
    )
    (listed,) = root.findall(".//p:resource/p:globalVars", NS)
    assert listed.get("name") == "GVL"
    assert listed.find(".//p:Attribute[@Name='qualified_only']", NS) is not None


def test_attributes_of_a_type_stay_with_every_type_of_it() -> None:
    root = tree(
        "{attribute 'qualified_only'}\nTYPE\n A : (x, y);\n B : (x, y);\nEND_TYPE\n"
        "PROGRAM Main VAR a : A := A.y; END_VAR END_PROGRAM\n"
    )
    types = root.findall(".//p:dataType", NS)
    assert [t.get("name") for t in types] == ["A", "B"]
    assert all("qualified_only" in "".join(t.itertext()) for t in types)


MAIN = "PROGRAM Main\nVAR x : INT; END_VAR\nx := 1;\nEND_PROGRAM\n"


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        (f"{MAIN}NAMESPACE N\n{MAIN.replace('Main', 'Other')}END_NAMESPACE\n", 5, "no namespaces"),
        (f"{MAIN}CLASS C\nEND_CLASS\n", 5, "write FUNCTION_BLOCK"),
        (f"{{define debug}}\n{MAIN}", 1, "definition"),
        (f"{{IF NOT defined (x)}}\n{MAIN}{{END_IF}}\n{MAIN.replace('Main', 'Other')}", 2, "a condition around several"),
    ],
)  # fmt: skip
def test_a_file_with_what_has_no_place_is_kept_as_it_is_with_a_word(text: str, line: int, words: str) -> None:
    whole = Source("whole.st", "FUNCTION Twice : INT\nVAR_INPUT i : INT; END_VAR\nTwice := 2 * i;\nEND_FUNCTION\n")
    written = write_project([Source("GVL.st", text), whole], "p", frozenset())
    assert written.ok
    assert [(d.file, d.line) for d in written.diagnostics] == [("GVL.st", line)]
    assert words in written.diagnostics[0].message
    assert "plctool" in written.diagnostics[0].message
    units = ElementTree.fromstring(written.text).findall(".//p:pou", NS)
    assert [unit.get("name") for unit in units] == ["Twice"]
    _, kept = read_project("p.xml", written.text)
    assert kept.text == text
    assert kept.stem == "GVL"
    assert kept.pos(text.index("PROGRAM Main")).file == "p.xml"


def test_a_file_kept_as_it_is_has_the_lines_of_the_xml_in_diagnostics() -> None:
    written = write_project([Source("a.st", f"{{define debug}}\n{MAIN}".replace("x := 1", "x := y"))], "p", frozenset())
    (error,) = [d for d in check_sources(read_project("p.xml", written.text)).diagnostics if d.severity == "error"]
    assert "x := y;" in written.text.splitlines()[error.line - 1]


def test_a_character_that_xml_cannot_hold_is_refused_with_its_line() -> None:
    written = exported(f"{MAIN}// a bell: \x07\n")
    assert not written.ok
    assert any(d.line == 5 and "character 7" in d.message for d in written.diagnostics), written.diagnostics


def test_unit_tests_are_left_out_with_a_word() -> None:
    text = f"{MAIN}TEST 'one' ASSERT_EQ(1, 1); END_TEST\n"
    ((line, message),) = said(text)
    assert (line, "unit tests" in message) == (5, True)


@pytest.mark.parametrize(
    ("text", "line", "what"),
    [
        ("FUNCTION_BLOCK F\nVAR_INPUT\n  i : BOOL R_EDGE;\nEND_VAR\nEND_FUNCTION_BLOCK\n", 3, "R_EDGE"),
        ("FUNCTION_BLOCK F\nVAR_STAT n : INT; END_VAR\nn := n + 1;\nEND_FUNCTION_BLOCK\n", 2, "VAR_STAT"),
        ("TYPE U : UNION\n a : INT;\n b : WORD;\nEND_UNION END_TYPE\n", 1, "UNION"),
    ],
)
def test_what_only_the_plain_text_has_is_named(text: str, line: int, what: str) -> None:
    ((at, message),) = said(text + MAIN)
    assert at == line
    assert message.startswith(what)
