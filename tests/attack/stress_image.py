"""Stress of the process image: two tasks write different bits of one output byte, all inputs and outputs are looked at
for a change within a cycle, while the PC writes inputs and bits beside those of the program.

    stress_image.py                                        10 s on plcrt
    stress_image.py --seconds 600                          10 minutes
    stress_image.py --board mps2-an385 firmware-standard.elf
    stress_image.py --without-copies                       what it looks like when tasks work on the shared areas

Prints what was lost (a bit that one side wrote and another one undid), changed (an input within a cycle) and torn
(words that were written together and seen apart), and exits 1 if anything was.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parents[2]
os.environ.setdefault("PLCRT", str(ROOT / "build/firmware/port/linux/plcrt"))
sys.path[:0] = [str(ROOT / "host"), str(ROOT / "build" / "host"), str(ROOT / "tests" / "target")]

from plctool.compiler import compile_sources  # noqa: E402
from plctool.debug.symbols import symbol_path  # noqa: E402
from plctool.device import Plc, connect  # noqa: E402
from plctool.image.targets import DEFAULT_TARGET  # noqa: E402
from plctool.link.connection import Connection  # noqa: E402
from plctool.testing.plcrt import Plcrt  # noqa: E402

WORDS = 4
TASKS = ("Fast", "Slow")

# Each task keeps the bits that it wrote last and finds them again, or not, in its next cycle. The loops let
# its cycle last so long that others come in between.
PROGRAM = """
VAR_GLOBAL
    in AT %ID0 : ARRAY[1..{words}] OF DWORD;
    out AT %QD1 : ARRAY[1..{words}] OF DWORD;
    fast0 AT %QX0.0 : BOOL; slow0 AT %QX0.1 : BOOL; fast1 AT %QX0.2 : BOOL; slow1 AT %QX0.3 : BOOL;
    pcOut AT %QX0.6 : BOOL;
    mark0 AT %MX0.0 : BOOL; mark1 AT %MX0.2 : BOOL;
    pcMark AT %MX0.6 : BOOL;
{pointer}END_VAR

FUNCTION_BLOCK Watch
VAR
    cycles, lost, changed, torn : UDINT;
    i : DINT;
    first : DWORD;
END_VAR
METHOD Start
VAR_INPUT undone : BOOL; END_VAR
    IF undone THEN lost := lost + 1; END_IF
    first := in[1];
    FOR i := 2 TO {words} DO
        IF in[i] <> first THEN torn := torn + 1; END_IF
        IF out[i] <> out[1] THEN torn := torn + 1; END_IF
    END_FOR
END_METHOD
METHOD Stop
    FOR i := 1 TO {words} DO
        IF in[i] <> first THEN changed := changed + 1; END_IF
    END_FOR
    cycles := cycles + 1;
END_METHOD
END_FUNCTION_BLOCK

PROGRAM FastProgram
VAR w : Watch; a, b : BOOL; i, x : DINT; END_VAR
    w.Start(fast0 <> a OR fast1 <> b OR mark0 <> a OR mark1 <> b);
    FOR i := 0 TO {fast} DO
        x := x XOR (x * 5 + i);
        a := NOT a; fast0 := a; mark0 := a;
        b := i.1; fast1 := b; mark1 := b;
    END_FOR
    w.Stop();
END_PROGRAM

PROGRAM SlowProgram
VAR w : Watch; a, b : BOOL; i, k, x : DINT; n : DWORD; END_VAR
    w.Start(slow0 <> a OR slow1 <> b OR out[1] <> n);
    FOR i := 0 TO {slow} DO
        x := x XOR (x * 5 + i);
        a := NOT a; slow0 := a;
        b := i.2; slow1 := b;
        FOR k := 1 TO {words} DO out[k] := DINT_TO_DWORD(i) + n; END_FOR
    END_FOR
    n := n + 1;
    FOR k := 1 TO {words} DO out[k] := n; END_FOR
    w.Stop();
END_PROGRAM

