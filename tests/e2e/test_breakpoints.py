"""Breakpoints on plcrt: a debugger that is killed or silent, watchdogs, communication meanwhile."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from breakpoints import FILE, PROGRAM, Breaking, build, halt

from plctool import connect
from plctool.compiler import compile_sources
from plctool.device import Plc
from plctool.image.targets import host_target
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually

DEBUGGER = """
import sys, time
from plctool import connect
with connect(sys.argv[1]) as plc:
    plc.breakpoints.set("halting.st", 15)
    assert plc.breakpoints.wait(60)
    print("halted", flush=True)
    time.sleep(600)
"""


@pytest.fixture
def link(plcrt: Plcrt) -> str:
    plcrt.stop()
    plcrt.options = ("--tcp", "0")
    plcrt.start()
    return f"tcp:{plcrt.tcp}"


@pytest.fixture
def plc(link: str, tmp_path: Path) -> Iterator[Plc]:
    with connect(link) as plc:
        plc.flash(build(tmp_path))
        yield plc


class TestPlcrt(Breaking):
    pass


def test_a_watchdog_rests_while_its_task_is_halted(plc: Plc) -> None:
    plc.breakpoints.set(FILE, 15)
    halt(plc.breakpoints)
    end = time.monotonic() + 0.5  # five times the watchdog of the task
    eventually(lambda: plc.breakpoints.wait(0.1) and time.monotonic() > end)
    plc.breakpoints.clear_all()
    plc.breakpoints.go()
    before = plc.read("Main.cycles")
    eventually(lambda: plc.read("Main.cycles") > before + 20)
    assert plc.status().exception is None


def test_a_halted_program_is_read_by_other_tools(plc: Plc, link: str) -> None:
    plc.breakpoints.set(FILE, 15)
    halt(plc.breakpoints)
    with connect(link) as other:
        assert other.status().state == "halted"
        assert other.read("Main.cycles") == other.read("Main.cycles")
        assert other.log()


def test_a_halted_program_answers_within_20_ms(plc: Plc, link: str) -> None:
    """The fastest of some replies: a busy machine makes others wait."""
    plc.breakpoints.set(FILE, 15)
    halt(plc.breakpoints)
    with connect(link) as other:
        times = []
        for _ in range(50):
            begin = time.monotonic()
            assert other.read("Main.cycles") >= 0
            times.append(time.monotonic() - begin)
    assert min(times) < 0.02, times


def test_a_debugger_that_is_killed_lets_the_machine_go_on(plc: Plc, link: str) -> None:
    debugger = subprocess.Popen([sys.executable, "-c", DEBUGGER, link], stdout=subprocess.PIPE, text=True)
    assert debugger.stdout
    assert debugger.stdout.readline() == "halted\n"
    assert plc.status().state == "halted"
    os.kill(debugger.pid, signal.SIGKILL)
    debugger.wait()
    debugger.stdout.close()
    eventually(lambda: plc.status().state == "run")
    before = plc.read("Main.cycles")
    eventually(lambda: plc.read("Main.cycles") > before + 20)
    assert any("debugger is gone" in entry.text for entry in plc.log())


def test_a_download_replaces_a_halted_program(plc: Plc, tmp_path: Path) -> None:
    plc.breakpoints.set(FILE, 15)
    halt(plc.breakpoints)
    plc.flash(build(tmp_path, level=2))
    plc.breakpoints.forget_halt()
    eventually(lambda: plc.read("Main.cycles") > 10)


def test_breakpoints_that_another_tool_ends_are_set_again(plc: Plc, link: str) -> None:
    said: list[str] = []
    debugger = plc.breakpoints
    debugger.output = said.append
    debugger.set(FILE, 15)
    debugger.watch("Main.divisor")
    with connect(link) as other:
        other.breakpoints.clear_all()
        other.end_debugging()
    assert [b.line for b, _ in debugger.list()] == [15]
    assert "another tool has ended the breakpoints: they are set again" in said[0]
    assert halt(debugger).calls[0].line == 15


def test_a_program_that_another_tool_downloads_has_the_breakpoints_of_its_lines(
    plc: Plc, link: str, tmp_path: Path
) -> None:
    said: list[str] = []
    debugger = plc.breakpoints
    debugger.output = said.append
    debugger.set(FILE, 15)
    debugger.set(FILE, 35)
    folder = tmp_path / "shorter"
    folder.mkdir()
    (folder / FILE).write_text(PROGRAM.partition("PROGRAM Other")[0] + "PROGRAM Other\nEND_PROGRAM\n")
    target = os.environ.get("PLCRT_TARGET", "") or host_target()
    built = compile_sources([folder / FILE], target=target, level=0, debug=True)
    built.write(folder / "halting.cdl")
    with connect(link) as other:
        other.flash(folder / "halting.cdl")
    assert [b.line for b, _ in debugger.list()] == [15]
    assert any("Breakpoint 2 has ended: the program has no " in text for text in said)
    assert halt(debugger).calls[0].line == 15


def test_an_online_change_waits_for_a_condition_that_another_tool_evaluates(plc: Plc, link: str) -> None:
    plc.breakpoints.set(FILE, 15)
    halt(plc.breakpoints)
    go = threading.Timer(0.3, lambda: (plc.breakpoints.clear_all(), plc.breakpoints.go()))
    with connect(link) as other:
        go.start()
        try:
            other._wait_for_conditions(other.raw_status())
        finally:
            go.join()
        assert other.status().state == "run"


def test_plcrt_ends_while_a_program_is_halted(plc: Plc, plcrt: Plcrt) -> None:
    plc.breakpoints.set(FILE, 15)
    halt(plc.breakpoints)
    assert plcrt.stop() == 0
    plcrt.start()
