"""PLCopen XML: Ladder and Function Block Diagrams become statements in the order in which the editors execute them."""

from __future__ import annotations

from pathlib import Path

import pytest
from plcopen_support import errors, pou, project, st, started, variables, written

from plctool.compiler import load_sources
from plctool.compiler.front import check_sources


def at(row: int, column: int = 0) -> str:
    """A position in the diagram."""
    return f'<position x="{column}" y="{row}"/>'


def lines(*sources: str) -> str:
    """What is connected to an input: local ids, `id.output` of blocks."""
    found = []
    for source in sources:
        ref, _, formal = source.partition(".")
        found.append(f'<connection refLocalId="{ref}"' + (f' formalParameter="{formal}"' if formal else "") + "/>")
    return f"<connectionPointIn>{''.join(found)}</connectionPointIn>"


def contact(number: int, name: str, *sources: str, more: str = "") -> str:
    """A contact."""
    return f'<contact localId="{number}" {more}>{at(0)}{lines(*sources)}<variable>{name}</variable></contact>\n'


def coil(number: int, name: str, *sources: str, row: int = 0, more: str = "") -> str:
    """A coil."""
    return f'<coil localId="{number}" {more}>{at(row, 90)}{lines(*sources)}<variable>{name}</variable></coil>\n'


def given(number: int, text: str, more: str = "") -> str:
    """An input variable or literal."""
    return f'<inVariable localId="{number}" {more}>{at(0)}<expression>{text}</expression></inVariable>\n'


def taken(number: int, name: str, source: str, row: int = 0, more: str = "") -> str:
    """An output variable."""
    head = f'<outVariable localId="{number}" {more}>{at(row, 90)}'
    return f"{head}{lines(source)}<expression>{name}</expression></outVariable>\n"


def block(
    number: int,
    kind: str,
    inputs: dict[str, str],
    outputs: str = "OUT",
    instance: str = "",
    row: int = 0,
    order: int = 0,
) -> str:
    """A block; an input may be `!id` for a negated one. `order`: its execution number."""
    name = f' executionOrderId="{order}"' + (f' instanceName="{instance}"' if instance else "")
    read = "".join(
        f'<variable formalParameter="{n}"{" negated=" + chr(34) + "true" + chr(34) if s.startswith("!") else ""}>'
        f"{lines(s.lstrip('!')) if s else ''}</variable>"
        for n, s in inputs.items()
    )
    written = "".join(f'<variable formalParameter="{n}"/>' for n in outputs.split())
    return (
        f'<block localId="{number}" typeName="{kind}"{name}>{at(row, 50)}<inputVariables>{read}</inputVariables>'
        f"<inOutVariables/><outputVariables>{written}</outputVariables></block>\n"
    )


RAIL = '<leftPowerRail localId="1"><position x="0" y="0"/></leftPowerRail>\n'


def ladder(*elements: str) -> str:
    """A body."""
    return f"<LD>\n{RAIL}{''.join(elements)}</LD>"


def network(*elements: str) -> str:
    """A body."""
    return f"<FBD>\n{''.join(elements)}</FBD>"


def run(folder: Path, body: str, local: list[str], cycles: int = 1, other: str = "") -> dict[str, object]:
    """The variables after some cycles, by name."""
    main = pou("Main", body, variables("localVars", *local))
    with started(folder, project(other + main, instances=CYCLE)) as plc:
        plc.run_cycles(cycles)
        declared = (d.split(":")[:2] for d in local)
        return {name: plc.read(f"Main.{name}") for name, kind in declared if kind.isupper() and kind != "TON"}


CYCLE = """<configuration name="c"><resource name="r"><task name="t" priority="1" interval="T#10ms">
<pouInstance name="Main" typeName="Main"/></task></resource></configuration>"""


