"""The formatter: its style, and that it changes nothing but white space and the case of keywords."""

from __future__ import annotations

import random
import re
import time
from collections.abc import Sequence
from difflib import SequenceMatcher
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from shares import examples
from test_st_programs import PROGRAMS, build, read_script, runs

from plctool.compiler.codegen.lower_unit import Options, parse_checks
from plctool.compiler.formats.il_files import has_lists
from plctool.compiler.front import check_sources
from plctool.compiler.image.build import build_program
from plctool.compiler.sources.source_files import read_content
from plctool.errors import PlcError, UsageError
from plctool.fmt.formatter import formatted
from plctool.fmt.scan import Item, scan
from plctool.image.targets import DEFAULT_TARGET, find_target

ROOT = Path(__file__).parents[2]
SHARE = 32  # of the programs of tests/st one in so many is compiled twice
CORPUS = [
    *PROGRAMS,
    *(p for f in ("examples", "host/plctool/stdlib", "tests/corpus") for p in (ROOT / f).rglob("*.st")),
]
EXAMPLES = sorted((ROOT / "examples").rglob("*.st"))
WITHOUT_LISTS = [path for path in EXAMPLES if not has_lists(path.read_text())]  # the lines of IL stay as they are
OPTIONS = Options(find_target(DEFAULT_TARGET), 0, parse_checks("all"))
HEAD = "PROGRAM Main\nVAR\n    a, b, c : INT;\n    x, y : BOOL;\n    f : Filter;\nEND_VAR\n"


def body(text: str) -> str:
    """The formatted statements of a program that consists of these."""
    result = formatted("main.st", f"{HEAD}{text.rstrip()}\nEND_PROGRAM\n")
    assert result.startswith(HEAD)
    assert formatted("main.st", result) == result
    return result.removeprefix(HEAD).removesuffix("END_PROGRAM\n")


def test_keywords_are_capitals_and_names_stay() -> None:
    assert body("if Foo and not bar then Foo:=true;end_if;") == "IF Foo AND NOT bar THEN\n    Foo := TRUE;\nEND_IF;\n"
    assert body("x := Task.step; a := int#5 mod t#5s;") == "x := Task.step;\na := int#5 MOD t#5s;\n"


def test_a_statement_takes_a_line() -> None:
    assert body("a:=1;b:=2;") == "a := 1;\nb := 2;\n"


def test_end_has_a_semicolon_if_it_was_written() -> None:
    assert body("IF x THEN ; END_IF WHILE x DO EXIT; END_WHILE;").splitlines() == [
        "IF x THEN", "    ;", "END_IF", "WHILE x DO", "    EXIT;", "END_WHILE;",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("written", "expected"),
    [
        ("a:=b+ - c*( -1 )**2;", "a := b + -c * (-1) ** 2;"),
        ("f ( IN:=a , Q=>b ) ;", "f(IN := a, Q => b);"),
        ("a:=list [ 1 , 2 ] . x ^ . y . 3;", "a := list[1, 2].x^.y.3;"),
        ("p REF= a; x S= y; x R=y;", "p REF= a;\nx S= y;\nx R= y;"),
        ("x:=a=b OR(c<>d)AND NOT(x);", "x := a = b OR (c <> d) AND NOT (x);"),
        ("a:=.g; b:=-.5e3-a;", None),
        ("a := AND(x, y); b := a MOD(3);", "a := AND(x, y);\nb := a MOD (3);"),
    ],
)
def test_blanks_stand_around_operators_and_not_in_brackets(written: str, expected: str | None) -> None:
    if expected is None:
        with pytest.raises(UsageError):
            body(written)
    else:
        assert body(written) == f"{expected}\n"


def test_blocks_are_indented() -> None:
    text = (
        "FOR a:=1 TO 3 BY 2 DO IF x THEN b:=1; ELSIF y THEN b:=2; ELSE b:=3; END_IF END_FOR "
        "REPEAT a:=1; UNTIL x END_REPEAT"
    )
    assert body(text).splitlines() == [
        "FOR a := 1 TO 3 BY 2 DO",
        "    IF x THEN", "        b := 1;", "    ELSIF y THEN", "        b := 2;", "    ELSE", "        b := 3;",
        "    END_IF", "END_FOR", "REPEAT", "    a := 1;", "UNTIL x", "END_REPEAT",
    ]  # fmt: skip


