"""The pause of an online change that moves 1 000 instances, each with a pointer to it: how long the 1 ms task of
plcrt cannot begin a cycle, as the log says, and the time until the program has changed."""

from __future__ import annotations

import re
import tempfile
import time
from pathlib import Path

from plctool import connect
from plctool.compiler import build, program_files
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
            texts = [entry.text for entry in plc.log()]
            (pause,) = [found[1] for found in map(_PAUSE.search, texts) if found is not None]
            return int(pause), seconds


def main() -> None:
    pause, seconds = measure()
    print(f"\nonline change on plcrt, a task of 1 ms, {INSTANCES} instances grow and move, and as many pointers")
    print(f"  pause for moving 1 000 instances: {pause} us; in all {seconds:.2f} s")
