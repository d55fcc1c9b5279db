"""CONFIGURATION, tasks and program instances; and what holds without one."""

from __future__ import annotations

import pytest
from front_support import messages, program, variable

from plctool.compiler.typed.nodes import Assign, Task, TaskKind, VarPlace
from plctool.iec.areas import Area

PROGRAMS = """PROGRAM P
VAR_INPUT a : INT; END_VAR
VAR_OUTPUT o : INT; END_VAR
VAR n : INT; END_VAR
n := n + 1; o := a * 2;
END_PROGRAM
"""


def configuration(items: str, before: str = "") -> str:
    """A configuration with one resource; its items start in line 1 of the text, column 48, after the programs."""
    return f"{before}CONFIGURATION c RESOURCE r ON PLC\n{items}\nEND_RESOURCE END_CONFIGURATION\n{PROGRAMS}"


def tasks(items: str) -> list[Task]:
    return program(configuration(items)).tasks


def test_without_configuration_the_only_program_runs_every_10_ms() -> None:
    p = program("PROGRAM Blink VAR x : BOOL; END_VAR x := NOT x; END_PROGRAM")
    (task,) = p.tasks
    assert (task.name, task.kind, task.interval_us, [x.name for x in task.programs]) == (
        "Main",
        TaskKind.CYCLIC,
        10_000,
        ["Blink"],
    )
    assert list(p.programs) == ["Blink"]


def test_without_configuration_plc_prg_is_chosen() -> None:
    p = program("PROGRAM Other END_PROGRAM PROGRAM Plc_Prg END_PROGRAM")
    assert list(p.programs) == ["Plc_Prg"]


def test_without_configuration_several_programs_are_an_error() -> None:
    assert messages("PROGRAM A END_PROGRAM PROGRAM B END_PROGRAM") == [
        "1:31: several programs: name one PLC_PRG, or write a CONFIGURATION that says what runs"
    ]


def test_task_takes_a_watchdog_time_and_its_sensitivity() -> None:
    guarded, plain = tasks(
        "TASK a(INTERVAL := T#10ms, WATCHDOG := T#5ms, SENSITIVITY := 3); TASK b(INTERVAL := T#10ms);"
    )
    assert (guarded.watchdog_us, guarded.watchdog_sensitivity) == (5_000, 3)
    assert (plain.watchdog_us, plain.watchdog_sensitivity) == (0, 1)


def test_nothing_to_run_is_a_warning() -> None:
    text = "FUNCTION_BLOCK F END_FUNCTION_BLOCK"
    assert messages(text, "warning") == ["1:1: there is no PROGRAM, so nothing would run"]


def test_program_without_instance_is_checked_but_takes_no_memory() -> None:
    text = configuration("PROGRAM one : P;") + "PROGRAM Q VAR x : INT; END_VAR x := 1; END_PROGRAM"
    assert program(text).area_sizes[Area.DATA] == 6
    assert len(messages(configuration("PROGRAM one : P;") + "PROGRAM Q x := 1; END_PROGRAM")) == 1


def test_task_has_interval_and_priority() -> None:
    (task,) = tasks("TASK t(INTERVAL := T#5ms, PRIORITY := 3); PROGRAM one WITH t : P;")
    assert (task.name, task.kind, task.interval_us, task.priority) == ("t", TaskKind.CYCLIC, 5000, 3)


def test_interval_may_be_finer_than_a_millisecond() -> None:
    assert tasks("TASK t(INTERVAL := LTIME#250us); PROGRAM one WITH t : P;")[0].interval_us == 250


def test_task_with_single_waits_for_its_event() -> None:
    before = "VAR_GLOBAL go : BOOL; END_VAR "
    (task,) = program(configuration("TASK t(SINGLE := go, PRIORITY := 1); PROGRAM one WITH t : P;", before)).tasks
    assert task.kind is TaskKind.EVENT
    assert task.event is not None
    assert (task.event.variable.name, task.event.offset, task.event.bit) == ("go", 0, None)


