"""Addresses that count modules and channels, such as %IX4.0.1: a channel of the description says where they are."""

from __future__ import annotations

from pathlib import Path

import pytest
from io_support import addresses, build, messages

from plctool.compiler import compile_sources
from plctool.compiler.syntax.diagnostics import CompileError
from plctool.sim import Simulator

MAIN = "PROGRAM Main\nVAR {} END_VAR\n{}\nEND_PROGRAM\n"
LAMP = MAIN.format("start AT %IX4.0.1 : BOOL; lamp AT %QX4.1.0 : BOOL; level AT %IW0.1 : INT;", "lamp := start;")


def test_a_channel_names_the_address(tmp_path: Path) -> None:
    description = "[sim]\nin = { a = '%IX4.0.1', b = '%iw0.1' }\nout = { c = '%QX4.1.0' }"
    built = build(tmp_path, LAMP, description)
    assert built.warnings == []
    assert set(addresses(built)) == {"Main.start", "Main.lamp", "Main.level"}
    with Simulator(built.image, built.symbols) as plc:
        plc.set_input("Main.start", True)
        plc.run_cycles(2)
        assert plc.output("Main.lamp") is True


def test_a_channel_names_the_variable(tmp_path: Path) -> None:
    description = "[sim]\nin = { a = 'Main.start', b = 'Main.level' }\nout = { c = 'Main.lamp' }"
    assert set(addresses(build(tmp_path, LAMP, description))) == {"Main.start", "Main.lamp", "Main.level"}


def test_statements_may_use_the_address(tmp_path: Path) -> None:
    program = MAIN.format("start AT %IX4.0.1 : BOOL;", "%QX4.1.0 := %IX4.0.1;")
    built = build(tmp_path, program, "[sim]\nin = { a = '%IX4.0.1' }\nout = { c = '%QX4.1.0' }")
    assert set(addresses(built)) == {"Main.start", "%QX4.1.0"}
    with Simulator(built.image, built.symbols) as plc:
        plc.set_input("Main.start", True)
        plc.run_cycles(2)
        assert plc.output("%QX4.1.0") is True


def test_an_address_without_a_variable_is_a_channel_all_the_same(tmp_path: Path) -> None:
    built = build(tmp_path, MAIN.format("a : BOOL;", "a := NOT a;"), "[sim]\nin = { a = '%IX4.0.1' }")
    assert set(addresses(built)) == {"%IX4.0.1"}


def test_a_global_and_one_without_a_name(tmp_path: Path) -> None:
    program = "VAR_GLOBAL g AT %IB1.2 : BYTE; AT %QB1.2 : BYTE; END_VAR\n" + MAIN.format("", "%QB1.2 := g;")
    built = build(tmp_path, program, "[sim]\nin = { a = '%IB1.2' }\nout = { b = '%QB1.2' }")
    assert len(addresses(built)) == 2


def test_a_program_that_is_kept_has_inputs_all_the_same(tmp_path: Path) -> None:
    program = MAIN.format("a AT %IX1.0.1 : BOOL; b AT %I* : BOOL;", "a := b;")
    program += "CONFIGURATION C\nTASK t(INTERVAL := T#10ms);\nPROGRAM RETAIN Main WITH t : Main;\nEND_CONFIGURATION\n"
    built = build(tmp_path, program, "[sim]\nin = { x = '%IX1.0.1', y = 'Main.b' }")
    assert set(addresses(built)) == {"Main.a", "Main.b"}


@pytest.mark.parametrize(
    ("variables", "description", "expected"),
    [
        ("a AT %IX4.0.1 : BOOL;", "out = { c = '%IX4.0.1' }", "%IX4.0.1 cannot be here"),
        ("a AT %IX4.0.1 : INT;", "in = { c = '%IX4.0.1' }", "%IX4.0.1 is a bit, INT is not"),
        ("a AT %IW4.0 : DINT;", "in = { c = '%IW4.0' }", "DINT has 32 bits, %IW4.0 16"),
        ("a AT %IX4.0.1 : BOOL; b AT %IX4.0.1 : BOOL;", "in = { c = '%IX4.0.1' }", "%IX4.0.1 is Main.a already"),
        ("a AT %IX4.0.1 : BOOL;", "in = { c = '%IX4.0.1', d = 'Main.a' }", "belongs to the channel"),
        ("a AT %IX4.0.1 : BOOL;", "in = { c = '%IX4.0.1', d = '%ix4.0.1' }", "belongs to the channel"),
        ("a AT %IX4.0.1 : BOOL;", "in = { c = '%IX4.0.2' }", "no channel leads to %IX4.0.1, and"),
        ("a AT %QX4.0.1 : BOOL;", "in = { c = 'Main.a' }", "is declared AT %Q*, but the channel"),
    ],
)
def test_what_does_not_fit_is_an_error(tmp_path: Path, variables: str, description: str, expected: str) -> None:
    found = messages(tmp_path, MAIN.format(variables, "a := a;"), f"[sim]\n{description}")
    assert len(found) == 1
    assert expected in found[0]


def test_without_a_description_such_addresses_are_memory_with_one_warning(tmp_path: Path) -> None:
    declared = "a AT %IX4.0.1 : BOOL; b AT %QX4.0.0.1 : BOOL; c AT %IL0.2 : LREAL; d AT %QW1 : WORD;"
    (tmp_path / "main.st").write_text(MAIN.format(declared, "b := NOT a; d := d + 1; %QW9.0.0 := d;"))
    built = compile_sources([tmp_path / "main.st"])
    (warning,) = built.warnings
    assert "no channel leads to %IX4.0.1 (and 3 more), so it is memory that no device reads or writes" in str(warning)
    with Simulator(built.image, built.symbols) as plc:
        plc.run_cycles(3)
        assert plc.read("Main.b") is True
        assert plc.read("Main.d") == 3


def test_without_a_description_an_address_has_one_variable_too(tmp_path: Path) -> None:
    (tmp_path / "main.st").write_text(MAIN.format("a AT %QW4.0 : WORD; b : WORD;", "a := 5; b := %QW4.0;"))
    built = compile_sources([tmp_path / "main.st"])
    with Simulator(built.image, built.symbols) as plc:
        plc.run_cycles(1)
        assert plc.read("Main.b") == 5
    (tmp_path / "main.st").write_text(MAIN.format("a AT %QW4.0 : WORD; b AT %QW4.0 : WORD;", "a := b;"))
    with pytest.raises(CompileError, match=r"%QW4.0 is Main.a already"):
        compile_sources([tmp_path / "main.st"])
