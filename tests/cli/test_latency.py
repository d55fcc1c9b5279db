"""`plctool latency`: the histogram of each task, a period of it, and cyclictest beside it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from plctool.core import lib

PORT = ("--port", "/dev/fake")
TASK = ([0, 1, 1000, 1000, 7, 8, 6, 9, 70, 2], "Fast")
SINCE_START = [[(256, 10), (320, 985), (1024, 4), (65536, 1)]]
LATER = [[(256, 10), (320, 1985), (1024, 4), (65536, 1), (81920, 2)]]


@pytest.fixture
def measured(tool: Any, plc: Any, image: Path) -> Any:
    assert tool("flash", *PORT, str(image)).status == 0
    plc.tasks, plc.lateness = [TASK], [SINCE_START]
    return plc


def test_all_starts_are_counted_by_their_lateness(tool: Any, measured: Any) -> None:
    document = tool("latency", *PORT, "--json").json
    (task,) = document["tasks"]
    assert (document["seconds"], document["cyclictest"]) == (None, None)
    assert (task["name"], task["starts"], task["latest_us"], task["overruns"]) == ("Fast", 1000, 70, 2)
    assert task["below_us"] == {"50%": 0.32, "99%": 0.32, "99.9%": 1.024}
    assert task["histogram"][0] == {"below_us": 0.256, "starts": 10}


def test_people_see_a_bar_for_each_power_of_two(tool: Any, measured: Any) -> None:
    first, *rows, summary = tool("latency", *PORT).out.splitlines()
    assert first == "Fast: 1000 cycles since the program was loaded, every 1 ms"
    cells = [tuple(row.split()[4:7]) for row in rows]
    assert cells[:3] == [("0.256", "us", "10"), ("0.512", "us", "985"), ("1.02", "us", "4")]
    assert rows[1].endswith("#" * 40) and rows[0].endswith(" #")
    assert cells[3:-1] == [(n, "us", "0") for n in ("2.05", "4.1", "8.19", "16.4", "32.8")]
    shares = "50% below 0.32 us, 99% below 0.32 us, 99.9% below 1.02 us"
    assert summary.strip() == f"{shares}; the latest since its start: 70 us"


def test_a_period_has_only_its_own_starts(tool: Any, measured: Any) -> None:
    measured.lateness = [SINCE_START, LATER]
    document = tool("latency", *PORT, "--time", "T#20ms", "--json").json
    assert document["seconds"] >= 0.02
    assert document["tasks"][0]["histogram"] == [{"below_us": 0.32, "starts": 1000}, {"below_us": 81.92, "starts": 2}]


def test_counts_that_pass_32_bits_go_on(tool: Any, measured: Any) -> None:
    measured.lateness = [[[(256, 0xFFFFFFFE)]], [[(256, 3)]]]
    assert tool("latency", *PORT, "--time", "T#1ms", "--json").json["tasks"][0]["starts"] == 5


@pytest.mark.parametrize("later", [[], [[(256, 3)], []], [[(256, 3)]]], ids=["none", "two", "reset"])
def test_another_program_during_the_period_is_an_error(tool: Any, measured: Any, later: Any) -> None:
    measured.lateness = [SINCE_START, later]
    done = tool("latency", *PORT, "--time", "T#1ms")
    assert done.status == 1
    assert "during the measurement. Measure again." in done.err


def test_a_task_without_a_cycle_has_no_figures(tool: Any, measured: Any) -> None:
    measured.lateness = [[[]]]
    assert tool("latency", *PORT, "--json").json["tasks"][0]["below_us"] == {}
    assert tool("latency", *PORT).out == "Fast: 0 cycles since the program was loaded, every 1 ms\n"


def test_a_device_without_tasks_says_what_to_do(tool: Any, plc: Any) -> None:
    plc.lateness = [[]]
    assert tool("latency", *PORT).out == "The device has no tasks. Flash a program first.\n"


def test_firmware_that_does_not_count_is_told(tool: Any, measured: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(type(measured), "_task_lateness", lambda *_: _refuse())
    done = tool("latency", *PORT, "--json")
    assert done.status == 1
    assert done.json["error"]["code"] == "no-lateness"
    assert "IEC_LATENESS" in done.json["error"]["message"]


def _refuse() -> Any:
    from plctool.link import bintag

    return [bintag.u16(lib.TAG_ERROR, lib.ERR_L7_UNKNOWNCMD)]


def a_cyclictest(folder: Path, script: str) -> str:
    program = folder / "cyclictest"
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o755)
    return str(folder)


def test_cyclictest_measures_the_interval_of_the_fastest_task(
    tool: Any, measured: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = "T: 0 ( 2300) P:80 I:1000 C:   1000 Min:      4 Act:   13 Avg:    9 Max:     606"
    monkeypatch.setenv("PATH", a_cyclictest(tmp_path, f'echo "$@" > {tmp_path}/options\necho "{said}"'))
    document = tool("latency", *PORT, "--cyclictest", "--json").json
    assert document["cyclictest"] == {"interval_us": 1000, "min_us": 4, "avg_us": 9, "max_us": 606}
    assert (tmp_path / "options").read_text() == "-q -m -p80 -i1000 -D1\n"
    assert "at least 4 us late, on average 9 us, at most 606 us" in tool("latency", *PORT, "--cyclictest").out


@pytest.mark.parametrize(
    ("script", "message"),
    [
        (None, "cyclictest was not found: sudo apt-get install rt-tests"),
        ("echo 'Unable to change policy!' >&2; exit 1", "did not measure: Unable to change policy!"),
    ],
)
def test_without_cyclictest_there_is_a_sentence(
    tool: Any, measured: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, script: str | None, message: str
) -> None:
    monkeypatch.setenv("PATH", a_cyclictest(tmp_path, script) if script else str(tmp_path))
    done = tool("latency", *PORT, "--cyclictest")
    assert done.status == 2
    assert message in done.err
