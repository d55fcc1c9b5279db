"""Instruction List: what is wrong in a body is said at its line, with what to write; PLCopen XML; the formatter."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from plcopen_support import errors, pou, project, started, variables
from shares import share

from plctool.compiler import load_sources
from plctool.compiler.front import check_sources
from plctool.fmt.formatter import formatted

HEAD = "PROGRAM Main\nVAR n : INT; b : BOOL; t : TON; s : STRING; END_VAR\n"


def found(folder: Path, *lines: str) -> list[tuple[int, str]]:
    """Line of the body, from 1, and message of each error."""
    path = folder / "main.st"
    path.write_text(HEAD + "\n".join(lines) + "\nEND_PROGRAM\n")
    checked = check_sources(load_sources([path])).diagnostics
    return [(d.line - 2, d.message) for d in checked if d.severity == "error"]


@pytest.mark.parametrize(
    ("lines", "line", "message"),
    [
        (["LD n", "ST"], 2, "ST needs an operand; write ST and a name"),
        (["CAL t", "ADD 1"], 2, "ADD needs a result, and nothing is loaded here; begin with LD"),
        (["LD n", "JMP on", "ADD 1", "on: LD n"], 3, "ADD needs a result, and nothing is loaded here; begin with LD"),
        (["LD n", "ADD( n", "MUL 2"], 2, "this ( is not closed; write ) on a line of its own"),
        (["LD n", ")"], 2, "there is no ( before this )"),
        (["LD n", "ADD( n", ") ST n"], 3, "nothing follows a ) in its line; write the next instruction below"),
        (["LD b", "NOT b"], 2, "NOT negates the result, and has no operand; write LDN or ANDN"),
        (["LD b", "RETC b"], 2, "RETC has no operand"),
        (["LD n", "LIMIT(2, 4)"], 2, "a call with operands has no brackets; write LD, then LIMIT 2, 4"),
        (["LD n", "CAL t(IN := b"], 2, "the brackets of this operand are not closed; write ) at its end"),
        (["LD n", "IF b THEN"], 2, "a list of instructions has no statements of Structured Text; write LD x, ST y"),
        (["LD n", "n := 2"], 2, "a list of instructions has no statements of Structured Text; write LD x, ST y"),
        (["LD b", "AND( b", "JMPC on", ")", "on:"], 3, "JMPC cannot be in brackets; write it after the )"),
        (["LD b", "AND( b", "on: OR b", ")"], 3,
         "a label cannot be in brackets; write it before the instruction with the ("),
        (["LD n", "AND b", "ST n"], 2, "AND cannot combine INT and BOOL"),
        (["LD n", "MAXIMUM 2", "ST n"], 2, "unknown function MAXIMUM"),
        (["LD u", "ST n"], 1, "unknown name u"),
        (["LD n", "5 ADD"], 2, "5 ADD is not an instruction; write an operator before it"),
        (["LD n", "JMP on"], 2, "there is no label on here; a JMP does not leave its body, METHOD or ACTION"),
        (["LD n", "ST @t1"], 2, "@ has no place in a program"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_at_its_line(tmp_path: Path, lines: list[str], line: int, message: str) -> None:
    assert found(tmp_path, *lines) == [(line, message)]


def test_comments_and_strings_hold_no_instructions(tmp_path: Path) -> None:
    assert found(tmp_path, "LD '(* ( $' // )'  // a ( here", "(* ST", "LD x *) ST s", "CONCAT ',', ')'") == []


def test_variables_of_the_compiler_have_no_place_in_a_source(tmp_path: Path) -> None:
    assert found(tmp_path, "n := @t1;") == [(1, "@ has no place in a program")]


def test_a_list_in_plcopen_xml_runs(tmp_path: Path) -> None:
    body = "<IL><xhtml>LD n\nADD 1\nST n\nGT 2\nST b</xhtml></IL>"
    with started(tmp_path, project(pou("Main", body, variables("localVars", "n:INT", "b:BOOL")))) as plc:
        plc.run_cycles(3)
        assert (plc.read("Main.n"), plc.read("Main.b")) == (3, True)


def test_an_error_in_plcopen_xml_has_the_line_of_the_file(tmp_path: Path) -> None:
    text = project(pou("Main", "<IL><xhtml>LD n\nADD 1\nST u</xhtml></IL>", variables("localVars", "n:INT")))
    line = text[: text.index("ST u")].count("\n") + 1
    assert errors(tmp_path, text) == [(line, "unknown name u")]


def test_the_formatter_leaves_a_list_alone() -> None:
    text = "program Main\nVAR n : INT; END_VAR\nLD n\n ST n\nEND_PROGRAM\n"
    assert formatted("main.st", text) == text


LIST = (
    "LD n", "ADD( n", "MUL 2", ")", "ST n", "on: LD b", "ANDN b", "JMPC on", "CAL t(IN := b,", "PT := T#1s)", "LD s",
    "CONCAT 'a', (s)", "ST s", "LD b", "S b", "CLK t", "RETCN", "NOT", "JMP on",
)  # fmt: skip


@pytest.mark.parametrize("seed", share(range(40), 4))
def test_damaged_lists_are_compiled_or_named(tmp_path: Path, seed: int) -> None:
    r = random.Random(seed)
    lines = [r.choice(LIST) for _ in range(r.randint(1, 30))]
    text = "\n".join(lines)
    for _ in range(r.randint(0, 4)):
        at = r.randint(0, len(text))
        text = text[:at] + r.choice(["(", ")", "'", "(*", "\n", ":", ",", ";", "@", "\0", "LD ", "$"]) + text[at + 1 :]
    found(tmp_path, *text.split("\n"))


def test_an_operand_without_an_end_is_named_at_once(tmp_path: Path) -> None:
    ((line, message), *_) = found(tmp_path, "LD n", "LIMIT (n", *["n,"] * 20000)
    assert (line, message) == (2, "the brackets of this operand are not closed; write ) at its end")