@pytest.mark.parametrize(("start", "stop", "runs"), [("TRUE", "FALSE", True), ("TRUE", "TRUE", False)])
def test_a_rung_with_a_seal_in_contact(tmp_path: Path, start: str, stop: str, runs: bool) -> None:
    body = ladder(
        contact(2, "start", "1"),
        contact(3, "motor", "1"),
        contact(4, "stop", "2", "3", more='negated="true"'),
        coil(5, "motor", "4"),
        coil(6, "lamp", "4", row=40, more='negated="true"'),
    )
    found = run(tmp_path, body, [f"start:BOOL:={start}", f"stop:BOOL:={stop}", "motor:BOOL", "lamp:BOOL"])
    assert (found["motor"], found["lamp"]) == (runs, not runs)


def test_coils_that_set_and_reset_keep_their_value(tmp_path: Path) -> None:
    body = ladder(
        contact(2, "a", "1"),
        coil(3, "x", "2", more='storage="set"'),
        coil(4, "y", "2", row=30, more='storage="reset"'),
        coil(5, "a", "1", row=60, more='negated="true"'),
    )
    found = run(tmp_path, body, ["a:BOOL:=TRUE", "x:BOOL", "y:BOOL:=TRUE"], cycles=3)
    assert found == {"a": False, "x": True, "y": False}


def test_a_contact_for_an_edge_is_true_for_one_cycle(tmp_path: Path) -> None:
    body = ladder(
        contact(2, "a", "1", more='edge="rising"'),
        block(3, "ADD", {"EN": "2", "IN1": "4", "IN2": "5"}, "ENO OUT"),
        given(4, "n"),
        given(5, "1"),
        taken(6, "n", "3.OUT", row=20),
    )
    assert run(tmp_path, body, ["a:BOOL:=TRUE", "n:INT"], cycles=4)["n"] == 1


def test_rungs_are_executed_from_top_to_bottom_whatever_their_order_in_the_file(tmp_path: Path) -> None:
    body = ladder(contact(2, "b", "1"), contact(3, "a", "1"), coil(4, "c", "2", row=90), coil(5, "b", "3", row=10))
    assert run(tmp_path, body, ["a:BOOL:=TRUE", "b:BOOL", "c:BOOL"])["c"] is True


def test_execution_numbers_come_before_positions(tmp_path: Path) -> None:
    body = network(
        given(1, "a"),
        given(2, "b"),
        taken(3, "b", "1", row=50, more='executionOrderId="1"'),
        taken(4, "c", "2", row=10, more='executionOrderId="2"'),
    )
    assert run(tmp_path, body, ["a:INT:=7", "b:INT", "c:INT"])["c"] == 7


def test_a_function_runs_at_its_execution_number(tmp_path: Path) -> None:
    body = network(
        given(1, "x"),
        given(2, "7"),
        block(3, "ADD", {"IN1": "1", "IN2": "2"}, order=1),
        given(4, "100"),
        taken(5, "x", "4", more='executionOrderId="2"'),
        taken(6, "r", "3.OUT", more='executionOrderId="3"'),
    )
    assert run(tmp_path, body, ["x:INT:=1", "r:INT"]) == {"x": 100, "r": 8}


INCREASE = pou("Inc", st("o := o + n;"), variables("inputVars", "n:INT") + variables("outputVars", "o:INT"),
               "functionBlock")  # fmt: skip
SAME = pou("Same", st("o := i;"), variables("inputVars", "i:INT") + variables("outputVars", "o:INT"), "functionBlock")


@pytest.mark.parametrize(("first", "second", "seen"), [(1, 2, 1), (2, 1, 2), (0, 0, 2), (1, 0, 2)])
def test_a_block_sees_the_outputs_that_a_later_one_had(tmp_path: Path, first: int, second: int, seen: int) -> None:
    body = network(
        given(1, "1"),
        block(2, "Inc", {"n": "1"}, "o", "a", order=second),
        block(3, "Same", {"i": "4.OUT"}, "o", "b", order=first),
        block(4, "MOVE", {"IN": "2.o"}),
        taken(5, "r", "3.o"),
    )
    assert run(tmp_path, body, ["a:Inc", "b:Same", "r:INT"], 2, INCREASE + SAME) == {"r": seen}


