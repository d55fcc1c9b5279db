"""What programs do wrong: the application stops and says where, the controller goes on.

Each fault happens in a task of 1 ms that has interrupted one of 10 ms.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from environment import HAS_FPU, IEC_STACK_SIZE, IS_RISCV, TARGET
from programs import FAST_AND_SLOW, Built, compile_text

from plctool.core import lib
from plctool.debug.symbols import symbol_path
from plctool.device import Plc
from plctool.errors import LinkError
from plctool.image.file import parse_image
from plctool.link.connection import Connection
from plctool.link.services import AppState
from plctool.testing.waiting import eventually

FUNCTION = """
FUNCTION Large : DINT
VAR_INPUT
    i : DINT;
END_VAR
VAR
    f : ARRAY[0..{last}] OF DINT;
END_VAR
f[i] := i;
Large := f[i + 1] + f[i];
END_FUNCTION
"""


@dataclass(frozen=True)
class Fault:
    """What goes wrong by which statement, and what it is called. `spoil` changes the image before it is flashed."""

    statement: str
    exception: str
    variables: str = ""
    checks: str = "all"
    before: str = ""
    spoil: Callable[[Built, int], bytes] = lambda built, line: built.image

    @property
    def text(self) -> str:
        return self.before + FAST_AND_SLOW.format(variables=self.variables, fault=self.statement)

    @property
    def line(self) -> int:
        return self.text.split("\n").index(self.statement) + 1


def undefined_instruction(built: Built, line: int) -> bytes:
    """As if the flash had lost some bits, or the compiler its mind: what a line compiles to is no instruction."""
    offset = next(offset for offset, _, number in built.symbols.lines if number == line)
    image = bytearray(built.image)
    at = image.index(parse_image(built.image).code) + offset
    image[at : at + 2] = b"\x00\x00" if IS_RISCV else b"\x00\xde"
    crc = slice(lib.CDL_CRC_OFFSET, lib.CDL_CRC_OFFSET + 4)
    image[crc] = bytes(4)
    image[crc] = zlib.crc32(image).to_bytes(4, "little")
    return bytes(image)


FAR = "f : ARRAY[0..3] OF DINT; i : DINT := 16#1800_0000;"  # in steps of 4 bytes from RAM to where nothing is

FAULTS = {
    "division by zero": Fault("x := n / x;", "DIVIDEBYZERO"),
    "array bounds": Fault("f[i] := 1;", "ARRAYBOUNDS", "f : ARRAY[0..3] OF INT; i : INT := 9;"),
    "null reference": Fault("p^ := 1;", "ACCESS_VIOLATION", "p : POINTER TO DINT;"),
    "null reference, unchecked": Fault("p^ := 1;", "ACCESS_VIOLATION", "p : POINTER TO DINT;", "none"),
    "bus fault, write": Fault("f[i] := 1;", "ACCESS_VIOLATION", FAR, "none"),
    "bus fault, read": Fault("x := f[i];", "ACCESS_VIOLATION", FAR, "none"),
    "undefined instruction": Fault("x := 4711;", "ILLEGAL_INSTRUCTION", spoil=undefined_instruction),
    "stack overflow": Fault(
        "x := Large(n);", "STACK_OVERFLOW", checks="none", before=FUNCTION.format(last=IEC_STACK_SIZE // 4 + 43)
    ),
    "stack overflow, past all stacks": Fault(
        "x := Large(n);", "STACK_OVERFLOW", checks="none", before=FUNCTION.format(last=999)
    ),
    "endless loop": Fault("WHILE trip DO x := x + 1; END_WHILE", "WATCHDOG"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_fault_stops_the_application_and_nothing_else(board, tmp_path: Path, name: str) -> None:
    fault = FAULTS[name]
    built = compile_text(fault.text, TARGET, tmp_path, checks=fault.checks)
    image = fault.spoil(built, fault.line)
    with Plc(Connection(board.line()), spoiled_symbols(built, image)) as plc:
        plc.flash(image)
        eventually(lambda: plc.read("finished") > 1)
        plc.write({"Main.trip": True})
        eventually(lambda: has_stopped(plc))

        exception = plc.status().exception
        assert (exception.name, exception.task) == (fault.exception, "Fast")
        if name == "stack overflow":  # the function that has no room may have become part of Main
            assert exception.pou in ("Main", "Large")
        elif name != "stack overflow, past all stacks":  # with it the processor has lost where it was
            assert (exception.pou, exception.line) == ("Main", fault.line)
        assert plc.log()[-1].text.startswith("Fast: ")
        assert plc.read("begun") == plc.read("finished"), "the task that was interrupted finishes its cycle"

        plc.reset("warm")
        plc.start()
        eventually(lambda: plc.read("finished") > 1)
        assert plc.status().state is AppState.RUN


def spoiled_symbols(built: Built, image: bytes) -> Path:
    """The symbols for an image that was changed."""
    if image == built.image:
        return symbol_path(built.path)
    crc = int.from_bytes(image[lib.CDL_CRC_OFFSET : lib.CDL_CRC_OFFSET + 4], "little")
    path = built.path.with_suffix(".spoiled.sym")
    replace(built.symbols, image_crc=crc).save(path)
    return path


# A watchdog of the task's own may make the 2 s of the default less, but not more: communication waits as long.
@pytest.mark.parametrize("watchdog", ["", ", WATCHDOG := T#30m, SENSITIVITY := 1000"])
def test_endless_loop_is_broken_while_a_faster_task_goes_on(make_board, build, watchdog) -> None:
    statement = "WHILE trip DO x := x + 1; END_WHILE"
    text = f"""
