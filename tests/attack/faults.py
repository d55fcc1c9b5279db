"""Bad programs: every fault in every place where the code of a program runs."""

from __future__ import annotations

import platform
import zlib
from dataclasses import dataclass

from plctool.core import lib
from plctool.image.file import parse_image


@dataclass(frozen=True)
class Fault:
    """What goes wrong: statements of a FUNCTION, with its variables and what else they need. `always`: it shows before
    the program can have proven itself."""

    statements: str
    variables: str = ""
    units: str = ""
    always: bool = False


def _fill(size: int, value: int) -> Fault:
    """A local array of 40 bytes is filled as if it had `size`."""
    return Fault(
        f"MEMSET(ADR(buffer), BYTE#{value}, none + UDINT#{size}); Fault := buffer[3];", "buffer : ARRAY[0..9] OF DINT;"
    )


def _stores(step: str) -> Fault:
    return Fault(
        f"p := ADR(global); FOR i := 0 TO 2000000 DO p := p {step}; p^ := -1; END_FOR",
        "p : POINTER TO DINT; i : DINT;",
    )


_RECURSION = """
FUNCTION_BLOCK Deep
VAR n : DINT; END_VAR
METHOD Down : DINT
VAR_INPUT me : POINTER TO Deep; k : DINT; END_VAR
Down := me^.Down(me := me, k := k + 1) / 3 + n;
END_METHOD
END_FUNCTION_BLOCK
"""

# What a program written in ST can do. The compiler does not know that `none` is 0 and `ten` 10.
FAULTS = {
    "division by zero": Fault("Fault := 1 / zero;", "zero : DINT;"),
    "index out of bounds": Fault("a[ten] := 1; Fault := a[0];", "a : ARRAY[0..9] OF DINT;"),
    "store through NULL": Fault("p^ := 1;", "p : POINTER TO DINT;"),
    "read from nowhere": Fault("p := ADR(global); p := p + 16#7000_0000_0000; Fault := p^;", "p : POINTER TO DINT;"),
    "store to nowhere": Fault("p := ADR(global); p := p + 16#7000_0000_0000; p^ := 1;", "p : POINTER TO DINT;"),
    "stores past its variables": _stores("+ 4"),
    "stores before its variables": _stores("- 4"),
    "MEMSET of 100 MB": Fault("MEMSET(ADR(global), BYTE#255, none + UDINT#100000000);"),
    "MEMCPY of 4 GB": Fault("MEMCPY(ADR(global), ADR(global) + 100, none + UDINT#4294967295);"),
    "local overrun of 4 bytes": _fill(44, 255),
    "local overrun of 20 bytes": _fill(60, 0),
    "local overrun of 9 MB": _fill(9_000_000, 255),
    "local underrun": Fault(
        "MEMSET(ADR(buffer) - 4000, BYTE#255, none + UDINT#4000); Fault := buffer[3];", "buffer : ARRAY[0..9] OF DINT;"
    ),
    "endless loop": Fault("WHILE TRUE DO Fault := Fault + ten; END_WHILE"),
    "endless recursion": Fault("Fault := deep.Down(me := ADR(deep), k := ten);", "deep : Deep;", _RECURSION),
    "frame of 17 MB": Fault(
        "f[ten] := 1; f[ten * 400000] := 2; Fault := f[ten * 200000];", "f : ARRAY[0..4259839] OF DINT;", always=True
    ),
}

# What only a program can do that did not come from this compiler, by what its code begins with.
MACHINE_CODE = {
    "x86_64": {
        "illegal instruction": "0F 0B",
        "breakpoint": "CC",
        "privileged instruction": "F4",
        "jump to NULL": "31 C0 FF E0",
        "jump to nowhere": "B8 78 56 34 12 FF E0",
        "stack pointer lost": "31 E4 50",
        "stack overwritten upwards": "48 89 E7 B9 00 00 10 00 31 C0 FC F3 AA",
        "direction flag left set": "FD C3",
        "alignment check left set": "9C 81 0C 24 00 00 04 00 9D C3",
        "floating-point exceptions left on": "6A 00 0F AE 14 24 58 C3",
        "single step": "9C 81 0C 24 00 01 00 00 9D 90 C3",
        "end of the process": "B8 E7 00 00 00 31 FF 0F 05",
    },
    "aarch64": {
        "illegal instruction": "00 00 00 00",
        "breakpoint": "00 00 20 D4",
        "jump to NULL": "00 00 80 D2 00 00 1F D6",
        "end of the process": "C8 0B 80 D2 00 00 80 D2 01 00 00 D4",
    },
}.get(platform.machine(), {})