def test_a_function_of_the_project_is_not_called_when_EN_is_FALSE(tmp_path: Path) -> None:
    result = "<returnType><BOOL/></returnType>"
    own = pou("Big", st("Big := 10 / d > 1;"), result + variables("inputVars", "d:INT"), "function")
    body = ladder(
        contact(2, "go", "1"),
        given(3, "d"),
        block(4, "Big", {"EN": "2", "d": "3"}),
        coil(5, "big", "4.OUT"),
        taken(6, "d", "7", row=30),
        given(7, "0"),
        coil(8, "go", "1", row=60, more='negated="true"'),
    )
    local = ["go:BOOL:=TRUE", "d:INT:=2", "big:BOOL"]
    assert run(tmp_path, body, local, 3, own) == {"go": False, "d": 0, "big": True}


def test_an_output_in_the_block_is_written_once(tmp_path: Path) -> None:
    point = "<connectionPointOut><expression>n</expression></connectionPointOut>"
    added = block(3, "ADD", {"IN1": "1", "IN2": "2"}).replace(
        '<variable formalParameter="OUT"/>', f'<variable formalParameter="OUT">{point}</variable>'
    )
    body = network(given(1, "(n)"), given(2, "(1)"), added)
    assert run(tmp_path, body, ["n:INT"]) == {"n": 1}


ONCE = 'edge="rising"'
PIN = '<variable formalParameter="Q1"'


@pytest.mark.parametrize(
    ("elements", "seen"),
    [
        ((given(2, "x", ONCE), taken(3, "y", "2")), [True, False]),
        ((given(2, "x"), taken(3, "y", "2", more=ONCE)), [True, False]),
        ((given(2, "x"), block(3, "SR", {"S1": "2"}, "Q1", "s").replace(PIN, f"{PIN} {ONCE}"), taken(4, "y", "3.Q1")),
         [True, False]),
        ((given(2, "x"), f'<inOutVariable localId="3" negatedIn="true">{at(0)}{lines("2")}<expression>z</expression>'
          "</inOutVariable>", given(4, "z"), taken(5, "y", "4", row=10)), [False, False]),
        ((f'<inOutVariable localId="3" negatedOut="true">{at(0)}<expression>z</expression></inOutVariable>',
          taken(5, "y", "3")), [True, True]),
        ((given(2, "x // on"), taken(5, "y", "2", more='negated="true"')), [False, False]),
    ],
)  # fmt: skip
def test_modifiers_are_heeded(tmp_path: Path, elements: tuple[str, ...], seen: list[bool]) -> None:
    main = pou("Main", network(*elements), variables("localVars", "x:BOOL:=TRUE", "y:BOOL", "z:BOOL", "s:SR"))
    with started(tmp_path, project(main, instances=CYCLE)) as plc:
        found = []
        for _ in seen:
            plc.run_cycles(1)
            found.append(plc.read("Main.y"))
    assert found == seen


def test_a_function_is_computed_once_for_all_that_read_it(tmp_path: Path) -> None:
    body = network(
        given(1, "n"),
        given(2, "1"),
        block(3, "ADD", {"IN1": "1", "IN2": "2"}),
        taken(4, "n", "3.OUT", row=10),
        taken(5, "m", "3.OUT", row=60),
    )
    assert run(tmp_path, body, ["n:INT:=4", "m:INT"]) == {"n": 5, "m": 5}