def test_a_short_branch_of_case_stays_beside_its_label() -> None:
    text = "CASE a OF 1 .. 2 ,5:b:=1; 3:\nb:=2; 4: b:=1;c:=2; ELSE c:=1; END_CASE;"
    assert body(text).splitlines() == [
        "CASE a OF", "    1..2, 5: b := 1;", "    3:",
        "        b := 2;", "    4:", "        b := 1;", "        c := 2;",
        "ELSE", "    c := 1;", "END_CASE;",
    ]  # fmt: skip


def test_types_take_a_line_each() -> None:
    text = "TYPE Color:(Red,Green:=2)INT:=Red; P:STRUCT x:INT;y:ARRAY [1..3]OF REAL:=[3(1.0)]; END_STRUCT END_TYPE"
    assert formatted("t.st", text).splitlines() == [
        "TYPE", "    Color : (Red, Green := 2) INT := Red;", "    P : STRUCT", "        x : INT;",
        "        y : ARRAY[1..3] OF REAL := [3(1.0)];", "    END_STRUCT", "END_TYPE",
    ]  # fmt: skip


def test_members_and_configurations_are_indented() -> None:
    text = (
        "function_block F extends A.B implements C,D property P:INT get P:=1; end_get end_property "
        "method public m:string(80) m:='a'; end_method action go: m(); end_action end_function_block "
        "configuration K resource R on PLC task T(interval:=t#1ms,priority:=1); program I with T:Main(x:=1); "
        "end_resource end_configuration test 'a b' f(); end_test"
    )
    assert formatted("t.st", text).splitlines() == [
        "FUNCTION_BLOCK F EXTENDS A.B IMPLEMENTS C, D",
        "PROPERTY P : INT", "    GET", "        P := 1;", "    END_GET", "END_PROPERTY",
        "METHOD PUBLIC m : STRING(80)", "m := 'a';", "END_METHOD",
        "ACTION go:", "    m();", "END_ACTION", "END_FUNCTION_BLOCK", "",
        "CONFIGURATION K", "    RESOURCE R ON PLC", "        TASK T(interval := t#1ms, priority := 1);",
        "        PROGRAM I WITH T : Main(x := 1);", "    END_RESOURCE", "END_CONFIGURATION", "",
        "TEST 'a b'", "f();", "END_TEST",
    ]  # fmt: skip


def test_a_long_list_is_broken_at_commas_and_a_condition_at_its_or() -> None:
    arguments = ", ".join(f"argument{i} := value{i}" for i in range(8))
    lines = body(f"f({arguments});").splitlines()
    assert len(lines) == 2
    assert max(map(len, lines)) <= 120
    assert lines[0].endswith(",")
    assert re.match(" {4}a", lines[1])
    condition = " OR ".join(f"(long_name_{i} AND other_name_{i})" for i in range(5))
    lines = body(f"IF {condition} THEN a := 1; END_IF").splitlines()
    assert lines[1].startswith("        OR (long")


def test_a_list_with_a_break_after_its_bracket_keeps_its_rows() -> None:
    rows = "f(\n    IN := TRUE,\n    PT := T#1s, Q => x\n);\n"
    assert body(rows) == rows
    assert body("f(\nIN:=TRUE,\n\n  PT:=T#1s,Q=>x);") == rows
    table = "m : ARRAY[0..1, 0..1] OF INT := [\n        1, 2,\n        3, 4\n    ];"
    assert table in formatted("t.st", f"PROGRAM p\nVAR\n{table}\nEND_VAR\nEND_PROGRAM\n")


def test_blank_lines_are_one_at_most_and_none_at_the_ends_of_a_block() -> None:
    assert body("a:=1;\n\n\n\nb:=2;\nIF x THEN\n\nc:=1;\n\nEND_IF;") == (
        "a := 1;\n\nb := 2;\nIF x THEN\n    c := 1;\nEND_IF;\n"
    )


def test_comments_stay_with_their_statement() -> None:
    text = "// one\n  a:=1;// two\n(* three *)b(* four *):=2;\n// five"
    assert body(text).splitlines() == ["// one", "a := 1;     // two", "(* three *) b (* four *) := 2;", "// five"]


