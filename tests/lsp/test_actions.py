"""Code actions: what a message says to write is written, and then the message is gone."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest
from editor import Editor, Json, edited

from plctool.compiler.base.source import Source
from plctool.compiler.formats.il_files import has_lists
from plctool.compiler.front import check_sources
from plctool.compiler.syntax.diagnostics import Diagnostic
from plctool.lsp.actions import changes_at
from plctool.lsp.project import Project
from plctool.lsp.session import Place

ROOT = Path(__file__).parents[2]
HEAD = """TYPE Color : (Red, Green, Blue); END_TYPE
TYPE Shade : (Dark, Light); END_TYPE
{attribute 'qualified_only'}
TYPE Level : (Low, High); END_TYPE
INTERFACE IRun
END_INTERFACE
FUNCTION_BLOCK Motor
VAR_INPUT
    speed : INT;
END_VAR
END_FUNCTION_BLOCK
"""


def program(body: str, declarations: str = "") -> str:
    """Returns a program with all kinds of variables."""
    return (
        f"{HEAD}PROGRAM Main\nVAR\n    i : INT;\n    r : REAL;\n    b : BOOL;\n    c : Color;\n    l : Level;"
        f"\n    s : STRING;\n    motor : Motor;\n    lt : LTIME;\n{declarations}END_VAR\n{body}\nEND_PROGRAM\n"
    )


def found_in(text: str, name: str = "main.st") -> list[Diagnostic]:
    """Returns the diagnostics of a text."""
    return check_sources([Source(name, text)], max_errors=1000).diagnostics


def fixes(text: str, diagnostic: Diagnostic, folder: Path, name: str = "main.st") -> list[str]:
    """Returns the text after each change that is offered for a diagnostic."""
    file = folder / name
    file.write_text(text)
    project = Project([file], {})
    (tree,) = project.trees_of(str(file))
    starts = tree.source.line_starts
    place = Place(project, tree, starts[diagnostic.line - 1] + diagnostic.column - 1)
    return [text[: c.start] + c.text + text[c.end :] for c in changes_at(place, diagnostic.message)]


CASES = [
    ("motr.speed := 1;", "did you mean motor", "motor.speed := 1;"),
    ("motor(spede := 3);", "did you mean speed", "motor(speed := 3);"),
    ("c := Grene;", "did you mean Green", "c := Green;"),
    ("l := Low;", "write Level.Low", "l := Level.Low;"),
    ("i := 1", "expected ;", "i := 1;"),
    ("IF b i := 1; END_IF;", "expected THEN", "IF b THEN i := 1; END_IF;"),
    ("i := (i + 1;", "expected )", "i := (i + 1);"),
    ("IF b THEN\n    i := 1;", "END_IF missing", "IF b THEN\n    i := 1;\nEND_IF;"),
    ("WHILE b DO\n    b := FALSE;\nEND_FOR;", "expected END_WHILE", "WHILE b DO\n    b := FALSE;\nEND_WHILE;"),
    ("IF b THEN i := 1; ELSE IF i > 1 THEN i := 2; END_IF;", "write ELSIF", "ELSIF i > 1"),
    ("i := r;", "write REAL_TO_INT", "i := REAL_TO_INT(r);"),
    ("IF i THEN b := TRUE; END_IF;", "write INT_TO_BOOL", "IF INT_TO_BOOL(i) THEN"),
    ("s := '$4';", "write $$", "s := '$$4';"),
    ("lt := T#1us;", "write LTIME#", "lt := LTIME#1us;"),
    ("i += 1;", "write i := i + 1", "i := i + 1;"),
    ("IF b := i > 1 THEN i := 1; END_IF;", "a comparison is written =", "IF b = i > 1 THEN"),
    ("i := 0x10;", "is written 16#10", "i := 16#10;"),
    ("s := ‘abc’;", "straight quotes", "s := 'abc';"),
    ("n := TRUE;", "unknown name n", "    n : BOOL;\nEND_VAR"),
    ("n := r;", "unknown name n", "    n : REAL;\nEND_VAR"),
    ("IF n THEN i := 1; END_IF;", "unknown name n", "    n : BOOL;\nEND_VAR"),
    ("i := INT#5.5;", "write REAL_TO_INT(5.5)", "i := REAL_TO_INT(5.5);"),
    ("CASE c OF Red: i := 1; END_CASE;", "this CASE misses", "i := 1; ELSE ; END_CASE;"),
]


@pytest.mark.parametrize(("body", "said", "expected"), CASES)
def test_the_first_action_mends_the_mistake(body: str, said: str, expected: str, tmp_path: Path) -> None:
    text = program(body)
    before = found_in(text)
    diagnostic = next(d for d in before if said in d.message)
    after = fixes(text, diagnostic, tmp_path)
    assert after, diagnostic.message
    assert expected in after[0]
    assert [d.message for d in found_in(after[0]) if d.severity == "error"] == []


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("i := (i := 1) + 1;", "a comparison is written ="),
        ("other.ready := TRUE;", "unknown name other"),
        ("i := motr.sped;", "did you mean motor"),
    ],
)
def test_nothing_is_offered_that_would_be_the_next_mistake(body: str, said: str, tmp_path: Path) -> None:
    text = program(body)
    diagnostic = next(d for d in found_in(text) if said in d.message)
    assert fixes(text, diagnostic, tmp_path) == []


def test_an_interface_in_place_of_a_base_is_implemented(tmp_path: Path) -> None:
    text = program("").replace("FUNCTION_BLOCK Motor", "FUNCTION_BLOCK Motor EXTENDS IRun")
    diagnostic = next(d for d in found_in(text) if "write IMPLEMENTS" in d.message)
    (after,) = fixes(text, diagnostic, tmp_path)
    assert "FUNCTION_BLOCK Motor IMPLEMENTS IRun" in after
    assert not any(d.severity == "error" for d in found_in(after))


@pytest.mark.parametrize(
    ("declaration", "left"),
    [("    x : INT;\n", ""), ("    x, i2 : INT;\n", "    i2 : INT;\n"), ("    i2, x : INT;\n", "    i2 : INT;\n")],
)
def test_an_unused_variable_is_removed(declaration: str, left: str, tmp_path: Path) -> None:
    text = program("i2 := 1;" if left else "", declaration)
    diagnostic = next(d for d in found_in(text) if d.message.startswith("x is never"))
    (after,) = fixes(text, diagnostic, tmp_path)
    assert after == program("i2 := 1;" if left else "", left)


GUESSES = {
    "unknown type T_Missing; did you mean T_MaxString?": "the type has no such members",
    "program Main has no lvel; did you mean level?": "level is in the list, too",
}
"""Messages that guess what was meant: that it is declared is known, not that it is right."""


def test_each_action_of_all_programs_mends_its_mistake_and_makes_no_error(tmp_path: Path) -> None:
    """The programs of tests/st, of which many have an error or a warning that says what to write."""
    offered, bad, guesses = 0, [], set()
    for file in sorted((ROOT / "tests" / "st").rglob("*.st")):
        text = file.read_bytes().decode("utf-8", "replace")
        if has_lists(text):
            continue  # its statements are made by the reader of the file
        found = found_in(text, file.name)
        before = Counter((d.severity, d.message) for d in found)
        for diagnostic in found:
            for after in fixes(text, diagnostic, tmp_path, file.name):
                offered += 1
                now = Counter((d.severity, d.message) for d in found_in(after, file.name))
                key = (diagnostic.severity, diagnostic.message)
                new = [message for severity, message in now - before if severity == "error"]
                if now[key] < before[key] and not new:
                    continue
                if diagnostic.message in GUESSES:
                    guesses.add(diagnostic.message)
                else:
                    bad.append(f"{file}: {diagnostic.message} gives {new}")
    assert not bad, "\n".join(bad)
    assert guesses == GUESSES.keys()
    assert offered > 100


def test_the_editor_offers_the_actions_of_a_diagnostic(editor: Editor) -> None:
    editor.open("src/main.st")
    editor.type("src/main.st", editor.texts["src/main.st"].replace("Scaled(n, 3)", "Scaledd(n, 3)"))
    (diagnostic,) = editor.expect("src/main.st", "did you mean Scaled?")
    uri = editor.uri("src/main.st")
    params = {"textDocument": {"uri": uri}, "range": diagnostic["range"], "context": {"diagnostics": [diagnostic]}}
    actions: list[Json] = editor.request("textDocument/codeAction", params)
    assert [a["title"] for a in actions] == ["Write Scaled"]
    editor.type("src/main.st", edited(editor.texts["src/main.st"], actions[0]["edit"]["changes"][uri]))
    editor.expect("src/main.st")
