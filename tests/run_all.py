"""Runs the tests of the build folders given as one pool, and prints what was skipped, the failures and one closing
line over all.

A process runs for each processor and two more (or --jobs), because many tests wait more than they work. Those with
the highest priority, which is about their seconds, come first, so that no processor idles while the last long one
ends. The C tests of a folder, which are short, are one process: a `meson test`. Its short Python tests of a board with
the same environment are one, too: most of their time is the start of Python.

C tests count as one test each; pytest suites are counted by their own tests, from the JUnit files they leave. What a
process printed is in meson-logs/, and here if it failed.

The Python tests that took most of the processors are listed: where `make test` is to be made faster.

At the end the tests that failed run once more, one after the other, with nothing beside them. A test that passes then
is listed as FLAKY and does not fail the run: a race is mended, but it does not cost the work that it came with.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import signal
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
C_TESTS_SECONDS = 60  # of one folder, about
SHORT_SECONDS = 40  # shorter tests of a board share a process
SKIPPED = 77  # exit status, as for meson: there was nothing that could be tested
LOOK_EVERY = 0.02  # for processes that ended [s]
LISTED = 20  # tests that took most
MOST_REPEATED = 8  # tests that failed; if there are more, the change has broken something


@dataclass
class Outcome:
    """Of some tests: their number by outcome, and the first line of each failure, and of the reason of each skip, after
    the name of the test. `failed`: the arguments with which the runner of the tests repeats those that failed. `used`:
    seconds of processors and name of each test whose report has them."""

    counts: Counter[str]
    failures: list[str]
    skips: list[str]
    failed: list[str] = field(default_factory=list)
    used: list[tuple[float, str]] = field(default_factory=list)


@dataclass(frozen=True)
class Job:
    """What one process tests. `seconds`: it takes, about; `timeout` [s]: it is given; `report`: where it leaves what
    became of its tests, if it does."""

    name: str
    command: list[str]
    seconds: int
    timeout: float
    report: Path
    output: Path
    folder: str | None = None
    env: dict[str, str] = field(default_factory=dict)


@dataclass
class Running:
    """The process of a job, and when it began and is killed [s of time.monotonic]."""

    job: Job
    process: subprocess.Popen[bytes]
    begin: float
    end: float

    @classmethod
    def start(cls, job: Job) -> Running:
        job.report.unlink(missing_ok=True)
        with job.output.open("wb") as output:
            process = subprocess.Popen(
                job.command, cwd=job.folder, env=os.environ | job.env, start_new_session=True,
                stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT,
            )  # fmt: skip
        now = time.monotonic()
        return cls(job, process, now, now + job.timeout)

    def kill(self) -> None:
        """With all it started; its end is still to be waited for."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)


@dataclass
class Done:
    """A job that ended. `seconds`: from begin to end; `used`: of processors, with the processes it waited for."""

    job: Job
    status: int
    seconds: float
    used: float

    @property
    def is_good(self) -> bool:
        return self.status in (0, SKIPPED)

    @property
    def outcome(self) -> Outcome:
        """Of its tests; a process that failed without a test that did is a failure of its own."""
        if self.status == SKIPPED:
            return Outcome(Counter(skipped=1), [], [_first_line(self.job.output.read_text(errors="replace"))])
        if not self.job.report.exists():
            outcome = Outcome(Counter({"failed" if self.status else "passed": 1}), [], [])
        elif self.job.report.suffix == ".xml":
            outcome = pytest_outcome(self.job.report)
        else:
            outcome = meson_outcome(self.job.report)
        if self.status and not outcome.failures:
            outcome.failures.append(f"exit status {self.status}, see {self.job.output}")
        return outcome


def _first_line(text: str) -> str:
    return next(iter(text.strip().splitlines()), "")


def pytest_outcome(report: Path) -> Outcome:
    """The tests in a pytest JUnit file."""
    suite = next(ET.parse(report).getroot().iter("testsuite"))
    total, failed, skipped = (int(suite.get(key, "0")) for key in ("tests", "failures", "skipped"))
    failed += int(suite.get("errors", "0"))

    def messages(*tags: str) -> list[str]:
        return [
            f"{case.get('classname')}::{case.get('name')}: {_first_line(found.get('message', ''))}"
            for case in suite.iter("testcase")
            for tag in tags
            for found in case.findall(tag)
        ]

    counts = Counter(passed=total - failed - skipped, failed=failed, skipped=skipped)
    wrong = [
        case for case in suite.iter("testcase") if case.find("failure") is not None or case.find("error") is not None
    ]
    names = dict.fromkeys(_node_id(case.get("classname", ""), case.get("name", "")) for case in wrong)
    used = [
        (float(found.get("value", "0")), f"{case.get('classname')}::{case.get('name')}")
        for case in suite.iter("testcase")
        for found in case.iterfind("properties/property[@name='processors']")
    ]
    return Outcome(counts, messages("failure", "error"), messages("skipped"), list(names), used)


