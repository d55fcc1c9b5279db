"""The whole story of a controller, as its engineer types it: two programs, a fault, a reset, a power failure.

Only `plctool` is used, as a process of its own on the board's serial line. The programs are benchmarks in a task of
10 ms, beside a task of 1 ms that interrupts them and counts how often.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

import pytest
from environment import ROOT, TARGET

from plctool.testing.waiting import eventually

sys.path.append(str(Path(__file__).parents[1]))

from plctool_commands import run_plctool

CYCLES = 60  # at least, of the benchmark before its checksum is looked at

AROUND_BENCHMARK = """
VAR_GLOBAL
    busy : BOOL; (* the slow task is in the middle of its cycle *)
END_VAR
PROGRAM Begin
VAR
    n : DINT;
END_VAR
busy := TRUE;
n := n + 1;
END_PROGRAM
PROGRAM Finish
VAR
    n, i, x : DINT;
END_VAR
FOR i := 1 TO 50_000 DO (* several cycles of the fast task *)
    x := x XOR (x * 5 + i);
END_FOR
busy := FALSE;
n := n + 1;
END_PROGRAM
PROGRAM Watch
VAR
    n, preempted, share, zero : DINT;
    trip : BOOL;
END_VAR
VAR RETAIN
    kept : DINT;
END_VAR
n := n + 1;
kept := kept + 1;
IF busy THEN
    preempted := preempted + 1;
    IF trip THEN
        share := n / zero;
    END_IF
END_IF
END_PROGRAM
CONFIGURATION Plant
    RESOURCE Res ON PLC
        TASK Control(INTERVAL := T#10ms, PRIORITY := 5);
        TASK Fast(INTERVAL := T#1ms, PRIORITY := 1);
        PROGRAM Opening WITH Control : Begin;
        PROGRAM Main WITH Control : Bench;
        PROGRAM Closing WITH Control : Finish;
        PROGRAM Watch WITH Fast : Watch;
    END_RESOURCE
END_CONFIGURATION
"""


class Engineer:
    """Types plctool's commands, here on a board's serial line. `port` changes when the board is switched on again."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.port = ""
        self._env = os.environ | {"XDG_CACHE_HOME": str(folder / "cache")}

    def types(self, *words: str) -> Any:
        """A command; what it answers to --json."""
        done = run_plctool([*words, "--json"], self.folder, self._env, timeout=120)
        assert done.returncode == 0, f"plctool {' '.join(words)}: {done.stdout}{done.stderr}"
        return json.loads(done.stdout)

    def asks(self, *words: str) -> Any:
        """A command for the controller."""
        return self.types(*words, "--port", self.port)

    def reads(self, *names: str) -> list[Any]:
        return list(self.asks("read", *names)["values"].values())

    def writes_program(self, benchmark: str) -> Path:
        """A source file with one of the benchmarks of this project, in two tasks."""
        source = self.folder / f"{benchmark}.st"
        text = (ROOT / "bench/programs" / source.name).read_text()
        source.write_text(text.partition("CONFIGURATION")[0] + AROUND_BENCHMARK)
        return source

    def builds(self, source: Path, target: str) -> str:
        """The image of a program for a processor."""
        image = f"{source.stem}-{target}.cdl"
        self.types("build", str(source), "-o", image, "--target", target)
        return image

    def runs_on_this_machine(self, source: Path, cycles: int) -> Any:
        """The checksum after `cycles` in the simulator."""
        image = self.builds(source, "x86_64-linux")
        return self.types("run", image, "--cycles", str(cycles), "--get", "Main.chk")["values"]["Main.chk"]


@pytest.fixture
def engineer(tmp_path: Path) -> Engineer:
    return Engineer(tmp_path)


def check_benchmark(engineer: Engineer, source: Path) -> None:
    """The benchmark on the controller has computed what it computes on this machine in as many cycles."""
    eventually(lambda: engineer.reads("Closing.n")[0] >= CYCLES)
    engineer.asks("stop")
    cycles, chk, preempted = engineer.reads("Closing.n", "Main.chk", "Watch.preempted")
    assert chk == engineer.runs_on_this_machine(source, cycles)
    assert preempted > cycles, "the fast task interrupts every cycle of the slow one, more than once"
    control, fast = engineer.asks("tasks")["tasks"]
    assert (control["name"], fast["name"]) == ("Control", "Fast")
    assert fast["cycles"] > 5 * control["cycles"]
    engineer.asks("start")


def test_from_an_empty_board_to_one_that_starts_its_program_by_itself(make_board, engineer):
    board = make_board()
    board.power_on()
    engineer.port = board.port
    assert engineer.asks("status")["state"] == "none"

    # A first program, with arithmetic in REAL.
    source = engineer.writes_program("pid")
    assert engineer.asks("flash", engineer.builds(source, TARGET))["skipped"] is False
    check_benchmark(engineer, source)

    # A second one takes its place while it runs.
    source = engineer.writes_program("tables")
    image = engineer.builds(source, TARGET)
    engineer.asks("flash", image)
    crc = engineer.types("info", image)["crc"]
    assert engineer.asks("status")["image_crc"] == crc
    check_benchmark(engineer, source)

    # It divides by zero, in the middle of a cycle of the slow task.
    engineer.asks("write", "Watch.trip=TRUE")
    status = eventually(lambda: (now := engineer.asks("status"))["state"] == "exception" and now)
    line = source.read_text().split("\n").index("        share := n / zero;") + 1
    fault = status["exception"]
    assert (fault["name"], fault["task"], fault["pou"], fault["line"]) == ("DIVIDEBYZERO", "Fast", "Watch", line)
    entry = engineer.asks("log")["entries"][-1]
    assert entry["text"].startswith("Fast: division by zero")
    assert (entry["pou"], Path(entry["file"]).name, entry["line"]) == ("Watch", "tables.st", line)

    # Communication goes on, and the slow task has finished what it was doing.
    begun, finished, busy, kept = engineer.reads("Opening.n", "Closing.n", "busy", "Watch.kept")
    assert (begun, busy) == (finished, False)

    # A reset: the program begins again and has only its retain variables from before.
    assert engineer.asks("reset", "warm")["state"] == "stop"
    assert engineer.reads("Closing.n", "Watch.trip", "Watch.kept") == [0, False, kept]
    engineer.asks("start")
    eventually(lambda: engineer.reads("Closing.n")[0] > 5)
    engineer.asks("stop")
    (kept,) = engineer.reads("Watch.kept")
    engineer.asks("start")

    # The power fails. The controller starts its program by itself.
    board.power_off()
    board.power_on()
    engineer.port = board.port
    status = engineer.asks("status")
    assert (status["state"], status["image_crc"]) == ("run", crc)
    assert engineer.reads("Watch.kept")[0] >= kept
    assert "Reset: power on" in [entry["text"] for entry in engineer.asks("log")["entries"]]
    eventually(lambda: engineer.reads("Closing.n")[0] > 5)
