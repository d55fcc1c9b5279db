"""The tanks example beside its twin in C: ns per cycle of each of its tasks.

Each time is taken in a process of its own: where a process has its memory decides about a tenth of it.
"""

from __future__ import annotations

import struct
import subprocess
import tempfile
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

from targets import CYCLES, HOST_VARIANTS, ROOT, ROUNDS, TWIN_LEVELS, Series

from plctool.compiler import IoFiles, compile_sources
from plctool.debug.symbols import SymbolTable
from plctool.sim import Simulator

SOURCES = [ROOT / f"examples/tanks/{name}.st" for name in ("types", "blocks", "control", "plant")]
SOURCES += [ROOT / "bench/tanks.st"]
TWIN = ROOT / "examples/tanks/c"
C_FLAGS = ("-std=c99", "-ffp-contract=off")
CALLS = 900_000

Times = tuple[int, list[float]]  # a checksum, and ns per cycle of the controller and of the plant


def checksum(plc: Simulator) -> int:
    """As tanks_checksum() in the C twin."""
    bits = [int.from_bytes(struct.pack("<f", plc.read(f"Plant.level{i}")), "little") for i in (1, 2)]
    return (bits[0] * 31 + bits[1]) % (1 << 32)


def time_tasks(image: bytes, symbols: SymbolTable) -> Times:
    with Simulator(image, symbols) as plc:
        plc.run_cycles(CYCLES)
        value = checksum(plc)
        return value, [plc.bench(task, CALLS)[0] for task in range(len(symbols.tasks))]


def time_program(image: bytes, symbols: SymbolTable) -> Times:
    with ProcessPoolExecutor(1, get_context("spawn")) as process:
        return process.submit(time_tasks, image, symbols).result()


def time_twin(program: Path) -> Times:
    done = subprocess.run([program, str(CYCLES), str(CALLS)], check=True, capture_output=True, text=True)
    value, *ns = done.stdout.split()
    return int(value), [float(each) for each in ns]


def compiled_twin(optimisation: str, folder: Path) -> Path:
    program = folder / f"tanks{optimisation}"
    command = ["cc", *C_FLAGS, optimisation, f"-I{TWIN}", "-o", program, ROOT / "bench/tanks_main.c", TWIN / "tanks.c"]
    subprocess.run([*command, "-lm"], check=True)
    return program


def main() -> None:
    print(
        f"\nexamples/tanks, ns per cycle of each task, the best of {ROUNDS} processes in turn, beside the same\n"
        "program in C, and how far the median of the worst variant is above its best"
    )
    names: list[str] = []
    programs: list[Callable[[], Times]] = []
    for checks, level in HOST_VARIANTS:
        built = compile_sources(SOURCES, checks=checks, level=int(level[2:]), io=IoFiles(wanted=False))
        names = built.symbols.tasks
        programs.append(partial(time_program, built.image, built.symbols))
    with tempfile.TemporaryDirectory() as folder:
        twins = [partial(time_twin, compiled_twin(level, Path(folder))) for level in TWIN_LEVELS]
        rounds = [[variant() for variant in (*programs, *twins)] for _ in range(ROUNDS)]
    for task, name in enumerate(names):
        series = [Series(runs[0][0], [ns[task] for _, ns in runs]) for runs in zip(*rounds, strict=True)]
        others = series[len(programs) :]
        for (checks, level), mine in zip(HOST_VARIANTS, series, strict=False):
            same = "" if all(mine.value == other.value for other in others) else "  OTHER CHECKSUM"
            beside = ", ".join(
                f"gcc {level} {other.best:.1f}: {mine.best / other.best:.2f} of it"
                for level, other in zip(TWIN_LEVELS, others, strict=True)
            )
            spread = max(each.spread for each in (mine, *others))
            print(
                f"  {f'{name}, checks {checks}, {level}':<34}{mine.best:>6.1f}  {beside}, spread {spread:.0%}{same}",
                flush=True,
            )


if __name__ == "__main__":
    main()
