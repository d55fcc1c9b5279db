"""Runs tests/e2e with the plcrt of cross builds in QEMU's user mode: run.py [--short] BUILD... [-- PYTEST'S ARGUMENTS].

Programs are built for the processor of that plcrt; the tool runs on this machine. A build folder is build-TARGET, and
cross/TARGET.ini says how its programs are run. Tests of what QEMU's user mode cannot do are skipped with the reason
(tests/e2e/emulated.py). --short: what depends on the processor, and only what is built.
"""

from __future__ import annotations

import argparse
import ast
import configparser
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
E2E = ROOT / "tests" / "e2e"
NOTHING_TO_TEST = 77  # exit status, as for meson
SHORT = [
    "test_breakpoints.py",
    "test_call_stack.py",
    "test_plcrt_programs.py::test_what_no_check_stops_the_processor_does",
    "test_plcrt_programs.py::test_a_killed_controller_runs_its_program_again_with_its_retain_variables",
]


def emulator_of(target: str) -> list[str]:
    """The command that runs programs of a target, by its cross file."""
    cross = configparser.ConfigParser()
    cross.read(ROOT / "cross" / f"{target}.ini")
    command: list[str] = ast.literal_eval(cross["binaries"]["exe_wrapper"])
    return command


def target_of(build: Path) -> str:
    return build.resolve().name.removeprefix("build-")


def plcrt_of(build: Path) -> Path:
    return build.resolve() / "firmware/port/linux/plcrt"


def missing(build: Path) -> str:
    """Why nothing of a build can be run; "" if it can."""
    if not plcrt_of(build).exists():
        return f"{build} has no plcrt: make linux-arm"
    emulator = emulator_of(target_of(build))[0]
    return "" if shutil.which(emulator) else f"needs {emulator}: ./bootstrap.sh --tests"


def run(build: Path, tests: list[str]) -> int:
    """The exit status of pytest with the plcrt of a build."""
    target = target_of(build)
    with tempfile.TemporaryDirectory(prefix="linux-arm-") as folder:
        wrapper = Path(folder) / "plcrt"
        wrapper.write_text(f'#!/bin/sh\nexec {shlex.join([*emulator_of(target), str(plcrt_of(build))])} "$@"\n')
        wrapper.chmod(0o755)
        env = os.environ | {"PLCRT": str(wrapper), "PLCRT_TARGET": target}
        command = [sys.executable, "-m", "pytest", "-q", "-rs", *tests]
        print(f"{target}: {' '.join(command[1:])}", flush=True)
        return subprocess.run(command, cwd=ROOT, env=env).returncode


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--short", action="store_true", help="only what depends on the processor")
    parser.add_argument("builds", nargs="+", type=Path)
    words = sys.argv[1:]
    end = words.index("--") if "--" in words else len(words)
    args, others = parser.parse_args(words[:end]), words[end + 1 :]
    reasons = {build: missing(build) for build in args.builds}
    builds = [build for build, reason in reasons.items() if not reason]
    print(*filter(None, reasons.values()), sep="\n")
    if not builds:
        return NOTHING_TO_TEST
    tests = [str(E2E / test) for test in SHORT] if args.short else [str(E2E)]
    return max(run(build, [*tests, *others]) for build in builds)


if __name__ == "__main__":
    sys.exit(main())
