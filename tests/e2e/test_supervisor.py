"""plcrt's supervisor: whatever ends the process that runs the controller, it is there again, or all ends in order."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import time
from contextlib import suppress
from pathlib import Path

import pytest
from processes import is_alive, started
from questions import log

from plctool.link.connection import Connection
from plctool.link.serial import SerialTransport
from plctool.link.services import read_identity, read_status
from plctool.link.session import Session
from plctool.testing.plcrt import Plcrt, find_plcrt

PATIENCE = 60  # for what is bound to happen [s]
DEADLY = [signal.SIGSEGV, signal.SIGBUS, signal.SIGILL, signal.SIGFPE, signal.SIGTRAP, signal.SIGABRT, signal.SIGSYS]
OUTSIDE = signal.SIGKILL


def name(pid: int) -> str:
    return Path(f"/proc/{pid}/comm").read_text().strip()


def files(pid: int) -> int:
    return len(list(Path(f"/proc/{pid}/fd").iterdir()))


def exists(pid: int) -> bool:
    return Path(f"/proc/{pid}").exists()


def is_pending(pid: int, number: signal.Signals) -> bool:
    """Whether a process has not taken a signal yet."""
    status = Path(f"/proc/{pid}/status").read_text()
    masks = re.findall(r"^(?:SigPnd|ShdPnd):\s*(\w+)", status, re.MULTILINE)
    return any(int(mask, 16) >> number - 1 & 1 for mask in masks)


def answer(port: str) -> str:
    with Connection(SerialTransport(port)) as connection:
        session = Session(connection)
        assert read_identity(session).device_name == "plcrt"
        return read_status(session).state.value


@pytest.mark.parametrize("number", [*DEADLY, OUTSIDE])
def test_it_answers_on_the_same_line_after_a_death_and_says_what_it_died_of(tool, plcrt, kill_worker, number):
    kill_worker(number)
    assert answer(plcrt.port) == "none"
    said = f"signal {number.name}" if number is not signal.SIGSYS else f"signal {number.value}"
    assert any("was started again" in text and said in text for text in log(tool, plcrt).splitlines())


def test_it_is_there_again_within_a_second(plcrt, kill_worker, eventually):
    """Once at least: machines under load are slow."""

    def is_quick() -> bool:
        begin = time.monotonic()
        kill_worker(OUTSIDE)
        answer(plcrt.port)
        return time.monotonic() - begin < 1

    eventually(is_quick)


def test_nothing_is_left_of_those_that_died(plcrt, kill_worker):
    before = files(plcrt.process.pid), files(plcrt.worker)
    workers = []
    for _ in range(10):
        workers.append(plcrt.worker)
        kill_worker(OUTSIDE)
    answer(plcrt.port)
    assert (files(plcrt.process.pid), files(plcrt.worker)) == before
    assert not any(map(exists, workers))


def test_ps_tells_them_apart(plcrt):
    assert (name(plcrt.process.pid), name(plcrt.worker)) == ("plcrt", "plcrt-worker")


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_both_end_in_order(plcrt, number):
    worker = plcrt.worker
    assert plcrt.stop(number) == 0
    assert not exists(worker)


def test_an_interrupt_of_the_terminal_reaches_both_and_ends_them_in_order(tmp_path):
    with Plcrt(tmp_path / "flash") as plcrt:
        worker = plcrt.worker
        os.kill(worker, signal.SIGINT)
        assert plcrt.stop(signal.SIGINT) == 0
        assert not exists(worker)


def test_a_worker_that_is_asked_to_end_ends_plcrt(plcrt):
    os.kill(plcrt.worker, signal.SIGTERM)
    assert plcrt.process.wait(PATIENCE) == 0


def test_a_second_signal_ends_both_at_once(plcrt, eventually):
    worker = plcrt.worker
    os.kill(worker, signal.SIGSTOP)
    plcrt.process.terminate()
    with pytest.raises(subprocess.TimeoutExpired):
        plcrt.process.wait(0.3)
    eventually(lambda: not is_pending(plcrt.process.pid, signal.SIGTERM))  # two that wait are one
    plcrt.process.terminate()
    assert plcrt.process.wait(PATIENCE) == -signal.SIGTERM
    assert not is_alive(worker)


def test_the_worker_ends_with_a_supervisor_that_is_killed(plcrt, eventually):
    worker = plcrt.worker
    plcrt.stop(signal.SIGKILL)
    eventually(lambda: not is_alive(worker))
    plcrt.start()  # at once: neither the flash file nor the line is held
    assert answer(plcrt.port) == "none"


def test_a_killed_plcrt_may_be_started_at_once(plcrt):
    for _ in range(20):
        plcrt.stop(signal.SIGKILL)
        plcrt.start()
    assert answer(plcrt.port) == "none"


def test_a_controller_that_dies_again_and_again_without_a_program_is_given_up(plcrt, eventually):
    worker, deaths = None, 0
    while plcrt.process.poll() is None:
        if plcrt.worker not in (None, worker):
            worker = plcrt.worker
            os.kill(worker, signal.SIGABRT)
            deaths += 1
    _, said = plcrt.process.communicate(timeout=PATIENCE)
    assert plcrt.process.returncode == 1 and 3 <= deaths <= 10
    assert "times in a row without a program (signal SIGABRT)" in said


def test_one_that_is_killed_from_outside_is_never_given_up(plcrt, kill_worker):
    for _ in range(12):
        kill_worker(OUTSIDE)
        answer(plcrt.port)


def test_it_ends_while_it_waits_to_start_the_next(plcrt, eventually):
    """With the third death comes a pause."""
    worker, deaths = None, 0
    while deaths < 4:
        if plcrt.worker not in (None, worker):
            worker = plcrt.worker
            os.kill(worker, signal.SIGABRT)
            deaths += 1
    plcrt.process.terminate()
    assert plcrt.process.wait(PATIENCE) in (0, 1)


def test_it_runs_where_ended_children_are_ignored(tmp_path):
    """As a shell may start it; the kernel then forgets how a child ended."""
    ignore = lambda: signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # noqa: E731
    command = [find_plcrt(), "--flash", str(tmp_path / "flash"), "--serial", "pty"]
    with started(command, stdout=subprocess.PIPE, preexec_fn=ignore) as process:
        assert process.stdout.readline()
        process.terminate()
        assert process.wait(PATIENCE) == 0


def test_without_a_supervisor_it_is_one_process(tmp_path):
    with Plcrt(tmp_path / "flash", "--no-supervisor") as plcrt:
        assert plcrt.worker is None
        assert answer(plcrt.port) == "none"
        assert plcrt.stop() == 0


def test_a_serial_device_is_opened_again_by_the_next_worker(tmp_path, eventually):
    import pty

    ours, theirs = pty.openpty()
    line = os.ttyname(theirs)

    def opened(pid: int) -> bool:
        """Whether a process has the line open."""
        for file in Path(f"/proc/{pid}/fd").iterdir():
            with suppress(OSError):  # closed meanwhile
                if os.readlink(file) == line:
                    return True
        return False

    command = [find_plcrt(), "--flash", str(tmp_path / "flash"), "--serial", line]
    with started(command) as process:
        plcrt = Plcrt(tmp_path / "flash")
        plcrt.process = process
        worker = eventually(lambda: plcrt.worker)
        eventually(lambda: opened(worker))
        eventually(lambda: not opened(process.pid))  # a device that goes away is not held by the supervisor
        os.kill(worker, OUTSIDE)
        eventually(lambda: plcrt.worker not in (None, worker))
        eventually(lambda: opened(plcrt.worker))
        process.terminate()
        assert process.wait(PATIENCE) == 0
    os.close(ours)
    os.close(theirs)
