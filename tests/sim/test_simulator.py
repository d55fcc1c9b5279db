"""The runtime in this process: what a unit test of a PLC program relies on."""

from __future__ import annotations

from pathlib import Path

import pytest

from plctool.compiler import compile_sources
from plctool.compiler.image.build import BuildResult
from plctool.core import lib
from plctool.errors import DeviceError, UsageError
from plctool.sim import Simulator

MAIN = """
TYPE Mode : (Idle, Run := 5); END_TYPE
TYPE Point : STRUCT x : INT; y : REAL := 1.5; END_STRUCT; END_TYPE
PROGRAM Main
VAR
    n : UDINT;
    points : ARRAY[1..3] OF Point;
    pulse : TON;
    pulses : UDINT;
    name : STRING := 'tank';
    divisor : INT := 1;
    mode : Mode;
    result : INT;
END_VAR
VAR RETAIN kept : UDINT := 5; END_VAR
VAR CONSTANT limit : INT := 7; END_VAR
n := n + 1;
pulse(IN := NOT pulse.Q, PT := T#1s);
IF pulse.Q THEN pulses := pulses + 1; END_IF;
result := limit / divisor;
kept := kept + 1;
END_PROGRAM
"""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> BuildResult:
    path = tmp_path_factory.mktemp("sim") / "main.st"
    path.write_text(MAIN)
    return compile_sources([path])


@pytest.fixture
def plc(built: BuildResult):
    with Simulator(built.image, built.symbols) as simulator:
        yield simulator


def test_a_day_of_a_10_ms_task_has_8640000_cycles(plc):
    plc.run_for(seconds=86_400)
    assert plc.read("Main.n") == 8_640_000
    assert plc.now_ns == 86_400 * 10**9


def test_time_passes_only_on_request(plc):
    assert plc.read("Main.n") == 0
    plc.run_for(ms=30)
    assert plc.read("Main.n") == 3
    plc.run_cycles(4)
    assert plc.read("Main.n") == 7


@pytest.mark.parametrize("time", [{"ms": -5}, {"seconds": -1}, {"ms": 10**16}, {"seconds": 2**62 / 1e9}])
def test_a_time_that_cannot_pass_is_refused(plc, time):
    with pytest.raises(UsageError):
        plc.run_for(**time)
    assert lib.SimNow() == 0


@pytest.mark.parametrize("count", [2**32, 2**64])
def test_more_cycles_than_are_counted_are_refused(plc, count):
    with pytest.raises(UsageError, match="At most 4294967295 cycles"):
        plc.run_cycles(count)


@pytest.mark.parametrize("ns", [-1, 2**63 - 1, 2**63 - 2])
def test_the_clock_does_not_overflow(plc, ns):
    plc.run_for(ms=10)
    assert lib.SimAdvance(ns) == lib.SimRunFor(ns) == lib.ERR_PARAMETER
    assert lib.SimNow() == 10_000_000


def test_timers_follow_the_virtual_clock(plc):
    plc.run_for(seconds=1)
    assert plc.read("Main.pulses") == 0
    plc.run_for(ms=10)
    assert plc.read("Main.pulses") == 1


def test_structures_and_arrays_come_as_dicts_and_lists(plc):
    assert plc.read("Main.points") == [{"x": 0, "y": 1.5}] * 3
    plc.write({"main.POINTS[2].X": 4})
    assert plc.read("Main.points[2]") == {"x": 4, "y": 1.5}
    assert plc.read_all(["Main.name", "Main.pulse.PT"]) == {"Main.name": "tank", "Main.pulse.PT": "T#0ms"}


def test_values_are_written_as_python_values_or_as_text(plc):
    plc.write({"Main.name": "pump"})
    plc.write({"Main.pulse.PT": "T#80ms"})
    assert plc.read("Main.name") == "pump" and plc.read("Main.pulse.PT") == "T#80ms"