def test_functions_and_comparisons_in_each_other(tmp_path: Path) -> None:
    body = network(
        given(1, "r"),
        given(2, "10.0"),
        block(3, "GT", {"IN1": "1", "IN2": "2"}),
        block(4, "REAL_TO_INT", {"IN": "1"}),
        block(5, "SEL", {"G": "!3.OUT", "IN0": "4.OUT", "IN1": "6"}),
        given(6, "INT#-1"),
        taken(7, "n", "5.OUT"),
        taken(8, "big", "3.OUT", row=30, more='negated="true"'),
    )
    assert run(tmp_path, body, ["r:REAL:=12.0", "n:INT", "big:BOOL"]) == {"r": 12.0, "n": 12, "big": False}


def test_function_blocks_are_called_once_in_a_cycle_before_they_are_read(tmp_path: Path) -> None:
    body = ladder(
        contact(2, "go", "1"),
        block(3, "TON", {"IN": "2", "PT": "4"}, "Q ET", "TON0"),
        given(4, "T#20ms"),
        coil(5, "done", "3.Q"),
        taken(6, "elapsed", "3.ET", row=50),
        block(7, "CTU", {"CU": "8", "R": "", "PV": "9"}, "Q CV", "count", row=80),
        given(8, "done"),
        given(9, "1"),
    )
    local = ["go:BOOL:=TRUE", "done:BOOL", "elapsed:TIME", "TON0:TON", "count:CTU"]
    main = pou("Main", body, variables("localVars", *local))
    with started(tmp_path, project(main, instances=CYCLE)) as plc:
        plc.run_cycles(5)
        assert plc.read("Main.done") is True
        assert plc.read("Main.count.CV") == 1


def test_a_block_that_feeds_itself_sees_the_cycle_before(tmp_path: Path) -> None:
    own = pou(
        "Step", st("n := i + 1;"), variables("inputVars", "i:INT") + variables("outputVars", "n:INT"), "functionBlock"
    )
    body = network(block(1, "Step", {"i": "1.n"}, "n", "s"), taken(2, "m", "1.n"))
    main = pou("Main", body, variables("localVars", "s:Step", "m:INT"))
    with started(tmp_path, project(own + main, instances=CYCLE)) as plc:
        plc.run_cycles(4)
        assert plc.read("Main.m") == 4


def test_functions_of_the_project_are_called_by_their_parameters(tmp_path: Path) -> None:
    own = pou(
        "Less",
        st("Less := a - b;"),
        "<returnType><INT/></returnType>" + variables("inputVars", "a:INT", "b:INT"),
        "function",
    )
    body = network(
        given(1, "9"), given(2, "2"), block(3, "Less", {"b": "2", "a": "1"}, "Less"), taken(4, "n", "3.Less")
    )
    assert run(tmp_path, body, ["n:INT"], 1, own)["n"] == 7


def test_connectors_are_followed(tmp_path: Path) -> None:
    body = network(
        given(1, "5"),
        f'<connector name="wire" localId="2">{at(0)}{lines("1")}</connector>',
        f'<continuation name="wire" localId="3">{at(0)}</continuation>',
        taken(4, "n", "3"),
    )
    assert run(tmp_path, body, ["n:INT"])["n"] == 5


def test_a_rung_may_return(tmp_path: Path) -> None:
    body = ladder(
        contact(2, "a", "1"),
        f'<return localId="3">{at(20)}{lines("2")}</return>',
        coil(4, "b", "1", row=10),
        coil(5, "c", "1", row=30),
    )
    assert run(tmp_path, body, ["a:BOOL:=TRUE", "b:BOOL", "c:BOOL"]) == {"a": True, "b": True, "c": False}


def test_an_export_without_positions_is_executed_in_the_order_of_the_file(tmp_path: Path) -> None:
    body = (
        ladder(
            contact(2, "a", "1"),
            coil(3, "b", "2"),
            block(4, "GT", {"EN": "2", "In2": "5", "In3": "6"}, "Out1"),
            given(5, "n"),
            given(6, "3"),
            coil(7, "c", "4.Out1"),
            '<rightPowerRail localId="2147483646"><position x="0" y="0"/><connectionPointIn/></rightPowerRail>',
        )
        .replace('x="90"', 'x="0"')
        .replace('x="50"', 'x="0"')
    )
    assert run(tmp_path, body, ["a:BOOL:=TRUE", "b:BOOL", "c:BOOL", "n:INT:=4"])["c"] is True
    assert run(tmp_path, body, ["a:BOOL:=FALSE", "b:BOOL", "c:BOOL", "n:INT:=4"])["c"] is False


