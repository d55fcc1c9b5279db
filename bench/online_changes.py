"""Measures online changes on plcrt: how long the program pauses while 1 000 instances move, and how long it takes from
an edit in 10 000 lines until the changed program runs. A pointer leads to each instance."""

from __future__ import annotations

import re
import tempfile
import time
from pathlib import Path

from plctool import connect
from plctool.compiler import build, program_files
from plctool.compiler.kept.kept_build import KeptBuild
from plctool.compiler.sources.request import BuildRequest
from plctool.debug.symbols import SymbolTable
from plctool.device import Plc
from plctool.testing.plcrt import Plcrt

INSTANCES = 1000
_PAUSE = re.compile(r"Tasks waited (\d+) us")


def _source(members: str) -> str:
    return f"""FUNCTION_BLOCK Motor VAR_INPUT speed : REAL := 3.0; END_VAR VAR {members} END_VAR hours := hours + speed;
END_FUNCTION_BLOCK
PROGRAM Main VAR n : DINT; motors : ARRAY[1..{INSTANCES}] OF Motor; to : ARRAY[1..{INSTANCES}] OF POINTER TO Motor;
i : DINT; END_VAR
IF n < {INSTANCES} THEN n := n + 1; to[n] := ADR(motors[n]); END_IF motors[1 + i MOD {INSTANCES}](); i := i + 1;
END_PROGRAM
CONFIGURATION C RESOURCE R ON PLC TASK T(INTERVAL := T#1ms, PRIORITY := 1); PROGRAM Main WITH T : Main;
END_RESOURCE END_CONFIGURATION"""


def measure() -> tuple[int, float]:
    """Returns the time that tasks waited for the exchange [us], and the time of the whole change [s]."""
    with tempfile.TemporaryDirectory() as name, Plcrt(Path(name) / "plc.flash", "--tcp", "0") as plcrt:
        folder = Path(name)

        def built(members: str, base: SymbolTable | None = None) -> tuple[bytes, SymbolTable]:
            file = folder / "bench.st"
            file.write_text(_source(members))
            result = build(BuildRequest(program_files([file]), base=base))
            return result.image, result.symbols

        with connect(f"tcp:{plcrt.tcp}") as plc:
            assert isinstance(plc, Plc)
            image, symbols = built("hours : REAL;")
            plc.add_symbols(symbols)
            plc.flash(image)
            while plc.read("Main.n") < INSTANCES:
                time.sleep(0.1)
            image, symbols = built("limit : LREAL := 9.5; hours : REAL;", symbols)
            plc.add_symbols(symbols)
            seconds = plc.change(image).seconds
            assert plc.read(f"Main.to[{INSTANCES}]^.limit") == 9.5
            (pause,) = _pauses(plc)
            return pause, seconds


def _pauses(plc: Plc) -> list[int]:
    return [int(found[1]) for found in (_PAUSE.search(entry.text) for entry in plc.log()) if found is not None]


BLOCKS, LINES = 200, 44  # of each block: 10 000 lines in all


def _write_large(folder: Path, edited: int) -> list[Path]:
    """Writes a program with a file for each block; only one of them changes."""
    lines = "\n".join(f"    n := n * {line} + {line};" for line in range(LINES))
    for number in range(BLOCKS):
        text = f"FUNCTION_BLOCK B{number}\nVAR n : DINT; END_VAR\n{lines}\nEND_FUNCTION_BLOCK\n"
        (folder / f"b{number}.st").write_text(text.replace("n * 3 + 3", f"n * 3 + {edited if number == 7 else 3}"))
    instances = "".join(f"    b{number} : B{number};\n" for number in range(BLOCKS))
    calls = "".join(f"b{number}();\n" for number in range(BLOCKS))
    (folder / "main.st").write_text(f"""PROGRAM Main
VAR
{instances}END_VAR
{calls}END_PROGRAM
CONFIGURATION C RESOURCE R ON PLC TASK T(INTERVAL := T#1ms, PRIORITY := 1); PROGRAM Main WITH T : Main;
END_RESOURCE END_CONFIGURATION
""")
    return sorted(folder.glob("*.st"))


def measure_edits(edits: int = 5) -> tuple[int, list[float], list[int]]:
    """Returns the lines of the program, the seconds from each edit of it until it runs, as `--watch` does it, and the
    times that tasks waited for the exchanges [us]."""
    with tempfile.TemporaryDirectory() as name, Plcrt(Path(name) / "plc.flash", "--tcp", "0") as plcrt:
        kept, seconds = KeptBuild(), []
        with connect(f"tcp:{plcrt.tcp}") as plc:
            assert isinstance(plc, Plc)
            symbols = None
            for edited in range(edits + 1):
                files = _write_large(Path(name), edited)
                begin = time.monotonic()
                result = build(BuildRequest(program_files(files), base=symbols, cache=True), kept=kept)
                plc.add_symbols(result.symbols)
                if symbols is None:
                    plc.flash(result.image)
                else:
                    plc.change(result.image)
                    seconds.append(time.monotonic() - begin)
                symbols = result.symbols
            return sum(file.read_text().count("\n") for file in files), seconds, _pauses(plc)


def main() -> None:
    pause, seconds = measure()
    print(f"\nonline change on plcrt, a task of 1 ms, {INSTANCES} instances grow and move, and as many pointers")
    print(f"  pause for moving 1 000 instances: {pause} us; in all {seconds:.2f} s")
    lines, edits, pauses = measure_edits()
    print(f"  {lines} lines in {BLOCKS + 1} files, one edited: runs after {min(edits):.2f} to {max(edits):.2f} s")
    print(f"  pause when nothing moves: {min(pauses)} to {max(pauses)} us; one of less than 1 ms loses no cycle")
