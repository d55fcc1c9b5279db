"""Runs `meson test` in the build folders given and prints the failures and one closing line over all of them.

C tests count as one test each; pytest suites are counted by their own tests, from the JUnit files they leave.
"""

from __future__ import annotations

import argparse
import compileall
import json
import os
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


@dataclass
class Outcome:
    """Of some tests: their number by outcome, and the first line of each failure after the name of its test."""

    counts: Counter[str]
    failures: list[str]


def pytest_outcome(report: Path) -> Outcome:
    """The tests in a pytest JUnit file."""
    suite = next(ET.parse(report).getroot().iter("testsuite"))
    total, failed, skipped = (int(suite.get(key, "0")) for key in ("tests", "failures", "skipped"))
    failed += int(suite.get("errors", "0"))
    failures = [
        f"{case.get('classname')}::{case.get('name')}: {problem.get('message', '').splitlines()[0]}"
        for case in suite.iter("testcase")
        for problem in (*case.findall("failure"), *case.findall("error"))
    ]
    return Outcome(Counter(passed=total - failed - skipped, failed=failed, skipped=skipped), failures)


def meson_outcome(test: dict[str, str]) -> Outcome:
    """A test in the log of meson that is no pytest suite."""
    outcome = {"OK": "passed", "SKIP": "skipped"}.get(test["result"], "failed")
    return Outcome(Counter({outcome: 1}), [f"{test['name']}: {test['result']}"] if outcome == "failed" else [])


def run(meson: str, build: Path) -> tuple[int, Outcome]:
    """One `meson test`; its exit status and the outcome of its tests."""
    reports = build / "pytest-reports"
    for old in reports.glob("*.xml"):
        old.unlink()
    processes = (os.cpu_count() or 1) + 1  # some tests wait more than they work
    command = [meson, "test", "-C", str(build), "--print-errorlogs", "--no-rebuild", "--num-processes", str(processes)]
    status = subprocess.run(command, check=False).returncode
    total = Outcome(Counter(), [])
    for line in (build / "meson-logs" / "testlog.json").read_text().splitlines():
        test = json.loads(line)
        report = reports / f"{test['name'].rsplit(':', 1)[-1]}.xml"
        outcome = pytest_outcome(report) if report.exists() else meson_outcome(test)
        total.counts += outcome.counts
        total.failures += [f"{build.name}: {failure}" for failure in outcome.failures]
    return status, total


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--meson", required=True)
    parser.add_argument("builds", nargs="+", type=Path)
    args = parser.parse_args()
    # Tests start plctool some thousand times, and write no bytecode themselves: compiling it took half of each start.
    compileall.compile_dir(ROOT / "host" / "plctool", quiet=1)
    status, total = 0, Outcome(Counter(), [])
    for build in args.builds:
        print(f"==== {build}", flush=True)
        one_status, outcome = run(args.meson, build)
        status = status or one_status
        total.counts += outcome.counts
        total.failures += outcome.failures
    for failure in total.failures:
        print(f"FAILED {failure}")
    counts = total.counts
    print(f"{counts['passed']} passed, {counts['failed']} failed, {counts['skipped']} skipped")
    return status


if __name__ == "__main__":
    sys.exit(main())