def _node_id(classname: str, name: str) -> str:
    """Returns what pytest takes to run one test: `tests.cli.test_x.TestY` and `test_z` are of tests/cli/test_x.py."""
    parts = classname.split(".")
    for end in range(len(parts), 0, -1):
        file = Path(*parts[:end]).with_suffix(".py")
        if (ROOT / file).is_file():
            return "::".join([str(file), *parts[end:], name])
    return name


def meson_outcome(log: Path) -> Outcome:
    """The tests in a log of meson."""
    tests = [json.loads(line) for line in log.read_text().splitlines()]
    outcomes = [{"OK": "passed", "SKIP": "skipped"}.get(test["result"], "failed") for test in tests]
    failures = [f"{t['name']}: {t['result']}" for t, o in zip(tests, outcomes, strict=True) if o == "failed"]
    skipped = [t for t, o in zip(tests, outcomes, strict=True) if o == "skipped"]
    skips = [f"{t['name']}: {_first_line(t.get('stdout', '') + t.get('stderr', ''))}" for t in skipped]
    failed = [t["name"].rpartition(":")[2] for t, o in zip(tests, outcomes, strict=True) if o == "failed"]
    return Outcome(Counter(outcomes), failures, skips, failed)


def c_tests(meson: str, build: Path, suite: str) -> Job:
    """The C tests of a suite in a build folder."""
    logs = build / "meson-logs"
    command = [meson, "test", "-C", str(build), "--print-errorlogs", "--no-rebuild", "--num-processes", "1"]
    return Job(
        f"{build.name} {suite}", [*command, "--suite", suite], C_TESTS_SECONDS, float("inf"),
        logs / "testlog.json", logs / f"{suite}.txt",
    )  # fmt: skip


def jobs_of(meson: str, build: Path) -> Iterator[Job]:
    """All tests of a build folder."""
    logs, reports = build / "meson-logs", build / "pytest-reports"
    yield c_tests(meson, build, "c")
    tests = json.loads(subprocess.check_output([meson, "introspect", "--tests", str(build)]))
    for group in processes(test for test in tests if _is_in(test, "python")):
        name = group[0]["name"]
        report = reports / f"{name}.xml"
        more = f" and {len(group) - 1} more" if len(group) > 1 else ""
        yield Job(
            f"{build.name} {name}{more}", command_of(group, report),
            sum(test["priority"] for test in group), max(test["timeout"] for test in group),
            report, logs / f"{name}.txt", group[0]["workdir"], group[0]["env"],
        )  # fmt: skip


def _is_in(test: dict[str, Any], suite: str) -> bool:
    return any(name.endswith(f":{suite}") for name in test["suite"])


def processes(tests: Iterable[dict[str, Any]]) -> list[list[dict[str, Any]]]:
    """Returns the short tests of a board with the same environment together, any other alone."""
    groups: dict[str, list[dict[str, Any]]] = {}
    for test in tests:
        is_shared = _is_in(test, "target") and test["priority"] < SHORT_SECONDS
        key = str(sorted(test["env"].items())) if is_shared else test["name"]
        groups.setdefault(key, []).append(test)
    return list(groups.values())


def command_of(group: list[dict[str, Any]], report: Path) -> list[str]:
    """Returns the command of a test, or that of pytest with the files of all."""
    if len(group) == 1:
        return list(group[0]["cmd"])
    first, module = group[0]["cmd"], group[0]["cmd"].index("pytest") + 1
    files = [word for test in group for word in test["cmd"][module:] if not word.startswith("--junit-xml=")]
    return [*first[:module], *files, f"--junit-xml={report}"]


def repetition(done: Done) -> Job:
    """Returns the job that repeats the tests of a job which failed; all of them if it does not say which."""
    job, failed = done.job, done.outcome.failed
    if not failed:
        return job
    if job.report.suffix != ".xml":
        return replace(job, command=[*job.command[: job.command.index("--suite")], *failed])
    module = job.command.index("pytest") + 1
    report = job.report.with_stem(f"{job.report.stem}-again")
    return replace(job, command=[*job.command[:module], *failed, f"--junit-xml={report}"], report=report)


