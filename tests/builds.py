"""The runtime and the modules of a build folder, for programs that are started from the source tree."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def environment(build: Path, sanitized: bool) -> dict[str, str]:
    """What the modules and the runtime of a build folder are found by. A sanitized module needs the libraries of the
    sanitizers before all others."""
    env = os.environ | {
        "PYTHONPATH": f"{ROOT / 'host'}:{build / 'host'}",
        "PYTHONDONTWRITEBYTECODE": "1",
        "PLCRT": str(build / "firmware/port/linux/plcrt"),
        "PLCTOOL_GATEWAY": "off",
        "PLCTOOL_PATIENCE": "3",  # the machine may be busy
    }
    if sanitized:
        names = ("libasan.so", "libubsan.so")
        found = [subprocess.check_output(["cc", f"-print-file-name={name}"], text=True).strip() for name in names]
        env |= {"LD_PRELOAD": " ".join(found), "ASAN_OPTIONS": "detect_leaks=0", "UBSAN_OPTIONS": "halt_on_error=1"}
    return env


def become(script: Path, make: str) -> None:
    """Replaces this process by a script with the same arguments and what is in build, in build-sanitized with
    --sanitized, or in another folder with --build. `make` is what builds it."""
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--build", type=Path, default=None)
    parser.add_argument("--sanitized", action="store_true")
    args, _ = parser.parse_known_args()
    build = args.build or ROOT / ("build-sanitized" if args.sanitized else "build")
    if not list((build / "host").glob("_plccore.*.so")):
        sys.exit(f"{build} has no module for Python; `make {make}{' ARGS=--sanitized' * args.sanitized}` builds it.")
    developers = ROOT / ".venv/bin/python"
    python = str(developers) if developers.exists() else sys.executable
    os.execve(python, [python, str(script), *sys.argv[1:]], environment(build.resolve(), args.sanitized))
