"""Alarms on plcrt, over power cuts; the rest of the promise is in tests/alarms.py."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from alarms import EACH_CYCLE, PROGRAM, Alarms, check_one_moment

from plctool import connect
from plctool.device import Plc
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually

CUTS = 6


@pytest.fixture
def image(tool) -> Path:
    return tool.build("alarms", PROGRAM)


@pytest.fixture
def plc(plcrt: Plcrt, image: Path) -> Iterator[Plc]:
    plcrt.stop()
    plcrt.options = ("--tcp", "0")
    plcrt.start()
    with connect(f"tcp:{plcrt.tcp}") as plc:
        plc.flash(image)
        yield plc


class TestPlcrt(Alarms):
    pass


def test_power_cuts_leave_the_history_of_one_moment(plc: Plc, plcrt: Plcrt, tool) -> None:
    plc.flash(tool.build("each_cycle", EACH_CYCLE))
    check_one_moment(plc)
    plc.stop()  # saves
    saved = count = plc.alarm_history().count
    plc.start()
    for cut in range(CUTS):
        with connect(f"tcp:{plcrt.tcp}") as again:
            count = check_one_moment(again)
            assert count >= saved
            eventually(lambda plc=again, least=count + 60 + 23 * cut: plc.read("Main.events") > least)
        plcrt.stop(signal.SIGKILL)
        plcrt.start()
    assert count > saved + 24


def test_commands_list_acknowledge_and_follow(plc: Plc, plcrt: Plcrt, image: Path, tool) -> None:
    link = ["--tcp", plcrt.tcp]
    assert tool("alarms", *link).out == "no alarms\n"
    assert len(tool.ok("alarms", "--all", *link)["alarms"]) == 6
    plc.write({"Main.level": 90.0, "Main.dry": True})
    eventually(lambda: len(plc.alarms()) == 2)
    first, second = tool.ok("alarms", *link)["alarms"]
    assert (first["name"], first["state"], first["class"], first["text"]) == (
        "Main.high", "UNACKNOWLEDGED", "error", "too high",
    )  # fmt: skip
    assert second["name"] == "Main.pump" and second["age_s"] >= 0
    assert "UNACKNOWLEDGED  error " in tool("alarms", *link).out
    assert tool.ok("alarms", "--ack", "Main.high", *link) == {"acknowledged": ["Main.high"]}
    assert tool("alarms", "--ack", "*", *link).out == "none waits\n"
    assert [e["state"] for e in tool.ok("alarms", "--history", *link)["events"]] in (
        ["UNACKNOWLEDGED", "ACKNOWLEDGED", "ACKNOWLEDGED"],
    )
    assert "Main.high: NORMAL -> UNACKNOWLEDGED" in tool("alarms", "--history", *link).out
    done = tool("alarms", "--ack", "Main.hgih", *link)
    assert done.status == 2 and "There is no alarm Main.hgih; 'plctool alarms --all' lists them." in done.err


def test_acknowledgement_that_a_stopped_program_does_not_take_is_an_error(plc: Plc, plcrt: Plcrt, tool) -> None:
    plc.write({"Main.level": 90.0})
    eventually(lambda: plc.alarms())
    plc.stop()
    done = tool("alarms", "--ack", "*", "--tcp", plcrt.tcp)
    assert done.status == 1 and "has not taken the acknowledgement of Main.high" in done.err


def test_follow_prints_changes_until_it_is_interrupted(plc: Plc, plcrt: Plcrt, image: Path, tmp_path: Path) -> None:
    words = ["alarms", "--follow", "--json", "--interval", "0.05", "--tcp", plcrt.tcp]
    env = os.environ | {"XDG_CACHE_HOME": str(tmp_path / "cache"), "PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen(
        [sys.executable, "-m", "plctool", *words], stdout=subprocess.PIPE, text=True, cwd=tmp_path, env=env
    )
    assert process.stdout is not None
    try:
        change = True
        while not select.select([process.stdout], [], [], 0.2)[0]:  # it may not look yet
            plc.write({"Main.dry": change})
            change = not change
        assert '"name": "Main.pump"' in process.stdout.readline()
        process.send_signal(signal.SIGINT)
        process.stdout.read()
        assert process.wait(60) == 0
    finally:
        process.kill()
        process.wait()