@pytest.mark.parametrize(
    ("elements", "why"),
    [
        ((f'<jump label="a b" localId="2">{at(0)}{lines("1")}</jump>',), "the name of a label is missing"),
        ((f'<jump label="x" storage="set" localId="2">{at(0)}{lines("1")}</jump>',), 'storage="set" has no'),
        ((coil(2, "a"),), "a part of it is connected to nothing"),
        ((coil(2, "a", "77"),), "a line comes from element 77, which does not exist"),
        ((contact(2, "a", "3"), contact(3, "a", "2"), coil(4, "a", "3")), "it has a loop without a function block"),
        ((block(2, "AND", {"IN1": "2.OUT", "IN2": "1"}), coil(4, "a", "2.OUT")), "a loop without a function block"),
        ((given(2, "a", 'storage="set"'), coil(3, "a", "2")), 'storage="set" has no translation here'),
        ((contact(2, "a", "1", more='storage="set"'), coil(3, "a", "2")), 'storage="set" has no translation here'),
        ((coil(3, "a", "1", more='edge="both"'),), 'edge="both" has no translation here'),
        (
            (f'<inOutVariable localId="2" edgeOut="falling">{at(0)}<expression>a</expression></inOutVariable>',),
            'edgeOut="falling" has no translation here',
        ),
        (
            (block(2, "SR", {"S1": "1"}, "Q1", "a").replace('"S1"', '"S1" storage="set"'),),
            'storage="set" has no translation here',
        ),
        (
            (
                given(2, "n"),
                block(3, "ABS", {"IN": "2"}, order=2),
                block(4, "ABS", {"IN": "3.OUT"}, order=1),
                taken(5, "n", "4.OUT"),
            ),
            "number 2 is needed before",
        ),
        (
            (
                contact(2, "a", "1"),
                block(3, "SR", {"EN": "2", "S1": "1"}, "ENO Q1", "b", order=2),
                block(4, "SR", {"S1": "3.ENO"}, "Q1", "c", order=1),
            ),
            "its ENO is needed before it is executed",
        ),
    ],
)
def test_what_has_no_translation_is_refused_by_name(tmp_path: Path, elements: tuple[str, ...], why: str) -> None:
    text = project(pou("Main", ladder(*elements), variables("localVars", "a:BOOL", "n:INT")))
    ((line, message),) = errors(tmp_path, text)
    assert message.startswith("the diagram Main (LD) cannot be compiled: ")
    assert why in message
    assert 1 < line <= len(text.splitlines())


def test_an_error_in_a_diagram_has_the_line_of_its_element(tmp_path: Path) -> None:
    text = project(pou("Main", ladder(contact(2, "a", "1"), coil(3, "nobody", "2")), variables("localVars", "a:BOOL")))
    ((line, message),) = errors(tmp_path, text)
    assert "nobody" in message
    assert "nobody" in text.splitlines()[line - 1]


def test_an_output_may_name_its_variable_in_the_block(tmp_path: Path) -> None:
    point = "<connectionPointOut><expression>el</expression></connectionPointOut>"
    timer = block(3, "TON", {"IN": "2", "PT": "4"}, "Q ET", "TON0").replace(
        '<variable formalParameter="ET"/>', f'<variable formalParameter="ET">{point}</variable>'
    )
    body = ladder(contact(2, "go", "1"), given(4, "T#1s"), timer, coil(5, "done", "3.Q"))
    found = run(tmp_path, body, ["go:BOOL:=TRUE", "done:BOOL", "el:TIME", "TON0:TON"], cycles=4)
    assert found["el"] not in (0, "T#0s", "T#0ms")


