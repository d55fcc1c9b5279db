"""Runs the fuzz targets of build folders for a while, from another seed each time.

A finding is written to the corpus in the repository, where every later run begins with it. Inputs that only reached
something new stay in the build folder, for the next run from there; --keep adds the best of them to the corpus.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

HERE = Path(__file__).parent
CORPUS = HERE / "corpus"


def corpus_of(program: Path) -> Path:
    """The inputs of a target; those for the sizes of the smallest firmware are the same as for the others."""
    return CORPUS / program.name.removeprefix("fuzz_").removeprefix("minimal_")


def fuzz(program: Path, seconds: int, seed: int) -> tuple[Path, int, str]:
    """One target for a while: its exit status and what it said."""
    corpus, found = corpus_of(program), program.parent / f"{program.name}.inputs"
    corpus.mkdir(parents=True, exist_ok=True)
    found.mkdir(exist_ok=True)
    command = [program, "-t", str(seconds), "-s", str(seed), "-c", corpus, "-c", found, "-k", found, "-f", corpus]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return program, done.returncode, (done.stdout + done.stderr).strip()


def keep(program: Path) -> None:
    """The corpus of a target becomes the smallest inputs that reach all that is reached, and its findings."""
    corpus, found = corpus_of(program), program.parent / f"{program.name}.inputs"
    merged = program.parent / f"{program.name}.merged"
    merged.mkdir(exist_ok=True)
    subprocess.run([program, "-n", "0", "-c", corpus, "-c", found, "-k", merged], check=True, capture_output=True)
    for old in [*corpus.glob("input-*")]:
        old.unlink()
    for file in merged.iterdir():
        file.rename(corpus / file.name)
    merged.rmdir()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("builds", nargs="+", type=Path)
    parser.add_argument("--seconds", type=int, default=60, help="for each target")
    parser.add_argument("--seed", type=int, default=int(time.time()), help="the time, if not given")
    parser.add_argument("--only", help="targets, separated by commas")
    parser.add_argument("--keep", action="store_true", help="what was reached goes to the corpus")
    args = parser.parse_args()
    only = args.only.split(",") if args.only else None
    programs = [
        program
        for build in args.builds
        for program in sorted((build / "tests/fuzz").glob("fuzz_*"))
        if program.is_file() and (only is None or program.name.removeprefix("fuzz_") in only)
    ]
    print(f"seed {args.seed}, {len(programs)} targets, {args.seconds} s each", flush=True)
    status = 0
    with ThreadPoolExecutor(min(2, os.cpu_count() or 1)) as pool:
        for program, result, said in pool.map(lambda p: fuzz(p, args.seconds, args.seed), programs):
            print(f"{program}: {said}", flush=True)
            status = status or result
            if args.keep:
                keep(program)
    return status


if __name__ == "__main__":
    sys.exit(main())
