"""LD and FBD of .TcPOU files run as TwinCAT runs them; what is not known of their archive is refused by name."""

from __future__ import annotations

from pathlib import Path

import pytest
from twincat_archive import (
    RAIL,
    archive,
    assign,
    box,
    demux,
    given,
    item,
    network,
    parallel,
    unit,
)

from plctool.compiler import compile_sources, load_sources
from plctool.compiler.front import check_sources
from plctool.sim import Simulator

CYCLE = 10_000_000


def run(folder: Path, body: str, declared: str, more: str = "", cycles: int = 1) -> Simulator:
    """A program after some cycles."""
    path = folder / "Main.TcPOU"
    path.write_text(unit(f"PROGRAM Main\nVAR\n{declared}\nEND_VAR", body, more))
    built = compile_sources([path])
    plc = Simulator(built.image, built.symbols)
    plc.run_cycles(cycles)
    return plc


def errors(folder: Path, body: str, declared: str = "a, b, o : BOOL;") -> list[str]:
    """The messages about a program."""
    path = folder / "Main.TcPOU"
    path.write_text(unit(f"PROGRAM Main\nVAR\n{declared}\nEND_VAR", body))
    return [d.message for d in check_sources(load_sources([path])).diagnostics if d.severity == "error"]


GATE = item(box("OR", [item(box("AND", [given("a"), given("b", 1)])), given("c")]))


@pytest.mark.parametrize("mode", ["Fbd", "Ld"])
def test_boxes_and_contacts_with_negation(tmp_path: Path, mode: str) -> None:
    body = archive(network(assign(GATE, ("o", 0), ("n", 1))), mode=mode)
    with run(tmp_path, body, "a : BOOL := TRUE; b, c, o, n : BOOL;") as plc:
        assert (plc.read("Main.o"), plc.read("Main.n")) == (True, False)


def test_set_and_reset_coils_keep_their_value(tmp_path: Path) -> None:
    body = archive(network(assign(given("a"), ("o", 2))), network(assign(given("b"), ("o", 3))), mode="Ld")
    with run(tmp_path, body, "a : BOOL := TRUE; b, o : BOOL;") as plc:
        seen = [plc.read("Main.o")]
        for name, level in (("a", False), ("b", True)):
            plc.write({f"Main.{name}": level})
            plc.run_cycles(1)
            seen.append(plc.read("Main.o"))
    assert seen == [True, True, False]


def test_all_coils_of_a_rung_get_the_value_of_one_moment(tmp_path: Path) -> None:
    body = archive(network(assign(given("x", 1), ("x", 0), ("y", 0))), mode="Ld")
    with run(tmp_path, body, "x, y : BOOL;") as plc:
        assert (plc.read("Main.x"), plc.read("Main.y")) == (True, True)


def test_a_branch_keeps_its_value_while_the_variable_changes(tmp_path: Path) -> None:
    items = (demux(3, given("n")), assign(given("7"), ("n", 0)), assign(demux(3), ("m", 0)))
    with run(tmp_path, archive(network(*items)), "n : INT := 5; m : INT;") as plc:
        assert (plc.read("Main.n"), plc.read("Main.m")) == (7, 5)


def test_an_edge_is_seen_in_one_cycle(tmp_path: Path) -> None:
    rising = item(box("ADD", [given("n"), item(box("SEL", [given("a", 16), given("0"), given("1")]))]))
    with run(tmp_path, archive(network(assign(rising, ("n", 0)))), "a : BOOL := TRUE; n : INT;", cycles=5) as plc:
        assert plc.read("Main.n") == 1


def test_a_function_block_gets_its_inputs_by_name(tmp_path: Path) -> None:
    timer = box("TON", {"IN": given("a"), "PT": given("T#25ms")}, {"Q:BOOL": "", "ET:TIME": "seen"}, "t")
    with run(
        tmp_path, archive(network(assign(item(timer), ("o", 0)))), "a : BOOL := TRUE; o : BOOL; t : TON; seen : TIME;"
    ) as plc:
        early = plc.read("Main.o")
        plc.run_cycles(20)
        assert (early, plc.read("Main.o"), plc.read("Main.seen") != "T#0s") == (False, True, True)