def repeat(failed: Iterable[Done]) -> Iterator[tuple[Done, bool]]:
    """Runs the tests that failed once more, one job after the other; gives each job, and whether it passed now."""
    for done in failed:
        job = repetition(done)
        (again,) = run([replace(job, output=job.output.with_stem(f"{job.output.stem}-again"))], 1)
        yield done, again.is_good


def run(jobs: Iterable[Job], at_once: int) -> Iterator[Done]:
    """Runs them in this order, so many at once, and gives them as they end."""
    waiting = list(reversed(list(jobs)))
    running: dict[int, Running] = {}
    try:
        while waiting or running:
            while waiting and len(running) < at_once:
                started = Running.start(waiting.pop())
                running[started.process.pid] = started
            for late in running.values():
                if time.monotonic() > late.end:
                    late.kill()
            pid, status, usage = os.wait4(-1, os.WNOHANG)
            if pid:
                ended = running.pop(pid)
                ended.process.returncode = os.waitstatus_to_exitcode(status)
                seconds = time.monotonic() - ended.begin
                yield Done(ended.job, ended.process.returncode, seconds, usage.ru_utime + usage.ru_stime)
            else:
                time.sleep(LOOK_EVERY)
    finally:
        for left in running.values():
            left.kill()


def most_used(tests: list[tuple[float, str]]) -> list[tuple[float, str]]:
    """Returns the tests that took most of the processors, the greatest first."""
    return sorted(tests, reverse=True)[:LISTED]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--meson", required=True)
    parser.add_argument("--jobs", type=int, default=(os.cpu_count() or 1) + 2, help="processes that run at once")
    parser.add_argument(
        "--processor", action="append", default=[], type=Path, metavar="BUILD",
        help="a build folder of which only those C tests run that depend on the processor",
    )  # fmt: skip
    parser.add_argument("builds", nargs="+", type=Path)
    args = parser.parse_args()
    if args.jobs < 1:
        parser.error("--jobs takes 1 or more")
    signal.signal(signal.SIGINT, signal.default_int_handler)  # tests send it; `make test &` would have it ignored
    jobs = [job for build in args.builds for job in jobs_of(args.meson, build.resolve())]
    jobs += [c_tests(args.meson, build.resolve(), "processor") for build in args.processor]
    jobs.sort(key=lambda job: -job.seconds)
    begin, used, counts, lines, failed = time.monotonic(), 0.0, Counter[str](), list[str](), list[Done]()
    broken: dict[str, list[str]] = {}
    tests: list[tuple[float, str]] = []
    for number, done in enumerate(run(jobs, args.jobs), 1):
        outcome = done.outcome
        result = "ok" if done.is_good else "failed"
        print(
            f"{number}/{len(jobs)} {done.job.name}: {result}, {done.seconds:.1f} s, {done.used:.1f} s of processors",
            flush=True,
        )
        if not done.is_good:
            print(done.job.output.read_text(errors="replace"), flush=True)
            failed.append(done)
        used += done.used
        tests += [(seconds, f"{done.job.name}: {test}") for seconds, test in outcome.used]
        counts += outcome.counts
        lines += [f"SKIPPED {done.job.name}: {skip}" for skip in outcome.skips]
        if done.is_good:
            continue
        broken[done.job.name] = [f"{done.job.name}: {failure}" for failure in outcome.failures]
    if sum(map(len, broken.values())) <= MOST_REPEATED:
        for done, passed in repeat(failed):
            if passed:
                flaky = broken.pop(done.job.name)
                lines += [f"FLAKY {failure}" for failure in flaky]
                counts += Counter(passed=len(flaky), flaky=len(flaky), failed=-len(flaky))
    lines += [f"FAILED {failure}" for failures in broken.values() for failure in failures]
    print(*(f"MOST {seconds:.1f} s of processors: {test}" for seconds, test in most_used(tests)), sep="\n")
    print(*sorted(lines, reverse=True), sep="\n")
    print(f"{time.monotonic() - begin:.0f} s, {used:.0f} s of processors")
    print(f"{counts['passed']} passed, {counts['failed']} failed, {counts['skipped']} skipped, {counts['flaky']} flaky")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
