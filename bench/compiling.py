"""How long the compiler takes for programs of 10 000 lines, where the time goes, and how quickly plctool starts."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from unittest.mock import patch

import llvmlite.binding as llvm
from large_project import NETWORKS, project

from plctool.compiler import build, load_sources, program_files
from plctool.compiler.codegen.emit import optimised
from plctool.compiler.codegen.link import link
from plctool.compiler.codegen.lower import lower
from plctool.compiler.codegen.lower_unit import Options
from plctool.compiler.front import check_sources
from plctool.compiler.kept.kept_build import KeptBuild
from plctool.compiler.sources.request import BuildRequest
from plctool.compiler.syntax.diagnostics import Diagnostics
from plctool.compiler.syntax.parser import parse
from plctool.image.targets import DEFAULT_TARGET, find_target

BLOCKS_FILE = "Block50.st"
LINES = 10_000
STARTS = 5
BUILDS = 3

BLOCK = """FUNCTION_BLOCK Block{n}
VAR_INPUT value : REAL; enable : BOOL; END_VAR
VAR_OUTPUT output : REAL; alarm : BOOL; count : DINT; END_VAR
VAR delay : TON; rise : R_TRIG; last : REAL; END_VAR
IF enable THEN
    output := LIMIT(0.0, value * {n}.5 + last, 100.0);
ELSE
    output := 0.0;
