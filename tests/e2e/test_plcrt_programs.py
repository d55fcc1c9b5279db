"""Programs on a real plcrt: what the processor itself catches, what is left after a kill, tasks that run in main."""

from __future__ import annotations

import random
import signal

import pytest
from questions import read, status

from plctool.gateway.control import dismiss_idle
from plctool.link.connection import Connection
from plctool.link.serial import SerialTransport
from plctool.link.services import download
from plctool.link.session import Session


def program(variables: str, body: str) -> str:
    return f"PROGRAM Main\nVAR\n{variables}\nEND_VAR\n{body}\nEND_PROGRAM\n" + CYCLIC


CYCLIC = """
CONFIGURATION Config
    RESOURCE Res ON PLC
        TASK Fast(INTERVAL := T#5ms, PRIORITY := 1);
        PROGRAM Main WITH Fast : Main;
    END_RESOURCE
END_CONFIGURATION
"""

NULL_WRITE = program("p : POINTER TO DINT; n : DINT;", "n := n + 1; p^ := n;")
LARGE_FRAME = """
FUNCTION Far : DINT
VAR_INPUT
    i : DINT;
END_VAR
VAR
    field : ARRAY[0..1999999] OF DINT;
END_VAR
field[i] := i;
Far := field[i + 1];
END_FUNCTION
""" + program("n : DINT; i : DINT;", "n := Far(i);")


@pytest.mark.parametrize(
    ("text", "name"),
    [
        (NULL_WRITE, "ACCESS_VIOLATION"),
        (LARGE_FRAME, "STACK_OVERFLOW"),
    ],
    ids=["null", "stack"],
)
def test_what_no_check_stops_the_processor_does(tool, plcrt, eventually, text, name):
    image = tool.build("fault", text, "--checks", "none", "--no-limits")
    tool("flash", "--port", plcrt.port, str(image))
    fault = eventually(lambda: status(tool, plcrt)["exception"])
    assert fault["name"] == name
    assert fault["task"] == "Fast"
    assert plcrt.stop() == 0


def test_an_endless_loop_does_not_keep_plcrt_from_ending(tool, plcrt, eventually):
    text = program("go : BOOL; n : DINT;", "WHILE go DO n := n + 1; END_WHILE;")
    tool.ok("flash", "--port", plcrt.port, str(tool.build("loop", text)))
    tool.ok("write", "--port", plcrt.port, "Main.go=TRUE")
    assert plcrt.stop() == 0  # what has to be killed ends with another status


def test_a_killed_controller_runs_its_program_again_with_its_retain_variables(tool, plcrt, counter, eventually):
    tool.ok("flash", "--port", plcrt.port, str(counter))
    saved = eventually(lambda: read(tool, plcrt, "Main.total"))
    eventually(lambda: read(tool, plcrt, "Main.total") > saved + 150)  # it is saved once a second
    plcrt.stop(signal.SIGKILL)
    plcrt.start()
    assert status(tool, plcrt)["state"] == "run"
    assert read(tool, plcrt, "Main.total") > saved
    assert read(tool, plcrt, "Main.count") < read(tool, plcrt, "Main.total")


def test_an_orderly_end_loses_no_retain_variable(tool, plcrt, counter, eventually):
    tool.ok("flash", "--port", plcrt.port, str(counter))
    eventually(lambda: read(tool, plcrt, "Main.total") > 5)
    tool.ok("stop", "--port", plcrt.port)
    total = read(tool, plcrt, "Main.total")
    assert plcrt.stop() == 0
    plcrt.start()
    assert read(tool, plcrt, "Main.total") >= total


class PowerCut(Exception):
    """plcrt was killed."""


@pytest.mark.parametrize("seed", range(3))
def test_a_kill_during_a_download_leaves_the_old_program(tool, plcrt, counter, seed):
    tool.ok("flash", "--port", plcrt.port, str(counter))
    crc = status(tool, plcrt)["image_crc"]
    other = counter.read_bytes() * 200
    limit = random.Random(seed).randrange(len(other))

    def kill(arrived: int) -> None:
        if arrived >= limit:
            plcrt.stop(signal.SIGKILL)
            raise PowerCut

    dismiss_idle(plcrt.port)
    with Connection(SerialTransport(plcrt.port)) as connection, pytest.raises(PowerCut):
        download(Session(connection), other, restart=True, progress=kill)
    plcrt.start()
    now = status(tool, plcrt)
    assert now["state"] == "run" and now["image_crc"] == crc


BACKGROUND = """
VAR_GLOBAL
    start : BOOL;
END_VAR
PROGRAM Main
VAR
    n : DINT;
END_VAR
n := n + 1;
END_PROGRAM
PROGRAM Answer
VAR
    n : DINT;
END_VAR
n := n + 1;
END_PROGRAM
CONFIGURATION Config
    RESOURCE Res ON PLC
        TASK OnStart(SINGLE := start, PRIORITY := 3);
        PROGRAM Free : Main;
        PROGRAM Reply WITH OnStart : Answer;
    END_RESOURCE
END_CONFIGURATION
"""


def test_freewheeling_and_event_tasks_run_beside_the_communication(tool, plcrt, eventually):
    tool.ok("flash", "--port", plcrt.port, str(tool.build("background", BACKGROUND)))
    assert eventually(lambda: read(tool, plcrt, "Free.n") > 100)
    assert read(tool, plcrt, "Reply.n") == 0
    tool.ok("write", "--port", plcrt.port, "start=TRUE")
    assert eventually(lambda: read(tool, plcrt, "Reply.n")) == 1
    tool.ok("write", "--port", plcrt.port, "start=FALSE")
    tool.ok("write", "--port", plcrt.port, "start=TRUE")
    assert eventually(lambda: read(tool, plcrt, "Reply.n") > 1)
