"""LD and FBD in exports of CODESYS 2.3 run as drawn; a word that is not known is refused by name."""

from __future__ import annotations

from pathlib import Path

import pytest

from plctool.compiler import compile_sources, load_sources
from plctool.compiler.front import check_sources
from plctool.sim import Simulator

HEAD = "(* @NESTEDCOMMENTS := 'Yes' *)\n(* @PATH := '' *)\n(* @OBJECTFLAGS := '0, 8' *)\n"
COMMENT = "_COMMENT\n'_NETWORK in a comment'\n_END_COMMENT\n"


def sign(negated: bool) -> str:
    """A sign."""
    return "_EXPRESSION\n" + ("_NEGATIV\n" if negated else "_POSITIV\n")


def operand(text: str, negated: bool = False) -> str:
    """An operand of a box."""
    return f"_OPERAND\n{sign(negated)}{text}\n"


def contact(name: str, negated: bool = False) -> str:
    """A contact."""
    return f"_LD_CONTACT\n{name}\n{sign(negated)}"


def gate(kind: str, *values: str) -> str:
    """Contacts after or beside each other."""
    return f"_LD_{kind}\n_LD_OPERATOR : {len(values)}\n{''.join(values)}{sign(False)}"


def outputs(*targets: tuple[str, str]) -> str:
    """Coils: name and one of `=`, `/`, `S`, `R`."""
    marks = {"=": "_POSITIV\n_NO_SET", "/": "_NEGATIV\n_NO_SET", "S": "_POSITIV\n_SET", "R": "_NEGATIV\n_SET"}
    return f"_OUTPUTS : {len(targets)}\n" + "".join(f"_OUTPUT\n{marks[how]}\n{name}\n" for name, how in targets)


def rung(value: str, *targets: tuple[str, str], boxes: tuple[str, ...] = (), label: str = "") -> str:
    """A network of LD."""
    listed = f"\n\nENABLELIST : {len(boxes)}\n{''.join(boxes)}ENABLELIST_END\n"
    return f"_NETWORK\n{label}\n{COMMENT}_LD_ASSIGN\n{value}{sign(False)}{listed}{outputs(*targets)}"


def box(kind: str, *inputs: str, instance: str = "", others: str = "", enabled: bool = False) -> str:
    """A box."""
    head = f"_FUNCTIONBLOCK\n{instance}\n" if instance else "_OPERATOR\n"
    enable = "_ENABLED\n" if enabled else ""
    return f"{head}_BOX_EXPR : {len(inputs)}\n{enable}{''.join(inputs)}{sign(False)}{kind}\n{others}"


def assign(value: str, *targets: tuple[str, str]) -> str:
    """An assignment of FBD."""
    return f"_ASSIGN\n{value}{sign(False)}{outputs(*targets)}"


def network(statement: str, label: str = "") -> str:
    """A network of FBD."""
    return f"_NETWORK\n{label}\n{COMMENT}{statement}"


def export(language: str, networks: list[str], declared: str, more: str = "", name: str = "PLC_PRG") -> str:
    """A program."""
    return (
        f"{HEAD}PROGRAM {name}\nVAR\n{declared}\nEND_VAR\n(* @END_DECLARATION := '0' *)\n"
        f"_{language}_BODY\n_NETWORKS : {len(networks)}\n{''.join(networks)}{more}\nEND_PROGRAM\n"
    )


def run(folder: Path, text: str, cycles: int = 1) -> Simulator:
    """A program after some cycles."""
    (folder / "plc.EXP").write_text(text)
    built = compile_sources([folder / "plc.EXP"])
    plc = Simulator(built.image, built.symbols)
    plc.run_cycles(cycles)
    return plc


def test_contacts_and_coils(tmp_path: Path) -> None:
    either = gate("OR", gate("AND", contact("a"), contact("b", negated=True)), contact("c"))
    networks = [rung(either, ("o", "="), ("n", "/"), ("s", "S")), rung(contact("a"), ("r", "R"))]
    declared = "a, r : BOOL := TRUE; b, c, o, n, s : BOOL;"
    with run(tmp_path, export("LD", networks, declared)) as plc:
        assert [plc.read(f"PLC_PRG.{v}") for v in "onsr"] == [True, False, True, False]


@pytest.mark.parametrize(("on", "seen"), [("TRUE", 7), ("FALSE", 3)])
def test_a_box_after_a_rung_runs_only_while_it_is_true(tmp_path: Path, on: str, seen: int) -> None:
    moved = assign(box("REAL_TO_INT", operand("x"), enabled=True), ("n", "="))
    networks = [rung(contact("a"), boxes=(moved,))]
    with run(tmp_path, export("LD", networks, f"a : BOOL := {on}; x : REAL := 7.0; n : INT := 3;")) as plc:
        assert plc.read("PLC_PRG.n") == seen