@pytest.mark.parametrize(("variable", "declared"), [("p.x", "p:Point"), ("r[2]", "r:Row"), ("c.CV", "c:CTU")])
def test_the_type_of_a_member_or_element_is_known(tmp_path: Path, variable: str, declared: str) -> None:
    types = """<dataType name="Point"><baseType><struct><variable name="x"><type><INT/></type></variable></struct>
</baseType></dataType>"""
    body = network(
        given(1, variable),
        given(2, "5"),
        block(3, "ADD", {"IN1": "1", "IN2": "2"}),
        taken(4, "n", "3.OUT", row=10),
        taken(5, "m", "3.OUT", row=60),
    )
    row = '<array><dimension lower="1" upper="3"/><baseType><INT/></baseType></array>'
    array = f'<localVars><variable name="r"><type>{row}</type></variable></localVars>'
    own = array if declared == "r:Row" else variables("localVars", declared)
    main = pou("Main", body, variables("localVars", "n:INT", "m:INT") + own)
    with started(tmp_path, project(main, types, CYCLE)) as plc:
        plc.run_cycles(1)
        assert (plc.read("Main.n"), plc.read("Main.m")) == (5, 5)


@pytest.mark.parametrize(
    ("kind", "given_values", "declared", "seen"),
    [
        ("ADD", ("a", "b"), ("a:INT:=1", "b:DINT:=100000", "r:DINT"), 100001),
        ("ADD", ("a", "7"), ("a:INT:=1", "r:INT"), 8),
        ("MOVE", ("-INT#5",), ("r:DINT",), -5),
        ("ADD", ("a", "16#10"), ("a:SINT:=1", "r:SINT"), 17),
        ("ADD", ("T#1s", "a"), ("a:LTIME:=LT#2s", "r:LTIME"), "LTIME#3s"),
        ("MUL", ("3", "a"), ("a:TIME:=T#2s", "r:TIME"), "T#6s"),
        ("DIV", ("a", "2.5"), ("a:REAL:=5.0", "r:REAL"), 2.0),
        ("MAX", ("a", "b"), ("a:INT:=2", "b:REAL:=3.5", "r:REAL"), 3.5),
        ("AND", ("a", "b"), ("a:BYTE:=255", "b:WORD:=4095", "r:WORD"), 255),
        ("SEL", ("TRUE", "a", "b"), ("a:UINT:=2", "b:INT:=-3", "r:DINT"), -3),
        ("ADD", ("Fast", "a"), ("a:INT:=-1", "r:DINT"), 69999),
        ("ADD", ("List.Slow", "a"), ("a:SINT:=-1", "r:INT"), 6),
        ("ADD", ("a", "5"), ("a:Percent:=98", "r:INT"), 103),
        ("SIN", ("a",), ("a:LREAL:=0", "r:LREAL"), 0.0),
        ("UINT_TO_BCD", ("a",), ("a:UINT:=12", "r:WORD"), 0x12),
        ("UINT_TO_BCD_BYTE", ("a",), ("a:UINT:=12", "r:BYTE"), 0x12),
        ("WORD_BCD_TO_UINT", ("a",), ("a:WORD:=16#12", "r:UINT"), 12),
        ("REAL_TRUNC_INT", ("a",), ("a:REAL:=1.7", "r:INT"), 1),
        ("BYTE_TO_HEXSTR", ("a", "2", "FALSE"), ("a:BYTE:=171", "r:STRING"), "AB"),
        ("CONCAT", ("a", "'b'"), ("a:STRING:='a'", "r:STRING"), "ab"),
        ("Standard.LEN", ("a",), ("a:STRING:='abc'", "r:INT"), 3),
    ],
)
def test_a_result_has_the_type_that_the_function_gives_it(
    tmp_path: Path, kind: str, given_values: tuple[str, ...], declared: tuple[str, ...], seen: object
) -> None:
    types = """<dataType name="Percent"><baseType><subrangeSigned><range lower="0" upper="100"/>
<baseType><INT/></baseType></subrangeSigned></baseType></dataType>"""
    values = [given(10 + i, text) for i, text in enumerate(given_values)]
    inputs = {f"IN{i}": str(10 + i) for i in range(len(values))}
    body = network(*values, block(3, kind, inputs), taken(4, "r", "3.OUT"), taken(5, "other", "3.OUT", row=40))
    other = declared[-1].replace("r:", "other:")
    main = pou("Main", body, variables("localVars", *declared, other))
    listed = variables("globalVars", "Fast:DINT:=70000", "Slow:INT:=7").replace(">", ' name="List">', 1)
    instances = CYCLE.replace("<resource", f"{listed}<resource", 1)
    with started(tmp_path, project(main, types, instances)) as plc:
        plc.run_cycles(1)
        assert plc.read("Main.r") == plc.read("Main.other") == seen