def test_comments_at_the_end_of_lines_form_a_column() -> None:
    assert body("a:=1; // x\nlonger:=2; (* y *)\nb:=3;\nc:=1; // z").splitlines() == [
        "a := 1;         // x", "longer := 2;    (* y *)", "b := 3;", "c := 1;     // z",
    ]  # fmt: skip


def test_a_comment_in_a_call_keeps_its_argument() -> None:
    text = "f(\n    IN := x,    // start\n    // the time\n    PT := T#1s // end\n);"
    assert body(text).splitlines() == ["f(", "    IN := x, // start", "    // the time", "    PT := T#1s // end", ");"]


def test_a_comment_of_several_lines_moves_as_a_whole() -> None:
    assert body("IF x THEN\n(* one\n   two *)\na:=1; END_IF") == (
        "IF x THEN\n    (* one\n       two *)\n    a := 1;\nEND_IF\n"
    )


def test_code_that_is_left_out_stays_as_written() -> None:
    text = "{IF defined(SLOW)}\n  a:=1  ;\n{ELSE}\nb:=2;\n{END_IF}"
    assert body(text).splitlines() == ["{IF defined(SLOW)}", "  a:=1  ;", "{ELSE}", "b := 2;", "{END_IF}"]


def test_pragmas_stay_in_their_line() -> None:
    text = "PROGRAM p\nVAR\n{attribute 'a'}\nx:INT;\n{attribute 'b'} y:INT;\nEND_VAR\nEND_PROGRAM\n"
    assert formatted("t.st", text).splitlines()[2:5] == [
        "    {attribute 'a'}", "    x : INT;", "    {attribute 'b'} y : INT;",
    ]  # fmt: skip


def test_the_formatter_can_be_switched_off() -> None:
    text = "a := 1;\n// fmt: off\nb  :=  2;\n\n\n c:=3;\n// fmt: on\na := 1;\n"
    assert body(text) == text
    assert "x:=1" in body("// fmt: off\nx:=1;")


def test_an_object_without_end_gets_none() -> None:
    assert formatted("t.st", "FUNCTION_BLOCK F\nVAR\na:INT;\nEND_VAR\na:=1;\n") == (
        "FUNCTION_BLOCK F\nVAR\n    a : INT;\nEND_VAR\na := 1;\n"
    )


@pytest.mark.parametrize("text", ["", "\n", "// only\n", "PROGRAM a\n(*x*)END_PROGRAM"])
def test_texts_without_statements_are_formatted(text: str) -> None:
    result = formatted("t.st", text)
    assert formatted("t.st", result) == result


def test_line_ends_of_windows_are_kept() -> None:
    result = formatted("t.st", "PROGRAM a\r\nVAR x:INT;\r\nEND_VAR\r\nEND_PROGRAM\r\n")
    assert result == "PROGRAM a\r\nVAR\r\n    x : INT;\r\nEND_VAR\r\nEND_PROGRAM\r\n"


def test_a_range_leaves_other_lines_alone() -> None:
    lines = [*HEAD.splitlines(), "a  :=  1 ;", "IF x THEN b:=1;END_IF", "", "", "c  := 1;", "END_PROGRAM", ""]
    result = formatted("t.st", "\n".join(lines), ranges=[(8, 8)])
    assert result.splitlines() == [*lines[:7], "IF x THEN", "    b := 1;", "END_IF", *lines[8:-1]]
    assert formatted("t.st", "\n".join(lines), ranges=[(9, 10), (900, 901)]) == "\n".join(lines)


@examples(12)
@given(st.randoms(use_true_random=False))
def test_a_range_changes_nothing_outside_of_its_statements(chance: random.Random) -> None:
    text = chance.choice(EXAMPLES).read_text()
    text = re.sub("\n", lambda _: chance.choice(("\n", "\n\n", "  \n")), text)
    lines = text.splitlines()
    first = chance.randint(1, len(lines))
    result = formatted("t.st", text, ranges=[(first, first)]).splitlines()
    if result != lines:
        changed = SequenceMatcher(None, lines, result, autojunk=False).get_opcodes()
        touched = [
            i for kind, begin, end, _, _ in changed if kind != "equal" for i in range(begin, max(end, begin + 1))
        ]
        assert max(touched) - min(touched) < 12
        assert min(touched) - 2 < first <= max(touched) + 2


