"""Tasks that wait for events, on a real plcrt: every rise is a run."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest

import plctool
from plctool.testing.plcrt import Plcrt

EDGES = 500

PROGRAM = """VAR_GLOBAL
    go, toggle : BOOL;
    edges : DINT;
END_VAR
PROGRAM Source
IF edges < {edges} AND go THEN
    toggle := NOT toggle;
    IF toggle THEN edges := edges + 1; END_IF
    %QX0.5 := toggle;
END_IF
END_PROGRAM
PROGRAM Counter
VAR
    n : DINT;
END_VAR
n := n + 1;
END_PROGRAM
CONFIGURATION Config
    TASK Fast(INTERVAL := T#1ms, PRIORITY := 5, WATCHDOG := T#30m);
    TASK Above(SINGLE := toggle, PRIORITY := 0, WATCHDOG := T#30m);
    TASK Below(SINGLE := %QX0.5, PRIORITY := 31, WATCHDOG := T#30m);
    TASK Input(SINGLE := %IX0.3, PRIORITY := 7, WATCHDOG := T#30m);
    PROGRAM Main WITH Fast : Source;
    PROGRAM OnToggle WITH Above : Counter;
    PROGRAM OnOutput WITH Below : Counter;
    PROGRAM OnInput WITH Input : Counter;
END_CONFIGURATION
"""


@pytest.fixture
def plc(tool, plcrt, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tool.folder / "cache"))
    with plctool.connect(f"serial:{plcrt.port}") as connected:
        yield connected


def answered(plc, task: int) -> int:
    """Events that led to a cycle, and those that were lost because the machine had no time for the task."""
    info = plc.tasks()[task]
    return info.cycles + info.overruns


def test_every_rise_at_the_end_of_a_cycle_is_a_run(tool, plc, eventually):
    plc.flash(tool.build("edges", PROGRAM.replace("{edges}", str(EDGES))))
    plc.write({"go": True})
    eventually(lambda: plc.read("edges") == EDGES)
    eventually(lambda: answered(plc, 1) >= EDGES and answered(plc, 2) >= EDGES)
    assert (answered(plc, 1), answered(plc, 2)) == (EDGES, EDGES)
    assert plc.read("OnToggle.n") == plc.tasks()[1].cycles
    plc.stop()
    plc.start()
    assert answered(plc, 1) == EDGES  # a variable that is TRUE at the start is no event


def test_an_input_bit_that_is_written_from_outside_is_an_event(tool, plc, eventually):
    plc.flash(tool.build("edges", PROGRAM.replace("{edges}", "0")))
    for count in (1, 2, 3):
        plc.write({"%IX0.3": True})
        eventually(lambda count=count: plc.read("OnInput.n") == count)
        plc.write({"%IX0.3": False})


WAITS = """PROGRAM Main
VAR
    n : DINT;
END_VAR
n := n + 1;
END_PROGRAM
CONFIGURATION Config
    TASK OnDoor(EVENT := 'door', PRIORITY := 1, WATCHDOG := T#30m);
    PROGRAM Main WITH OnDoor : Main;
END_CONFIGURATION
"""


@pytest.fixture
def with_door(tmp_path) -> Iterator[Plcrt]:
    with Plcrt(tmp_path / "plc.flash", "--event", f"door={tmp_path / 'door'}") as running:
        yield running


def test_each_byte_in_the_pipe_is_an_external_event(tool, with_door, eventually, tmp_path):
    tool.ok("flash", "--port", with_door.port, str(tool.build("waits", WAITS)))
    assert tool.ok("read", "--port", with_door.port, "Main.n")["values"] == {"Main.n": 0}
    pipe = os.open(tmp_path / "door", os.O_WRONLY)
    for count, posts in ((1, b"x"), (4, b"abc"), (24, bytes(20))):
        os.write(pipe, posts)
        eventually(
            lambda count=count: tool.ok("read", "--port", with_door.port, "Main.n")["values"] == {"Main.n": count}
        )
    os.close(pipe)
    (task,) = tool.ok("tasks", "--port", with_door.port)["tasks"]
    assert (task["name"], task["cycles"], task["overruns"]) == ("OnDoor", 24, 0)


def test_a_program_that_waits_for_an_event_the_device_lacks_is_refused(tool, plcrt):
    done = tool("flash", "--port", plcrt.port, str(tool.build("waits", WAITS)))
    assert done.status == 1
    assert "OnDoor waits for an event" in done.err


@pytest.mark.parametrize(
    ("event", "advice"), [("door", "NAME=PIPE"), ("=x", "NAME=PIPE"), ("door=plc.flash", "not a pipe")]
)
def test_an_event_that_cannot_be_is_refused(tmp_path, monkeypatch, event, advice):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "plc.flash").touch()
    with pytest.raises(plctool.errors.UsageError, match=advice), Plcrt(tmp_path / "flash", "--event", event):
        pass
