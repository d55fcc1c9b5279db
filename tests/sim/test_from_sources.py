"""A simulator made from sources, and exceptions of its program."""

from __future__ import annotations

from datetime import timedelta
from pathlib import Path

import pytest

from plctool import Simulator, UsageError
from plctool.compiler import CompileError
from plctool.controller import ProgramStopped

DIVIDES = """FUNCTION Share : INT VAR_INPUT by : INT; END_VAR
Share := 12 / by;
END_FUNCTION
PROGRAM Main VAR by : INT := 3; share : INT; pause : TIME; long : LTIME; END_VAR
share := Share(by);
END_PROGRAM
"""


@pytest.fixture
def source(tmp_path: Path) -> Path:
    path = tmp_path / "divides.st"
    path.write_text(DIVIDES)
    return path


def test_sources_and_folders_become_a_running_program(source: Path) -> None:
    for paths in ((source,), (str(source.parent),)):
        with Simulator.from_sources(*paths) as plc:
            plc.run_for(ms=10)
            assert plc.read("Main.share") == 4


def test_sources_with_errors_say_where(tmp_path: Path) -> None:
    (tmp_path / "bad.st").write_text("PROGRAM Main\nx := 1;\nEND_PROGRAM")
    with pytest.raises(CompileError, match=r"bad\.st:2:1: error"):
        Simulator.from_sources(tmp_path)


@pytest.mark.parametrize("run", [lambda plc: plc.run_for(ms=10), lambda plc: plc.run_cycles(1)], ids=["time", "cycles"])
def test_an_exception_of_the_program_raises_with_its_location_and_calls(source: Path, run) -> None:
    with Simulator.from_sources(source, level=0) as plc:
        run(plc)
        plc.write({"Main.by": 0})
        with pytest.raises(ProgramStopped) as raised:
            run(plc)
        exception = raised.value.exception
        assert (exception.name, exception.pou, exception.line) == ("DIVIDEBYZERO", "Share", 2)
        assert [(call.pou, call.line) for call in exception.calls] == [("Main", 5)]
        assert "divides.st:2, called from Main" in str(raised.value)
        assert plc.status().exception == exception


def test_an_exception_may_be_left_to_status(source: Path) -> None:
    with Simulator.from_sources(source) as plc:
        plc.write({"Main.by": 0})
        plc.run_for(ms=10, check=False)
        assert plc.status().exception.name == "DIVIDEBYZERO"
        with pytest.raises(ProgramStopped):
            plc.check_running()


def test_durations_may_be_timedeltas(source: Path) -> None:
    with Simulator.from_sources(source) as plc:
        plc.run_for(timedelta(seconds=2))
        assert plc.now_ns == 2_000_000_000
        plc.write({"Main.pause": timedelta(minutes=1, milliseconds=5), "Main.long": timedelta(microseconds=-3)})
        assert plc.read("Main.pause", "Main.long") == {"Main.pause": "T#1m5ms", "Main.long": "LTIME#-3us"}
        assert plc.read("Main.pause").timedelta == timedelta(minutes=1, milliseconds=5)
        assert plc.read("Main.long").timedelta == timedelta(microseconds=-3)
        with pytest.raises(UsageError, match="whole number"):
            plc.write({"Main.pause": timedelta(microseconds=1)})
        with pytest.raises(UsageError, match=r"999 days.* T#-24d20h31m23s648ms to T#24d20h31m23s647ms"):
            plc.write({"Main.pause": timedelta(days=999)})