@pytest.mark.parametrize(
    ("kind", "inputs", "output", "more", "result", "seen"),
    [
        ("CTD_DINT", {"LD": "TRUE", "PV": "100000"}, "CV", "1", "DINT", 100001),
        ("LTON", {"IN": "TRUE", "PT": "LT#1s"}, "ET", "LT#1ms", "LTIME", "LTIME#1ms"),
        ("Standard.TON", {"IN": "TRUE", "PT": "T#1s"}, "ET", "T#1ms", "TIME", "T#1ms"),
    ],
)
def test_the_outputs_of_a_block_have_the_types_that_the_library_declares(
    tmp_path: Path, kind: str, inputs: dict[str, str], output: str, more: str, result: str, seen: object
) -> None:
    values = [given(10 + i, text) for i, text in enumerate(inputs.values())]
    body = network(
        *values,
        block(3, kind, {name: str(10 + i) for i, name in enumerate(inputs)}, output, "b"),
        given(4, more),
        block(5, "ADD", {"IN1": f"3.{output}", "IN2": "4"}),
        taken(6, "r", "5.OUT"),
        taken(7, "other", "5.OUT", row=40),
    )
    declared = f'<localVars><variable name="b"><type><derived name="{kind}"/></type></variable></localVars>'
    main = pou("Main", body, declared + variables("localVars", f"r:{result}", f"other:{result}"))
    with started(tmp_path, project(main, instances=CYCLE)) as plc:
        plc.run_cycles(1)
        assert plc.read("Main.r") == plc.read("Main.other") == seen


def sum_of(first: str, second: str) -> str:
    """A program in which two outputs take a sum."""
    body = network(
        given(1, first),
        given(2, second),
        block(3, "ADD", {"IN1": "1", "IN2": "2"}),
        taken(4, "n", "3.OUT"),
        taken(5, "n", "3.OUT", row=40),
    )
    return project(pou("Main", body, variables("localVars", "n:INT")), instances=CYCLE)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (("n", "gone"), "unknown name gone"),
        (("n.y", "1"), "INT has no members"),
        (("n", "T#1s"), "cannot combine INT and TIME"),
    ],
)
def test_what_has_no_type_is_an_error_as_it_is_in_text(tmp_path: Path, values: tuple[str, str], said: str) -> None:
    messages = [message for _, message in errors(tmp_path, sum_of(*values))]
    assert len(messages) == 1
    assert said in messages[0]


def test_numbers_alone_have_the_type_that_they_have_in_text(tmp_path: Path) -> None:
    with started(tmp_path, sum_of("5", "7")) as plc:
        plc.run_cycles(1)
        assert plc.read("Main.n") == 12


def test_a_function_of_the_library_is_called_though_nothing_reads_its_result(tmp_path: Path) -> None:
    body = network(
        given(1, "ADR(n)"), given(2, "1"), given(3, "2"),
        block(4, "MEMSET", {"destAddr": "1", "fillByte": "2", "n": "3"}),
    )  # fmt: skip
    assert run(tmp_path, body, ["n:INT"]) == {"n": 0x0101}


