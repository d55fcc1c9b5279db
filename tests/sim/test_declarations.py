"""What declarations mean over a restart, and in programs of several files."""

from __future__ import annotations

from pathlib import Path

import pytest

from plctool.compiler import compile_sources
from plctool.errors import UsageError
from plctool.sim import Simulator

RETAINED = """
VAR_GLOBAL
    start : INT := 4;
END_VAR
VAR_GLOBAL RETAIN
    count : INT := start + 1;
END_VAR
FUNCTION_BLOCK Counter
VAR_INPUT RETAIN
    step : INT := start * 2;
END_VAR
VAR
    address : POINTER TO INT := ADR(start);
END_VAR
VAR_OUTPUT
    seen : INT;
END_VAR
VAR_STAT RETAIN
    all : INT := 1;
END_VAR
seen := address^;
all := all + 1;
END_FUNCTION_BLOCK
PROGRAM Main
VAR
    c : Counter;
END_VAR
VAR PERSISTENT
    kept : INT := start;
END_VAR
VAR NON_RETAIN
    lost : INT := start;
END_VAR
c();
count := count + 1;
kept := kept + 1;
lost := lost + 1;
c.step := c.step + 1;
END_PROGRAM
"""


@pytest.fixture
def plc(tmp_path: Path):
    path = tmp_path / "main.st"
    path.write_text(RETAINED)
    built = compile_sources([path])
    with Simulator(built.image, built.symbols) as simulator:
        simulator.run_cycles(1)
        yield simulator


NAMES = ("count", "Main.c.step", "Counter.all", "Main.kept", "Main.lost")


def test_calculated_initial_values_are_there_in_the_first_cycle(plc):
    assert [plc.read(name) for name in NAMES] == [6, 9, 2, 5, 5]


def test_retained_variables_keep_their_values_though_the_initial_ones_are_calculated(plc):
    plc.reset("warm")
    plc.start()
    plc.run_cycles(1)
    assert [plc.read(name) for name in NAMES] == [7, 10, 3, 6, 5]
    assert plc.read("Main.c.seen") == 4  # addresses are set again


def test_a_cold_start_calculates_all_that_are_not_persistent(plc):
    plc.run_cycles(3)
    plc.reset("cold")
    plc.start()
    plc.run_cycles(1)
    assert [plc.read(name) for name in NAMES] == [6, 9, 2, 9, 5]


LISTS = {
    "Motors": "{attribute 'qualified_only'}\nVAR_GLOBAL speed : INT := 20; END_VAR\n"
    "VAR_GLOBAL CONSTANT LIMIT : INT := 300; END_VAR",
    "Pumps": "VAR_GLOBAL speed : INT := 21; level : INT := 1; END_VAR",
    "main": "PROGRAM Main VAR a, b, c, d : INT; END_VAR\n"
    "a := Motors.speed; b := speed; c := MOTORS.limit; d := Pumps.level + level; END_PROGRAM",
}


def test_a_file_of_globals_is_a_list_and_qualified_only_ones_do_not_get_in_the_way(tmp_path: Path):
    for name, text in LISTS.items():
        (tmp_path / f"{name}.st").write_text(text)
    built = compile_sources([tmp_path / f"{name}.st" for name in LISTS])
    with Simulator(built.image, built.symbols) as simulator:
        simulator.run_cycles(1)
        assert [simulator.read(f"Main.{name}") for name in "abcd"] == [20, 21, 300, 2]
        assert simulator.read("Motors.speed") == 20
        assert simulator.read("Pumps.speed") == simulator.read("speed") == 21


ACCESS = """
PROGRAM Plant
VAR
    n, wish : INT;
END_VAR
n := n + wish;
END_PROGRAM
CONFIGURATION Machine
TASK Fast(INTERVAL := T#10ms, PRIORITY := 1);
PROGRAM Main WITH Fast : Plant;
VAR_ACCESS
    total : Main.n : INT READ_ONLY;
    sum : Main.n : INT;
    step : Main.wish : INT READ_WRITE;
END_VAR
END_CONFIGURATION
"""


def test_access_names_are_only_read_unless_they_say_read_write(tmp_path: Path):
    path = tmp_path / "main.st"
    path.write_text(ACCESS)
    built = compile_sources([path])
    with Simulator(built.image, built.symbols) as simulator:
        simulator.write({"step": 3})
        simulator.run_cycles(2)
        assert simulator.read("total") == simulator.read("sum") == 6
        for name in ("total", "sum"):
            with pytest.raises(UsageError, match="READ_ONLY"):
                simulator.write({name: 1})