@pytest.mark.parametrize(("name", "hint"), [("Main.nmae", "Main.name"), ("Main.points[4].x", "1 to 3")])
def test_a_name_that_is_not_there_is_refused_with_a_hint(plc, name, hint):
    with pytest.raises(UsageError, match=hint):
        plc.read(name)


def test_values_that_do_not_fit_are_refused(plc):
    for name, value in (("Main.divisor", 40_000), ("Main.divisor", "abc"), ("Main.name", "x" * 81)):
        with pytest.raises(UsageError):
            plc.write({name: value})
    assert plc.read("Main.divisor") == 1


@pytest.mark.parametrize("value", [1, "1", "Stop", "Mode#2"])
def test_a_value_that_an_enumeration_has_not_is_refused(plc, value):
    plc.write({"Main.mode": "Run"})
    with pytest.raises(UsageError, match=r"choose one of Idle \(0\), Run \(5\)\."):
        plc.write({"Main.mode": value})
    assert plc.read("Main.mode") == "Run"


def test_an_exception_stops_the_program_and_a_reset_lets_it_start_again(plc):
    plc.write({"Main.divisor": 0})
    plc.run_cycles(3, check=False)
    assert plc.status().exception.name == "DIVIDEBYZERO"
    with pytest.raises(DeviceError, match="reset it first"):
        plc.start()
    plc.reset("warm")
    plc.start()
    plc.run_cycles(2)
    assert plc.read("Main.n") == 2


def test_after_power_off_and_on_the_boot_project_runs_and_retain_variables_are_kept(plc):
    plc.run_for(seconds=10)
    kept = plc.read("Main.kept")
    plc.restart()
    assert plc.status().state == "run"
    plc.run_cycles(1)
    assert plc.read("Main.n") == 1 and plc.read("Main.kept") == kept + 1


def test_a_refused_image_leaves_the_program_running(plc, built):
    plc.run_cycles(5)
    damaged = bytearray(built.image)
    damaged[200] ^= 1
    with pytest.raises(DeviceError, match="CRC"):
        plc.flash(bytes(damaged), unchecked=True)
    plc.run_cycles(5)
    assert plc.read("Main.n") == 10


def test_tasks_have_statistics(plc):
    plc.run_cycles(100)
    (task,) = plc.tasks()
    assert task.cycles == 100 and task.interval_us == 10_000 and task.min_us <= task.avg_us <= task.max_us


def test_images_are_loaded_with_the_symbols_beside_them(built, tmp_path: Path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    built.write(tmp_path / "app.cdl")
    with Simulator.from_file(tmp_path / "app.cdl") as plc:
        plc.run_cycles(1)
        assert plc.read("Main.n") == 1


def test_two_builds_of_the_same_sources_give_the_same_image(built, tmp_path: Path):
    path = tmp_path / "main.st"
    path.write_text(MAIN)
    assert compile_sources([path]).image == built.image


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda plc: plc.run_cycles(-1), "cycles are run at once, and at least 0"),
        (lambda plc: plc.run_cycles(1.5), "cycles are run at once, and at least 0"),
        (lambda plc: plc.run_for(ms=float("nan")), "nan is not a length of time"),
        (lambda plc: plc.run_for(seconds=float("inf")), "inf is not a length of time"),
        (lambda plc: plc.run_for(seconds="1"), "'1' is not a length of time"),
        (lambda plc: plc.attach(None), "A plant is a function"),
        (lambda plc: plc.attach(print, None), "None is not a length of time"),
        (lambda plc: plc.at(1, None), "A plant is a function"),
        (lambda plc: plc.at(float("nan"), print), "nan is not a length of time"),
    ],
)
def test_arguments_that_mean_nothing_are_refused(plc, call, words):
    with pytest.raises(UsageError, match=words):
        call(plc)
    plc.run_cycles(1)
    assert plc.read("Main.n") == 1
