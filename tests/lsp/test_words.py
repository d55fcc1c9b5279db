"""What the server says of the word at the cursor: hover, signature, definition, references, rename."""

from __future__ import annotations

from pathlib import Path

import pytest
from editor import Editor, RequestFailed, edited, words


@pytest.fixture(autouse=True)
def _open(editor: Editor) -> None:
    for name in ("src/types.st", "src/pump.st", "src/main.st", "src/globals.st"):
        editor.open(name)


def hover(editor: Editor, name: str, before: str, after: str = "") -> str:
    """Returns what is shown."""
    return str(editor.at("hover", name, before, after)["contents"]["value"])


def target(editor: Editor, request: str, name: str, before: str, after: str = "") -> tuple[str, int]:
    """Returns the name of the file and the line, from 1, where a request leads."""
    found = editor.at(request, name, before, after)
    found = found[0] if isinstance(found, list) else found
    return Path(found["uri"]).name, found["range"]["start"]["line"] + 1


def test_hover_shows_declaration_and_comment_of_a_variable(editor: Editor) -> None:
    shown = hover(editor, "src/pump.st", "IN := ena", "ble")
    assert "VAR_INPUT\n    enable : BOOL;" in shown
    assert "switches it on" in shown


def test_hover_shows_comment_above_a_block_and_its_parameters(editor: Editor) -> None:
    shown = hover(editor, "src/main.st", "pump : Pu", "mp")
    assert "FUNCTION_BLOCK Pump IMPLEMENTS IDrive" in shown
    assert "level : INT := 5;" in shown
    assert "Moves water." in shown and "It needs a motor." in shown
    assert "running" in shown and "timer" not in shown


def test_hover_shows_the_address_of_an_input(editor: Editor) -> None:
    assert "Address: %IX0.0" in hover(editor, "src/main.st", "enable := gSt", "art")


def test_hover_shows_a_member_of_an_element_and_its_comment(editor: Editor) -> None:
    assert "y : REAL;" in hover(editor, "src/pump.st", "points[1].", "y")
    assert "from the left" in hover(editor, "src/pump.st", "place.", "x :=")


def test_hover_shows_what_the_standard_library_says(editor: Editor) -> None:
    assert "FUNCTION_BLOCK TON" in hover(editor, "src/pump.st", "timer : T", "ON")
    assert "standard library" in hover(editor, "src/pump.st", "timer.", "Q THEN")


def test_hover_in_a_comment_says_nothing(editor: Editor) -> None:
    assert editor.at("hover", "src/pump.st", "(* Moves wa", "ter") is None


def test_columns_count_utf_16_units(editor: Editor) -> None:
    editor.type("src/main.st", editor.texts["src/main.st"].replace("n := Sc", "(* 🙂 ü *) n := Sc"))
    result = editor.at("hover", "src/main.st", "🙂 ü *) n := Sca", "led")
    assert words(editor, "src/main.st", _shifted(result["range"], -1)) == "Scaled"


def _shifted(found: dict, by: int) -> dict:  # the emoji is one character of Python and two units
    return {end: {**place, "character": place["character"] + by} for end, place in found.items()}


def test_signature_shows_parameters_and_the_one_that_is_written(editor: Editor) -> None:
    help_ = editor.at("signatureHelp", "src/main.st", "Scaled(n, ", "3")
    assert help_["signatures"][0]["label"] == "Scaled(raw := INT, factor := INT) : INT"
    assert help_["activeParameter"] == 1


def test_signature_follows_names_of_parameters_and_unfinished_calls(editor: Editor) -> None:
    help_ = editor.at("signatureHelp", "src/main.st", "level := LIM", "IT")
    assert help_["activeParameter"] == 1
    assert "running => BOOL" in help_["signatures"][0]["label"]
    editor.type("src/main.st", editor.texts["src/main.st"].replace("n := Scaled(n, 3);", "n := Scaled(n, \n"))
    assert editor.at("signatureHelp", "src/main.st", "Scaled(n, ")["activeParameter"] == 1


def test_definition_leads_to_variables_methods_members_and_units(editor: Editor) -> None:
    assert target(editor, "definition", "src/main.st", "pump.Sta", "rt") == ("pump.st", 31)
    assert target(editor, "definition", "src/main.st", "enable := gSt", "art") == ("globals.st", 3)
    assert target(editor, "definition", "src/pump.st", "points[1].", "y") == ("types.st", 7)
    assert target(editor, "definition", "src/pump.st", "color := Gr", "een") == ("types.st", 1)
    assert target(editor, "definition", "src/main.st", "pump(ena", "ble") == ("pump.st", 13)
    assert target(editor, "definition", "src/main.st", "WITH Quick : Ma", "in") == ("main.st", 9)


