"""Functions of the program that Python implements in the simulator."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from contextlib import suppress
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from plctool import DeviceError, Simulator, UsageError
from plctool.controller import ProgramStopped
from plctool.link.services import AppState

ADC = """{attribute 'external' := 'board_adc'}
FUNCTION BoardAdc : REAL
VAR_INPUT channel : USINT; END_VAR
END_FUNCTION
PROGRAM Main VAR n : UDINT; first, second : REAL; END_VAR
first := BoardAdc(1); second := BoardAdc(channel := 2); n := n + 1;
END_PROGRAM
"""
TYPES = "TYPE Mode : (Idle, Run := 5); Point : STRUCT x : INT; y : LREAL; END_STRUCT END_TYPE\n"


def simulator(folder: Path, source: str, **functions: Callable[..., Any]) -> Simulator:
    path = folder / "main.st"
    path.write_text(source)
    return Simulator.from_sources(path, functions=functions)


def called(folder: Path, declaration: str, call: str, function: Callable[..., Any], variables: str = "") -> Any:
    """What the variable `r` is after a cycle that has called the function F."""
    source = f"{TYPES}{declaration}\nEND_FUNCTION\nPROGRAM Main VAR {variables} END_VAR {call} END_PROGRAM"
    with simulator(folder, source, F=function) as plc:
        plc.run_cycles(1)
        return plc.read("Main.r")


def test_a_function_in_c_is_one_of_python(tmp_path: Path) -> None:
    asked = []

    def adc(channel: int) -> float:
        asked.append(channel)
        return channel * 1.5

    with simulator(tmp_path, ADC, boardadc=adc) as plc:
        plc.run_cycles(3)
        assert (plc.read("Main.first"), plc.read("Main.second"), plc.read("Main.n")) == (1.5, 3.0, 3)
    assert asked == [1, 2] * 3


def test_without_it_the_function_is_missing(tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match="board_adc") as raised:
        simulator(tmp_path, ADC)
    assert "functions={'Name': function}" in raised.value.__notes__[0]


@pytest.mark.parametrize(
    ("type_name", "argument", "given_value"),
    [
        ("BOOL", "TRUE", True),
        ("BYTE", "16#FF", 255),
        ("INT", "-32768", -32768),
        ("ULINT", "16#FFFF_FFFF_FFFF_FFFF", 2**64 - 1),
        ("REAL", "1.5", 1.5),
        ("LREAL", "-1E300", -1e300),
        ("TIME", "T#1s500ms", "T#1s500ms"),
        ("STRING", "'tank'", "tank"),
        ("STRING(3)", "'tan'", "tan"),
        ("WSTRING", '"täglich"', "täglich"),
        ("Mode", "Mode.Run", "Run"),
        ("DATE", "D#2026-11-23", "D#2026-11-23"),
        ("ARRAY[0..2] OF INT", "[1, 2, 3]", [1, 2, 3]),
        ("Point", "(x := 1, y := 2.5)", {"x": 1, "y": 2.5}),
    ],
)
def test_values_of_every_kind_go_there_and_back(
    tmp_path: Path, type_name: str, argument: str, given_value: Any
) -> None:
    seen = []

    def same(value: Any) -> Any:
        seen.append(value)
        return value

    result = called(
        tmp_path,
        f"FUNCTION F : {type_name} VAR_INPUT x : {type_name}; END_VAR",
        "r := F(x);",
        same,
        f"x : {type_name} := {argument}; r : {type_name};",
    )
    assert seen == [given_value] and result == given_value


def test_durations_may_be_timedelta(tmp_path: Path) -> None:
    declaration = "FUNCTION F : TIME VAR_INPUT x : INT; END_VAR"
    assert called(tmp_path, declaration, "r := F(1);", lambda x: timedelta(seconds=x), "r : TIME;") == "T#1s"
    declaration = "FUNCTION F : BOOL VAR_INPUT x : TIME; END_VAR"
    assert called(tmp_path, declaration, "r := F(T#2s);", lambda x: x.timedelta > timedelta(seconds=1), "r : BOOL;")


def test_outputs_and_in_outs_are_set(tmp_path: Path) -> None:
    def move(by: int, point: Any, far: Any) -> bool:
        point.value = {"x": point.value["x"] + by, "y": -point.value["y"]}
        far.value = point.value["x"] > 10
        return True

    declaration = (
        "FUNCTION F : BOOL VAR_INPUT by : INT; END_VAR VAR_IN_OUT p : Point; END_VAR VAR_OUTPUT far : BOOL; END_VAR"
    )
    variables = "r : Point := (x := 9, y := 0.5); far, ok : BOOL;"
    source = (
        f"{TYPES}{declaration} END_FUNCTION PROGRAM Main VAR {variables} END_VAR ok := F(5, r, far => far); END_PROGRAM"
    )
    with simulator(tmp_path, source, F=move) as plc:
        plc.run_cycles(1)
        assert plc.read("Main.r") == {"x": 14, "y": -0.5}
        assert plc.read("Main.far") is True and plc.read("Main.ok") is True


def test_a_function_with_a_body_is_replaced(tmp_path: Path) -> None:
    declaration = "FUNCTION F : DINT VAR_INPUT x : DINT; END_VAR VAR local : DINT; END_VAR local := x; F := local + 1;"
    assert called(tmp_path, declaration, "r := F(4);", lambda x: x * 100, "r : DINT;") == 400


def test_a_function_without_result(tmp_path: Path) -> None:
    seen: list[int] = []
    called(tmp_path, "FUNCTION F VAR_INPUT x : DINT; END_VAR", "F(4); r := 1;", seen.append, "r : DINT;")
    assert seen == [4]


@given(value=st.integers(-(2**63), 2**63 - 1), number=st.floats(allow_nan=False), flag=st.booleans())
def test_all_values_of_many_parameters(tmp_path_factory: Any, value: int, number: float, flag: bool) -> None:
    plc = _many(tmp_path_factory)
    plc.write({"Main.a": value, "Main.b": number, "Main.c": flag})
    plc.run_cycles(1)
    assert (plc.read("Main.ra"), plc.read("Main.rb"), plc.read("Main.rc")) == (value, number, flag)


_plcs: list[Simulator] = []


def _many(tmp_path_factory: Any) -> Simulator:
    """One for all examples."""
    if not _plcs:
        declaration = (
            "FUNCTION F : LINT VAR_INPUT a : LINT; b : LREAL; c : BOOL; END_VAR "
            "VAR_OUTPUT rb : LREAL; rc : BOOL; END_VAR END_FUNCTION"
        )
        main = (
            "PROGRAM Main VAR a, ra : LINT; b, rb : LREAL; c, rc : BOOL; END_VAR "
            "ra := F(a, b, c, rb => rb, rc => rc); END_PROGRAM"
        )

        def function(a: int, b: Any, c: bool, rb: Any, rc: Any) -> int:
            rb.value, rc.value = b, c
            return a

        _plcs.append(simulator(tmp_path_factory.mktemp("many"), f"{declaration}\n{main}", F=function))
    return _plcs[0]


@pytest.fixture(scope="module", autouse=True)
def close_at_the_end() -> Any:
    yield
    while _plcs:
        _plcs.pop().close()


# ---- what goes wrong -------------------------------------------------------------------------------------------------


def test_what_it_raises_ends_the_program_and_arrives(tmp_path: Path) -> None:
    def fails(channel: int) -> float:
        raise KeyError(f"channel {channel}")

    with simulator(tmp_path, ADC, BoardAdc=fails) as plc:
        with pytest.raises(KeyError, match="channel 1"):
            plc.run_for(ms=100)
        assert plc.status().state is AppState.EXCEPTION
        assert plc.read("Main.n") == 0
        with pytest.raises(ProgramStopped, match=r"main\.st:6"):
            plc.run_for(ms=10)
        plc.reset("warm")
        plc.start()
        with pytest.raises(KeyError):
            plc.run_cycles(1)


@pytest.mark.parametrize("value", ["text", None, 1e300, [1.0]])
def test_results_that_do_not_fit_are_errors(tmp_path: Path, value: Any) -> None:
    with simulator(tmp_path, ADC, BoardAdc=lambda channel: value) as plc, pytest.raises(UsageError):
        plc.run_cycles(1)


def test_it_does_not_run_the_program(tmp_path: Path) -> None:
    plcs: list[Simulator] = []

    def nested(channel: int) -> float:
        plcs[0].run_cycles(1)
        return 0.0

    with simulator(tmp_path, ADC, BoardAdc=nested) as plc:
        plcs.append(plc)
        with pytest.raises(UsageError, match="part of a cycle"):
            plc.run_cycles(1)


def test_it_may_read_and_write_variables(tmp_path: Path) -> None:
    plcs: list[Simulator] = []

    def counts(channel: int) -> float:
        plcs[0].write({"Main.n": plcs[0].read("Main.n") + 10})
        return 0.0

    with simulator(tmp_path, ADC, BoardAdc=counts) as plc:
        plcs.append(plc)
        plc.run_cycles(1)
        assert plc.read("Main.n") == 21


def test_unknown_functions_are_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"no function BoardAdcc; [Dd]id you mean BoardAdc"):
        simulator(tmp_path, ADC, BoardAdcc=lambda channel: 0.0)


def test_what_is_no_function_is_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="BoardAdc in Python is 5, which cannot be called"):
        simulator(tmp_path, ADC, BoardAdc=5)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("declaration", "what"),
    [
        ("FUNCTION F : INT VAR_IN_OUT s : STRING; END_VAR", "a STRING that it may write"),
        ("FUNCTION F : INT VAR_IN_OUT s : ARRAY[*] OF INT; END_VAR", r"an ARRAY\[\*\]"),
    ],
)
def test_parameters_that_python_cannot_take_are_named(tmp_path: Path, declaration: str, what: str) -> None:
    with pytest.raises(UsageError, match=what):
        called(tmp_path, declaration, "r := 1;", lambda s: 0, "r : INT;")


# ---- the stack of the thread -----------------------------------------------------------------------------------------


def test_python_may_nest_as_deeply_as_elsewhere(tmp_path: Path) -> None:
    """It runs on the stack of its thread, not on that of the program."""

    def depth(n: int) -> int:
        return 0 if n == 0 else 1 + max(map(depth, [n - 1]))  # through C, so that it takes stack

    levels = sys.getrecursionlimit() // 4
    declaration = "FUNCTION F : DINT VAR_INPUT x : DINT; END_VAR"
    assert called(tmp_path, declaration, f"r := F({levels});", depth, "r : DINT;") == levels


def test_a_long_function_is_not_interrupted(tmp_path: Path) -> None:
    """Its time counts for the cycle, which may be aborted when the function has returned."""
    done = []

    def slow(channel: int) -> float:
        end = time.process_time() + 0.15
        while time.process_time() < end:
            pass
        done.append(channel)
        return 1.0

    path = tmp_path / "main.st"
    path.write_text(ADC)
    with Simulator.from_sources(path, cycle_limit_ms=50, functions={"BoardAdc": slow}) as plc:
        with suppress(ProgramStopped):
            plc.run_cycles(1)
        assert done
        plc.reset("cold")
        assert plc.read("Main.n") == 0


@pytest.mark.parametrize("work", [0, 2000])
def test_an_endless_loop_that_calls_a_function_is_aborted_each_time(tmp_path: Path, work: int) -> None:
    """The function is not interrupted; what is passed to it may be, and leaves nothing to the next call."""

    def busy(channel: int) -> float:
        channels.add(channel)
        return float(sum(range(work)) >= 0)

    channels = set[int]()

    path = tmp_path / "main.st"
    path.write_text(ADC.replace("n := n + 1;", "WHILE first < 2.0 DO first := BoardAdc(1); END_WHILE"))
    with Simulator.from_sources(path, cycle_limit_ms=20, functions={"BoardAdc": busy}) as plc:
        for _ in range(10):
            with pytest.raises(ProgramStopped, match="WATCHDOG"):
                plc.run_cycles(1)
            plc.reset("cold")
            plc.start()
    assert channels == {1, 2}


def test_a_function_with_too_many_parameters_is_refused(tmp_path: Path) -> None:
    names = ", ".join(f"p{n}" for n in range(65))
    source = f"FUNCTION F : DINT VAR_INPUT {names} : DINT; END_VAR END_FUNCTION PROGRAM Main END_PROGRAM"
    with pytest.raises(UsageError, match="it has 65 parameters; at most 64 are possible"):
        simulator(tmp_path, source, F=lambda *numbers: 0)


def test_python_in_several_simulators(tmp_path: Path) -> None:
    with (
        simulator(tmp_path, ADC, BoardAdc=lambda channel: 1.0) as a,
        simulator(tmp_path, ADC, BoardAdc=lambda channel: 2.0) as b,
    ):
        for plc in (a, b, a, b):
            plc.run_cycles(1)
        assert (a.read("Main.first"), b.read("Main.first")) == (1.0, 2.0)
