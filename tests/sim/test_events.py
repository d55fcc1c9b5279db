"""Tasks that wait for events, on the virtual clock: each rise between the ends of two cycles is a run."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from shares import examples

from plctool.compiler import compile_sources
from plctool.compiler.image.build import BuildResult
from plctool.core import lib
from plctool.errors import DeviceError
from plctool.image.file import parse_image
from plctool.sim import Simulator

LENGTH = 40
MAX_WAITING = 100  # SCHED_MAX_WAITING_EVENTS
SCRIPTED = f"""
VAR_GLOBAL
    first, second : ARRAY[0..{LENGTH - 1}] OF BYTE; (* per cycle: what the bit becomes, one after the other *)
END_VAR
PROGRAM First
VAR
    script : Writer;
END_VAR
script(script := first);
END_PROGRAM
PROGRAM Second
VAR
    script : Writer;
END_VAR
script(script := second);
END_PROGRAM
FUNCTION_BLOCK Writer
VAR_IN_OUT
    script : ARRAY[0..{LENGTH - 1}] OF BYTE;
END_VAR
VAR
    i : UDINT;
    k : INT;
END_VAR
FOR k := 0 TO 2 DO
    %QX0.6 := (script[i] AND SHL(BYTE#1, k)) <> 0;
END_FOR
i := (i + 1) MOD {LENGTH};
END_FUNCTION_BLOCK
PROGRAM Answer
VAR
    n : UDINT;
END_VAR
n := n + 1;
END_PROGRAM
CONFIGURATION Config
    TASK A(INTERVAL := T#2ms, PRIORITY := 4);
    TASK B(INTERVAL := T#3ms, PRIORITY := 8);
    TASK Above(SINGLE := %QX0.6, PRIORITY := 0);
    TASK Between(SINGLE := %QX0.6, PRIORITY := 6);
    TASK Below(SINGLE := %QX0.6, PRIORITY := 31);
    PROGRAM A1 WITH A : First;
    PROGRAM B1 WITH B : Second;
    PROGRAM Above1 WITH Above : Answer;
    PROGRAM Between1 WITH Between : Answer;
    PROGRAM Below1 WITH Below : Answer;
END_CONFIGURATION
"""

WAITS = """
PROGRAM Main
VAR
    n : UDINT;
END_VAR
n := n + 1;
END_PROGRAM
CONFIGURATION Config
    TASK Door(EVENT := 'door', PRIORITY := 1);
    TASK Same(EVENT := 'door', PRIORITY := 2);
    TASK Bell(EVENT := 'bell', PRIORITY := 1);
    PROGRAM OnDoor WITH Door : Main;
    PROGRAM OnSame WITH Same : Main;
    PROGRAM OnBell WITH Bell : Main;
END_CONFIGURATION
"""


def compiled(tmp_path_factory: pytest.TempPathFactory, text: str) -> BuildResult:
    path: Path = tmp_path_factory.mktemp("events") / "main.st"
    path.write_text(text)
    return compile_sources([path])


@pytest.fixture(scope="module")
def scripted(tmp_path_factory: pytest.TempPathFactory) -> BuildResult:
    return compiled(tmp_path_factory, SCRIPTED)


@pytest.fixture(scope="module")
def waits(tmp_path_factory: pytest.TempPathFactory) -> BuildResult:
    return compiled(tmp_path_factory, WAITS)


def rises(first: list[int], second: list[int], ms: int) -> int:
    """How often the bit is TRUE after a cycle and was not after the previous one; A comes before B."""
    due = sorted([(2 * i, 0, script) for i, script in enumerate(first)] + [(3 * i, 1, s) for i, s in enumerate(second)])
    states = [False] + [bool(script & 4) for at, _, script in due if at < ms]
    return sum(after and not before for before, after in pairwise(states))


SCRIPT = st.lists(st.integers(0, 7), min_size=LENGTH, max_size=LENGTH)


@examples(60)
@given(first=SCRIPT, second=SCRIPT, ms=st.integers(0, 80))
def test_every_rise_between_cycles_is_a_run_at_every_priority(scripted, first, second, ms):
    with Simulator(scripted.image, scripted.symbols, start=False) as plc:
        plc.write({"first": first})
        plc.write({"second": second})
        plc.start()
        plc.run_for(ms=ms)
        expected = rises(first, second, ms)
        assert [plc.read(f"{name}1.n") for name in ("Above", "Between", "Below")] == [expected] * 3
        assert all(task.overruns == 0 for task in plc.tasks())


@examples(60)
@given(posts=st.lists(st.tuples(st.sampled_from(["door", "bell"]), st.integers(0, 250), st.integers(0, 3)), max_size=6))
def test_every_post_is_a_run_or_counted_as_lost(waits, posts):
    with Simulator(waits.image, waits.symbols) as plc:
        plc.run_for(ms=1)
        runs = {"door": 0, "bell": 0}
        lost = {"door": 0, "bell": 0}
        waiting = {"door": 0, "bell": 0}
        for event, count, ms in [*posts, ("door", 0, 1)]:
            for _ in range(count):
                plc.post(event)
            waiting[event] += count
            if ms:
                plc.run_for(ms=ms)
                for name in waiting:
                    answered = min(waiting[name], MAX_WAITING)
                    runs[name] += answered
                    lost[name] += waiting[name] - answered
                    waiting[name] = 0
        assert [plc.read(f"On{name}.n") for name in ("Door", "Same", "Bell")] == [runs["door"]] * 2 + [runs["bell"]]
        assert [task.overruns for task in plc.tasks()][::2] == [lost["door"], lost["bell"]]


def test_an_event_that_no_task_waits_for_is_refused(waits):
    with Simulator(waits.image, waits.symbols) as plc, pytest.raises(DeviceError, match="window"):
        plc.post("window")


def test_events_survive_a_restart_of_the_device(waits):
    with Simulator(waits.image, waits.symbols) as plc:
        plc.restart()
        plc.post("bell")
        plc.run_for(ms=1)
        assert plc.read("OnBell.n") == 1
        assert plc.status().exception is None


def test_the_image_names_its_events(waits):
    tasks = parse_image(waits.image).tasks
    assert [task.external for task in tasks] == ["door", "door", "bell"]
    assert {task.kind for task in tasks} == {lib.KIND_EXTERNAL}