_PROGRAM = """
{fault.units}
VAR_GLOBAL
    global : DINT;
    ten : DINT := 10;
    none : UDINT;
    edge : BOOL;
END_VAR
VAR_GLOBAL {kept}
    trip : BOOL := {trip};
END_VAR
FUNCTION Fault : DINT
VAR_INPUT on : BOOL; END_VAR
VAR {fault.variables} END_VAR
IF on THEN
    {fault.statements}
END_IF
END_FUNCTION
{place.units}
PROGRAM Main
VAR
    n : DINT;
    {place.variables}
END_VAR
n := n + 1;
edge := NOT edge;
{place.statements}
END_PROGRAM
PROGRAM Other
VAR n : DINT; END_VAR
n := {place.other};
END_PROGRAM
CONFIGURATION Config
    RESOURCE Res ON PLC
        TASK Cyclic(INTERVAL := T#10ms, PRIORITY := 1, WATCHDOG := T#100ms);
        TASK Second({place.task}PRIORITY := 5, WATCHDOG := T#100ms);
        PROGRAM Main WITH Cyclic : Main;
        PROGRAM Other WITH Second : Other;
    END_RESOURCE
END_CONFIGURATION
"""

_BLOCK = """
FUNCTION_BLOCK Holder
VAR n : DINT; END_VAR
METHOD {method} : BOOL
VAR_INPUT {inputs} END_VAR
n := Fault(trip);
END_METHOD
END_FUNCTION_BLOCK
"""


@dataclass(frozen=True)
class Place:
    """Where it happens: in a cycle of Main, in the task of Other, or outside of cycles."""

    variables: str = ""
    statements: str = ""
    other: str = "n + 1"
    task: str = "INTERVAL := T#20ms, "
    units: str = ""
    in_cycle: bool = True


PLACES = {
    "cyclic task": Place(statements="n := Fault(trip);"),
    "event task": Place(other="Fault(trip)", task="SINGLE := edge, "),
    "freewheeling task": Place(other="Fault(trip)", task=""),
    "initial value": Place(variables="v : DINT := Fault(trip);", in_cycle=False),
    "FB_Init": Place(
        variables="holder : Holder;",
        units=_BLOCK.format(method="FB_Init", inputs="bInitRetains : BOOL; bInCopyCode : BOOL;"),
        in_cycle=False,
    ),
    "FB_Exit": Place(
        variables="holder : Holder;",
        units=_BLOCK.format(method="FB_Exit", inputs="bInCopyCode : BOOL;"),
        in_cycle=False,
    ),
}


def source(fault: str, place: str, proven: bool) -> str:
    """A program with a fault. One that shall prove itself first trips when its retain variable `trip` is set."""
    kept, trip = ("RETAIN", "FALSE") if proven else ("", "TRUE")
    return _PROGRAM.format(fault=FAULTS[fault], place=PLACES[place], kept=kept, trip=trip)


HARMLESS = Fault("Fault := ten;")


def frame(place: str) -> str:
    """The program that machine code is put into."""
    return _PROGRAM.format(fault=HARMLESS, place=PLACES[place], kept="", trip="TRUE")


_ENTRY = {
    "initial value": lib.CDL_FUNCTION_GLOBAL_INIT,
    "FB_Init": lib.CDL_FUNCTION_GLOBAL_INIT,
    "FB_Exit": lib.CDL_FUNCTION_GLOBAL_EXIT,
}


def with_machine_code(image: bytes, fault: str, place: str) -> bytes:
    """The image with a fault in place of the first instructions that run at `place`."""
    parsed = parse_image(image)
    if place in _ENTRY:
        entry = parsed.functions[int(_ENTRY[place])]
    else:
        entry = parsed.tasks[0 if place == "cyclic task" else 1].entry
    code = bytes.fromhex(MACHINE_CODE[fault])
    at = image.index(parsed.code) + entry
    changed = bytearray(image)
    changed[at : at + len(code)] = code
    return with_crc(changed)


def with_crc(image: bytearray) -> bytes:
    """The image with a CRC that is right."""
    at = int(lib.CDL_CRC_OFFSET)
    image[at : at + 4] = bytes(4)
    image[at : at + 4] = zlib.crc32(image).to_bytes(4, "little")
    return bytes(image)
