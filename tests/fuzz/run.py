"""Runs the fuzz targets of build folders for a while, from another seed each time: those in C by their own driver or by
libFuzzer, as the folder was set up, and what plctool reads by atheris, if that is installed.

A finding is written to the corpus in the repository, where every later run begins with it. Inputs that only reached
something new stay in the build folder, for the next run from there; --keep adds the best of them to the corpus.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

HERE = Path(__file__).parent
CORPUS = HERE / "corpus"
LONGEST = 8192  # bytes of an input
TAIL = 4000  # characters of what a finding says


@dataclass(frozen=True)
class Target(ABC):
    """`found`: where inputs stay that reached something."""

    name: str
    corpus: Path
    found: Path

    @abstractmethod
    def command(self, seconds: int, seed: int) -> list[str | Path]:
        """What runs it."""

    @abstractmethod
    def summary(self, output: str) -> str:
        """What is to be said of the command's output."""


@dataclass(frozen=True)
class Driven(Target):
    """By tests/fuzz/driver.c."""

    program: Path

    def command(self, seconds: int, seed: int) -> list[str | Path]:
        limits = ["-t", str(seconds), "-s", str(seed)]
        return [self.program, *limits, "-c", self.corpus, "-c", self.found, "-k", self.found, "-f", self.corpus]

    def summary(self, output: str) -> str:
        return output.strip()

    def keep(self) -> None:
        """The corpus becomes the smallest inputs that reach all that is reached, and its findings."""
        merged = self.found.with_suffix(".merged")
        merged.mkdir(exist_ok=True)
        command = [self.program, "-n", "0", "-c", self.corpus, "-c", self.found, "-k", merged]
        subprocess.run(command, check=True, capture_output=True)
        for old in [*self.corpus.glob("input-*")]:
            old.unlink()
        for file in merged.iterdir():
            file.rename(self.corpus / file.name)
        merged.rmdir()


@dataclass(frozen=True)
class ByLibFuzzer(Target):
    """`start`: the program and what it has before libFuzzer's own arguments. `first`: what writes its first inputs to
    the folder that follows; nothing for a program that does so itself."""

    start: tuple[str | Path, ...]
    first: tuple[str | Path, ...] = ()

    def command(self, seconds: int, seed: int) -> list[str | Path]:
        if self.first:
            subprocess.run([*self.first, self.found], check=True, stdout=subprocess.DEVNULL)
        limits = [f"-max_total_time={seconds}", f"-seed={seed % 2**32}", f"-max_len={LONGEST}", "-timeout=60"]
        return [*self.start, *limits, f"-artifact_prefix={self.corpus}/", self.found, self.corpus]

    def summary(self, output: str) -> str:
        done = [line for line in output.splitlines() if line.startswith("Done ")]
        return done[-1] if done else output[-TAIL:]


def c_targets(build: Path) -> Iterator[Target]:
    """Those of a build folder. libFuzzer cannot ask for first inputs: the program in the folder `build` has them."""
    folder = build / "tests/fuzz"
    for program in sorted(path for path in folder.glob("fuzz_*") if path.is_file() and os.access(path, os.X_OK)):
        name = program.name.removeprefix("fuzz_")
        corpus = CORPUS / name.removeprefix("minimal_")  # the same for the sizes of the smallest firmware
        found = folder / f"{program.name}.inputs"
        if build.name.endswith("libfuzzer"):
            first = (build.parent / "build/tests/fuzz" / program.name, "-n", "0", "-k")
            yield ByLibFuzzer(f"{name} by libFuzzer", corpus, found, (program,), first)
        else:
            yield Driven(name, corpus, found, program)


def host_targets(build: Path) -> Iterator[Target]:
    if find_spec("atheris") is None:
        print("What plctool reads is left out; for it: pip install atheris", flush=True)
        return
    sys.path.insert(0, str(HERE))
    from host_targets import TARGETS

    for name in TARGETS:
        found = build / f"tests/fuzz/host_{name}.inputs"
        start = (sys.executable, HERE / "host.py", name, found)
        yield ByLibFuzzer(f"plctool's {name}", CORPUS / f"host_{name}", found, start)


def fuzz(target: Target, seconds: int, seed: int) -> tuple[Target, int, str]:
    """One target for a while: its exit status and what it said."""
    target.corpus.mkdir(parents=True, exist_ok=True)
    target.found.mkdir(exist_ok=True)
    done = subprocess.run(target.command(seconds, seed), capture_output=True, text=True, check=False)
    if not any(target.corpus.iterdir()):
        target.corpus.rmdir()
    return target, done.returncode, target.summary(done.stdout + done.stderr)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("builds", nargs="+", type=Path)
    parser.add_argument("--seconds", type=int, default=60, help="for each target")
    parser.add_argument("--seed", type=int, default=int(time.time()), help="the time, if not given")
    parser.add_argument("--only", help="targets, separated by commas")
    parser.add_argument("--keep", action="store_true", help="what was reached goes to the corpus")
    args = parser.parse_args()
    only = args.only.split(",") if args.only else None
    targets = [target for build in args.builds for target in c_targets(build)] + [*host_targets(args.builds[0])]
    chosen = [t for t in targets if only is None or t.found.name.removesuffix(".inputs").removeprefix("fuzz_") in only]
    print(f"seed {args.seed}, {len(chosen)} targets, {args.seconds} s each", flush=True)
    status = 0
    with ThreadPoolExecutor(min(2, os.cpu_count() or 1)) as pool:
        for target, result, said in pool.map(lambda t: fuzz(t, args.seconds, args.seed), chosen):
            print(f"{target.found.parent}: {target.name}: {said}", flush=True)
            status = status or result
            if args.keep and isinstance(target, Driven):
                target.keep()
    return status


if __name__ == "__main__":
    sys.exit(main())
