"""Runs the tests nearest to a change, in about ten seconds: `make quick`, before the whole of `make test`.

What changed is what git says: the files that differ from the last commit (--since COMMIT: from that one), and new ones.
Chosen are, from near to far:

- tests that changed themselves;
- of a module of plctool, the test files that import it, then those that import what imports it, and so on;
- of a C source or header, the C tests that include the header of the component; of a header also the Python tests of
  the numbers in it.

Files are taken in this order until their times, as the last `make test` measured them, fill the budget; a line says
what was left out.
"""

from __future__ import annotations

import argparse
import ast
import os
import re
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from collections import defaultdict
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
HOST = ROOT / "host"
BUDGET_S = 8.0  # of each processor
UNKNOWN_S = 2.0  # a file that was never timed; of folders whose tests start processes or emulators:
UNKNOWN_SLOW_S = 30.0
SLOW = ("attack", "corpus", "docs", "e2e", "same_results", "soak", "target", "vcan", "kernel")
C_TEST_S = 0.3


def changed(since: str) -> list[Path]:
    """Returns the files that differ from a commit, and those that git does not know yet."""
    differ = ["git", "diff", "--name-only", "--diff-filter=d", since]
    new = ["git", "ls-files", "--others", "--exclude-standard"]
    said = [subprocess.check_output(command, cwd=ROOT, text=True) for command in (differ, new)]
    return [Path(line) for line in "".join(said).splitlines()]


@cache
def imports(file: Path) -> frozenset[str]:
    """Returns the modules of plctool that a Python file imports, each with the packages it is in."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(file.read_bytes())):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found.add(node.module)
            found.update(f"{node.module}.{alias.name}" for alias in node.names)
    return frozenset(name for name in found if name.startswith("plctool"))


def module_of(file: Path) -> str:
    """Returns `plctool.link.services` for host/plctool/link/services.py, and the package for an __init__.py."""
    parts = file.with_suffix("").parts[1:]
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def python_tests(modules: Iterable[str]) -> Iterator[Path]:
    """Returns test files by the length of the chain of imports that leads from them to one of the modules."""
    users: dict[str, set[str]] = defaultdict(set)
    for file in HOST.rglob("*.py"):
        for name in imports(file):
            users[name].add(module_of(file.relative_to(ROOT)))
    tests = sorted((ROOT / "tests").rglob("test_*.py"))
    near, seen = set(modules), set(modules)
    while near:
        yield from (test.relative_to(ROOT) for test in tests if near & imports(test))
        near = {user for module in near for user in users[module]} - seen
        seen |= near


def c_tests(files: Iterable[Path]) -> Iterator[Path]:
    """Returns the C tests that include the header of a changed source, or that are changed."""
    wanted = {file.stem for file in files if file.suffix in (".c", ".h")}
    include = re.compile(r'^#include "(\w+)\.h"', re.MULTILINE)
    for test in sorted((ROOT / "tests/c").glob("test_*.c")):
        if test.stem in wanted or wanted & set(include.findall(test.read_text())):
            yield test.relative_to(ROOT)


def seconds() -> dict[str, float]:
    """Returns how long each Python test file took when `make test` ran last."""
    found: dict[str, float] = defaultdict(float)
    for report in (ROOT / "build/pytest-reports").glob("*.xml"):
        for case in ET.parse(report).getroot().iter("testcase"):
            found[case.get("classname", "")] += float(case.get("time", "0"))
    return found


def within(files: Iterable[Path], budget: float) -> tuple[list[Path], list[Path]]:
    """Returns the first files whose times fit the budget together, and the others."""
    known = seconds()
    taken, left = [], []
    for file in dict.fromkeys(files):
        name = ".".join(file.with_suffix("").parts)
        unknown = UNKNOWN_SLOW_S if file.parts[1] in SLOW else UNKNOWN_S
        time_s = C_TEST_S if file.suffix == ".c" else known.get(name, unknown)
        if time_s <= budget:
            taken.append(file)
            budget -= time_s
        else:
            left.append(file)
    return taken, left


def choose(files: list[Path]) -> Iterator[Path]:
    """Returns the tests of a change, from near to far; some may come twice."""
    yield from (file for file in files if file.parts[0] == "tests" and file.match("test_*.py"))
    yield from c_tests(files)
    yield from python_tests(module_of(file) for file in files if file.parts[0] == "host" and file.suffix == ".py")
    if any(file.match("firmware/include/*.h") for file in files):
        yield from python_tests(["plctool.core"])


def run_python(files: list[Path]) -> Iterator[subprocess.Popen[bytes]]:
    """Starts a pytest for each folder: two of them in one disturb each other."""
    folders: dict[Path, list[str]] = defaultdict(list)
    for file in files:
        folders[file.parent].append(str(file))
    env = os.environ | {
        "PYTHONPATH": f"{HOST}:{ROOT / 'build/host'}",
        "PLCRT": str(ROOT / "build/firmware/port/linux/plcrt"),
    }
    for names in folders.values():
        yield subprocess.Popen([sys.executable, "-m", "pytest", "-x", "--no-header", *names], cwd=ROOT, env=env)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--since", default="HEAD", metavar="COMMIT")
    parser.add_argument("--list", action="store_true", help="print the tests instead of running them")
    args = parser.parse_args()
    begin = time.monotonic()
    files = changed(args.since)
    chosen, left = within(choose(files), BUDGET_S * (os.cpu_count() or 1))
    if args.list:
        print(*chosen, sep="\n")
        return 0
    of_c = [file.stem for file in chosen if file.suffix == ".c"]
    if of_c or any(file.suffix in (".c", ".h") for file in files):
        subprocess.run(["ninja", "--quiet", "-C", "build", *(f"tests/c/{name}" for name in of_c)], cwd=ROOT, check=True)
    status = max((subprocess.run([ROOT / "build/tests/c" / name], check=False, stdout=subprocess.DEVNULL).returncode
                  for name in of_c), default=0)  # fmt: skip
    processes = list(run_python([file for file in chosen if file.suffix == ".py"]))
    status = max([status, *(process.wait() for process in processes)])
    print(f"{len(files)} files changed; {len(chosen)} test files in {time.monotonic() - begin:.1f} s"
          f"{f'; {len(left)} that are slow or far away are left to make test' if left else ''}")  # fmt: skip
    return status


if __name__ == "__main__":
    sys.exit(main())
