"""Completion: what fits is there, best first, and what is inserted parses."""

from __future__ import annotations

from pathlib import Path

import pytest
from editor import Editor, edited

from plctool.compiler.base.source import Source
from plctool.compiler.syntax.parser import parse


@pytest.fixture(autouse=True)
def _open(editor: Editor) -> None:
    for name in ("src/types.st", "src/pump.st", "src/main.st", "src/globals.st"):
        editor.open(name)


def test_after_a_point_come_the_parameters_and_methods_of_an_instance(editor: Editor) -> None:
    assert editor.labels("src/main.st", "IF pump.", "Start") == ["enable", "level", "running", "Start"]


def test_inside_the_block_its_own_variables_are_offered_but_not_those_of_an_instance(editor: Editor) -> None:
    assert editor.labels("src/pump.st", "place.", "x :=") == ["x", "y"]
    assert "timer" in editor.labels("src/pump.st", "running := ", "TRUE")
    assert "ET" in editor.labels("src/pump.st", "IF timer.", "Q")


def test_a_method_of_a_base_is_offered(editor: Editor) -> None:
    editor.type("src/main.st", editor.texts["src/main.st"].replace("n := Scaled", "big.\nn := Scaled"))
    assert "Start" in editor.labels("src/main.st", "\nbig.")


def test_after_an_unfinished_point_the_next_line_does_not_matter(editor: Editor) -> None:
    editor.type("src/main.st", editor.texts["src/main.st"].replace("n := Scaled", "IF pump.\nn := Scaled"))
    assert editor.labels("src/main.st", "IF pump.", "\n") == ["enable", "level", "running", "Start"]


def test_parameters_come_first_with_their_types_and_only_those_that_are_missing(editor: Editor) -> None:
    items = editor.complete("src/main.st", "pump(", "enable")
    assert (items[0]["label"], items[0]["detail"]) == ("enable :=", "BOOL")
    labels = [i["label"] for i in items if i["label"].endswith((":=", "=>"))]
    assert labels == ["enable :=", "level :=", "running =>"]
    editor.type("src/main.st", editor.texts["src/main.st"].replace("LIMIT_HIGH);", "LIMIT_HIGH, );"))
    after = editor.labels("src/main.st", "LIMIT_HIGH, ", ");")
    assert [label for label in after if label.endswith((":=", "=>"))] == ["running =>"]


@pytest.mark.parametrize(
    ("statement", "cursor"),
    [("color := ;", "color := "), ("IF color = THEN END_IF;", "IF color = "), ("color := G;", "color := ")],
)
def test_values_of_an_enumeration_come_first_where_one_is_expected(editor: Editor, statement: str, cursor: str) -> None:
    editor.type("src/pump.st", editor.texts["src/pump.st"].replace("color := Green;", statement))
    assert set(editor.labels("src/pump.st", cursor)[:3]) == {"Red", "Green", "Blue"}


def test_what_was_typed_chooses(editor: Editor) -> None:
    editor.type("src/pump.st", editor.texts["src/pump.st"].replace("color := Green;", "color := gr;"))
    assert editor.labels("src/pump.st", "color := gr")[0] == "Green"


def test_types_are_offered_after_the_colon_of_a_declaration(editor: Editor) -> None:
    editor.type("src/main.st", editor.texts["src/main.st"].replace("n : INT;", "n : INT; t : TO;"))
    labels = editor.labels("src/main.st", "t : TO")
    assert {"TON", "TOF"} <= set(labels)
    assert "TRUE" not in labels


def test_blocks_are_offered_after_extends_and_interfaces_after_implements(editor: Editor) -> None:
    assert editor.labels("src/pump.st", "EXTENDS ", "Pump") == ["IDrive", "Point", "Pump"]
    assert editor.labels("src/pump.st", "IMPLEMENTS ", "IDrive") == ["IDrive"]


def test_nothing_is_offered_in_comments_and_strings(editor: Editor) -> None:
    assert editor.labels("src/pump.st", "(* Moves ", "water") == []
    assert editor.labels("src/pump.st", "// switches ", "it on") == []
    editor.type("src/main.st", editor.texts["src/main.st"].replace("n := Scaled", "s := 'n'; n := Scaled"))
    assert editor.labels("src/main.st", "s := '", "n") == []


def test_snippets_are_templates_only_for_editors_that_take_them(folder: Path) -> None:
    item = {"completionItem": {"snippetSupport": True}}
    with Editor(folder, capabilities={"textDocument": {"completion": item}}) as editor:
        editor.open("src/main.st")
        found = next(i for i in editor.complete("src/main.st", "END_IF;\n", "END_PROGRAM") if i["label"] == "FOR")
        assert found["insertTextFormat"] == 2
        assert "${1:i}" in found["textEdit"]["newText"]


def test_an_item_that_is_looked_at_gets_its_documentation(editor: Editor) -> None:
    item = next(i for i in editor.complete("src/main.st", "IF pump.", "Start") if i["label"] == "level")
    resolved = editor.request("completionItem/resolve", item)
    assert "level : INT := 5;" in resolved["documentation"]["value"]


def test_libraries_of_other_systems_are_named(editor: Editor) -> None:
    editor.type("src/main.st", editor.texts["src/main.st"].replace("n : INT;", "n : INT; b : BLIN;"))
    item = next(i for i in editor.complete("src/main.st", "b : BLIN") if i["label"] == "BLINK")
    assert item["labelDetails"]["description"] == "Util of CODESYS"


def test_statements_of_tests_are_offered_in_a_test_only(editor: Editor) -> None:
    editor.type("src/main.st", editor.texts["src/main.st"] + "\nTEST 't'\nFO\nEND_TEST\n")
    labels = editor.labels("src/main.st", "TEST 't'\nFO")
    assert labels[:2] == ["FORCE", "FOR"]
    assert "FORCE" not in editor.labels("src/main.st", "END_IF;\n", "END_PROGRAM")


PLACES = [
    ("src/main.st", "n := ", "Scaled(n, 3);", "{};"),
    ("src/main.st", "gCount := gCount ", "+ 1;", "{} 1;"),
    ("src/main.st", "END_IF;\n", "END_PROGRAM", "{}\nEND_PROGRAM"),
    ("src/main.st", "pump(", "enable := gStart,", "{}"),
    ("src/pump.st", "color : ", "Color;", "{};"),
    ("src/pump.st", "color := ", "Green;", "{};"),
    ("src/pump.st", "END_FUNCTION_BLOCK\n", "\nFUNCTION_BLOCK BigPump", "{}\n\nFUNCTION_BLOCK BigPump"),
    ("src/pump.st", "points : ARRAY[0..", "3]", "{}]"),
]


@pytest.mark.parametrize(("name", "before", "after", "form"), PLACES)
def test_what_is_inserted_parses(editor: Editor, name: str, before: str, after: str, form: str) -> None:
    original = editor.texts[name]
    text = original.replace(before + after, before + form.replace("{}", ""), 1)
    editor.type(name, text)
    items = editor.complete(name, before, form.replace("{}", ""))
    assert items
    for item in items:
        made = edited(text, [item["textEdit"]])
        end = text.index(before) + len(before + item["textEdit"]["newText"])  # what comes then is still to be written
        errors: list[str] = []
        parse(Source(name, made[:end]), lambda at, code, said: errors.append(said) if at < end else None)  # noqa: B023
        assert errors == [], f"{item['label']}: {made}"
