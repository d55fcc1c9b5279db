"""Tasks that wait for events: they run at their priority, once for each rise."""

from __future__ import annotations

from plctool.testing.waiting import eventually

EDGES = 400

# The slow task takes longer than the interval of the fast one, whose changes therefore come within its cycles.
PROGRAM = f"""
VAR_GLOBAL
    go, toggle : BOOL;
    edges : DINT;
    within : DINT; (* runs of the event task while the slow one was in its cycle *)
    begun, finished : DINT; (* cycles of the slow task *)
END_VAR
PROGRAM Source
IF go AND edges < {EDGES} THEN
    %QX0.5 := NOT %QX0.5;
    IF %QX0.5 THEN edges := edges + 1; END_IF
END_IF
END_PROGRAM
PROGRAM Answer
VAR
    n : DINT;
END_VAR
n := n + 1;
IF begun <> finished THEN within := within + 1; END_IF
END_PROGRAM
PROGRAM Long
VAR
    i, x : DINT;
END_VAR
begun := begun + 1;
FOR i := 1 TO 1_000_000 DO
    x := x XOR (x * 5 + i);
END_FOR
finished := finished + 1;
END_PROGRAM
CONFIGURATION Config
    RESOURCE Res ON PLC
        TASK Fast(INTERVAL := T#1ms, PRIORITY := 1);
        TASK OnEdge(SINGLE := %QX0.5, PRIORITY := {{priority}});
        TASK Slow(INTERVAL := T#100ms, PRIORITY := 9);
        PROGRAM Main WITH Fast : Source;
        PROGRAM OnEdge1 WITH OnEdge : Answer;
        PROGRAM Long1 WITH Slow : Long;
    END_RESOURCE
END_CONFIGURATION
"""


def run(plc, build, priority: int) -> int:
    """Lets all edges happen; how many were answered while the slow task was in its cycle."""
    plc.flash(build(PROGRAM.format(priority=priority)).path)
    plc.write({"go": True})
    eventually(lambda: plc.read("edges") == EDGES)
    eventually(lambda: plc.read("OnEdge1.n") >= EDGES)
    task = plc.tasks()[1]
    assert (task.name, task.cycles, task.overruns) == ("OnEdge", EDGES, 0)
    return int(plc.read("within"))


def test_event_task_above_a_slow_one_interrupts_it(plc, build):
    assert run(plc, build, 0) > 0


def test_event_task_below_a_slow_one_answers_all_events_after_it(plc, build):
    assert run(plc, build, 12) == 0


def test_freewheeling_task_of_the_main_loop_leaves_it_to_communication(plc, build):
    text = """
PROGRAM Main
VAR
    n : DINT;
END_VAR
n := n + 1;
END_PROGRAM
CONFIGURATION Config
    TASK Free(PRIORITY := 3);
    PROGRAM Main WITH Free : Main;
END_CONFIGURATION
"""
    plc.flash(build(text).path)
    before = eventually(lambda: plc.read("Main.n"))
    eventually(lambda: plc.read("Main.n") > before + 10)