CONFIGURATION Stress
    RESOURCE Device ON PLC
        TASK FastTask(INTERVAL := T#1ms, PRIORITY := 1);
        TASK SlowTask(INTERVAL := T#7ms, PRIORITY := 5);
        PROGRAM Fast WITH FastTask : FastProgram;
        PROGRAM Slow WITH SlowTask : SlowProgram;
    END_RESOURCE
END_CONFIGURATION
"""
POINTER = "    pointer : POINTER TO DWORD := ADR(in[1]); other : POINTER TO DWORD := ADR(out[1]);\n"


@dataclass
class Counts:
    """What happened. `lost`: bits of the program, `pc_lost`: of the PC."""

    cycles: int = 0
    writes: int = 0
    lost: int = 0
    pc_lost: int = 0
    changed: int = 0
    torn: int = 0

    @property
    def good(self) -> bool:
        return self.lost == self.pc_lost == self.changed == self.torn == 0

    def __str__(self) -> str:
        return (
            f"{self.lost + self.pc_lost} lost ({self.pc_lost} of the PC's), {self.changed} inputs changed, "
            f"{self.torn} torn of {self.cycles} cycles and {self.writes} writes of the PC"
        )


def build(folder: Path, target: str, fast: int, slow: int, *, copies: bool = True) -> Path:
    """The image of the program. `fast`, `slow`: turns of the loops in a cycle."""
    source = folder / "stress.st"
    pointer = "" if copies else POINTER
    source.write_text(PROGRAM.format(words=WORDS, fast=fast, slow=slow, pointer=pointer))
    image = folder / "stress.cdl"
    compile_sources([source], target=target).write(image)
    return image


def stress(plc: Plc, go_on: Callable[[Counts], bool]) -> Counts:
    """Writes inputs and bits while the program runs, until it is stopped."""
    counts = Counts()
    on = False
    while go_on(counts):
        on = not on
        value = counts.writes & 0x7FFFFFFF
        plc.write({"in": [value] * WORDS, "pcOut": on, "pcMark": on})
        counts.writes += 3
        names = [f"{task}.w.{name}" for task in TASKS for name in ("cycles", "lost", "changed", "torn")]
        values = plc.read_all([*names, "pcOut"])
        counts.pc_lost += values["pcOut"] is not on
        counts.cycles = sum(values[f"{task}.w.cycles"] for task in TASKS)
        counts.lost = sum(values[f"{task}.w.lost"] for task in TASKS)
        counts.changed = sum(values[f"{task}.w.changed"] for task in TASKS)
        counts.torn = sum(values[f"{task}.w.torn"] for task in TASKS)
    return counts


def for_seconds(seconds: float) -> Callable[[Counts], bool]:
    end = time.monotonic() + seconds
    return lambda counts: time.monotonic() < end


def for_cycles(cycles: int) -> Callable[[Counts], bool]:
    return lambda counts: counts.cycles < cycles


def on_plcrt(folder: Path, go_on: Callable[[Counts], bool], *, copies: bool = True) -> Counts:
    """On a plcrt process of its own."""
    image = build(folder, DEFAULT_TARGET, 2000, 100_000, copies=copies)
    with Plcrt(folder / "plc.flash") as running, connect(f"serial:{running.port}") as plc:
        plc.flash(image)
        return stress(plc, go_on)


def on_board(
    machine: str, firmware: Path, folder: Path, go_on: Callable[[Counts], bool], *, copies: bool = True
) -> Counts:
    """On a firmware in QEMU."""
    from environment import TARGETS
    from qemu import Board

    image = build(folder, TARGETS[machine], 200, 20_000, copies=copies)
    with Board(machine, firmware, folder) as board, Plc(Connection(board.line()), symbol_path(image)) as plc:
        plc.flash(image)
        return stress(plc, go_on)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=10)
    parser.add_argument("--board", nargs=2, metavar=("MACHINE", "FIRMWARE"), help="in QEMU instead of on plcrt")
    parser.add_argument("--without-copies", action="store_true")
    args = parser.parse_args()
    go_on, copies = for_seconds(args.seconds), not args.without_copies
    with TemporaryDirectory() as name:
        folder = Path(name)
        if args.board:
            machine, firmware = args.board
            counts = on_board(machine, Path(firmware).resolve(), folder, go_on, copies=copies)
        else:
            counts = on_plcrt(folder, go_on, copies=copies)
    print(f"{args.board[0] if args.board else 'plcrt'}: {counts}")
    return 0 if counts.good else 1


if __name__ == "__main__":
    sys.exit(main())