@pytest.mark.parametrize(
    ("single", "area", "offset", "bit"),
    [
        ("%IX0.3", Area.INPUT, 0, 3),
        ("%QX5.7", Area.OUTPUT, 5, 7),
        ("door", Area.INPUT, 2, 1),
        ("word.11", Area.MEMORY, 9, 3),
        ("list.second", Area.DATA, 3, None),
        ("list.bits.9", Area.DATA, 1, 1),
    ],
)
def test_task_may_wait_for_a_bit_or_a_member(single: str, area: Area, offset: int, bit: int | None) -> None:
    before = (
        "TYPE pair : STRUCT bits : WORD; first, second : BOOL; END_STRUCT END_TYPE "
        "VAR_GLOBAL list : pair; door AT %IX2.1 : BOOL; word AT %MW4 : WORD; END_VAR "
    )
    (task,) = program(configuration(f"TASK t(SINGLE := {single}); PROGRAM one WITH t : P;", before)).tasks
    assert task.kind is TaskKind.EVENT
    assert task.event is not None
    variable = task.event.variable
    assert (variable.area, variable.offset + task.event.offset, task.event.bit) == (area, offset, bit)


def test_task_waits_for_an_external_event_by_name() -> None:
    (task,) = tasks("TASK t(EVENT := 'door', PRIORITY := 1); PROGRAM one WITH t : P;")
    assert (task.kind, task.external) == (TaskKind.EXTERNAL, "door")


def test_program_without_task_runs_in_the_background() -> None:
    found = tasks("TASK t(INTERVAL := T#1ms); PROGRAM one WITH t : P; PROGRAM two : P; PROGRAM three : P;")
    assert [(t.kind, [p.name for p in t.programs]) for t in found] == [
        (TaskKind.CYCLIC, ["one"]),
        (TaskKind.FREEWHEELING, ["two", "three"]),
    ]


def test_instances_of_one_program_have_their_own_variables() -> None:
    p = program(configuration("TASK t(INTERVAL := T#1ms); PROGRAM one WITH t : P; PROGRAM two WITH t : P;"))
    assert [v.name for v in p.globals] == ["one.a", "one.o", "one.n", "two.a", "two.o", "two.n"]
    assert len({v.offset for v in p.globals}) == 6


def test_program_instance_may_be_retained() -> None:
    p = program(configuration("PROGRAM RETAIN one : P;"))
    assert variable(p, "one.n").area is Area.RETAIN


def test_connected_inputs_and_outputs_are_assigned_around_the_program() -> None:
    before = "VAR_GLOBAL x : INT; y : DINT; END_VAR "
    (task,) = program(configuration("TASK t(INTERVAL := T#1ms); PROGRAM one WITH t : P(a := x, o => y);", before)).tasks
    assert [p.name for p in task.programs] == ["one.inputs", "one", "one.outputs"]
    (before_it,), (behind_it,) = task.programs[0].body, task.programs[2].body
    assert isinstance(before_it, Assign)
    assert isinstance(before_it.target, VarPlace)
    assert before_it.target.var.name == "one.a"
    assert isinstance(behind_it, Assign)
    assert isinstance(behind_it.target, VarPlace)
    assert behind_it.target.var.name == "y"


def test_variables_of_another_program_are_reached_by_its_instance() -> None:
    text = configuration("TASK t(INTERVAL := T#1ms); PROGRAM one WITH t : P; PROGRAM two WITH t : Q;")
    q = "PROGRAM Q VAR x : INT; END_VAR x := one.o; one.a := x; {0} END_PROGRAM"
    program(text + q.format(""))
    assert "output of one" in messages(text + q.format("one.o := 1;"))[0]
    assert "program one has no k" in messages(text + q.format("x := one.k;"))[0]


def test_globals_of_a_configuration_are_known_everywhere() -> None:
    text = (
        "CONFIGURATION c VAR_GLOBAL g : INT; END_VAR RESOURCE r ON PLC PROGRAM one : Q; END_RESOURCE\n"
        "END_CONFIGURATION\n"
    )
    assert [v.name for v in program(text + "PROGRAM Q g := 1; END_PROGRAM").globals] == ["g"]