def test_inputs_and_outputs_of_a_block_are_those_of_its_declaration(tmp_path: Path) -> None:
    own = (
        f"{HEAD}FUNCTION_BLOCK Twice\nVAR_INPUT\n  x : INT; y : INT;\nEND_VAR\nVAR_OUTPUT\n  sum, difference : INT;\n"
        "END_VAR\n(* @END_DECLARATION := '0' *)\nsum := x + y; difference := x - y;\nEND_FUNCTION_BLOCK\n"
    )
    called = box("Twice", operand("9"), operand("4"), instance="f", others=outputs(("d", "=")))
    timer = box("TON", operand("FALSE", negated=True), operand("T#0ms"), instance="t")
    networks = [network(assign(called, ("s", "="))), network(assign(timer, ("q", "=")))]
    with run(tmp_path, own + export("FBD", networks, "f : Twice; t : TON; s, d : INT; q : BOOL;")) as plc:
        assert [plc.read(f"PLC_PRG.{v}") for v in "sdq"] == [13, 5, True]


def test_boxes_in_boxes_and_globals(tmp_path: Path) -> None:
    text = export(
        "FBD",
        [network(assign(box("GT", box("ADD", operand("g"), operand("1")), operand("5")), ("o", "=")))],
        "o : BOOL;",
    )
    with run(tmp_path, f"{HEAD}VAR_GLOBAL\n  g : INT := 5;\nEND_VAR\n" + text) as plc:
        assert plc.read("PLC_PRG.o") is True


def test_an_action_may_be_drawn(tmp_path: Path) -> None:
    compared = network(assign(box("GE", operand("n"), operand("1")), ("o", "=")))
    text = (
        f"{HEAD}PROGRAM PLC_PRG\nVAR\n  n : INT; o : BOOL;\nEND_VAR\n(* @END_DECLARATION := '0' *)\n"
        f"n := n + 1; Look();\nACTION Look:\n_FBD_BODY\n_NETWORKS : 1\n{compared}END_ACTION\nEND_PROGRAM\n"
    )
    with run(tmp_path, text) as plc:
        assert plc.read("PLC_PRG.o") is True


def messages(folder: Path, text: str) -> list[tuple[str, str]]:
    """Line and message of each error."""
    (folder / "plc.EXP").write_text(text)
    found = check_sources(load_sources([folder / "plc.EXP"])).diagnostics
    return [(text.splitlines()[d.line - 1], d.message) for d in found if d.severity == "error"]


@pytest.mark.parametrize(
    ("networks", "line", "message"),
    [
        ([network("_JUMP\nx\n")], "_JUMP", "it has _JUMP, which is not known"),
        ([rung("_LD_EDGE\na\n", ("o", "="))], "_LD_EDGE", "a rung has _LD_EDGE, which is not known"),
        ([rung(contact("???"), ("o", "="))], "???", "an operand is missing (???)"),
        ([rung(contact("a"), ("???", "="))], "???", "a coil or output has no variable"),
        ([network(assign(box("Other", operand("a"), instance="f"), ("o", "=")))], "Other", "Other is not declared"),
        (
            [network(assign(box("AND", operand("a"), operand("???")), ("o", "=")))],
            "AND",
            "an input of AND is connected",
        ),
        ([network("_ASSIGN\n")], "END_PROGRAM", "it ends within a network"),
        (
            [network(assign(operand("a"), ("o", "=")).replace("_NO_SET", "_EDGE"))],
            "_EDGE",
            "an output has _EDGE, which",
        ),
    ],
)
def test_what_is_not_known_is_refused_by_name(tmp_path: Path, networks: list[str], line: str, message: str) -> None:
    ((at, found),) = messages(tmp_path, export("FBD", networks, "a, o : BOOL;"))
    assert found.startswith("the diagram PLC_PRG cannot be compiled: ")
    assert message in found
    assert at.strip() == line


def test_a_rung_that_is_too_deep_is_refused(tmp_path: Path) -> None:
    deep = "_LD_AND\n_LD_OPERATOR : 1\n" * 5000 + contact("a") + sign(False) * 5000
    ((_, message),) = messages(tmp_path, export("LD", [rung(deep, ("o", "="))], "a, o : BOOL;"))
    assert message == "the diagram PLC_PRG cannot be compiled: it is too deep"


def test_an_error_stands_in_its_line(tmp_path: Path) -> None:
    ((line, message),) = messages(tmp_path, export("LD", [rung(contact("missing"), ("o", "="))], "o : BOOL;"))
    assert (line, "missing" in message) == ("missing", True)
