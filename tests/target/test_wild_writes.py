"""A program that writes where it must not, where the MPU keeps it from doing so: it is stopped, the place is named,
nothing was changed; and who keeps to its own memory does not notice that there is an MPU."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from environment import IS_RISCV, MACHINE
from programs import FAST_AND_SLOW, Built, program
from qemu import Board

from plctool.core import lib
from plctool.debug.symbols import symbol_path
from plctool.device import Plc
from plctool.link.connection import Connection
from plctool.link.services import AppState
from plctool.testing.waiting import eventually

STATEMENT = "p^ := 16#5A5A_A5A5;"
TEXT = FAST_AND_SLOW.format(
    variables="home, distance : DINT; p : POINTER TO DINT;",
    fault=f"trip := FALSE;\np := ADR(home) + distance; (* from home *)\n{STATEMENT}",
)
LINE = TEXT.split("\n").index(STATEMENT) + 1
STACK_SIZE = 2048  # of a task, in the full configuration
PERIPHERAL = 0x0200_0000 if IS_RISCV else 0x4000_0000  # the software interrupt; a timer or the watchdog
REGISTER = 0xE000_ED08  # VTOR

# What it must not write: where that is.
TARGETS: dict[str, Callable[[Board], int]] = {
    "variables": lambda board: board.address_of("tasks"),
    "initialised variables": lambda board: board.address_of("data_start"),
    "saved retain values": lambda board: board.address_of("saved_area"),
    "past the areas": lambda board: board.address_of("areas_end"),
    "main stack": lambda board: board.address_of("stack_top") - 64,
    "stack of the task below": lambda board: board.address_of("areas_start") - 64,
    "stack of a task above": lambda board: board.address_of("stacks") + STACK_SIZE // 2,
    "vectors": lambda board: 0x40,
    "code of the runtime": lambda board: board.address_of("IecCall") & ~3,
    "peripheral": lambda board: PERIPHERAL,
}
if MACHINE.startswith("mps2"):  # QEMU's model of the other one passes over what the bus refuses; RISC-V has none there
    TARGETS["register of the processor"] = lambda board: REGISTER


@pytest.fixture
def full(make_board: Callable[..., Board]) -> Board:
    """A board with the full configuration, on."""
    board = make_board("full")
    board.power_on()
    return board


def address_of(board: Board, built: Built, name: str) -> int:
    """Of a variable in the data area."""
    symbol = built.symbols.resolve(name)
    assert symbol.area == lib.APP_AREA_DATA
    return board.address_of("areas") + symbol.offset


@pytest.mark.parametrize("target", TARGETS)
def test_wild_write_is_stopped_and_changes_nothing(full: Board, build: Callable[[str], Built], target: str) -> None:
    built = build(TEXT)
    where = TARGETS[target](full)
    distance = where - address_of(full, built, "Main.home")
    with Plc(Connection(full.line()), symbol_path(built.path)) as plc:
        plc.flash(built.path)
        eventually(lambda: plc.read("finished") > 1)
        plc.write({"Main.distance": (distance + 2**31) % 2**32 - 2**31, "Main.trip": True})
        eventually(lambda: plc.status().state is AppState.EXCEPTION)

        exception = plc.status().exception
        assert (exception.name, exception.task) == ("ACCESS_VIOLATION", "Fast")
        assert (exception.pou, exception.line) == ("Main", LINE)
        assert plc.read("begun") == plc.read("finished"), "the task that was interrupted finishes its cycle"
        if where not in (PERIPHERAL, REGISTER):
            assert int.from_bytes(full.read_memory(where, 4), "little") != 0x5A5A_A5A5

        plc.reset("warm")
        plc.start()
        eventually(lambda: plc.read("finished") > 1)
        assert plc.status().state is AppState.RUN


def test_pointer_within_the_areas_may_be_written(full: Board, build: Callable[[str], Built]) -> None:
    text = TEXT.replace("trip : BOOL;", "trip : BOOL;\n    far : ARRAY[0..3900] OF DINT;")
    built = build(text)
    distance = address_of(full, built, "Main.far") + 3900 * 4 - address_of(full, built, "Main.home")
    with Plc(Connection(full.line()), symbol_path(built.path)) as plc:
        plc.flash(built.path)
        plc.write({"Main.distance": distance, "Main.trip": True})
        eventually(lambda: plc.read("Main.far[3900]") == 0x5A5A_A5A5)
        assert plc.status().state is AppState.RUN


def test_frame_that_is_larger_than_the_stack_names_the_task_s_code(full: Board, build: Callable[[str], Built]) -> None:
    text = """
FUNCTION Large : DINT
VAR_INPUT i : DINT; END_VAR
VAR f : ARRAY[0..599] OF DINT; END_VAR
f[i] := i;
Large := f[i + 1] + f[i];
END_FUNCTION
""" + program("VAR x : DINT; trip : BOOL; END_VAR", "IF trip THEN x := Large(x); END_IF")
    with Plc(Connection(full.line())) as plc:
        plc.flash(build(text).path)
        plc.write({"Main.trip": True})
        eventually(lambda: plc.status().state is AppState.EXCEPTION)
        exception = plc.status().exception
        assert exception.name == "STACK_OVERFLOW"
        assert exception.pou in ("Main", "Large")


# The runtime asks the flash, by a gate, whether there is a value: on the LM3S6965 that is hardware.
def test_initial_value_that_is_calculated_gives_way_to_one_that_is_kept(full: Board, build) -> None:
    text = """
FUNCTION Start : DINT
VAR_INPUT n : DINT; END_VAR
Start := n * 7;
END_FUNCTION
""" + program("VAR RETAIN kept : DINT := Start(6); END_VAR VAR n : DINT; END_VAR", "n := n + 1;")
    with Plc(Connection(full.line())) as plc:
        plc.flash(build(text).path)
        assert plc.read("Main.kept") == 42
        plc.write({"Main.kept": 4711})
        plc.stop()  # saves
        plc.reset("warm")
        plc.start()
        eventually(lambda: plc.read("Main.n") > 1)
        assert plc.read("Main.kept") == 4711
        plc.reset("cold")
        plc.start()
        assert plc.read("Main.kept") == 42


def test_mathematics_that_overflows_writes_nothing_of_its_own(full: Board, build) -> None:
    """C libraries have a variable for errors, which the program may not write."""
    text = program(
        "VAR x : REAL := 1000.0; big, bad : REAL; l : LREAL := 1000.0; lbig : LREAL; n : DINT; END_VAR",
        "big := EXP(x); bad := LN(-x); lbig := EXP(l); lbig := lbig + SIN(l); n := n + 1;",
    )
    with Plc(Connection(full.line())) as plc:
        plc.flash(build(text).path)
        eventually(lambda: plc.read("Main.n") > 3)
        assert plc.read("Main.big") == float("inf")
        assert plc.status().state is AppState.RUN


def test_program_runs_while_the_flash_is_written(full: Board, build) -> None:
    """The MPU lets main write the flash then, from which the program runs."""
    text = program(
        "VAR n, i : DINT; END_VAR VAR RETAIN kept : DINT; END_VAR",
        "n := n + 1; kept := kept + 1; FOR i := 0 TO 500 DO n := n * 1; END_FOR",
    )
    with Plc(Connection(full.line())) as plc:
        plc.flash(build(text).path)
        for _ in range(3):
            eventually(lambda: plc.read("Main.n") > 50)
            plc.flash(build(text).path)
        assert plc.status().state is AppState.RUN