@pytest.mark.parametrize(
    ("items", "message"),
    [
        ("PROGRAM one WITH tt : P;", "2:18: there is no task tt"),
        ("PROGRAM one : PP;", "2:15: there is no program PP"),
        ("PROGRAM one : P; PROGRAM one : P;", "2:26: there is a program instance one already"),
        ("TASK t(INTERVAL := T#1s); TASK T(INTERVAL := T#1s);", "2:32: there is a task T already"),
        ("TASK t(INTERVAL := 5);", "2:20: INTERVAL is a duration such as T#10ms, not integer constant"),
        ("TASK t(INTERVAL := T#-1s);", "2:20: INTERVAL must be between 0 and 35 minutes"),
        ("TASK t(PRIORITY := 65536);", "2:20: PRIORITY is 0 (highest) to 31, not 65536"),
        ("TASK t(SINGLE := 5);", "2:18: SINGLE is a global BOOL variable or a bit such as %IX0.3"),
        ("TASK t(SINGLE := TRUE);", "2:18: SINGLE is a global BOOL variable or a bit such as %IX0.3"),
        ("TASK t(SINGLE := NOT %IX0.1);", "2:18: SINGLE is a global BOOL variable or a bit such as %IX0.3"),
        ("TASK t(SINGLE := %IW0);", "2:18: SINGLE is a global BOOL variable or a bit such as %IX0.3"),
        ("TASK t(EVENT := 5);", "2:17: EVENT is the name of an external event such as 'door', not integer constant"),
        ("TASK t(EVENT := '');", "2:17: the name of an EVENT has 1 to 63 ASCII characters"),
        ("TASK t(EVENT := 'a$Nb');", "2:17: the name of an EVENT has 1 to 63 ASCII characters"),
        (
            "TASK t(INTERVAL := T#1s, SINGLE := %IX0.1);",
            "2:36: a TASK runs by INTERVAL or by SINGLE, not by both: write another task",
        ),
        (
            "TASK t(SINGLE := %IX0.1, EVENT := 'door');",
            "2:35: a TASK runs by SINGLE or by EVENT, not by both: write another task",
        ),
        (
            "TASK t(SPEED := 5);",
            "2:8: a TASK has INTERVAL, PRIORITY, SINGLE, LEVEL, EVENT, WATCHDOG and SENSITIVITY, not SPEED",
        ),
        ("TASK t(WATCHDOG := 5);", "2:20: WATCHDOG is a duration such as T#10ms, not integer constant"),
        ("TASK t(WATCHDOG := T#2h);", "2:20: WATCHDOG must be between 0 and 35 minutes"),
        ("TASK t(WATCHDOG := T#1s, SENSITIVITY := 0);", "2:41: SENSITIVITY is 1 to 65535, not 0"),
        (
            "TASK t(SENSITIVITY := 2);",
            "2:8: SENSITIVITY says how often in a row a cycle may be longer than WATCHDOG, which is missing",
        ),
        ("PROGRAM one : P(x := 5);", "2:17: one has no parameter x; it has a, o"),
        ("PROGRAM one : P(a := TRUE);", "2:22: BOOL does not fit INT; write BOOL_TO_INT(...)"),
        ("PROGRAM one : P(o => 5);", "2:22: the output o needs a variable"),
    ],
)
def test_wrong_configuration_is_explained(items: str, message: str) -> None:
    assert messages(configuration(items)) == [message]


def test_a_lower_priority_than_there_is_becomes_the_lowest_with_a_warning() -> None:
    text = configuration("TASK t(INTERVAL := T#10ms, PRIORITY := 100);\nPROGRAM p WITH t : P;")
    assert [task.priority for task in program(text).tasks] == [31]
    found = messages(text, severity="warning")
    assert found == ["2:40: PRIORITY is 0 (highest) to 31, not 100; 31 is taken"]
