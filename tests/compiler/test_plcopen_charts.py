"""PLCopen XML: charts become steps, transitions and actions."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest
from plcopen_support import data, errors, pou, project, st, started, variables

CYCLE = """<configuration name="c"><resource name="r"><task name="t" priority="1" interval="T#10ms">
<pouInstance name="Main" typeName="Main"/></task></resource></configuration>"""


def into(*sources: str) -> str:
    """What is above, by local id."""
    connections = [f'<connection refLocalId="{s}"/>' for s in sources]
    return f"<connectionPointIn>{''.join(connections)}</connectionPointIn>"


def step(number: int, name: str, *sources: str, initial: bool = False, more: str = "") -> str:
    """A step."""
    first = ' initialStep="true"' if initial else ""
    return f'<step localId="{number}" name="{name}"{first}>{into(*sources)}{more}</step>\n'


def transition(number: int, source: str, condition: str, column: int = 0, more: str = "") -> str:
    """A transition with a condition in Structured Text."""
    inline = f'<condition {more}><inline name="">{st(condition)}</inline></condition>'
    return f'<transition localId="{number}"><position x="{column}" y="0"/>{into(source)}{inline}</transition>\n'


def jump(number: int, source: str, target: str) -> str:
    """A jump to a step."""
    return f'<jumpStep localId="{number}" targetName="{target}">{into(source)}</jumpStep>\n'


def actions(number: int, source: str, *listed: str) -> str:
    """A block of actions."""
    return f'<actionBlock localId="{number}">{into(source)}{"".join(listed)}</actionBlock>\n'


def action(name: str, qualifier: str = "N", more: str = "") -> str:
    """An action by its name."""
    return f'<action qualifier="{qualifier}" {more}><reference name="{name}"/></action>'


MAIN, ENTRY, EXIT = (
    "700a583f-b4d4-43e4-8c14-629c7cd3bec8", "A6B08BD8-b696-47e3-9cbf-7408b61c9ff8",
    "a2621e18-7de3-4ea6-ae6d-89e9e0b7befd",
)  # fmt: skip


def attributes(*found: tuple[str, str]) -> str:
    """What CODESYS adds to a step: identifiers and values."""
    listed = "".join(f'<attribute guid="{identifier}">{value}</attribute>' for identifier, value in found)
    return f"<addData>{data('sfc/element', f'<attributes>{listed}</attributes>')}</addData>"


def branch(kind: str, number: int, *sources: str) -> str:
    """A divergence or convergence."""
    return f'<{kind} localId="{number}">{into(*sources)}</{kind}>\n'


def chart(*elements: str, more: str = "", local: tuple[str, ...] = ("n:INT", "a:BOOL", "b:BOOL")) -> str:
    """A project with a chart."""
    body = f"<SFC>\n{''.join(elements)}</SFC>"
    return project(pou("Main", body, variables("localVars", *local), more=more), instances=CYCLE)


LOOP = (
    step(1, "Start", initial=True),
    transition(2, "1", "n >= 2"),
    step(3, "Busy", "2"),
    actions(4, "3", action("a"), action("Count")),
    transition(5, "3", ":= n > 4;"),
    jump(6, "5", "Start"),
    actions(7, "1", '<action qualifier="N"><inline name="">' + st("n := n + 1;") + "</inline></action>"),
)
COUNT = f'<actions><action name="Count"><body>{st("n := n + 1;")}</body></action></actions>'


def test_a_chart_goes_round(tmp_path: Path) -> None:
    seen = []
    with started(tmp_path, chart(*LOOP, more=COUNT)) as plc:
        for _ in range(20):
            plc.run_cycles(1)
            seen.append((plc.read("Main.Busy.X"), plc.read("Main.a")))
    changes = [b for a, b in pairwise(seen) if a != b]
    assert changes[:3] == [(True, True), (False, False), (True, True)]


def test_branches_are_looked_at_from_left_to_right(tmp_path: Path) -> None:
    elements = (
        step(1, "Start", initial=True),
        branch("selectionDivergence", 2, "1"),
        transition(3, "2", "TRUE", column=200),
        transition(4, "2", "TRUE", column=100),
        step(5, "Right", "3"),
        step(6, "Left", "4"),
        transition(7, "5", "FALSE"),
        transition(8, "6", "FALSE"),
        branch("selectionConvergence", 9, "7", "8"),
        jump(10, "9", "Start"),
    )
    with started(tmp_path, chart(*elements)) as plc:
        plc.run_cycles(3)
        assert plc.read("Main.Left.X") is True
        assert plc.read("Main.Right.X") is False


def test_simultaneous_branches_wait_for_each_other(tmp_path: Path) -> None:
    elements = (
        step(1, "Start", initial=True),
        transition(2, "1", "TRUE"),
        branch("simultaneousDivergence", 3, "2"),
        step(4, "One", "3"),
        step(5, "Two", "3"),
        transition(6, "5", "TRUE"),
        step(7, "Three", "6"),
        branch("simultaneousConvergence", 8, "4", "7"),
        transition(9, "8", "n > 0"),
        step(10, "End", "9"),
        transition(11, "10", "FALSE"),
        jump(12, "11", "Start"),
    )
    with started(tmp_path, chart(*elements)) as plc:
        plc.run_cycles(6)
        assert [plc.read(f"Main.{s}.X") for s in ("One", "Two", "Three", "End")] == [True, False, True, False]
        plc.write({"Main.n": 1})
        plc.run_cycles(2)
        assert [plc.read(f"Main.{s}.X") for s in ("One", "Three", "End")] == [False, False, True]


def test_blocks_beside_a_chart_run_in_every_cycle(tmp_path: Path) -> None:
    timer = (
        '<block localId="20" typeName="TON" instanceName="timer"><position x="9" y="9"/><inputVariables>'
        f'<variable formalParameter="IN">{into("21")}</variable><variable formalParameter="PT">{into("22")}</variable>'
        '</inputVariables><outputVariables><variable formalParameter="Q"/></outputVariables></block>\n'
        '<inVariable localId="21"><expression>Start.X</expression></inVariable>\n'
        '<inVariable localId="22"><expression>T#30ms</expression></inVariable>\n'
    )
    point = '<connectionPointIn><connection refLocalId="20" formalParameter="Q"/></connectionPointIn>'
    wired = f'<transition localId="2">{into("1")}<condition>{point}</condition></transition>\n'
    elements = (
        step(1, "Start", initial=True), wired, step(3, "End", "2"), transition(4, "3", "FALSE"), jump(5, "4", "Start"),
        timer,
    )  # fmt: skip
    with started(tmp_path, chart(*elements, local=("timer:TON",))) as plc:
        plc.run_cycles(3)
        assert plc.read("Main.Start.X") is True
        plc.run_cycles(4)
        assert plc.read("Main.End.X") is True


def test_a_condition_may_be_a_named_transition_or_a_variable(tmp_path: Path) -> None:
    named = '<transition localId="2">' + into("1") + '<condition><reference name="Go"/></condition></transition>\n'
    variable = '<transition localId="4">' + into("3") + '<condition><reference name="a"/></condition></transition>\n'
    elements = (step(1, "Start", initial=True), named, step(3, "Busy", "2"), variable, jump(5, "4", "Start"))
    go = f'<transitions><transition name="Go"><body>{st("n = 0")}</body></transition></transitions>'
    with started(tmp_path, chart(*elements, more=go)) as plc:
        plc.run_cycles(3)
        assert plc.read("Main.Busy.X") is True
        plc.write({"Main.n": 1})
        plc.write({"Main.a": True})
        plc.run_cycles(3)
        assert plc.read("Main.Start.X") is True


RAIL = '<leftPowerRail localId="1"/>'


def contact(number: int, name: str, source: str, more: str = "") -> str:
    """A contact of a drawn condition."""
    return f'<contact localId="{number}" {more}>{into(source)}<variable>{name}</variable></contact>'


def coil(number: int, name: str, *sources: str, more: str = "") -> str:
    """A coil of a drawn condition."""
    return f'<coil localId="{number}" {more}>{into(*sources)}<variable>{name}</variable></coil>'


GREATER = (
    '<block localId="3" typeName="GT"><inputVariables>'
    f'<variable formalParameter="IN1">{into("1")}</variable><variable formalParameter="IN2">{into("2")}</variable>'
    '</inputVariables><outputVariables><variable formalParameter="OUT"/></outputVariables></block>'
    '<inVariable localId="1"><expression>n</expression></inVariable>'
    '<inVariable localId="2"><expression>1</expression></inVariable>'
)  # fmt: skip
OUTPUT = (
    '<outVariable localId="4"><connectionPointIn><connection refLocalId="3" formalParameter="OUT"/></connectionPointIn>'
    "<expression>Go</expression></outVariable>"
)


def drawn_condition(body: str) -> str:
    """A chart that counts in its first step and goes on when the transition Go holds."""
    named = '<transition localId="2">' + into("1") + '<condition><reference name="Go"/></condition></transition>\n'
    elements = (
        step(1, "Start", initial=True), named, step(3, "Busy", "2"), actions(6, "1", action("Count")),
        transition(4, "3", "FALSE"), jump(5, "4", "Start"),
    )  # fmt: skip
    go = f'<transition name="Go"><body>{body}</body></transition>'
    return chart(*elements, more=f"{COUNT}<transitions>{go}</transitions>")


@pytest.mark.parametrize(
    ("body", "cycles"),
    [
        (f"<FBD>{GREATER}{OUTPUT}</FBD>", 3),
        (f"<LD>{RAIL}{contact(2, 'Start.X', '1')}{coil(3, 'go', '2')}</LD>", 2),
        (f"<LD>{RAIL}{contact(2, 'a', '1', 'negated=' + chr(34) + 'true' + chr(34))}{coil(3, 'Go', '2')}</LD>", 2),
        (f"<LD>{RAIL}{contact(2, 'a', '1')}{contact(4, 'b', '1')}{coil(3, 'Go', '2', '4')}</LD>", None),
    ],
)
def test_a_condition_may_be_drawn(tmp_path: Path, body: str, cycles: int | None) -> None:
    with started(tmp_path, drawn_condition(body)) as plc:
        seen = []
        for _ in range(4):
            plc.run_cycles(1)
            seen.append(plc.read("Main.Busy.X"))
    assert (seen.index(True) + 1 if True in seen else None) == cycles


@pytest.mark.parametrize(
    ("body", "why"),
    [
        (f"<LD>{RAIL}{coil(3, 'Go', '1', more='storage=' + chr(34) + 'set' + chr(34))}</LD>", "cannot be set or reset"),
        (
            f"<LD>{RAIL}{contact(2, 'a', '1', 'edge=' + chr(34) + 'rising' + chr(34))}{coil(3, 'Go', '2')}</LD>",
            "its condition has an edge; compute it before, in a variable",
        ),
        (f"<LD>{RAIL}{coil(3, 'x', '1')}{coil(4, 'y', '1')}</LD>", "no coil or output variable says what Go is"),
        ("<IL>LD a</IL>", "a condition is written in a language other than ST, LD and FBD"),
    ],
)
def test_a_drawn_condition_that_is_no_expression_is_refused(tmp_path: Path, body: str, why: str) -> None:
    assert why in errors(tmp_path, drawn_condition(body))[0][1]


@pytest.mark.parametrize("more", ["", 'negated="true"'])
@pytest.mark.parametrize("condition", ["{} // go", "{}; // go", "// go\n:= {}; (* go *)", "(* ; *) {}"])
def test_a_condition_may_have_comments(tmp_path: Path, condition: str, more: str) -> None:
    wired = transition(2, "1", condition.format("n > 3 AND a" if more else "n < 3 OR a"), more=more)
    elements = (step(1, "Start", initial=True), wired, step(3, "End", "2"), transition(4, "3", "FALSE"))
    with started(tmp_path, chart(*elements, jump(5, "4", "Start"))) as plc:
        plc.run_cycles(3)
        assert plc.read("Main.End.X") is True


@pytest.mark.parametrize("condition", ["", ":=", ";", "// go"])
def test_a_comment_is_no_condition(tmp_path: Path, condition: str) -> None:
    elements = (step(1, "Start", initial=True), transition(2, "1", condition), jump(3, "2", "Start"))
    ((_, message),) = errors(tmp_path, chart(*elements))
    assert message.endswith("a transition has no condition")


def test_an_action_may_have_a_qualifier_with_a_time(tmp_path: Path) -> None:
    elements = (*LOOP[:3], actions(4, "3", action("b", "L", 'duration="T#20ms"')), *LOOP[4:])
    with started(tmp_path, chart(*elements[:4], transition(5, "3", "FALSE"), *elements[5:])) as plc:
        seen = []
        for _ in range(10):
            plc.run_cycles(1)
            seen.append(plc.read("Main.b"))
        assert seen == [False] * 2 + [True] * 2 + [False] * 6
        assert plc.read("Main.Busy.X") is True


@pytest.mark.parametrize(
    ("extra", "why"),
    [
        ('<macroStep localId="9" name="m"/>', "it has a macro step"),
        (transition(9, "77", "TRUE"), "a transition has no step before or after it"),
        ('<transition localId="9">' + into("1") + "</transition>", "a transition has no condition"),
        (
            step(9, "CS", "5", more=attributes(("11111111-1111-1111-1111-111111111111", "Count"))),
            "the step CS has an action of CODESYS, Count; use an action block",
        ),
    ],
)  # fmt: skip
def test_what_has_no_translation_is_refused_by_name(tmp_path: Path, extra: str, why: str) -> None:
    found = errors(tmp_path, chart(*LOOP, extra, more=COUNT))
    assert found[0][1] == f"the diagram Main (SFC) cannot be compiled: {why}"


def named_action(name: str, text: str) -> str:
    """An action of a POU."""
    return f'<action name="{name}"><body>{st(text)}</body></action>'


STEP_ACTIONS = (
    "<actions>" + named_action("Enter", "entered := entered + 1; log := log * 10 + 1;")
    + named_action("Work", "worked := worked + 1; log := log * 10 + 2;")
    + named_action("Leave", "left := left + 1; log := log * 10 + 3;")
    + named_action("Next", "log := log * 10 + 4;") + "</actions>"
)  # fmt: skip


def test_actions_of_steps_run_on_entry_while_active_and_on_exit_without_a_final_scan(tmp_path: Path) -> None:
    own = attributes((ENTRY, "Enter"), (MAIN, "Work"), (EXIT, "Leave"))
    elements = (
        step(1, "Start", initial=True, more=own),
        transition(2, "1", "worked >= 3"),
        step(3, "Busy", "2", more=attributes((MAIN, "Next"), (EXIT, ""), (ENTRY, ""))),
        transition(4, "3", "FALSE"),
        jump(5, "4", "Start"),
    )
    local = ("entered:INT", "worked:INT", "left:INT", "log:DINT")
    with started(tmp_path, chart(*elements, more=STEP_ACTIONS, local=local)) as plc:
        plc.run_cycles(1)
        assert plc.read("Main.log") == 12
        plc.run_cycles(4)
        assert plc.read("Main.log") == 1222344
        assert [plc.read(f"Main.{name}") for name in ("entered", "worked", "left")] == [1, 3, 1]


def test_several_steps_may_have_the_same_action(tmp_path: Path) -> None:
    elements = (
        step(1, "Start", initial=True, more=attributes((MAIN, "Next"))),
        transition(2, "1", "TRUE"),
        step(3, "Busy", "2", more=attributes((MAIN, "Next"), (ENTRY, "Enter"))),
        transition(4, "3", "TRUE"),
        jump(5, "4", "Start"),
    )
    local = ("entered:INT", "worked:INT", "left:INT", "log:DINT")
    with started(tmp_path, chart(*elements, more=STEP_ACTIONS, local=local)) as plc:
        plc.run_cycles(4)
        assert plc.read("Main.log") == 414414


def test_actions_of_steps_in_the_chart_of_an_action_are_refused(tmp_path: Path) -> None:
    inner = f"<SFC>{step(1, 'Start', initial=True, more=attributes((MAIN, 'Next')))}</SFC>"
    more = f'<actions><action name="Next"><body>{st("n := 1;")}</body></action>'
    more += f'<action name="Inner"><body>{inner}</body></action></actions>'
    found = errors(tmp_path, project(pou("Main", st("Inner();"), variables("localVars", "n:INT"), more=more)))
    assert "Main.Inner cannot be compiled: its chart needs the action Start_main_action; move" in found[0][1]


def test_an_action_of_an_instance_runs_in_an_action_block(tmp_path: Path) -> None:
    motor = pou("Motor", st("calls := calls + 1;"), variables("outputVars", "calls:INT", "stops:INT"), "functionBlock",
                f"<actions>{named_action('Stop', 'stops := stops + 1;')}</actions>")  # fmt: skip
    elements = (
        step(1, "Start", initial=True), transition(2, "1", "TRUE"), step(3, "Busy", "2"),
        actions(4, "3", action("m.Stop", "D", 'duration="T#25ms"')), transition(5, "3", "m.stops >= 2"),
        jump(6, "5", "Start"),
    )  # fmt: skip
    text = chart(*elements, local=("m:Motor",)).replace("<pous>", f"<pous>{motor}")
    with started(tmp_path, text) as plc:
        plc.run_cycles(4)
        assert plc.read("Main.m.stops") == 0
        plc.run_cycles(2)
        assert plc.read("Main.m.stops") == 2
        assert plc.read("Main.m.calls") == 0


def test_an_error_in_a_condition_has_its_place(tmp_path: Path) -> None:
    text = chart(*LOOP, more=COUNT).replace("n &gt; 4", "nn &gt; 4")
    ((line, message),) = errors(tmp_path, text)
    assert "nn" in message
    assert "nn &gt; 4" in text.splitlines()[line - 1]
