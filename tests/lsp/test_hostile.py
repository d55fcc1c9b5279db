"""Workspaces that are meant to do harm, or that were never cleaned up: an answer in bounded time, nothing executed."""

from __future__ import annotations

import os
import random
from pathlib import Path

import pytest
from conftest import FILES
from editor import Editor, RequestFailed

MAIN = "PROGRAM Main\nVAR\n    n : INT;\nEND_VAR\nn := n + 1;\nEND_PROGRAM\n"


def hover_works(editor: Editor, name: str = "main.st") -> None:
    """Fails unless the server answers."""
    if name not in editor.texts:
        editor.open(name)
    assert "n : INT" in editor.at("hover", name, "\nn := ", "n + 1")["contents"]["value"]


def test_a_file_of_fifty_megabytes_is_named_and_the_others_are_served(tmp_path: Path) -> None:
    (tmp_path / "main.st").write_text(MAIN)
    with (tmp_path / "big.st").open("w") as file:
        file.truncate(50 << 20)
    with Editor(tmp_path) as editor:
        hover_works(editor)
        editor.wait(lambda: "more than 8 MiB" in str(editor.messages_of("big.st")), "a message about the large file")


def test_deep_nesting_gets_a_message(tmp_path: Path) -> None:
    deep = MAIN.replace(
        "n := n + 1;", "n := n + 1;\nn := " + "(" * 3000 + "n" + ")" * 3000 + ";\n" + "IF n > 1 THEN " * 900
    )
    (tmp_path / "main.st").write_text(MAIN)
    with Editor(tmp_path) as editor:
        editor.open("main.st", deep)
        editor.wait(lambda: bool(editor.messages_of("main.st")), "a message")
        hover_works(editor)
        uri = {"textDocument": {"uri": editor.uri("main.st")}}
        assert editor.request("textDocument/documentSymbol", uri)
        assert editor.request("textDocument/foldingRange", uri)
        assert editor.request("textDocument/semanticTokens/full", uri)


def test_links_in_circles_end(tmp_path: Path) -> None:
    (tmp_path / "main.st").write_text(MAIN)
    (tmp_path / "loop").symlink_to(tmp_path)
    (tmp_path / "self.st").symlink_to(tmp_path / "self.st")
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "up").symlink_to(tmp_path)
    with Editor(tmp_path) as editor:
        hover_works(editor)
        editor.type("main.st", MAIN.replace("n + 1", "m + 1"))
        editor.expect("main.st", "unknown name m")


def test_invalid_encodings_and_binary_files_are_named(tmp_path: Path) -> None:
    (tmp_path / "main.st").write_text(MAIN)
    (tmp_path / "latin.st").write_bytes(b"// gr\xfcn\nTYPE Farbe : (gr\xfcn); END_TYPE\n\xff\xfe\x80")
    (tmp_path / "binary.st").write_bytes(bytes(range(256)) * 50)
    with Editor(tmp_path) as editor:
        editor.wait(lambda: "binary file" in str(editor.messages_of("binary.st")), "a message about the binary file")
        hover_works(editor)


def test_a_plc_toml_that_points_outside_reads_nothing_there(tmp_path: Path) -> None:
    (tmp_path / "secret").mkdir()
    (tmp_path / "secret" / "other.st").write_text("TYPE Secret : INT; END_TYPE\n")
    inside = tmp_path / "inside"
    inside.mkdir()
    (inside / "main.st").write_text(MAIN)
    (inside / "plc.toml").write_text('sources = ["../secret", "main.st", "/etc/passwd"]\nio = "/etc/hostname"\n')
    with Editor(inside) as editor:
        editor.wait(lambda: "outside" in str(editor.messages_of("plc.toml")), "a message about the path")
        hover_works(editor)
        assert editor.request("workspace/symbol", {"query": "Secret"}) == []


