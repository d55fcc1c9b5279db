"""The benchmark programs beside their C twins: time per cycle on this machine, instructions and flash on Cortex-M.

A program is a pair X.st and X.c. The twin has `void scan_init(void)`, `void scan(void)` and `uint32_t chk`, and reads
`int64_t now_ms`; both must hold the same `chk` after CYCLES cycles of 1 ms.
"""

from __future__ import annotations

import argparse
import os
import shutil
import statistics
import struct
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path += [str(ROOT / "tests/same_results"), str(ROOT / "bench/programs")]

import instances  # noqa: E402
import logic  # noqa: E402
from runners import RUNNERS, Runner  # noqa: E402

from plctool.compiler import load_sources  # noqa: E402
from plctool.compiler.codegen.lower_unit import Options, parse_checks  # noqa: E402
from plctool.compiler.front import check_sources  # noqa: E402
from plctool.compiler.image.build import BuildResult, build_program  # noqa: E402
from plctool.compiler.typed.nodes import TypedProgram  # noqa: E402
from plctool.core import lib  # noqa: E402
from plctool.debug.variables import Symbol  # noqa: E402
from plctool.image.file import parse_image  # noqa: E402
from plctool.image.targets import find_target  # noqa: E402
from plctool.sim import Simulator  # noqa: E402
from plctool.testing.children import ends_with_us  # noqa: E402

CYCLES = 1000  # before the checksums are compared
GUEST_CYCLES = 200  # fewer, because soft float takes 50 000 instructions in each
CALLS = 30_000  # of a program or twin, for its time on this machine
HOST = "x86_64-linux"
GUESTS = ("cortex-m3", "cortex-m4f")
HOST_VARIANTS = (("all", "-O2"), ("none", "-O2"), ("all", "-O3"))  # checks and level
TWIN_LEVELS = ("-O2", "-O3")
VARIANTS = (("all", "-O2"), ("none", "-O2"), ("all", "-O3"), ("all", "-Os"))  # on Cortex-M
C_FLAGS = ("-std=c99", "-ffp-contract=off", "-fno-strict-aliasing")
ROUNDS = 7  # in each, every variant of a program is timed once


@dataclass
class Program:
    """A benchmark and its twin."""

    st: Path
    twin: Path

    @cached_property
    def typed(self) -> TypedProgram:
        checked = check_sources(load_sources([self.st]))
        assert checked.program, checked.diagnostics
        return checked.program

    def build(self, target: str, checks: str, level: str = "-O2") -> BuildResult:
        number, size = (2, True) if level == "-Os" else (int(level[2:]), False)
        options = Options(find_target(target), number, parse_checks(checks), size=size)
        return build_program(self.typed, options)


def checksum(built: BuildResult) -> Symbol:
    """The variable `chk` of the only program."""
    return next(s for name, s in built.symbols.variables.items() if name.lower().endswith(".chk"))


# ---- this machine --------------------------------------------------------------------------------------------------


Timed = tuple[int, float]  # a checksum, and ns per cycle


def time_program(built: BuildResult) -> Timed:
    with Simulator(built.image, built.symbols) as plc:
        plc.run_cycles(CYCLES)
        value = plc.read(checksum(built).name)
        return value, plc.bench(0, CALLS)[0]


def time_twin(program: Path) -> Timed:
    done = subprocess.run([program, str(CALLS)], check=True, capture_output=True, text=True)
    value, ns = done.stdout.split()
    return int(value), float(ns)


def compiled_twin(twin: Path, optimisation: str, folder: Path) -> Path:
    program = folder / f"twin{optimisation}"
    sources = [ROOT / "bench/twin_main.c", twin]
    subprocess.run(["cc", *C_FLAGS, optimisation, f"-DCYCLES={CYCLES}", "-o", program, *sources, "-lm"], check=True)
    return program


