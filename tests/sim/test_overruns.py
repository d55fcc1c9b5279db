"""A program that writes where it may not gets an exception; this process and the runtime in it live on."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from shares import examples

from plctool.compiler import Level, compile_sources
from plctool.compiler.image.build import BuildResult
from plctool.core import error_name, lib
from plctool.sim import Simulator

ARRAY_BYTES = 40
CAUGHT = {lib.RTSEXCPT_ACCESS_VIOLATION, lib.RTSEXCPT_STACK_OVERFLOW, lib.RTSEXCPT_ILLEGAL_INSTRUCTION}

CLEAR = f"""
VAR_GLOBAL go : BOOL; bytes : UDINT; value : BYTE; END_VAR
FUNCTION Clear : DINT
VAR_INPUT bytes : UDINT; value : BYTE; END_VAR
VAR buffer : ARRAY[0..{ARRAY_BYTES // 4 - 1}] OF DINT; END_VAR
MEMSET(ADR(buffer), value, bytes);
Clear := buffer[3];
END_FUNCTION
"""
BODY = "PROGRAM Main VAR n : DINT; END_VAR IF go THEN n := Clear(bytes, value); END_IF; n := n + 1; END_PROGRAM\n"
TASKS = {
    "cyclic": "CONFIGURATION C TASK T(INTERVAL := T#10ms); PROGRAM Main WITH T : Main; END_CONFIGURATION",
    "freewheeling": "CONFIGURATION C PROGRAM Main : Main; END_CONFIGURATION",
}


def build(folder: Path, text: str, level: Level = 2, checks: str = "all") -> BuildResult:
    path = folder / "main.st"
    path.write_text(text)
    return compile_sources([path], level=level, checks=checks, limits=False)


def code_after(plc: Simulator, ms: int = 50) -> int:
    plc.run_for(ms=ms, check=False)
    exception = plc.status().exception
    return exception.code if exception else lib.RTSEXCPT_NOEXCEPTION


@pytest.mark.parametrize("task", TASKS)
def test_any_overrun_of_a_local_array_in_a_cycle_is_an_exception(tmp_path: Path, task: str) -> None:
    built = build(tmp_path, CLEAR + BODY + TASKS[task])
    with Simulator(built.image, built.symbols) as plc:

        @examples(60)
        @given(over=st.integers(20, 4096) | st.integers(4096, 9_000_000), value=st.integers(0, 255))
        def overrun(over: int, value: int) -> None:
            plc.reset("cold")
            plc.start()
            plc.write({"bytes": ARRAY_BYTES + over})
            plc.write({"value": value})
            plc.write({"go": True})
            assert code_after(plc) in CAUGHT

        overrun()
        plc.reset("cold")
        plc.start()
        assert code_after(plc) == lib.RTSEXCPT_NOEXCEPTION and plc.read("Main.n") > 0


@pytest.mark.parametrize("over", [20, 24, 88, 216, 1000, 4096, 65536, 1_048_576, 9_000_000])
@pytest.mark.parametrize("value", [0, 255])
def test_an_overrun_of_a_local_array_in_initialisation_is_an_exception(tmp_path: Path, over: int, value: int) -> None:
    call = f"Clear({ARRAY_BYTES + over}, {value})"
    built = build(tmp_path, CLEAR + f"PROGRAM Main VAR v : DINT := {call}; END_VAR END_PROGRAM")
    with Simulator(built.image, built.symbols, start=False) as plc:
        exception = plc.raw_status().exception
        assert exception is not None and exception.code in CAUGHT and exception.task == -1


WRITES = {
    "copy of 4 GB": "MEMCPY(ADR(a), ADR(a) + 100, UDINT#4294967295);",
    "100 MB from the first variable on": "MEMSET(ADR(a), 255, 100000000);",
    "100 MB before the first variable": "FOR i := 0 TO 100000000 DO p := ADR(a) - i; p^ := 255; END_FOR",
    "4 GB far away": "MEMSET(ADR(a) + 100000000, 255, UDINT#4294967295);",
    "inputs and beyond": "MEMSET(ADR(in), 255, 10000000);",
    "retain variables and beyond": "MEMSET(ADR(kept), 255, 10000000);",
}


@pytest.mark.parametrize("write", WRITES.values(), ids=WRITES.keys())
def test_a_wild_write_is_an_exception_before_it_reaches_the_runtime(tmp_path: Path, write: str) -> None:
    variables = "a : ARRAY[0..99] OF DINT; p : POINTER TO BYTE; i : DINT; in AT %IB0 : BYTE;"
    text = f"PROGRAM Main VAR {variables} END_VAR VAR RETAIN kept : DINT; END_VAR\n{write}\nEND_PROGRAM"
    bad, good = build(tmp_path, text), build(tmp_path, CLEAR + BODY)
    with Simulator(bad.image, bad.symbols) as plc:
        assert code_after(plc) == lib.RTSEXCPT_ACCESS_VIOLATION
        plc.reset("cold")
        plc.flash(good.image, start=False)
        plc.add_symbols(good.symbols)
        plc.start()
        assert code_after(plc) == lib.RTSEXCPT_NOEXCEPTION
        plc.restart()
        assert code_after(plc) == lib.RTSEXCPT_NOEXCEPTION and plc.read("Main.n") > 0


def large_frame(elements: int) -> str:
    return f"""
FUNCTION Far : DINT
VAR_INPUT i : DINT; END_VAR
VAR field : ARRAY[0..{elements - 1}] OF DINT; END_VAR
field[i] := i;
Far := field[i + 1];
END_FUNCTION
PROGRAM Main VAR n : DINT; i : DINT; END_VAR n := Far(i); END_PROGRAM
"""


@pytest.mark.parametrize("level", [0, 2, "s"])
@pytest.mark.parametrize("elements", [300_000, 4_259_840, 8_388_608, 40_000_000])
def test_a_frame_larger_than_the_stack_does_not_pass_over_its_guard(
    tmp_path: Path, elements: int, level: Level
) -> None:
    built = build(tmp_path, large_frame(elements), level, "none")
    with Simulator(built.image, built.symbols) as plc:
        assert code_after(plc) == lib.RTSEXCPT_STACK_OVERFLOW, error_name(code_after(plc))


def test_a_frame_of_half_a_megabyte_is_room_enough(tmp_path: Path) -> None:
    built = build(tmp_path, large_frame(131_072))
    with Simulator(built.image, built.symbols) as plc:
        assert code_after(plc) == lib.RTSEXCPT_NOEXCEPTION
