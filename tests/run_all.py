"""Runs `meson test` in the build folders given and prints one closing line over all of them.

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
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def pytest_counts(report: Path) -> Counter[str]:
    """Tests in a pytest JUnit file."""
    suite = next(ET.parse(report).getroot().iter("testsuite"))
    total, failed, skipped = (int(suite.get(key, "0")) for key in ("tests", "failures", "skipped"))
    failed += int(suite.get("errors", "0"))
    return Counter(passed=total - failed - skipped, failed=failed, skipped=skipped)


def run(meson: str, build: Path) -> tuple[int, Counter[str]]:
    """One `meson test`; its exit status and the number of tests by outcome."""
    reports = build / "pytest-reports"
    for old in reports.glob("*.xml"):
        old.unlink()
    processes = (os.cpu_count() or 1) + 1  # some tests wait more than they work
    command = [meson, "test", "-C", str(build), "--print-errorlogs", "--no-rebuild", "--num-processes", str(processes)]
    status = subprocess.run(command, check=False).returncode
    counts: Counter[str] = Counter()
    for line in (build / "meson-logs" / "testlog.json").read_text().splitlines():
        test = json.loads(line)
        report = reports / f"{test['name'].rsplit(':', 1)[-1]}.xml"
        if report.exists():
            counts += pytest_counts(report)
        else:
            counts[{"OK": "passed", "SKIP": "skipped"}.get(test["result"], "failed")] += 1
    return status, counts


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--meson", required=True)
    parser.add_argument("builds", nargs="+", type=Path)
    args = parser.parse_args()
    # Tests start plctool some thousand times, and write no bytecode themselves: compiling it took half of each start.
    compileall.compile_dir(ROOT / "host" / "plctool", quiet=1)
    status, total = 0, Counter[str]()
    for build in args.builds:
        print(f"==== {build}", flush=True)
        one_status, counts = run(args.meson, build)
        status = status or one_status
        total += counts
    print(f"{total['passed']} passed, {total['failed']} failed, {total['skipped']} skipped")
    return status


if __name__ == "__main__":
    sys.exit(main())
