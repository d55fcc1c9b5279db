#!/usr/bin/env python3
"""Attacks the promise "no power cut, bad program or bad packet can lose the program".

    tests/attack/run.py                  all campaigns
    tests/attack/run.py --short          some cases of each, in less than a minute
    tests/attack/run.py --only cut,call  these campaigns
    tests/attack/run.py --replay cut:17  one case, with everything that is said on the way
    tests/attack/run.py --seed 5         other random cases
    tests/attack/run.py --sanitized      with what is in build-sanitized instead of build
    tests/attack/run.py --help           more options

Each case ends with a look at the device: the newest good program runs, or the previous one where the new one died
before it proved itself, or it is stopped with communication up and the cause in the log. Anything else is a failure,
and the line that replays it is printed.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]


def environment(build: Path, sanitized: bool) -> dict[str, str]:
    """What the campaigns find the modules and the runtime of a build folder by. A sanitized module needs the libraries
    of the sanitizers before all others."""
    env = os.environ | {
        "PYTHONPATH": f"{ROOT / 'host'}:{build / 'host'}",
        "PYTHONDONTWRITEBYTECODE": "1",
        "PLCRT": str(build / "firmware/port/linux/plcrt"),
        "PLCTOOL_GATEWAY": "off",
    }
    if sanitized:
        names = ("libasan.so", "libubsan.so")
        found = [subprocess.check_output(["cc", f"-print-file-name={name}"], text=True).strip() for name in names]
        env |= {"LD_PRELOAD": " ".join(found), "ASAN_OPTIONS": "detect_leaks=0", "UBSAN_OPTIONS": "halt_on_error=1"}
    return env


def main() -> None:
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--build", type=Path, default=None)
    parser.add_argument("--sanitized", action="store_true")
    args, _ = parser.parse_known_args()
    build = args.build or ROOT / ("build-sanitized" if args.sanitized else "build")
    if not list((build / "host").glob("_plccore.*.so")):
        sys.exit(f"{build} has no module for Python; `make attack{' ARGS=--sanitized' * args.sanitized}` builds it.")
    developers = ROOT / ".venv/bin/python"
    python = str(developers) if developers.exists() else sys.executable
    command = [python, str(HERE / "attack.py"), *sys.argv[1:]]
    os.execve(python, command, environment(build.resolve(), args.sanitized))


if __name__ == "__main__":
    main()
