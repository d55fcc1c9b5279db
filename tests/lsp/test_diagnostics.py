"""Diagnostics while typing: the compiler's own, of every file, and for the newest text."""

from __future__ import annotations

import os
import random
from pathlib import Path

import pytest
from editor import Editor

from plctool.compiler import check_with_tests, program_files
from plctool.lsp.checks import MAX_ERRORS


def fresh(folder: Path, texts: dict[str, str]) -> dict[str, list[tuple[int, str, str]]]:
    """Returns what a check of the files finds: line, code and message, by file."""
    for name, text in texts.items():
        (folder / name).write_text(text)
    files = program_files([folder / "plc.toml"])
    result = check_with_tests(
        files.load_sources(), None, files.load_io, files.load_libraries(), None, max_errors=MAX_ERRORS
    )
    found: dict[str, list[tuple[int, str, str]]] = {}
    for d in result.diagnostics:
        found.setdefault(Path(d.file).name, []).append((d.line, d.code, d.message))
    return found


def shown(editor: Editor) -> dict[str, list[tuple[int, str, str]]]:
    """Returns the same of what the editor shows."""
    found = {}
    for uri, diagnostics in editor.diagnostics.items():
        if diagnostics:
            found[Path(uri).name] = [(d["range"]["start"]["line"] + 1, d["code"], d["message"]) for d in diagnostics]
    return found


def test_an_error_is_shown_while_typing_and_goes_when_it_is_mended(editor: Editor) -> None:
    editor.open("src/main.st")
    good = editor.texts["src/main.st"]
    editor.type("src/main.st", good.replace("n := Scaled(n, 3);", "n := Scaled(m, 3);"))
    (found,) = editor.expect("src/main.st", "unknown name m")
    assert found["severity"] == 1 and found["source"] == "plctool" and found["code"] == "unknown"
    assert found["range"]["end"]["character"] - found["range"]["start"]["character"] == 1
    editor.type("src/main.st", good)
    editor.expect("src/main.st")


def test_an_error_in_a_file_that_is_not_open_is_shown_there(editor: Editor) -> None:
    editor.open("src/types.st")
    editor.type("src/types.st", editor.texts["src/types.st"].replace("Green", "Olive"))
    editor.expect("src/pump.st", "unknown name Green")
    editor.shut("src/types.st")
    editor.expect("src/pump.st")


def test_a_warning_is_shown_and_unused_variables_are_marked(editor: Editor) -> None:
    editor.open("src/main.st")
    editor.type("src/main.st", editor.texts["src/main.st"].replace("    n : INT;", "    n : INT; spare : INT;"))
    (found,) = editor.expect("src/main.st", "spare")
    assert found["severity"] == 2 and found["tags"] == [1]
    editor.shut("src/main.st")
    editor.expect("src/main.st")


def test_mistakes_in_plc_toml_are_shown_in_it_and_the_program_is_checked(folder: Path) -> None:
    (folder / "plc.toml").write_text('sources = ["src"]\nboard = "none"\n')
    (folder / "src/pump.st").write_text("FUNCTION_BLOCK Pump\nEND_FUNCTION_BLOCK\n")
    with Editor(folder) as editor:
        editor.wait(lambda: bool(editor.messages_of("plc.toml")), "a message about plc.toml")
        assert "board cannot be 'none'" in editor.messages_of("plc.toml")[0]
        editor.wait(lambda: bool(editor.messages_of("src/main.st")), "the program is checked")


def test_a_file_that_appears_or_goes_is_noticed(folder: Path) -> None:
    with Editor(folder) as editor:
        editor.open("src/main.st")
        (folder / "src/more.st").write_text("PROGRAM More\nx := 1;\nEND_PROGRAM\n")
        change = {"uri": editor.uri("src/more.st"), "type": 1}
        editor.notify("workspace/didChangeWatchedFiles", {"changes": [change]})
        editor.wait(lambda: "unknown name x" in str(editor.messages_of("src/more.st")), "the new file is checked")
        os.unlink(folder / "src/more.st")
        editor.notify("workspace/didChangeWatchedFiles", {"changes": [change | {"type": 3}]})
        editor.wait(lambda: not editor.messages_of("src/more.st"), "its diagnostics go")


def test_with_the_setting_save_only_saving_checks(folder: Path) -> None:
    with Editor(folder, settings={"diagnostics": "save"}) as editor:
        editor.open("src/main.st")
        bad = editor.texts["src/main.st"].replace("n := Scaled(n", "n := Scaled(m")
        editor.type("src/main.st", bad)
        editor.at("hover", "src/main.st", "Sca", "led(m")  # answered after the change was taken
        assert editor.messages_of("src/main.st") == []
        editor.notify("textDocument/didSave", {"textDocument": {"uri": editor.uri("src/main.st")}})
        editor.expect("src/main.st", "unknown name m")


def test_a_file_alone_is_checked_alone(tmp_path: Path) -> None:
    (tmp_path / "open").mkdir()
    (tmp_path / "open" / "readme.txt").write_text("nothing\n")
    (tmp_path / "other.st").write_text("PROGRAM Other\ny := 1;\nEND_PROGRAM\n")
    with Editor(tmp_path / "open") as editor:
        editor.open("../other.st")
        uri = (tmp_path / "open" / ".." / "other.st").as_uri()
        editor.wait(lambda: any(found for u, found in editor.diagnostics.items() if u.endswith("other.st")), uri)


CHANGES = [
    lambda line: "",
    lambda line: line.replace("n", "q", 1),
    lambda line: line.replace(":=", ":= TRUE +", 1),
    lambda line: line.replace(";", "", 1),
    lambda line: line.replace("(", "", 1),
    lambda line: line + "\nRETURN;",
    lambda line: line + "\nzz := 1;",
    lambda line: line + "\nIF n > 2 THEN",
    lambda line: line + "\npump.",
    lambda line: line + " (* open",
    lambda line: line.replace("Pump", "Pumpe"),
    lambda line: line.replace("INT", "REAL"),
    lambda line: line.replace("END_VAR", "", 1),
    lambda line: line.upper(),
]


@pytest.mark.parametrize("seed", [1, 2])
def test_after_random_edits_the_diagnostics_are_those_of_a_fresh_check(folder: Path, seed: int) -> None:
    rng = random.Random(seed)
    names = ["src/main.st", "src/pump.st", "src/types.st", "src/globals.st"]
    original = {name: (folder / name).read_text() for name in names}
    with Editor(folder) as editor:
        for name in names:
            editor.open(name)
        for _ in range(20):
            for name in rng.sample(names, rng.randint(1, 2)):
                base = original[name] if rng.random() < 0.3 else editor.texts[name]
                lines = base.split("\n")
                at = rng.randrange(len(lines))
                lines[at] = rng.choice(CHANGES)(lines[at])
                editor.type(name, "\n".join(lines))
            expected = fresh(folder, editor.texts)
            editor.wait(lambda expected=expected: shown(editor) == expected, f"the diagnostics are {expected}")