VAR_GLOBAL
    count : DINT; (* cycles of the fast task *)
END_VAR
PROGRAM Count
count := count + 1;
END_PROGRAM
PROGRAM Main
VAR
    n, x, before : DINT;
    trip : BOOL;
END_VAR
n := n + 1;
before := count;
{statement}
END_PROGRAM
CONFIGURATION Config
    RESOURCE Res ON PLC
        TASK Fast(INTERVAL := T#1ms, PRIORITY := 1);
        TASK Slow(INTERVAL := T#10ms, PRIORITY := 5{watchdog});
        PROGRAM Count WITH Fast : Count;
        PROGRAM Main WITH Slow : Main;
    END_RESOURCE
END_CONFIGURATION
"""
    board = make_board()
    board.power_on("slow")
    with Plc(Connection(board.line())) as plc:
        plc.flash(build(text).path)
        eventually(lambda: plc.read("Main.n") > 1)
        plc.write({"Main.trip": True})
        eventually(lambda: has_stopped(plc))
        exception = plc.status().exception
        assert (exception.name, exception.task, exception.pou) == ("WATCHDOG", "Slow", "Main")
        assert exception.line == text.split("\n").index(statement) + 1
        assert plc.read("count") > plc.read("Main.before") + 1800, "cycles in the 2 s of the default watchdog"
        plc.reset("warm")
        plc.start()
        eventually(lambda: plc.read("Main.n") > 1)


def test_endless_loops_in_two_tasks_are_both_broken(make_board, build) -> None:
    loop = "WHILE trip DO x := x + 1; END_WHILE"
    text = FAST_AND_SLOW.format(variables="", fault=loop).replace("END_FOR", f"END_FOR\n{loop}", 1)
    # One variable for both: a task may come between two writes.
    text = text.replace("    trip : BOOL;\n", "").replace("finished : DINT;", "finished : DINT; trip : BOOL;")
    board = make_board()
    board.power_on("slow")
    with Plc(Connection(board.line())) as plc:
        plc.flash(build(text).path)
        eventually(lambda: plc.read("finished") > 1)
        plc.write({"trip": True})
        eventually(lambda: has_stopped(plc))
        assert plc.status().exception.task == "Fast", "the one that interrupted the other comes first"
        assert plc.read("begun") == plc.read("finished") + 1
        plc.reset("warm")
        plc.start()
        eventually(lambda: plc.read("finished") > 1)


def has_stopped(plc: Plc) -> bool:
    """Whether an exception stopped the application. The device does not answer before an endless loop was broken."""
    with suppress(LinkError):
        return plc.status().state is AppState.EXCEPTION
    return False


def test_two_tasks_with_real_arithmetic_do_not_disturb_each_other(plc, build) -> None:
    """Each computes the same over and over; a register that the other one has changed makes it another result."""
    text = """
FUNCTION Series : REAL
VAR_INPUT
    first, factor : REAL;
    count : DINT;
END_VAR
VAR
    i : DINT;
    a, b, c : REAL;
END_VAR
a := first;
b := factor;
c := 1.0;
FOR i := 1 TO count DO
    a := a * factor + b;
    b := b - a * 0.125;
    c := c + a * b;
END_FOR
Series := a + b + c;
END_FUNCTION
FUNCTION_BLOCK Calculation
VAR_INPUT
    first, factor : REAL;
    count : DINT;
END_VAR
VAR
    expected, result : REAL;
    n, wrong : DINT;
END_VAR
result := Series(first, factor, count);
IF n = 0 THEN
    expected := result;
ELSIF result <> expected THEN
    wrong := wrong + 1;
END_IF
n := n + 1;
END_FUNCTION_BLOCK
PROGRAM Fast
VAR
    it : Calculation;
END_VAR
it(first := 3.5, factor := 0.75, count := 20);
END_PROGRAM
PROGRAM Slow
VAR
    it : Calculation;
END_VAR
it(first := -1.25, factor := 0.5, count := LOOPS);
END_PROGRAM
CONFIGURATION Config
    RESOURCE Res ON PLC
        TASK FastTask(INTERVAL := T#1ms, PRIORITY := 1);
        TASK SlowTask(INTERVAL := T#10ms, PRIORITY := 5);
        PROGRAM Fast WITH FastTask : Fast;
        PROGRAM Slow WITH SlowTask : Slow;
    END_RESOURCE
END_CONFIGURATION
"""
    loops = 60_000 if HAS_FPU else 2_000
    plc.flash(build(text.replace("LOOPS", str(loops))).path)
    eventually(lambda: plc.read("Slow.it.n") > 100)
    values = plc.read_all(["Fast.it.wrong", "Slow.it.wrong"])
    assert list(values.values()) == [0, 0]
    fast, slow = plc.tasks()
    assert slow.min_us > 2000, "the slow one has to be interrupted in every cycle"
    assert fast.cycles > 5 * slow.cycles
