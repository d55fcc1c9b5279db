"""What tasks see of inputs and outputs that they share, and what the PC sees."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from plctool.compiler import compile_sources
from plctool.errors import DeviceError, UsageError
from plctool.sim import Simulator

Start = Callable[..., Simulator]

GLOBALS = """
VAR_GLOBAL
    out AT %QW0 : WORD := 16#0100;
    flag AT %QX2.0 : BOOL := TRUE;
    in AT %IW0 : INT;
    divisor : INT := 1;
END_VAR
"""


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Starts a program of two tasks: Fast, each millisecond, and Slow, each 10, which is first at time 0."""
    with ExitStack() as stack:

        def begin(fast: str, slow: str, variables: str = "", declarations: str = "") -> Simulator:
            path = tmp_path / "main.st"
            path.write_text(
                f"{GLOBALS}{declarations}"
                f"PROGRAM Fast VAR n, seen : INT; w : WORD; {variables} END_VAR {fast} END_PROGRAM "
                f"PROGRAM Slow VAR n, seen : INT; w : WORD; END_VAR {slow} END_PROGRAM "
                "CONFIGURATION C RESOURCE R ON D TASK F(INTERVAL := T#1ms, PRIORITY := 5); "
                "TASK S(INTERVAL := T#10ms, PRIORITY := 1); PROGRAM Fast WITH F : Fast; PROGRAM Slow WITH S : Slow; "
                "END_RESOURCE END_CONFIGURATION"
            )
            built = compile_sources([path])
            return stack.enter_context(Simulator(built.image, built.symbols))

        yield begin


def test_initial_values_are_there_in_the_first_cycle(start: Start) -> None:
    plc = start("w := out; flag := flag;", "w := out; flag := flag;")
    plc.run_for(ms=1)
    assert plc.read_all(["Fast.w", "Slow.w", "flag"]) == {"Fast.w": 0x100, "Slow.w": 0x100, "flag": True}


def test_an_output_that_another_task_wrote_is_read_in_the_next_cycle(start: Start) -> None:
    plc = start("w := out;", "n := n + 1; out := INT_TO_WORD(n);")
    plc.run_for(ms=11)
    assert plc.read("Slow.n") == 2 and plc.read("Fast.w") == 2 and plc.read("out") == 2


def test_an_input_that_a_task_writes_is_seen_by_the_others(start: Start) -> None:
    plc = start("seen := in;", "n := n + 1; in := n;")
    plc.run_for(ms=21)
    assert plc.read("Fast.seen") == plc.read("in") == 3


def test_what_the_pc_writes_is_seen_in_the_next_cycle_and_holds(start: Start) -> None:
    plc = start("seen := in; out := out;", "seen := in; flag := flag;")
    plc.run_for(ms=5)
    plc.write({"in": 77})
    plc.write({"flag": False})
    plc.write({"out": 5})
    assert plc.read("in") == 77
    plc.run_for(ms=15)
    assert plc.read_all(["Fast.seen", "Slow.seen", "flag", "out"]) == {
        "Fast.seen": 77,
        "Slow.seen": 77,
        "flag": False,
        "out": 5,
    }


def test_outputs_are_zero_after_an_exception_whatever_the_failing_cycle_had_written(start: Start) -> None:
    plc = start("out := 16#FFFF; seen := 1 / divisor;", "flag := TRUE;")
    plc.run_for(ms=5)
    plc.write({"divisor": 0})
    plc.run_for(ms=20, check=False)
    assert plc.status().exception is not None
    assert plc.read_all(["out", "flag"]) == {"out": 0, "flag": False}
    plc.reset("warm")
    assert plc.read_all(["out", "flag"]) == {"out": 0x100, "flag": True}


def test_outputs_are_zero_after_a_stop_and_come_back_with_the_start(start: Start) -> None:
    plc = start("out := 16#1234;", "flag := flag OR TRUE;")
    plc.run_for(ms=5)
    plc.stop()
    assert plc.read_all(["out", "flag"]) == {"out": 0, "flag": False}
    plc.start()
    plc.run_for(ms=11)
    assert plc.read_all(["out", "flag"]) == {"out": 0x1234, "flag": True}


def test_a_pointer_into_the_outputs_is_followed_by_the_pc(start: Start) -> None:
    plc = start("p := ADR(out); p^ := p^ + 1;", "w := out;", "p : POINTER TO WORD;")
    plc.run_for(ms=3)
    assert plc.read("Fast.p^") == plc.read("out") == 0x103
    plc.write({"Fast.p^": 7})
    plc.write({"Fast.p^.0": False})
    assert plc.read("out") == 6
    plc.run_for(ms=1)
    assert plc.read("out") == 7


def test_a_pointer_taken_by_the_initialisation_and_the_name_are_one_variable(start: Start) -> None:
    declarations = "VAR_GLOBAL early : POINTER TO WORD := ADR(out); END_VAR "
    plc = start("early^ := 3; w := out;", "flag := TRUE;", declarations=declarations)
    plc.run_for(ms=1)
    assert plc.read("Fast.w") == 3


def test_a_pointer_that_another_task_took_leads_to_what_it_sees(start: Start) -> None:
    plc = start(
        "IF common <> 0 THEN common^ := 9; w := out; END_IF", "common := ADR(out); w := out;",
        declarations="VAR_GLOBAL common : POINTER TO WORD; END_VAR ",
    )  # fmt: skip
    plc.run_for(ms=11)
    assert plc.read("Fast.w") == 9 and plc.read("Slow.w") == 9


def test_a_program_that_needs_more_copies_than_the_device_has_is_refused_with_the_reason(tmp_path: Path) -> None:
    body = "in[1] := 1; in[512] := 1; out[1] := 1; out[512] := 1;"
    runs = "".join(f"TASK T{i}(INTERVAL := T#1s); PROGRAM P{i} WITH T{i} : All; " for i in range(16))
    path = tmp_path / "main.st"
    path.write_text(
        "VAR_GLOBAL in AT %IL0 : ARRAY[1..512] OF LINT; out AT %QL0 : ARRAY[1..512] OF LINT; END_VAR "
        f"PROGRAM All {body} END_PROGRAM CONFIGURATION C RESOURCE R ON D {runs} END_RESOURCE END_CONFIGURATION"
    )
    built = compile_sources([path])
    assert built.needs["all_copies"].amount == 262144
    with pytest.raises(DeviceError, match="The process image area needs 262144 bytes, this device has 196608"):
        Simulator(built.image)
    with pytest.raises(UsageError, match="needs 262144 bytes of copies of inputs and outputs, the device has 196608"):
        compile_sources([path], board="plcrt")