def execute(number: int, text: str, enable: str = "", row: int = 0, uri: str = "3s-software.com/plcopenxml") -> str:
    """A box of Structured Text."""
    read = f'<variable formalParameter="EN">{lines(enable)}</variable>' if enable else ""
    code = f'<addData><data name="http://www.{uri}/stcode"><STCode>{text}</STCode></data></addData>'
    return (
        f'<block localId="{number}" typeName="EXECUTE">{at(row, 50)}<inputVariables>{read}</inputVariables>'
        f'<outputVariables><variable formalParameter="ENO"/></outputVariables>{code}</block>\n'
    )


@pytest.mark.parametrize("uri", ["3s-software.com/plcopenxml", "openplc.org/plcopenxml"])
@pytest.mark.parametrize(("enabled", "seen"), [("TRUE", (2, True)), ("FALSE", (0, False))])
def test_a_box_of_structured_text_runs_while_its_input_is_true(
    tmp_path: Path, uri: str, enabled: str, seen: tuple[int, bool]
) -> None:
    box = execute(3, "IF NOT z THEN n := n + 1; END_IF; // counts", "2", uri=uri)
    body = ladder(contact(2, "a", "1"), box, coil(4, "b", "3.ENO", row=10))
    local = [f"a:BOOL:={enabled}", "b:BOOL", "z:BOOL", "n:INT"]
    values = run(tmp_path, body, local, cycles=2)
    assert (values["n"], values["b"]) == seen


def test_a_box_of_structured_text_runs_though_nothing_is_connected_to_it(tmp_path: Path) -> None:
    assert run(tmp_path, network(execute(2, "n := n + 1;")), ["n:INT"], cycles=3)["n"] == 3


def test_an_error_in_a_box_of_structured_text_has_its_place(tmp_path: Path) -> None:
    text = project(pou("Main", network(execute(2, "\nn := n + 'a';")), variables("localVars", "n:INT")))
    ((line, _),) = errors(tmp_path, text)
    assert "n := n + 'a'" in text.splitlines()[line - 1]


def _diagram(tmp_path: Path, *elements: str, types: str = "", declared: str = "v:Vendor_Type") -> list[str]:
    body = network(*elements)
    text = project(pou("Main", body, variables("localVars", "n:INT", declared)), types)
    return [message for _, message in errors(tmp_path, text)]


TWICE = (taken(8, "n", "3.OUT"), taken(9, "n", "3.OUT", row=40))


def test_a_diagram_with_a_variable_of_an_unknown_type_is_no_second_error(tmp_path: Path) -> None:
    elements = (given(1, "v.speed"), given(2, "n"), block(3, "SUB", {"IN1": "1", "IN2": "2"}), *TWICE)
    assert _diagram(tmp_path, *elements) == ["unknown type Vendor_Type"]


def test_an_unknown_function_in_a_diagram_is_named(tmp_path: Path) -> None:
    elements = (given(1, "n"), block(3, "VendorScale", {"x": "1"}), *TWICE)
    assert _diagram(tmp_path, *elements, declared="v:INT") == ["unknown function VendorScale"]


def test_a_diagram_takes_types_from_another_file(tmp_path: Path) -> None:
    elements = (given(1, "v.speed"), given(2, "n"), block(3, "SUB", {"IN1": "1", "IN2": "2"}), *TWICE)
    body = network(*elements)
    xml = written(tmp_path, project(pou("Main", body, variables("localVars", "n:INT", "v:Vendor_Type"))))
    other = tmp_path / "other.st"
    other.write_text("TYPE Vendor_Type : STRUCT speed : INT; END_STRUCT END_TYPE\n")
    checked = check_sources(load_sources([xml, other]))
    assert checked.program is not None, checked.diagnostics
    assert [str(t) for t in checked.program.inferred.values()] == ["INT"]