def test_a_link_to_a_source_outside_is_refused(tmp_path: Path) -> None:
    (tmp_path / "secret.st").write_text("TYPE Secret : INT; END_TYPE\n")
    inside = tmp_path / "inside"
    inside.mkdir()
    (inside / "main.st").write_text(MAIN)
    (inside / "link.st").symlink_to(tmp_path / "secret.st")
    with Editor(inside) as editor:
        hover_works(editor)
        editor.wait(lambda: "outside" in str(editor.messages), "a message about the link")
        assert editor.request("workspace/symbol", {"query": "Secret"}) == []


def test_a_folder_of_very_many_files_is_not_loaded(tmp_path: Path) -> None:
    (tmp_path / "main.st").write_text(MAIN)
    for n in range(21):
        (tmp_path / f"d{n}").mkdir()
        for k in range(1000):
            os.close(os.open(tmp_path / f"d{n}" / f"f{k}", os.O_CREAT))
    with Editor(tmp_path) as editor:
        hover_works(editor)
        assert "more than 20000 files" in str(editor.messages)


def test_python_in_a_project_is_not_run(tmp_path: Path) -> None:
    (tmp_path / "main.st").write_text(MAIN)
    (tmp_path / "conftest.py").write_text("open('ran', 'w')\n")
    (tmp_path / "sitecustomize.py").write_text("open('ran', 'w')\n")
    (tmp_path / "plctool.py").write_text("open('ran', 'w')\n")
    with Editor(tmp_path) as editor:
        hover_works(editor)
    assert not (tmp_path / "ran").exists()


def test_positions_outside_of_the_text_are_answered(editor: Editor) -> None:
    editor.open("src/main.st")
    for line, character in ((0, 99999), (99999, 0), (99999, 99999)):
        place = {"textDocument": {"uri": editor.uri("src/main.st")}, "position": {"line": line, "character": character}}
        for request in ("hover", "completion", "definition", "signatureHelp", "documentHighlight"):
            editor.request(f"textDocument/{request}", place)


def test_files_that_are_not_there_are_answered(editor: Editor) -> None:
    for uri in (editor.uri("src/absent.st"), "untitled:Untitled-1", "file:///", "git:/main.st"):
        editor.request("textDocument/hover", {"textDocument": {"uri": uri}, "position": {"line": 0, "character": 0}})
        editor.request("textDocument/documentSymbol", {"textDocument": {"uri": uri}})


REQUESTS = (
    "hover", "completion", "definition", "typeDefinition", "implementation", "signatureHelp", "documentHighlight",
    "prepareRename", "prepareCallHierarchy", "prepareTypeHierarchy",
)  # fmt: skip


@pytest.mark.parametrize("seed", range(2))
def test_every_request_is_answered_at_every_place_of_damaged_files(editor: Editor, seed: int) -> None:
    """Parts of the files are cut out, doubled and mixed; no request may fail but by a sentence."""
    rng = random.Random(seed)
    name = "src/pump.st"
    editor.open(name)
    original = editor.texts[name]
    for _ in range(25):
        a, b = sorted(rng.sample(range(len(original)), 2))
        text = rng.choice([original[:a] + original[b:], original[:b] + original[a:], original[a:b]])
        editor.type(name, text)
        for _ in range(6):
            line = rng.randrange(text.count("\n") + 1)
            position = {"line": line, "character": rng.randrange(1 + len(text.split("\n")[line]))}
            place = {"textDocument": {"uri": editor.uri(name)}, "position": position}
            for request in REQUESTS:
                try:
                    editor.request(f"textDocument/{request}", place)
                except RequestFailed as error:
                    assert request == "prepareRename", error
                    assert "Error" not in str(error) and "Traceback" not in str(error)
        for request in ("documentSymbol", "foldingRange", "semanticTokens/full"):
            editor.request(f"textDocument/{request}", {"textDocument": {"uri": editor.uri(name)}})
    assert set(FILES)