END_IF;
last := output / 2.0;
delay(IN := output > 90.0, PT := T#{n}ms);
alarm := delay.Q;
rise(CLK := alarm);
IF rise.Q THEN
    count := count + 1;
END_IF;
CASE count OF
    0..9: ;
    10: count := 0;
END_CASE;
END_FUNCTION_BLOCK
"""


def with_main(blocks: list[str], arguments: Callable[[int], str]) -> str:
    """The blocks Block0, Block1 ... and a program that has one of each."""
    declarations = "".join(f"b{n} : Block{n};\n" for n in range(len(blocks)))
    calls = "".join(f"b{n}({arguments(n)});\n" for n in range(len(blocks)))
    return "".join(blocks) + f"PROGRAM Main\nVAR\n{declarations}END_VAR\n{calls}END_PROGRAM\n"


def blocks_with_timers() -> str:
    """Small function blocks that have a timer each."""
    blocks = [BLOCK.format(n=n) for n in range(LINES * 10 // 226)]
    return with_main(blocks, lambda n: f"value := b{max(n - 1, 0)}.output, enable := TRUE")


def networks() -> str:
    """Function blocks of 100 lines of every kind of statement."""
    names = {prefix: ", ".join(f"{prefix}{x}" for x in range(40)) for prefix in ("in", "m", "n", "r")}
    head = (
        f"VAR_INPUT {names['in']} : BOOL; END_VAR\nVAR {names['m']} : BOOL; {names['n']} : INT; {names['r']} : REAL;\n"
        "j : INT; a : ARRAY[0..9] OF DINT; END_VAR\n"
    )
    blocks = []
    for n in range(LINES // 105):
        body: list[str] = []
        while len(body) < 100:
            k = len(body)
            body += NETWORKS[k % 5].format(k=k % 40, a=k * 7 % 40, b=k % 32, c=k * 3 % 40, d=k * 11 % 40).split("\n")
        blocks.append(f"FUNCTION_BLOCK Block{n}\n{head}" + "\n".join(body) + "\nEND_FUNCTION_BLOCK\n")
    return with_main(blocks, lambda n: "in0 := TRUE")


def one_body() -> str:
    """A single program of assignments, each with its own constants, as generators write them."""
    body = "\n".join(f"a[{i % 50}] := a[{i * 7 % 50}] * {i * 7919 + 13} + a[{i * 3 % 50}];" for i in range(LINES))
    return f"PROGRAM Main VAR a : ARRAY[0..49] OF DINT; END_VAR\n{body}\nEND_PROGRAM\n"


class Stages:
    """Processor seconds by name of the stage, in order."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        begin = time.process_time()
        yield
        self.seconds[name] = self.seconds.get(name, 0.0) + time.process_time() - begin


def profile(path: Path) -> Stages:
    """Where the time of a compilation goes, all of it in this process."""
    target, stages = find_target(DEFAULT_TARGET), Stages()
    options = Options(target)
    sources = load_sources([path])
    with stages.stage("lexing, parsing"):
        for source in sources:
            parse(source, Diagnostics().at(source).error)
    with stages.stage("names and types"):
        checked = check_sources(sources)
    stages.seconds["names and types"] -= stages.seconds["lexing, parsing"]
    assert checked.program, checked.diagnostics
    with stages.stage("lowering"):
        lowered = lower(checked.program, options)
    objects = []
    for part in lowered.parts:
        with stages.stage("LLVM: reading"):
            llvm.parse_assembly(part.text, llvm.create_context())
        with stages.stage("LLVM: optimising"):
            module, machine = optimised(part, options)
        with stages.stage("LLVM: code"):
            objects.append(machine.emit_object(module))
    stages.seconds["LLVM: optimising"] -= stages.seconds["LLVM: reading"]
    with stages.stage("linking"):
        link(objects, target, [*lowered.tasks, *lowered.functions.values()], lowered.imports)
    return stages


def best_of(runs: int, arguments: list[str | Path]) -> float:
    """Seconds of a command of plctool."""
    seconds = []
    for _ in range(runs):
        begin = time.monotonic()
        subprocess.run([sys.executable, "-m", "plctool", *arguments], check=True, capture_output=True)
        seconds.append(time.monotonic() - begin)
    return min(seconds)


def bench_start() -> None:
    print(f"\nplctool --version: {best_of(STARTS, ['--version']):.2f} s, the best of {STARTS}")


def bench_change() -> None:
    """One changed block of a project of 100 files, whose other code is in the cache."""
    with tempfile.TemporaryDirectory() as name, patch.dict(os.environ, XDG_CACHE_HOME=f"{name}/cache"):
        folder, kept = Path(name) / "project", KeptBuild()
        folder.mkdir()
        project(folder)

        def seconds(build_it: Callable[[], object], changes: int) -> float:
            found = []
            for _ in range(changes):
                file = folder / BLOCKS_FILE
                file.write_text(file.read_text().replace("t(IN := in0", "n1 := n2 + 77;\nt(IN := in0", 1))
                begin = time.monotonic()
                build_it()
                found.append(time.monotonic() - begin)
            return min(found)

        command: list[str | Path] = ["build", folder, "-o", folder / "large.cdl"]
        request = BuildRequest(program_files([folder]), cache=True)
        rows = {
            "all compiled": seconds(lambda: best_of(1, command), 1),
            "one changed block": seconds(lambda: best_of(1, command), BUILDS),
            "one changed block, in a process that stays": seconds(lambda: build(request, kept=kept), BUILDS + 1),
        }
    print(f"\nBuilding {LINES} lines in 100 files, in seconds")
    for what, figure in rows.items():
        print(f"  {what:<52}{figure:>8.2f}", flush=True)


def bench_compile() -> None:
    texts = {"timers": blocks_with_timers(), "networks": networks(), "one body": one_body()}
    print(f"\nCompiling about {LINES} lines of Structured Text, in seconds, the best of {BUILDS} builds")
    print(f"  {'':<28}" + "".join(f"{name:>12}" for name in texts))
    rows: dict[str, list[str]] = {}
    with tempfile.TemporaryDirectory() as folder:
        for text in texts.values():
            path = Path(folder) / "large.st"
            path.write_text(text)
            image = Path(folder) / "large.cdl"
            seconds = best_of(BUILDS, ["build", path, "-o", image])
            stages = profile(path).seconds
            figures = {
                "lines": f"{text.count(chr(10))}",
                "bytes of image": f"{image.stat().st_size}",
                "seconds of plctool build": f"{seconds:.2f}",
                **{f"  {name}": f"{value:.2f}" for name, value in stages.items()},
                "  in all, in one process": f"{sum(stages.values()):.2f}",
            }
            for name, figure in figures.items():
                rows.setdefault(name, []).append(figure)
    for name, row in rows.items():
        print(f"  {name:<28}" + "".join(f"{figure:>12}" for figure in row), flush=True)


def main() -> None:
    bench_start()
    bench_compile()
    bench_change()


if __name__ == "__main__":
    main()
