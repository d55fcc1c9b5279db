"""Diagnostics while typing: the compiler's own, of every file, and for the newest text."""

from __future__ import annotations

import os
import random
from pathlib import Path

import pytest
from editor import Editor
from random_edits import CHANGES

from plctool.compiler import check_with_tests, program_files
from plctool.lsp.checks import MAX_ERRORS, checked
from plctool.lsp.incremental import Kept, Observer
from plctool.lsp.project import Project
from plctool.lsp.tree import Tree

Found = dict[str, list[tuple[int, str, str, int]]]
"""Line, code, message and severity, by file."""


def fresh(folder: Path, texts: dict[str, str]) -> tuple[Found, bool]:
    """Returns what a check of the files finds, and whether there are syntax errors."""
    for name, text in texts.items():
        (folder / name).write_text(text)
    files = program_files([folder / "plc.toml"])
    result = check_with_tests(
        files.load_sources(), None, files.load_io, files.load_libraries(), None, max_errors=MAX_ERRORS
    )
    found: Found = {}
    for d in result.diagnostics:
        found.setdefault(Path(d.file).name, []).append((d.line, d.code, d.message, 1 if d.severity == "error" else 2))
    return found, any(Tree(source).has_errors for source in files.load_sources())


def shown(editor: Editor) -> Found:
    """Returns what the editor shows."""
    found: Found = {}
    for uri, diagnostics in editor.diagnostics.items():
        if diagnostics:
            found[Path(uri).name] = [
                (d["range"]["start"]["line"] + 1, d["code"], d["message"], d["severity"]) for d in diagnostics
            ]
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
            expected, broken = fresh(folder, editor.texts)
            editor.wait(lambda e=expected, b=broken: as_expected(editor, e, b), f"the diagnostics are {expected}")


def as_expected(editor: Editor, expected: Found, broken: bool) -> bool:
    """True if the editor shows what is expected. While there are syntax errors it may show warnings that still hold,
    which a check does not look for then."""
    found = shown(editor)
    if not broken:
        return found == expected
    errors = {name: kept for name, said in found.items() if (kept := [d for d in said if d[3] == 1])}
    return errors == {name: kept for name, said in expected.items() if (kept := [d for d in said if d[3] == 1])}


def test_an_unfinished_statement_costs_no_warnings_elsewhere(editor: Editor) -> None:
    editor.open("src/pump.st")
    editor.open("src/main.st")
    editor.type("src/pump.st", editor.texts["src/pump.st"].replace("timer : TON;", "timer : TON; spare : INT;"))
    editor.expect("src/pump.st", "spare")
    editor.type("src/main.st", editor.texts["src/main.st"].replace("n := Scaled(n, 3);", "n := Scaled(n, 3;"))
    editor.expect("src/main.st", "expected )")
    assert "spare" in str(editor.messages_of("src/pump.st"))


def statements(folder: Path, path: str, edits: int, seed: int) -> None:
    """Compares checks of bodies alone with fresh ones, after random edits of statements."""
    rng = random.Random(seed)
    file = folder / path
    project = Project([folder / "plc.toml"], texts := {})
    observer = Observer(lambda: None)
    snapshot = project.snapshot()
    kept = Kept(observer, snapshot.sources, checked(snapshot, None, observer))
    lines = file.read_text().split("\n")
    first = lines.index("timer(IN := enable, PT := T#1s);")
    compared = 0
    for _ in range(edits):
        edited = list(lines)
        at = rng.randrange(first, first + 6)
        edited[at] = rng.choice(CHANGES)(edited[at])
        texts[str(file)] = "\n".join(edited)
        project.change(str(file))
        source = next(s for s in project.sources if s.path == str(file))
        found = kept.check(source)
        if found is None or Tree(source).has_errors:
            continue
        compared += 1
        expected = [d for d in checked(project.snapshot()) if d.file == str(file)]
        assert found == expected, texts[str(file)]
    assert compared > edits / 4


@pytest.mark.parametrize("seed", range(3))
def test_a_check_of_bodies_alone_finds_what_a_whole_check_finds(folder: Path, seed: int) -> None:
    statements(folder, "src/pump.st", 40, seed)


def test_a_program_that_no_task_runs_is_still_named_after_an_edit_of_statements(tmp_path: Path) -> None:
    file = tmp_path / "main.st"
    file.write_text(
        "PROGRAM Main\nVAR n : INT; spare : INT; END_VAR\nn := 1;\nEND_PROGRAM\n"
        "PROGRAM Other\nVAR n : INT; END_VAR\nn := 1;\nEND_PROGRAM\n"
        "CONFIGURATION C\nRESOURCE R ON PLC\nTASK Fast(INTERVAL := T#10ms, PRIORITY := 1);\n"
        "PROGRAM P WITH Fast : Main;\nEND_RESOURCE\nEND_CONFIGURATION\n"
    )
    project, observer = Project([file], texts := {}), Observer(lambda: None)
    snapshot = project.snapshot()
    kept = Kept(observer, snapshot.sources, checked(snapshot, None, observer))
    texts[str(file)] = file.read_text().replace("n := 1;", "n := 2;\nn := 3;", 1)
    project.change(str(file))
    (source,) = project.sources
    found = kept.check(source)
    assert found == checked(project.snapshot())
    assert [d.code for d in found or ()] == ["unused", "unused"]


def test_a_body_that_an_abstract_method_gets_is_left_to_the_check_of_all(tmp_path: Path) -> None:
    file = tmp_path / "main.st"
    file.write_text(
        "FUNCTION_BLOCK ABSTRACT A\nMETHOD ABSTRACT M : INT\nEND_METHOD\nEND_FUNCTION_BLOCK\n"
        "FUNCTION_BLOCK B EXTENDS A\nMETHOD M : INT\nM := 1;\nEND_METHOD\nEND_FUNCTION_BLOCK\n"
        "PROGRAM Main\nVAR b : B; n : INT; END_VAR\nn := b.M();\nEND_PROGRAM\n"
    )
    project, observer = Project([file], texts := {}), Observer(lambda: None)
    snapshot = project.snapshot()
    kept = Kept(observer, snapshot.sources, checked(snapshot, None, observer))
    texts[str(file)] = file.read_text().replace("M : INT\nEND_METHOD", "M : INT\nRETURN;\nEND_METHOD", 1)
    project.change(str(file))
    (source,) = project.sources
    assert kept.check(source) is None