@pytest.mark.parametrize(("enable", "seen"), [("TRUE", (7, True)), ("FALSE", (3, False))])
def test_en_decides_about_the_box_and_its_output(tmp_path: Path, enable: str, seen: tuple[int, bool]) -> None:
    move = box("MOVE", {"EN": given("e"), "IN": given("7")}, {"ENO:BOOL": "", ":INT": "n"})
    body = archive(network(assign(item(move), ("o", 0))), mode="Ld")
    with run(tmp_path, body, f"e : BOOL := {enable}; n : INT := 3; o : BOOL;") as plc:
        assert (plc.read("Main.n"), plc.read("Main.o")) == seen


@pytest.mark.parametrize(("skip", "seen"), [("TRUE", (False, True)), ("FALSE", (True, True))])
def test_a_jump_leaves_out_networks_and_a_commented_one_is_none(
    tmp_path: Path, skip: str, seen: tuple[bool, bool]
) -> None:
    body = archive(
        network(assign(given("skip"), ("over", 4))),
        network(assign(RAIL, ("a", 0))),
        network(assign(RAIL, ("b", 0)), label="over"),
        network(assign(given("FALSE"), ("b", 0)), out=True),
        network(assign(RAIL, ("", 8))),
        network(assign(given("FALSE"), ("b", 0))),
        mode="Ld",
    )
    with run(tmp_path, body, f"skip : BOOL := {skip}; a, b : BOOL;") as plc:
        assert (plc.read("Main.a"), plc.read("Main.b")) == seen


def test_parallel_branches_follow_what_feeds_them(tmp_path: Path) -> None:
    body = archive(network(assign(parallel(given("a"), given("b"), given("c")), ("o", 0))), mode="Ld")
    with run(tmp_path, body, "a, c : BOOL := TRUE; b, o : BOOL;") as plc:
        assert plc.read("Main.o") is True
        plc.write({"Main.a": False})
        plc.run_cycles(1)
        assert plc.read("Main.o") is False


def test_actions_and_methods_may_be_drawn(tmp_path: Path) -> None:
    drawn = archive(network(assign(item(box("GT", [given("n"), given("2")])), ("big", 0))))
    double = archive(network(assign(item(box("MUL", [given("x"), given("2")])), ("Double", 0))))
    body = "<ST><![CDATA[n := f.Double(x := 2); Look();]]></ST>"
    more = f'<Action Name="Look"><Implementation>{drawn}</Implementation></Action>'
    (tmp_path / "FB.TcPOU").write_text(
        unit(
            "FUNCTION_BLOCK FB",
            "<ST/>",
            '<Method Name="Double"><Declaration><![CDATA[METHOD Double : INT\n'
            "VAR_INPUT x : INT; END_VAR]]></Declaration>"
            f"<Implementation>{double}</Implementation></Method>",
            "FB",
        )
    )
    path = tmp_path / "Main.TcPOU"
    path.write_text(unit("PROGRAM Main\nVAR f : FB; n : INT; big : BOOL; END_VAR", body, more))
    built = compile_sources([tmp_path])
    with Simulator(built.image, built.symbols) as plc:
        plc.run_cycles(1)
        assert (plc.read("Main.n"), plc.read("Main.big")) == (4, True)


def test_a_method_with_en_is_called_by_name(tmp_path: Path) -> None:
    (tmp_path / "FB.st").write_text(
        "FUNCTION_BLOCK FB\nVAR n : INT; END_VAR\nMETHOD PUBLIC Add : INT\nVAR_INPUT by, more : INT; END_VAR\n"
        "n := n + by - more;\nAdd := n;\nEND_METHOD\nEND_FUNCTION_BLOCK\n"
    )
    call = box(
        "f.Add",
        {"EN": given("e"), "by": given("5"), "more": given("1")},
        {"ENO:BOOL": "", "Add:INT": "n"},
        call="Method",
    )
    path = tmp_path / "Main.TcPOU"
    path.write_text(unit("PROGRAM Main\nVAR f : FB; e : BOOL := TRUE; n : INT; END_VAR", archive(network(item(call)))))
    built = compile_sources([tmp_path])
    with Simulator(built.image, built.symbols) as plc:
        plc.run_cycles(2)
        assert plc.read("Main.n") == 8