@dataclass
class Series:
    """What rounds of one variant took. Other work on the machine only makes a round longer, so the shortest counts."""

    value: int
    ns: list[float]

    @property
    def best(self) -> float:
        return min(self.ns)

    @property
    def spread(self) -> float:
        """How far the median is above the best, as a share of it."""
        return statistics.median(self.ns) / self.best - 1


def interleaved(variants: list[Callable[[], Timed]]) -> list[Series]:
    """Each variant once in each round, so that what disturbs one of them disturbs all."""
    rounds = [[variant() for variant in variants] for _ in range(ROUNDS)]
    return [Series(runs[0][0], [ns for _, ns in runs]) for runs in zip(*rounds, strict=True)]


@contextmanager
def one_processor() -> Iterator[None]:
    """Keeps this process, and those it starts, on one processor."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(allowed)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, allowed)


def bench_host(programs: list[Program], folder: Path) -> None:
    print(f"\nBenchmark programs on this machine: ns per cycle, best of {ROUNDS} rounds in turn on one processor,")
    print("the ratio to their C twins, and how far the median of the worst variant is above its best")
    print(
        f"  {'':<12}{'checks':<8}{'level':<8}{'plctool':>10}{'gcc -O2':>10}{'gcc -O3':>10}"
        f"{'to -O2':>8}{'to -O3':>8}{'spread':>8}"
    )
    ratios: dict[tuple[str, str], list[list[float]]] = {variant: [] for variant in HOST_VARIANTS}
    for program in programs:
        builds = [partial(time_program, program.build(HOST, *variant)) for variant in HOST_VARIANTS]
        twins = [partial(time_twin, compiled_twin(program.twin, level, folder)) for level in TWIN_LEVELS]
        with one_processor():
            series = interleaved([*builds, *twins])
        own, others = series[: len(builds)], series[len(builds) :]
        for (checks, level), mine in zip(HOST_VARIANTS, own, strict=True):
            ratios[checks, level].append([mine.best / other.best for other in others])
            same = "" if all(mine.value == other.value for other in others) else "  OTHER CHECKSUM"
            times = "".join(f"{other.best:>10.0f}" for other in others)
            shares = "".join(f"{ratio:>8.2f}" for ratio in ratios[checks, level][-1])
            spread = max(each.spread for each in (mine, *others))
            variant = f"{program.st.stem:<12}{checks:<8}{level:<8}"
            print(f"  {variant}{mine.best:>10.0f}{times}{shares}{spread:>8.0%}{same}", flush=True)
    for (checks, level), of_one in ratios.items():
        means = "".join(f"{statistics.geometric_mean(column):>8.2f}" for column in zip(*of_one, strict=True))
        print(f"  {'mean':<12}{checks:<8}{level:<8}{'':>30}{means}  geometric")


# ---- Cortex-M ------------------------------------------------------------------------------------------------------


def run_guest(runner: Runner, program: Path, folder: Path) -> tuple[int, int]:
    """Checksum and instructions per cycle that a guest program prints."""
    command: list[str | Path] = [*runner.command[:-1], "-icount", "shift=0", runner.command[-1], program]
    # What a guest prints comes out on QEMU's standard error.
    done = subprocess.run(
        ends_with_us(command), cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=120
    )
    if done.returncode:
        raise RuntimeError(f"{program.name} failed: {done.stdout}")
    value, instructions = done.stdout.split()
    return int(value), int(instructions)


def guest_twin(runner: Runner, twin: Path, optimisation: str, folder: Path) -> tuple[int, int]:
    flags = (*C_FLAGS, optimisation, f"-DCYCLES={GUEST_CYCLES}")
    return run_guest(runner, runner.compile_alone(folder, [ROOT / "bench/guest/twin.c", twin], *flags), folder)


def guest_program(runner: Runner, guest: Path, built: BuildResult, folder: Path) -> tuple[int, int]:
    chk = checksum(built)
    target = getattr(lib, find_target(runner.target).device_id)
    (folder / "job").write_bytes(struct.pack("<4I", target, chk.area, chk.offset, len(built.image)) + built.image)
    return run_guest(runner, guest, folder)


def twin_flash(runner: Runner, twin: Path, optimisation: str, folder: Path) -> int:
    """Bytes of code and constants of the twin alone, without what it takes from libraries."""
    target = runner.compile_object(folder, twin, *C_FLAGS, optimisation)
    size = shutil.which("arm-none-eabi-size") or "size"
    return int(
        subprocess.run([size, target], check=True, capture_output=True, text=True).stdout.split("\n")[1].split()[0]
    )


def bench_guest(target: str, programs: list[Program], folder: Path) -> None:
    runner = RUNNERS[target]
    missing = runner.missing()
    if missing:
        print(f"\nBenchmark programs on {target}: left out, {' and '.join(missing)} not found")
        return
    print(
        f"\nBenchmark programs on {target} in QEMU: instructions per cycle, bytes of code, beside arm-none-eabi-gcc\n"
        "(the twins of pid, blocks, b1_pid and b3_fb loop over arrays, so their size is not comparable)"
    )
    print(
        f"  {'':<12}{'checks':<8}{'level':<8}{'plctool':>10}{'gcc -O2':>10}{'ratio':>8}"
        f"{'bytes':>10}{'gcc -Os':>10}{'gcc -O2':>10}{'to -Os':>8}{'to -O2':>8}"
    )
    guest = runner.compile(folder, ROOT / "bench/guest/iec.c", f"-DCYCLES={GUEST_CYCLES}", f"-I{ROOT / 'bench/guest'}")
    ratios: dict[tuple[str, str], list[float]] = {variant: [] for variant in VARIANTS}
    for program in programs:
        twin_value, twin = guest_twin(runner, program.twin, "-O2", folder)
        sizes = [twin_flash(runner, program.twin, level, folder) for level in ("-Os", "-O2")]
        for checks, level in VARIANTS:
            built = program.build(target, checks, level)
            value, instructions = guest_program(runner, guest, built, folder)
            same = "" if value == twin_value else "  OTHER CHECKSUM"
            code = len(parse_image(built.image).code)
            ratios[checks, level].append(instructions / twin)
            figures = f"{instructions:>10}{twin:>10}{instructions / twin:>8.2f}{code:>10}"
            figures += "".join(f"{size:>10}" for size in sizes) + "".join(f"{code / size:>8.2f}" for size in sizes)
            print(f"  {program.st.stem:<12}{checks:<8}{level:<8}{figures}{same}", flush=True)
    for (checks, level), of_one in ratios.items():
        print(f"  {'mean':<12}{checks:<8}{level:<8}{'':>20}{statistics.geometric_mean(of_one):>8.2f}  geometric")


# ---- all of it -----------------------------------------------------------------------------------------------------


def pairs(folder: Path) -> Iterator[Program]:
    """Programs with their twins below a folder."""
    twins = {path.stem: path for path in folder.rglob("*.c")}
    for st in sorted(folder.rglob("*.st")):
        if st.stem in twins:
            yield Program(st, twins[st.stem])


def find_programs(more: Path | None, folder: Path) -> list[Program]:
    """Ours, some of which are generated into `folder`, and those of `more`. Raises SystemExit if that has none."""
    for generator in (logic, instances):
        for suffix, text in zip((".st", ".c"), generator.texts(), strict=True):
            (folder / f"{generator.__name__}{suffix}").write_text(text)
    others = list(pairs(more)) if more else []
    if more and not others:
        raise SystemExit(f"There is no pair X.st and X.c in {more}.")
    return [*pairs(ROOT / "bench/programs"), *pairs(folder), *others]


def main() -> None:
    """`--programs DIR` on the command line names a folder with more pairs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--programs", type=Path, help="folder with more pairs X.st and X.c")
    more = parser.parse_args().programs
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        programs = find_programs(more, folder)
        bench_host(programs, folder)
        for target in GUESTS:
            bench_guest(target, programs, folder)


if __name__ == "__main__":
    main()
