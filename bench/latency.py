"""How long a read takes over TCP on this machine, idle and beside programs that leave the processor no rest."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import plctool
from plctool.compiler import compile_sources
from plctool.testing.plcrt import Plcrt

READS = 300
_LOOP = "FOR i := 1 TO 20000000 DO x := SQRT(x + 1.5); END_FOR"  # some 100 ms


def program(task: str, body: str) -> str:
    return f"""PROGRAM Main
VAR n, i : DINT; x : LREAL; END_VAR
n := n + 1;
{body}
END_PROGRAM
CONFIGURATION c RESOURCE r ON PLC
{task}
END_RESOURCE END_CONFIGURATION
"""


PROGRAMS = {
    "idle, a task every 10 ms": program(
        "TASK t(INTERVAL := T#10ms, PRIORITY := 1); PROGRAM Main WITH t : Main;", "x := n;"
    ),
    "beside a freewheeling task, long cycles": program("PROGRAM Main : Main;", _LOOP),
    "beside a task of the highest priority, every 1 ms": program(
        "TASK t(INTERVAL := T#1ms, PRIORITY := 0); PROGRAM Main WITH t : Main;", _LOOP
    ),
}


def reads_of(text: str, folder: Path) -> list[float]:
    """Milliseconds of each of READS reads of a variable, in ascending order."""
    source, image = folder / "latency.st", folder / "latency.cdl"
    source.write_text(text)
    result = compile_sources([source])
    image.write_bytes(result.image)
    result.symbols.save(image.with_suffix(".sym"))
    with Plcrt(folder / "plc.flash", "--tcp", "0") as runtime, plctool.connect(f"tcp:{runtime.tcp}") as plc:
        plc.flash(image)
        plc.read("Main.n")
        times = []
        for _ in range(READS):
            begin = time.perf_counter()
            plc.read("Main.n")
            times.append(1e3 * (time.perf_counter() - begin))
            time.sleep(0.003)
    return sorted(times)


def main() -> None:
    print(f"\nOne read over TCP, {READS} of them, tool and plcrt on this machine")
    for what, text in PROGRAMS.items():
        with tempfile.TemporaryDirectory() as folder:
            times = reads_of(text, Path(folder))
        figure = f"{times[READS // 2]:.2f} ms"
        print(f"  {what:<52}{figure:>14}  longest {times[-1]:.1f} ms", flush=True)


if __name__ == "__main__":
    main()
