"""Programs that write where they may not, and controllers that die under a program: the device stays reachable, and the
next start decides what runs."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import time

import pytest
from processes import processor_ns
from questions import log, read, status

from plctool.errors import PlcError
from plctool.gateway.control import dismiss_idle
from plctool.link.connection import Connection
from plctool.link.serial import SerialTransport
from plctool.link.services import download, read_status
from plctool.link.session import Session
from plctool.testing.plcrt import Plcrt

PROVEN_AFTER = 3.0  # seconds a new program has to run
CAUGHT = {"ACCESS_VIOLATION", "STACK_OVERFLOW", "ILLEGAL_INSTRUCTION"}

CLEAR = """
FUNCTION Clear : DINT
VAR_INPUT bytes : UDINT; END_VAR
VAR buffer : ARRAY[0..9] OF DINT; END_VAR
MEMSET(ADR(buffer), 255, bytes);
Clear := buffer[3];
END_FUNCTION
PROGRAM Main
VAR n : DINT; v : DINT {initial}; END_VAR
n := n + 1;
{body}
END_PROGRAM
CONFIGURATION Config
    {task}
END_CONFIGURATION
"""
CYCLIC = "TASK Fast(INTERVAL := T#5ms); PROGRAM Main WITH Fast : Main;"
FREEWHEELING = "PROGRAM Main : Main;"
WHERE = {
    "initialisation": {"initial": ":= Clear(60)", "body": "", "task": CYCLIC},
    "cyclic task": {"initial": "", "body": "v := Clear(60);", "task": CYCLIC},
    "freewheeling task": {"initial": "", "body": "v := Clear(9000000);", "task": FREEWHEELING},
}


def prove(tool, plcrt, image, eventually) -> None:
    """Flashes a program and lets it run until the device trusts it."""
    tool.ok("flash", "--port", plcrt.port, str(image))
    begin = read(tool, plcrt, "Main.count")
    eventually(lambda: read(tool, plcrt, "Main.count") > begin + 100 * (PROVEN_AFTER + 0.5))


# ---- what a program does to itself ----


@pytest.mark.parametrize("where", WHERE)
def test_a_program_that_overruns_its_stack_is_stopped_and_rolled_back_at_the_next_start(
    tool, plcrt, counter, eventually, where
):
    prove(tool, plcrt, counter, eventually)
    good = status(tool, plcrt)["image_crc"]
    worker = plcrt.worker
    tool("flash", "--port", plcrt.port, str(tool.build("bad", CLEAR.format(**WHERE[where]))))
    fault = eventually(lambda: status(tool, plcrt)["exception"])
    assert fault["name"] in CAUGHT
    assert plcrt.worker == worker
    assert plcrt.stop() == 0
    plcrt.start()
    now = status(tool, plcrt)
    assert (now["state"], now["image_crc"]) == ("run", good)


def test_a_program_that_overruns_its_stack_does_not_end_plcrt_at_start_after_start(tool, plcrt, eventually):
    """Nothing to go back to."""
    tool("flash", "--port", plcrt.port, str(tool.build("bad", CLEAR.format(**WHERE["initialisation"]))))
    for _ in range(3):
        assert plcrt.stop() == 0
        plcrt.start()
        assert status(tool, plcrt)["state"] in ("stop", "exception")


# ---- what ends the controller under it ----


@pytest.mark.parametrize("number", [signal.SIGSEGV, signal.SIGABRT, signal.SIGKILL])
def test_a_proven_program_runs_again_three_times_when_the_controller_died(
    tool, plcrt, counter, eventually, kill_worker, number
):
    prove(tool, plcrt, counter, eventually)
    crc = status(tool, plcrt)["image_crc"]
    for restart in (1, 2, 3):
        kill_worker(number)
        now = status(tool, plcrt)
        assert (now["state"], now["image_crc"], now["exception"]) == ("run", crc, None)
        assert f"(signal {number.name}) and was started again; its program runs again ({restart} of 3" in log(
            tool, plcrt
        )
    kill_worker(number)
    now = status(tool, plcrt)
    assert now["state"] in ("stop", "exception") and now["image_crc"] == crc
    said = f"(signal {number.name}) and was started again; its program stays stopped, after 3 restarts in 10 minutes"
    assert said in log(tool, plcrt)
    tool.ok("start", "--port", plcrt.port)
    assert status(tool, plcrt)["state"] == "run"


def test_what_runs_again_after_a_death_has_its_retain_values(tool, plcrt, eventually, kill_worker):
    source = "PROGRAM Main VAR RETAIN count : UDINT; END_VAR count := count + 1; END_PROGRAM"
    prove(tool, plcrt, tool.build("retained", source), eventually)
    before = read(tool, plcrt, "Main.count")
    eventually(lambda: read(tool, plcrt, "Main.count") > before + 300)  # they are saved each second
    kill_worker(signal.SIGKILL)
    assert read(tool, plcrt, "Main.count") > before


def test_a_program_that_is_not_proven_stays_stopped_when_the_controller_died(
    tool, plcrt, counter, eventually, kill_worker
):
    image = tool.build("quick", "PROGRAM Main VAR n : DINT; END_VAR n := n + 1; END_PROGRAM")
    prove(tool, plcrt, counter, eventually)
    tool.ok("flash", "--port", plcrt.port, str(image))
    kill_worker(signal.SIGKILL)
    assert status(tool, plcrt)["state"] == "stop"


def test_a_program_that_a_user_has_stopped_stays_stopped_when_the_controller_died(
    tool, plcrt, counter, eventually, kill_worker
):
    prove(tool, plcrt, counter, eventually)
    tool.ok("stop", "--port", plcrt.port)
    kill_worker(signal.SIGKILL)
    assert status(tool, plcrt)["state"] == "stop"


@pytest.mark.parametrize("number", [signal.SIGSEGV, signal.SIGKILL])
def test_a_proven_program_runs_again_at_the_next_start_after_too_many_deaths(
    tool, plcrt, counter, eventually, kill_worker, number
):
    prove(tool, plcrt, counter, eventually)
    for _ in range(4):
        kill_worker(number)
    assert status(tool, plcrt)["state"] != "run"
    assert plcrt.stop() == 0
    plcrt.start()
    assert status(tool, plcrt)["state"] == "run"


SLOW_START = """
FUNCTION Wait : DINT
VAR_INPUT times : DINT; END_VAR
VAR i, k : DINT; END_VAR
FOR i := 1 TO times DO k := k + i MOD 7; END_FOR
Wait := k;
END_FUNCTION
PROGRAM Main
VAR n : DINT; v : DINT := Wait(2000000000); END_VAR
n := n + 1;
END_PROGRAM
"""


@pytest.mark.parametrize("number", [signal.SIGABRT, signal.SIGKILL])
def test_a_death_in_initialisation_leaves_the_device_reachable(tool, plcrt, counter, eventually, kill_worker, number):
    prove(tool, plcrt, counter, eventually)
    good = status(tool, plcrt)["image_crc"]
    image = tool.build("slow", SLOW_START).read_bytes()

    def kill() -> None:  # nothing but the initialisation takes that long, and it takes longer
        before = processor_ns(plcrt.worker)
        while processor_ns(plcrt.worker) < before + 500_000_000:
            time.sleep(0.01)
        kill_worker(number)

    killer = threading.Thread(target=kill)
    dismiss_idle(plcrt.port)  # the gateway of the command before
    with Connection(SerialTransport(plcrt.port)) as connection, contextlib.suppress(PlcError):
        session = Session(connection)
        read_status(session)
        killer.start()
        download(session, image, restart=True)
    killer.join()
    assert status(tool, plcrt)["state"] != "run"
    assert f"signal {number.name}" in log(tool, plcrt)
    assert plcrt.stop() == 0
    plcrt.start()
    if number is not signal.SIGKILL:  # which counts as a power cut, so that it is tried again
        now = status(tool, plcrt)
        assert (now["state"], now["image_crc"]) == ("run", good)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_a_death_during_a_download_leaves_the_old_program(tool, plcrt, counter, eventually, kill_worker, share):
    prove(tool, plcrt, counter, eventually)
    crc = status(tool, plcrt)["image_crc"]
    other = counter.read_bytes() * 1000  # many messages, of which several are under way

    class Died(Exception):
        pass

    def kill(arrived: int) -> None:
        if arrived >= share * len(other):
            kill_worker(signal.SIGABRT)
            raise Died

    dismiss_idle(plcrt.port)  # the gateway of the command before
    with Connection(SerialTransport(plcrt.port)) as connection, pytest.raises(Died):
        download(Session(connection), other, restart=True, progress=kill)
    assert status(tool, plcrt)["image_crc"] == crc
    plcrt.stop()
    plcrt.start()
    now = status(tool, plcrt)
    assert (now["state"], now["image_crc"]) == ("run", crc)


def test_many_kills_of_the_controller_do_not_lose_the_program(tool, tmp_path, counter, eventually):
    with Plcrt(tmp_path / "many.flash") as plcrt:
        prove(tool, plcrt, counter, eventually)
        crc = status(tool, plcrt)["image_crc"]
        for _ in range(10):
            worker = eventually(lambda: plcrt.worker)
            os.kill(worker, signal.SIGKILL)
            time.sleep(0.02)  # any moment of the next start will do
        eventually(lambda: plcrt.worker)
        plcrt.stop()
        plcrt.start()
        now = status(tool, plcrt)
        assert (now["state"], now["image_crc"]) == ("run", crc)