def test_a_text_with_an_error_is_refused_with_its_place() -> None:
    with pytest.raises(UsageError, match=r"^t\.st:3:\d+: .*not formatted"):
        formatted("t.st", "PROGRAM a\nVAR x : INT; END_VAR\nx = ;\nEND_PROGRAM\n")


def test_every_program_is_formatted_once_and_keeps_its_tokens() -> None:
    count = 0
    for path in CORPUS[::3]:
        text = path.read_bytes().decode("utf-8", "replace").replace("\r\n", "\n")
        try:
            result = formatted(str(path), text)
        except UsageError:
            continue  # a program with a syntax error; an InternalError fails this test
        count += 1
        assert formatted(str(path), result) == result, path
        kept = [re.sub(r"\s", "", t).upper() for t in (text, result)]
        assert kept[0] == kept[1], path
    assert count > 300


@pytest.mark.parametrize("path", [p for p in PROGRAMS if runs(read_script(p))][::SHARE], ids=lambda p: p.stem)
def test_the_image_is_the_same(path: Path) -> None:
    text = path.read_text("utf-8")
    found = check_sources(read_content(path, formatted(str(path), text).encode()))
    assert found.program is not None
    assert build_program(found.program, OPTIONS).image == build(path, 0, "all").image


def test_examples_are_formatted() -> None:
    for path in EXAMPLES:
        text = path.read_text()
        assert formatted(str(path), text) == text, f"run 'plctool fmt {path}'"


@examples(12)
@given(st.randoms(use_true_random=False))
def test_white_space_does_not_matter(chance: random.Random) -> None:
    path = chance.choice(WITHOUT_LISTS)
    text = path.read_text()
    items = scan(str(path), text)
    bare = "".join(_separator(items, i, chance, wild=False) + item.text for i, item in enumerate(items))
    wild = "".join(_separator(items, i, chance, wild=True) + item.text for i, item in enumerate(items))
    expected, result = formatted("t.st", bare), formatted("t.st", wild)
    assert _without_blank_lines(result) == _without_blank_lines(expected)


def _separator(items: Sequence[Item], at: int, chance: random.Random, *, wild: bool) -> str:
    """White space before a token; line breaks not where they are kept: after a bracket and the label of a branch."""
    if at == 0:
        return ""
    if not wild or items[at - 1].type in ("_LPAR", "_LSQB", "_COLON"):
        return " "
    return chance.choice((" ", "\n", "\t", "\n\n\n", " \n  "))


def _without_blank_lines(text: str) -> list[str]:
    return [line for line in text.splitlines() if line]


def test_a_pragma_at_the_end_of_the_file_is_kept() -> None:
    result = formatted("t.st", "PROGRAM Main\nEND_PROGRAM {warning 'w'}")
    assert result == "PROGRAM Main\nEND_PROGRAM\n{warning 'w'}\n"
    assert formatted("t.st", result) == result


@examples(12)
@given(st.randoms(use_true_random=False))
def test_comments_anywhere_are_kept_and_settle_at_once(chance: random.Random) -> None:
    path = chance.choice(WITHOUT_LISTS)
    items = scan(str(path), path.read_text())
    choices = (" ", "\n", " (* c *) ", "\n(* c\n  d *)\n", " // e\n", "\n// e\n", " {warning 'w'} ", "\n\n")
    text = "".join((chance.choice(choices) if chance.random() < 0.2 else " ") + item.text for item in items)
    result = formatted("t.st", text)
    assert formatted("t.st", result) == result
    for mark in ("(* c", "// e", "{warning"):
        assert result.count(mark) == text.count(mark)


@pytest.mark.parametrize(
    "text",
    [
        "a := " + "(" * 2000 + "1" + ")" * 2000 + ";",
        "IF x THEN " * 1000 + "a := 1;" + "END_IF;" * 1000,
        "a := 1" + " + 1" * 5000 + ";",
        "// x\n" * 20000,
        "a := 1; // x\n" * 1000,
        "(*" * 5000,
        "{x}" * 10000,
        "CASE a OF " + ",".join(map(str, range(3000))) + ": a := 1; END_CASE",
    ],
    ids=range(8),
)
def test_hostile_texts_take_bounded_time(text: str) -> None:
    begin = time.process_time()
    try:
        result = formatted("t.st", f"{HEAD}{text}\nEND_PROGRAM\n")
    except PlcError:
        result = ""
    assert len(result) < 500 * len(text)
    assert time.process_time() - begin < 20
