"""Syntax: what is accepted, and what is said about the rest."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from front_support import body_of, check, main, messages, program

from plctool.compiler.front import Source, check_sources
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import MAX_ERRORS, MAX_LINE, render, render_all
from plctool.compiler.syntax.parser import parse
from plctool.compiler.syntax.tables import _GRAMMAR, _decode, _encode, load_tables, make_tables
from plctool.compiler.typed import nodes as typed

VARIABLES = "x, y : INT; b : BOOL; a : ARRAY[1..3] OF INT;"


def statement(text: str) -> list[str]:
    """Errors of one statement in PROGRAM Main; it stands in line 5."""
    return messages(main(VARIABLES, text))


def expression(text: str) -> str:
    """The tree of an expression, fully parenthesised."""
    (unit,) = parse(Source("f.st", f"PROGRAM p x := {text}; END_PROGRAM"), lambda *_: pytest.fail(text))
    assert isinstance(unit, ast.PouDecl)
    (assign,) = unit.body
    assert isinstance(assign, ast.Assign)
    return shown(assign.value)


def shown(e: ast.Expr) -> str:
    if isinstance(e, ast.Binary):
        return f"({shown(e.left)} {e.op} {shown(e.right)})"
    if isinstance(e, ast.Unary):
        return f"({e.op} {shown(e.operand)})"
    if isinstance(e, ast.Name):
        return e.name
    assert isinstance(e, ast.Literal)
    return str(e.value)


@pytest.mark.parametrize(
    ("text", "tree"),
    [
        ("a + b * c", "(a + (b * c))"),
        ("a - b - c", "((a - b) - c)"),
        ("a * b MOD c / d", "(((a * b) MOD c) / d)"),
        ("a ** b ** c", "((a ** b) ** c)"),
        ("-a ** b", "((- a) ** b)"),
        ("a * b ** c", "(a * (b ** c))"),
        ("NOT a AND b", "((NOT a) AND b)"),
        ("a OR b AND c XOR d", "(a OR ((b AND c) XOR d))"),
        ("a & b OR c", "((a AND b) OR c)"),
        ("a = b < c", "(a = (b < c))"),
        ("a + 1 > b AND c <> d", "(((a + 1) > b) AND (c <> d))"),
        ("a AND_THEN b OR_ELSE c", "((a AND_THEN b) OR_ELSE c)"),
        ("(a + b) * c", "((a + b) * c)"),
        ("-(a + b)", "(- (a + b))"),
        ("a - -b", "(a - (- b))"),
        ("a and b or not c", "((a AND b) OR (NOT c))"),
    ],
)
def test_operators_bind_as_the_standard_says(text: str, tree: str) -> None:
    assert expression(text) == tree


def test_keywords_and_names_ignore_case() -> None:
    program("program Main\nvar Counter : int; end_var\nif COUNTER = 1 Then counter := 2; end_if\nEnd_Program")


def test_comments_nest_and_pragmas_are_skipped() -> None:
    text = "(* a (* b *) c *) // d\n/* e /* f */ g */ {attribute 'x' := 'y'} {region}"
    program(text + main("x : INT; (* ( *) (**)", "x := 1; // END_PROGRAM"))


def test_structure_may_end_without_semicolon() -> None:
    body = body_of(VARIABLES, "IF b THEN x := 1; END_IF WHILE b DO b := FALSE; END_WHILE;;")
    assert [type(s) for s in body] == [typed.If, typed.While]


def test_words_that_are_keywords_elsewhere_may_be_names() -> None:
    program(main("task, on, with, at, retain : INT; by, to : INT;", "task := on + with; by := to + at - retain;"))


def test_set_and_reset_assignment_keep_the_variable_unless_the_condition_holds() -> None:
    for body, value in (("b S= x > 1;", 1), ("b R= x > 1;", 0)):
        (guard,) = body_of(VARIABLES, body)
        assert isinstance(guard, typed.If)
        (change,) = guard.branches[0][1]
        assert isinstance(change, typed.Assign)
        assert change.value == typed.Const(value, change.value.type, change.value.pos)


def test_s_and_r_may_be_variables() -> None:
    program(main("s, r : INT; b : BOOL;", "s := 1; r := s; b := s=r; s:=r;"))


def test_assignments_may_be_chained_from_the_right() -> None:
    body = body_of(VARIABLES, "x := y := 5;")
    assert [s.target.var.name for s in body if isinstance(s, typed.Assign)] == ["Main.y", "Main.x"]  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x := 1\ny := 2;", "5:7: expected ; after the statement"),
        ("x := 1 y := 2;", "5:7: expected ; after the statement"),
        ("x := MAX(1, 2)\ny := 2;", "5:15: expected ; after the statement"),
        ("x := ;", "5:6: expected a value before ;"),
        ("x := 1 +;", "5:9: expected a value before ;"),
        ("x := (1 + 2;", "5:12: expected )"),
        ("x := a[1;", "5:9: expected ]"),
        ("x := 5 5;", "5:8: expected an operator or ;, found 5"),
        ("x := ) ;", "5:6: expected a value, found )"),
        ("IF b x := 1; END_IF;", "5:5: expected THEN after the condition"),
        ("IF b = THEN x := 1; END_IF;", "5:8: expected a value before THEN"),
        ("WHILE b x := 1; END_WHILE;", "5:8: expected DO before the body of the loop"),
        ("FOR x := 1 TO 3 y := 1; END_FOR", "5:16: expected DO before the body of the loop"),
        ("IF b THEN x := 1;", "6:1: END_IF missing for the IF in line 5"),
        ("IF b THEN x := 1; END_WHILE;", "5:19: expected END_IF for the IF in line 5, not END_WHILE"),
        ("REPEAT x := 1; END_REPEAT;", "5:16: UNTIL and a condition missing before END_REPEAT"),
        ("END_IF;", "5:1: END_IF without an IF"),
        ("ELSE x := 1;", "5:1: ELSE without an IF"),
        ("THEN x := 1;", "5:1: THEN without an IF"),
        ("x = 5;", "5:3: an assignment is written :=, not ="),
        ("x == 5;", "5:3: a comparison is written =, an assignment :=; there is no =="),
        ("CASE x OF 1: y := 1; 2 y := 3; END_CASE;", "5:23: expected : before y"),
        ("CASE x OF y := 1; END_CASE", "5:11: this statement stands before the first label of the CASE"),
        ("x := 'abc;", "5:6: this string is not closed before the end of the line"),
        ("x := 1; @ y := 2;", "5:9: @ has no place in a program"),
        ("(* x := 1;", "5:1: this comment is not closed"),
    ],
)
def test_syntax_error_is_one_clear_sentence(text: str, message: str) -> None:
    assert statement(text) == [message]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("PROGRAM p\nVAR\n x : INT\n y : INT;\nEND_VAR\nEND_PROGRAM", "3:9: expected ; after the declaration"),
        ("PROGRAM p\nVAR\n x : INT;\n\nx := 5;\nx := 4;\nEND_PROGRAM", "5:1: END_VAR missing for the VAR in line 2"),
        (
            "PROGRAM p\nVAR x : INT;\nIF x = 1 THEN x := 2; END_IF;\nEND_PROGRAM",
            "3:1: END_VAR missing for the VAR in line 2",
        ),
        ("PROGRAM p\nVAR if : INT; END_VAR\nEND_PROGRAM", "2:5: if is a keyword and cannot be a name"),
        (
            "PROGRAM p\nVAR x AT y : INT; END_VAR\nEND_PROGRAM",
            "2:10: AT is for an address such as %IX0.3, not for y",
        ),
        ("END_ACTION", "1:1: END_ACTION without an ACTION"),
        ("PROGRAM p\nVAR x INT; END_VAR\nEND_PROGRAM", "2:6: expected : before INT"),
        ("PROGRAM p\nVAR x : INT; END_VAR\nWAIT 5;\nEND_PROGRAM", "3:5: expected := before 5"),
        ("PROGRAM p\nVAR q : POINTER TO INT; END_VAR\nq->x := 5;\nEND_PROGRAM", "3:2: -> is written ^. here: q^.x"),
        ("PROGRAM p\nx := 1;", "2:8: END_PROGRAM missing for the PROGRAM in line 1"),
        ("FUNCTION f : INT\nf := 1;\nPROGRAM p\nEND_PROGRAM", "3:1: END_FUNCTION missing for the FUNCTION in line 1"),
        (
            "FUNCTION_BLOCK f\nEND_FUNCTION",
            "2:1: expected END_FUNCTION_BLOCK for the FUNCTION_BLOCK in line 1, not END_FUNCTION",
        ),
        ("TYPE s : STRUCT x : INT; END_TYPE", "1:26: END_STRUCT missing for the STRUCT in line 1"),
        ("PROGRAM\nEND_PROGRAM", "2:1: expected a name, found END_PROGRAM"),
    ],
)
def test_error_in_a_declaration_is_one_clear_sentence(text: str, message: str) -> None:
    assert messages(text) == [message]


def test_every_missing_end_is_named() -> None:
    found = statement("WHILE b DO\nIF b THEN\nx := 1;")
    assert found == ["8:1: END_IF missing for the IF in line 6", "8:1: END_WHILE missing for the WHILE in line 5"]


def test_several_syntax_errors_are_found_in_one_run() -> None:
    found = statement("x := ;\ny := 1 2;\nIF b y := 1; END_IF;\nx := 3;\nx := a[1;")
    assert [m.split(":")[0] for m in found] == ["5", "6", "7", "9"]


def test_error_in_one_unit_does_not_hide_one_in_the_next() -> None:
    found = messages("FUNCTION f : INT\nf := ;\nEND_FUNCTION\nFUNCTION g : INT\ng := );\nEND_FUNCTION")
    assert [m.split(":")[0] for m in found] == ["2", "5"]


def test_errors_stop_at_the_limit() -> None:
    assert len(statement("".join(f"x := 1 + ;\ny := {i};\n" for i in range(100)))) == MAX_ERRORS


def test_diagnostic_is_shown_with_its_line_and_a_caret() -> None:
    source = Source("dir/f.st", "PROGRAM Main\nVAR x : INT; END_VAR\n\tx := ;\nEND_PROGRAM")
    (diagnostic,) = check_sources([source]).diagnostics
    assert render(diagnostic, [source]) == "dir/f.st:3:7: error: expected a value before ;\n\tx := ;\n\t     ^"


def test_of_a_very_long_line_the_part_around_the_finding_is_shown() -> None:
    sum_of_all = f"{'1 + ' * 100} nix {' + 1' * 100}"
    source = Source("f.st", f"PROGRAM Main\nVAR x : INT; END_VAR\n\tx := {sum_of_all};\nEND_PROGRAM")
    (diagnostic,) = check_sources([source]).diagnostics
    _, line, caret = render(diagnostic, [source]).split("\n")
    assert len(line) == MAX_LINE + 2 * len("...")
    assert line[caret.index("^") :].startswith("nix")
    assert line.startswith("...") and line.endswith("...")


def test_many_errors_may_be_followed_by_more() -> None:
    wrong = "x := 'text';\n" * (MAX_ERRORS + 1)
    source = Source("f.st", f"PROGRAM Main\nVAR x : INT; END_VAR\n{wrong}END_PROGRAM")
    texts = render_all(check_sources([source]).diagnostics, [source])
    assert len(texts) == MAX_ERRORS + 1
    assert texts[-1].startswith("There may be more")


def test_positions_count_lines_of_crlf_files() -> None:
    assert messages("PROGRAM Main\r\nVAR x : INT; END_VAR\r\nx := ;\r\nEND_PROGRAM") == [
        "3:6: expected a value before ;"
    ]


def test_tables_are_the_same_from_the_cache_and_from_the_grammar() -> None:
    fresh = make_tables(_GRAMMAR.read_text("utf-8"))
    assert _decode(json.loads(json.dumps(_encode(fresh)))) == fresh
    assert len(load_tables().rules) == len(fresh.rules)


def test_broken_cache_is_made_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    load_tables.cache_clear()
    load_tables()
    (file,) = (tmp_path / "plctool").iterdir()
    file.write_text('{"actions": 5}')
    load_tables.cache_clear()
    assert load_tables().rules
    assert "gotos" in file.read_text()
    load_tables.cache_clear()


def test_check_works_without_a_writable_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    load_tables.cache_clear()
    assert check("PROGRAM Main\nEND_PROGRAM").ok
    load_tables.cache_clear()
