"""Sources in XML, libraries, namespaces, projects of other systems, several projects in one workspace."""

from __future__ import annotations

from pathlib import Path

import pytest
from editor import Editor, RequestFailed, words

TCPOU = """<?xml version="1.0" encoding="utf-8"?>
<TcPlcObject Version="1.1.0.1">
  <POU Name="Valve" Id="{1}">
    <Declaration><![CDATA[FUNCTION_BLOCK Valve
VAR_INPUT
    open : BOOL; // command
END_VAR
VAR
    moves : INT;
END_VAR
]]></Declaration>
    <Implementation>
      <ST><![CDATA[IF open THEN
    moves := moves + 1;
END_IF
]]></ST>
    </Implementation>
    <Method Name="Reset" Id="{2}">
      <Declaration><![CDATA[METHOD Reset : BOOL]]></Declaration>
      <Implementation>
        <ST><![CDATA[moves := 0;
Reset := TRUE;]]></ST>
      </Implementation>
    </Method>
  </POU>
</TcPlcObject>
"""
MAIN = """PROGRAM Main
VAR
    valve : Valve;
END_VAR
valve(open := TRUE);
valve.Reset();
END_PROGRAM
"""


@pytest.fixture
def twincat(tmp_path: Path) -> Path:
    """A folder with a TwinCAT object and a program."""
    (tmp_path / "Valve.TcPOU").write_text(TCPOU)
    (tmp_path / "main.st").write_text(MAIN)
    return tmp_path


def test_words_of_an_xml_source_are_known_where_they_stand_in_the_file(twincat: Path) -> None:
    with Editor(twincat) as editor:
        editor.open("Valve.TcPOU")
        editor.open("main.st")
        assert "open : BOOL" in editor.at("hover", "Valve.TcPOU", "IF op", "en THEN")["contents"]["value"]
        found = editor.at("definition", "main.st", "valve.Re", "set")
        assert Path(found["uri"]).name == "Valve.TcPOU"
        assert words(editor, "Valve.TcPOU", found["range"]) == "Reset"
        assert editor.labels("main.st", "valve.", "Reset") == ["open", "Reset"]
        references = editor.at("references", "Valve.TcPOU", "    mo", "ves : INT", context={"includeDeclaration": True})
        assert len(references) == 4
        assert {words(editor, "Valve.TcPOU", r["range"]) for r in references} == {"moves"}


def test_errors_of_an_xml_source_are_shown_in_its_lines(twincat: Path) -> None:
    with Editor(twincat) as editor:
        editor.open("Valve.TcPOU")
        editor.type("Valve.TcPOU", TCPOU.replace("moves := 0;", "movs := 0;"))
        (found,) = editor.expect("Valve.TcPOU", "did you mean moves?")
        assert words(editor, "Valve.TcPOU", found["range"]) == "movs"


def test_rename_through_an_xml_source_is_refused_in_words(twincat: Path) -> None:
    with Editor(twincat) as editor:
        editor.open("main.st")
        with pytest.raises(
            RequestFailed, match=r"open is used in .*Valve\.TcPOU \(line \d+\), which is not plain text"
        ):
            editor.at("rename", "main.st", "valve(op", "en", newName="opened")


def test_a_library_given_as_source_is_completed_and_found(tmp_path: Path) -> None:
    library = tmp_path / "lib"
    library.mkdir()
    (library / "library.toml").write_text('name = "Tools"\nversion = "1.0.0"\n')
    (library / "tools.st").write_text(
        "// Doubles a number.\nFUNCTION Doubled : INT\nVAR_INPUT\n    value : INT;\nEND_VAR\n"
        "Doubled := 2 * value;\nEND_FUNCTION\n"
    )
    (tmp_path / "plc.toml").write_text('sources = ["main.st"]\nlibraries = ["lib"]\n')
    (tmp_path / "main.st").write_text("PROGRAM Main\nVAR\n    n : INT;\nEND_VAR\nn := Tools.Doubled(n);\nEND_PROGRAM\n")
    with Editor(tmp_path) as editor:
        editor.open("main.st")
        assert "Doubles a number." in editor.at("hover", "main.st", "Tools.Dou", "bled")["contents"]["value"]
        found = editor.at("definition", "main.st", "Tools.Dou", "bled")
        assert Path(found["uri"]).name == "tools.st" and found["range"]["start"]["line"] == 1
        assert editor.labels("main.st", "Tools.", "Doubled") == ["Doubled"]
        assert "Doubled" in editor.labels("main.st", "n := ", "Tools")
        with pytest.raises(RequestFailed, match="declared in a library"):
            editor.at("rename", "main.st", "Tools.Dou", "bled", newName="Twice")


def test_names_in_namespaces_are_found(tmp_path: Path) -> None:
    (tmp_path / "space.st").write_text(
        "NAMESPACE Plant\nFUNCTION Twice : INT\nVAR_INPUT\n    value : INT;\nEND_VAR\n"
        "Twice := 2 * value;\nEND_FUNCTION\nEND_NAMESPACE\n"
    )
    (tmp_path / "main.st").write_text(
        "PROGRAM Main\nVAR\n    n : INT;\nEND_VAR\nn := Plant.Twice(value := n);\nEND_PROGRAM\n"
    )
    with Editor(tmp_path) as editor:
        editor.open("main.st")
        assert Path(editor.at("definition", "main.st", "Plant.Tw", "ice")["uri"]).name == "space.st"
        assert editor.labels("main.st", "Plant.", "Twice") == ["Twice"]
        assert editor.labels("main.st", "Twice(", "value")[0] == "value :="


def test_two_projects_in_one_workspace_do_not_see_each_other(tmp_path: Path) -> None:
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "plc.toml").write_text("")
        (tmp_path / name / "main.st").write_text(
            f"PROGRAM Main\nVAR\n    {name} : INT;\nEND_VAR\n{name} := 1;\nEND_PROGRAM\n"
        )
    with Editor(tmp_path) as editor:
        editor.open("one/main.st")
        editor.open("two/main.st")
        editor.type("two/main.st", editor.texts["two/main.st"].replace("two := 1", "one := 1"))
        editor.wait(lambda: "unknown name one" in str(editor.messages_of("two/main.st")), "the error of the second")
        assert "one" in editor.labels("one/main.st", "END_VAR\n", "one := 1")
        assert "one" not in editor.labels("two/main.st", "END_VAR\n", "one := 1")


def test_variables_of_charts_and_tests_are_known(tmp_path: Path) -> None:
    (tmp_path / "main.st").write_text(
        """FUNCTION_BLOCK Seq
VAR
    go : BOOL;
END_VAR
INITIAL_STEP Idle:
END_STEP
STEP Run:
END_STEP
TRANSITION FROM Idle TO Run := go;
END_TRANSITION
TRANSITION FROM Run TO Idle := NOT go;
END_TRANSITION
END_FUNCTION_BLOCK
TEST 'it runs'
VAR
    seq : Seq;
END_VAR
seq();
ASSERT_TRUE(seq.go);
END_TEST
"""
    )
    with Editor(tmp_path) as editor:
        editor.open("main.st")
        assert editor.at("definition", "main.st", "FROM Id", "le TO")["range"]["start"]["line"] == 4
        assert "Seq" in editor.at("hover", "main.st", "END_VAR\nse", "q();")["contents"]["value"]
        assert "go" in editor.labels("main.st", "ASSERT_TRUE(seq.", "go")
