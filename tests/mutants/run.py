#!/usr/bin/env python3
"""Changes one decision of the firmware at a time, and tells which changes no C test notices.

    tests/mutants/run.py                         all files of files.txt
    tests/mutants/run.py --only ModbusClient     files with this in their name (a regular expression)
    tests/mutants/run.py firmware/src/app/AppBoot.c
    tests/mutants/run.py --sample 40 --seed 7    some mutants of each file
    tests/mutants/run.py --build build-sanitized with the sanitizers, which notice a bound that is off by one

Each line of the report is a living mutant: file, line, function, and what became of what. Write the test that notices
it, delete the decision if nothing depends on it, or copy the line into equivalent.toml with the reason why the changed
program does the same. An entry there that fits no mutant, or one that a test notices, is a failure, too.
"""

from __future__ import annotations

import argparse
import os
import random
import subprocess
import sys
import tempfile
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from mutate import Mutant
from programs import ROOT, Mutated, Workshop, dies, killers, matches, measure, tests_of

HERE = Path(__file__).resolve().parent
EQUIVALENT = HERE / "equivalent.toml"
FILES = HERE / "files.txt"
MEMORY = "Memory: "  # of a reason: the sanitizers may notice


def files() -> list[str]:
    """Returns the files whose mutants all die."""
    lines = FILES.read_text().splitlines()
    return [line for line in lines if line and not line.startswith("#")]


def equivalents(file: str) -> dict[str, str]:
    """Returns the reasons of a file's mutants that do the same as the source."""
    entries: dict[str, str] = tomllib.loads(EQUIVALENT.read_text()).get(file, {})
    return entries


class Report:
    """Counts, and prints what is wrong."""

    def __init__(self) -> None:
        self.failures = 0

    def wrong(self, line: str) -> None:
        print(line, flush=True)
        self.failures += 1


def survives(mutant: Mutant, mutated: Mutated) -> bool:
    return not any(dies(program, mutant.number) for program in killers(mutant.number, mutated.programs))


def baseline(mutated: Mutated, pool: ThreadPoolExecutor, slowest_s: float, report: Report) -> None:
    """Runs all tests of a file without a mutant. Those that see none of them, or take too long, are left out."""
    count = len(mutated.mutator.mutants)
    passed = pool.map(lambda program: measure(program, count, slowest_s), mutated.programs)
    kept = []
    for program, good in zip(mutated.programs, passed, strict=True):
        if good:
            kept.append(program)
        elif program.seconds < slowest_s:
            report.wrong(f"{program.test.name} fails without a mutant")
        else:
            print(f"  {program.test.name} is left out: it takes more than {slowest_s:g} s")
    mutated.programs = [program for program in kept if program.seen]


def chosen(mutated: Mutated, args: argparse.Namespace) -> list[Mutant]:
    mutants = [mutant for mutant in mutated.mutator.mutants if mutant.number in mutated.compiled]
    if args.sample is None or args.sample >= len(mutants):
        return mutants
    return sorted(random.Random(args.seed).sample(mutants, args.sample), key=lambda mutant: mutant.number)


def try_file(file: str, args: argparse.Namespace, pool: ThreadPoolExecutor, report: Report) -> None:
    tests = [test for test in tests_of(args.build) if matches(test.name, args.tests)]
    if args.built:
        tests = [test for test in tests if (args.build / test.program).exists()]
    with tempfile.TemporaryDirectory() as folder:
        mutated = Workshop(args.build, Path(folder)).mutate(ROOT / file, tests)
        baseline(mutated, pool, args.slowest, report)
        mutants = chosen(mutated, args)
        living = pool.map(lambda mutant: survives(mutant, mutated), mutants)
        alive = [mutant for mutant, lives in zip(mutants, living, strict=True) if lives]
    for line in mutated.mutator.unread:
        print(f"{file}:{line}: the parser does not understand this line: no mutants")
    reasons = equivalents(file)
    for mutant in alive:
        if mutant.change not in reasons:
            seen = any(mutant.number in program.seen for program in mutated.programs)
            report.wrong(f"{file}:{mutant.line}: {mutant.change}{'' if seen else '   (no test differs)'}")
    for name in reasons.keys() - {mutant.change for mutant in mutated.mutator.mutants}:
        report.wrong(f"{EQUIVALENT.name}: {file} has no such mutant: {name}")
    dead = {mutant.change for mutant in mutants} - {mutant.change for mutant in alive}
    for name in sorted(name for name in reasons.keys() & dead if not reasons[name].startswith(MEMORY)):
        report.wrong(f"{EQUIVALENT.name}: a test of {file} notices: {name}")
    listed = sum(mutant.change in reasons for mutant in alive)
    print(f"{file}: {len(mutants)} mutants, {len(alive) - listed} live, {listed} equivalent, "
          f"{len(mutated.programs)} tests", flush=True)  # fmt: skip


def build_tests(build: Path) -> None:
    programs = sorted({test.program for test in tests_of(build)})
    subprocess.run(["ninja", "--quiet", "-C", str(build), *programs], check=True)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", nargs="*", default=files(), help="instead of those in files.txt")
    parser.add_argument("--only", metavar="NAME")
    parser.add_argument("--tests", metavar="NAME", help="only the tests with this in their names")
    parser.add_argument("--sample", type=int, metavar="COUNT", help="mutants of each file")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--slowest", type=float, default=30.0, metavar="SECONDS", help="leave out slower tests")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--build", type=Path, default=ROOT / "build")
    parser.add_argument("--built", action="store_true", help="only tests that are built")
    args = parser.parse_args()
    args.build = args.build.resolve()
    if not args.built:
        build_tests(args.build)
    report = Report()
    with ThreadPoolExecutor(args.jobs) as pool:
        for file in args.file:
            if matches(file, args.only):
                try_file(file, args, pool, report)
    return min(report.failures, 1)


if __name__ == "__main__":
    sys.exit(main())