def test_definition_leads_into_the_standard_library(editor: Editor) -> None:
    file, line = target(editor, "definition", "src/pump.st", "timer : TO", "N")
    assert file == "timers.st"
    path = Path(__file__).parents[2] / "host" / "plctool" / "stdlib" / file
    assert "FUNCTION_BLOCK TON" in path.read_text().split("\n")[line - 1]


def test_type_definition_leads_to_the_block_of_an_instance_and_the_type_of_elements(editor: Editor) -> None:
    assert target(editor, "typeDefinition", "src/main.st", "IF pu", "mp.") == ("pump.st", 11)
    assert target(editor, "typeDefinition", "src/pump.st", "poi", "nts[1]") == ("types.st", 4)


def test_implementation_of_an_interface_and_of_its_method(editor: Editor) -> None:
    found = editor.at("implementation", "src/pump.st", "INTERFACE IDr", "ive")
    assert [f["range"]["start"]["line"] + 1 for f in found] == [11, 39]
    assert target(editor, "implementation", "src/pump.st", "IDrive\nMETHOD St", "art") == ("pump.st", 31)


def test_references_are_found_in_all_files(editor: Editor) -> None:
    place = editor.place("src/pump.st", "    ena", "ble : BOOL")
    found = editor.request("textDocument/references", place | {"context": {"includeDeclaration": False}})
    where = sorted((Path(f["uri"]).name, words(editor, f"src/{Path(f['uri']).name}", f["range"])) for f in found)
    assert where == [("main.st", "enable"), ("main.st", "enable"), ("pump.st", "enable")]


def test_references_do_not_mix_variables_of_one_name(editor: Editor) -> None:
    place = editor.place("src/pump.st", "Start := spe", "ed")
    found = editor.request("textDocument/references", place | {"context": {"includeDeclaration": True}})
    assert len(found) == 3  # declaration and use in Pump.Start, argument in Main; not that of the interface


def test_highlights_say_where_a_variable_is_written(editor: Editor) -> None:
    found = editor.at("documentHighlight", "src/main.st", "\nn", " := Scaled")
    assert [f["kind"] for f in found] == [2, 3, 2, 2]


def test_rename_there_and_back_gives_the_same_text(editor: Editor) -> None:
    before = dict(editor.texts)
    for old, new in (("running", "turning"), ("turning", "running")):
        edit = editor.at("rename", "src/pump.st", f"    {old[:4]}", f"{old[4:]} : BOOL", newName=new)
        for uri, edits in edit["changes"].items():
            name = f"src/{Path(uri).name}"
            editor.type(name, edited(editor.texts[name], edits))
        assert ("turning" in editor.texts["src/main.st"]) == (new == "turning")
    assert editor.texts == before


def test_rename_of_a_method_renames_that_of_its_interface(editor: Editor) -> None:
    edit = editor.at("rename", "src/main.st", "pump.Sta", "rt", newName="Begin")
    edits = {Path(uri).name: len(found) for uri, found in edit["changes"].items()}
    assert edits == {"pump.st": 3, "main.st": 1}


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("2nd", "is not a name"),
        ("IF", "word of the language"),
        ("DINT", "word of the language"),
        ("level", "declared already: variable Pump.level"),
        ("a__b", "is not a name"),
    ],
)
def test_rename_refuses_names_that_cannot_be(editor: Editor, name: str, why: str) -> None:
    with pytest.raises(RequestFailed, match=why):
        editor.at("rename", "src/pump.st", "    enab", "le : BOOL", newName=name)


def test_rename_refuses_a_name_that_is_used_for_something_else_where_the_item_is_used(editor: Editor) -> None:
    with pytest.raises(RequestFailed, match=r"declared already: variable Main\.n"):
        editor.at("rename", "src/globals.st", "gCo", "unt", newName="n")


def test_rename_refuses_what_a_library_declares(editor: Editor) -> None:
    with pytest.raises(RequestFailed, match="declared in a library"):
        editor.at("rename", "src/pump.st", "timer : TO", "N", newName="Timer2")


def test_rename_refuses_while_a_file_that_may_use_the_name_has_syntax_errors(editor: Editor) -> None:
    editor.type("src/main.st", editor.texts["src/main.st"].replace("END_IF", "EN_IF"))
    with pytest.raises(RequestFailed, match="syntax errors"):
        editor.at("rename", "src/pump.st", "    enab", "le : BOOL", newName="on_now")