def test_functions_without_a_known_type_are_called(tmp_path: Path) -> None:
    (tmp_path / "Note.st").write_text(
        "VAR_GLOBAL seen : INT; END_VAR\nFUNCTION Note : INT\nVAR_INPUT x : INT; END_VAR\nseen := seen + x;\n"
        "Note := x;\nEND_FUNCTION\nFUNCTION Plain\nVAR_INPUT x : INT; END_VAR\nseen := seen + x;\nEND_FUNCTION\n"
    )
    alone = item(box("Note", {"x": given("1")}, {":": ""}, call="Function"))
    enabling = assign(item(box("Note", {"x": given("10")}, {"ENO:BOOL": "", ":": ""}, call="Function")), ("o", 0))
    plain = item(box("Plain", {"x": given("100")}, call="Function"))
    path = tmp_path / "Main.TcPOU"
    path.write_text(unit("PROGRAM Main\nVAR o : BOOL; END_VAR", archive(network(alone, enabling, plain))))
    built = compile_sources([tmp_path])
    with Simulator(built.image, built.symbols) as plc:
        plc.run_cycles(1)
        assert (plc.read("seen"), plc.read("Main.o")) == (111, True)


@pytest.mark.parametrize(
    ("items", "message"),
    [
        ([assign('<o t="BoxTreeMux"></o>', ("o", 0))], "it has a BoxTreeMux, which is not known"),
        ([assign(given("a", 64), ("o", 0))], "it has the flags 64, which are not known"),
        ([assign(given("a", 17), ("o", 0))], "it has an edge of a negated value"),
        ([assign(given("a"), ("o", 16))], "the coil o has the flags 16, which are not known"),
        ([assign(given("???"), ("o", 0))], "an operand is missing (???)"),
        ([assign(given(""), ("o", 0))], "a part of it is connected to nothing"),
        ([assign(demux(4), ("o", 0))], "branch 4 is used before it has a value"),
        ([item(box("EXECUTE", []))], "it has an EXECUTE box"),
        ([assign(item(box("SEL", [given("a"), given(""), given("1")])), ("o", 0))], "the input IN2 of SEL"),
        ([assign(parallel("", item(box("TON", {"IN": given("a")}, {"Q": ""}, "t"))), ("o", 0))], "a parallel branch"),
        ([assign(given("a").replace(">0<", ">x<"), ("o", 0))], "it has the flags 'x', which are not known"),
    ],
)  # fmt: skip
def test_what_is_not_known_is_refused_by_name(tmp_path: Path, items: list[str], message: str) -> None:
    (found,) = errors(tmp_path, archive(network(*items)))
    assert found.startswith("the diagram Main cannot be compiled: ")
    assert message in found


def test_a_network_shown_as_il_says_what_to_do(tmp_path: Path) -> None:
    (found,) = errors(tmp_path, archive(network(il=True)))
    assert found.endswith("a network of it is shown as IL; show it as FBD or LD and save it")


def test_an_error_stands_where_the_operand_is(tmp_path: Path) -> None:
    path = tmp_path / "Main.TcPOU"
    path.write_text(unit("PROGRAM Main\nVAR o : BOOL; END_VAR", archive(network(assign(given("wrong"), ("o", 0))))))
    (found,) = [d for d in check_sources(load_sources([path])).diagnostics if d.severity == "error"]
    line = path.read_text().splitlines()[found.line - 1]
    assert line[found.column - 1 :].startswith('wrong"')
    assert "wrong" in found.message
