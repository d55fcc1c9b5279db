"""What the server says of whole files: symbols, tokens, folding, hints, hierarchies, formatting."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from editor import Editor, RequestFailed, edited

from plctool.fmt.formatter import formatted
from plctool.lsp.symbols import TOKEN_TYPES


@pytest.fixture(autouse=True)
def _open(editor: Editor) -> None:
    for name in ("src/types.st", "src/pump.st", "src/main.st", "src/globals.st"):
        editor.open(name)


def of_file(editor: Editor, request: str, name: str, **more: Any) -> Any:
    """Sends a request about a file."""
    return editor.request(f"textDocument/{request}", {"textDocument": {"uri": editor.uri(name)}} | more)


def test_symbols_of_a_file_are_nested(editor: Editor) -> None:
    found = {s["name"]: [c["name"] for c in s["children"]] for s in of_file(editor, "documentSymbol", "src/pump.st")}
    assert found["Pump"][:3] == ["enable", "level", "running"]
    assert found["Pump"][-1] == "Start"
    assert list(found) == ["IDrive", "Pump", "BigPump"]
    lists = of_file(editor, "documentSymbol", "src/globals.st")
    assert [(s["name"], [c["name"] for c in s["children"]]) for s in lists] == [
        ("globals", ["gCount", "gStart", "LIMIT_HIGH"])
    ]


def test_a_symbol_spans_its_unit(editor: Editor) -> None:
    pump = next(s for s in of_file(editor, "documentSymbol", "src/pump.st") if s["name"] == "Pump")
    lines = editor.texts["src/pump.st"].split("\n")
    assert lines[pump["range"]["start"]["line"]].startswith("FUNCTION_BLOCK Pump")
    assert lines[pump["range"]["end"]["line"]] == "END_FUNCTION_BLOCK"
    assert pump["selectionRange"]["start"]["character"] == len("FUNCTION_BLOCK ")


def test_symbols_of_the_workspace_are_found_by_some_of_their_letters(editor: Editor) -> None:
    found = [s["name"] for s in editor.request("workspace/symbol", {"query": "bgp"})]
    assert found == ["BigPump"]
    assert editor.request("workspace/symbol", {"query": "pump"})[0]["name"] == "Pump"


def kinds(editor: Editor, name: str) -> dict[str, str]:
    """Returns the kind of the tokens of a file by their text."""
    data = of_file(editor, "semanticTokens/full", name)["data"]
    lines = editor.texts[name].split("\n")
    found, line, column = {}, 0, 0
    for at in range(0, len(data), 5):
        line, column = line + data[at], data[at + 1] + (0 if data[at] else column)
        found[lines[line][column : column + data[at + 2]]] = TOKEN_TYPES[data[at + 3]]
    return found


def test_semantic_tokens_know_what_names_are(editor: Editor) -> None:
    found = kinds(editor, "src/pump.st")
    assert found["TON"] == "class"
    assert found["enable"] == "parameter"
    assert found["Green"] == "enumMember"
    assert found["IDrive"] == "interface"
    assert found["Point"] == "struct"
    assert found["Start"] == "method"
    assert found["FUNCTION_BLOCK"] == "keyword"
    assert found["T#1s"] == "number"


def test_blocks_and_comments_fold(editor: Editor) -> None:
    lines = editor.texts["src/pump.st"].split("\n")
    folds = {lines[f["startLine"]].strip(): lines[f["endLine"]] for f in of_file(editor, "foldingRange", "src/pump.st")}
    assert folds["IF timer.Q THEN"] == "    place.x := points[1].y;"
    assert folds["(* Moves water."].strip() == "It needs a motor. *)"


def test_inlay_hints_name_parameters_and_tasks(editor: Editor) -> None:
    whole = {"start": {"line": 0, "character": 0}, "end": {"line": 1000, "character": 0}}
    labels = [h["label"] for h in of_file(editor, "inlayHint", "src/main.st", range=whole)]
    assert labels == ["raw :=", "factor :=", "task Quick every 10 ms"]


def test_calls_of_a_block_are_found_in_both_directions(editor: Editor) -> None:
    (item,) = editor.at("prepareCallHierarchy", "src/pump.st", "FUNCTION_BLOCK Pu", "mp")
    calling = editor.request("callHierarchy/incomingCalls", {"item": item})
    assert sorted(c["from"]["name"] for c in calling) == ["BigPump", "Main"]
    called = editor.request("callHierarchy/outgoingCalls", {"item": item})
    assert [c["to"]["name"] for c in called] == ["TON"]


def test_types_above_and_below_a_block(editor: Editor) -> None:
    (item,) = editor.at("prepareTypeHierarchy", "src/main.st", "pump : Pu", "mp")
    assert [t["name"] for t in editor.request("typeHierarchy/supertypes", {"item": item})] == ["IDrive"]
    assert [t["name"] for t in editor.request("typeHierarchy/subtypes", {"item": item})] == ["BigPump"]


def test_selection_grows_from_a_word_to_its_unit(editor: Editor) -> None:
    position = editor.place("src/pump.st", "running := TR", "UE")["position"]
    (found,) = of_file(editor, "selectionRange", "src/pump.st", positions=[position])
    starts = []
    while found:
        starts.append(editor.texts["src/pump.st"].split("\n")[found["range"]["start"]["line"]].strip())
        found = found.get("parent")
    assert starts == ["running := TRUE;", "IF timer.Q THEN", "FUNCTION_BLOCK Pump IMPLEMENTS IDrive"]


OPTIONS = {"tabSize": 4, "insertSpaces": True}


def test_formatting_is_that_of_plctool_fmt(editor: Editor) -> None:
    ugly = editor.texts["src/main.st"].replace("n := Scaled(n, 3);", "n:=Scaled( n,3 ) ;").replace("    pump", "pump")
    editor.type("src/main.st", ugly)
    edits = of_file(editor, "formatting", "src/main.st", options=OPTIONS)
    assert edited(ugly, edits) == formatted("main.st", ugly)


def test_formatting_of_lines_leaves_the_others(editor: Editor) -> None:
    ugly = editor.texts["src/main.st"].replace("n := Scaled(n, 3);", "n:=Scaled( n,3 ) ;").replace("    pump", "pump")
    editor.type("src/main.st", ugly)
    line = ugly[: ugly.index("n:=")].count("\n")
    where = {"start": {"line": line, "character": 0}, "end": {"line": line + 1, "character": 0}}
    made = edited(ugly, of_file(editor, "rangeFormatting", "src/main.st", options=OPTIONS, range=where))
    assert "n := Scaled(n, 3);" in made and "\npump : Pump" in made


def test_formatting_a_file_with_a_syntax_error_is_refused_in_words(editor: Editor) -> None:
    editor.type("src/main.st", editor.texts["src/main.st"].replace("END_IF", ""))
    with pytest.raises(RequestFailed, match=r"Not formatted: .*main\.st"):
        of_file(editor, "formatting", "src/main.st", options=OPTIONS)


def test_the_server_says_what_it_can(editor: Editor) -> None:
    capabilities = editor.server["capabilities"]
    for name in (
        "hoverProvider", "completionProvider", "signatureHelpProvider", "definitionProvider", "typeDefinitionProvider",
        "implementationProvider", "referencesProvider", "renameProvider", "documentSymbolProvider",
        "workspaceSymbolProvider", "callHierarchyProvider", "typeHierarchyProvider", "semanticTokensProvider",
        "foldingRangeProvider", "inlayHintProvider", "documentFormattingProvider",
    ):  # fmt: skip
        assert capabilities[name], name
    assert Path(editor.folder, "plc.toml").is_file()
