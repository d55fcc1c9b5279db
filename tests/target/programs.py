"""Programs for the tests, compiled for a board."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from pathlib import Path

from plctool.compiler import Level, compile_sources
from plctool.debug.symbols import SymbolTable, symbol_path


@dataclass(frozen=True)
class Built:
    """An image, its file with the symbol file beside it, and the symbols."""

    image: bytes
    path: Path
    symbols: SymbolTable


def compile_text(text: str, target: str, folder: Path, checks: str = "all", level: Level = 2) -> Built:
    """Compiles `text`; the files go to `folder`."""
    source = folder / f"{zlib.crc32(text.encode()):08x}.st"
    source.write_text(text)
    built = compile_sources([source], target=target, checks=checks, level=level, limits=False)
    path = source.with_suffix(".cdl")
    path.write_bytes(built.image)
    built.symbols.save(symbol_path(path))
    return Built(built.image, path, built.symbols)


def program(variables: str, body: str, interval: str = "T#1ms") -> str:
    """One PROGRAM Main in one cyclic task Fast."""
    return f"""
PROGRAM Main
{variables}
{body}
END_PROGRAM
CONFIGURATION Config
    RESOURCE Res ON PLC
        TASK Fast(INTERVAL := {interval}, PRIORITY := 1);
        PROGRAM Main WITH Fast : Main;
    END_RESOURCE
END_CONFIGURATION
"""


COUNTER = program("VAR n : DINT; END_VAR VAR RETAIN kept : DINT; END_VAR", "n := n + 1; kept := kept + 1;")

TWO_TASKS = """
PROGRAM Count
VAR
    n : DINT;
END_VAR
n := n + 1;
END_PROGRAM
PROGRAM Long
VAR
    n : DINT;
    i : DINT;
    x : DINT;
END_VAR
FOR i := 1 TO 100000 DO
    x := x XOR (x * 5 + i);
END_FOR
n := n + 1;
END_PROGRAM
CONFIGURATION Config
    RESOURCE Res ON PLC
        TASK FastTask(INTERVAL := T#1ms, PRIORITY := 1);
        TASK SlowTask(INTERVAL := T#10ms, PRIORITY := 5);
        PROGRAM Fast WITH FastTask : Count;
        PROGRAM Slow WITH SlowTask : Long;
    END_RESOURCE
END_CONFIGURATION
"""

# A fast task that interrupts a slow one: when `trip` is set it does `fault` in the middle of a cycle of the slow one.
FAST_AND_SLOW = """
VAR_GLOBAL
    begun, finished : DINT; (* cycles of the slow task *)
END_VAR
PROGRAM Main
VAR
    n, x : DINT;
    trip : BOOL;
    {variables}
END_VAR
n := n + 1;
IF trip AND begun <> finished THEN
{fault}
END_IF
END_PROGRAM
PROGRAM Long
VAR
    i, x : DINT;
END_VAR
begun := begun + 1;
FOR i := 1 TO 50_000 DO
    x := x XOR (x * 5 + i);
END_FOR
finished := finished + 1;
END_PROGRAM
CONFIGURATION Config
    RESOURCE Res ON PLC
        TASK Fast(INTERVAL := T#1ms, PRIORITY := 1);
        TASK Slow(INTERVAL := T#10ms, PRIORITY := 5);
        PROGRAM Main WITH Fast : Main;
        PROGRAM Long WITH Slow : Long;
    END_RESOURCE
END_CONFIGURATION
"""
