"""`plctool latency`: how late the cycles of each task began, as a histogram, beside what cyclictest measures."""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from plctool.cli.arguments import add_link, duration_ms
from plctool.cli.connections import on_device
from plctool.cli.parser import Parser
from plctool.errors import DeviceError, UsageError

if TYPE_CHECKING:
    from plctool.device import Plc
    from plctool.link.services import Lateness, TaskInfo

QUANTILES = {"50%": 0.5, "99%": 0.99, "99.9%": 0.999}
CYCLICTEST_PRIORITY = 80  # that of an IEC priority 0 in plcrt
_CYCLICTEST = re.compile(r"^T:.*\bMin: *(\d+) .*\bAvg: *(\d+) Max: *(\d+)", re.MULTILINE)
_BAR = 40  # characters
_SHORTEST_S = 1.0  # that cyclictest measures
_COUNTS = 1 << 32  # the device counts modulo this
_DEFAULT_INTERVAL_US = 1000


def latency_arguments(command: Parser) -> None:
    command.add_argument(
        "--time", type=duration_ms, metavar="T#10s", help="only those of the next 10 s, instead of all since its start"
    )
    command.add_argument(
        "--cyclictest", action="store_true",
        help="measure this machine with cyclictest as well; only of use on the controller itself",
    )  # fmt: skip
    add_link(command)
    command.set_defaults(action=_latency)


def _latency(args: argparse.Namespace) -> int:
    return on_device(args, lambda plc: latency(plc, args.time, args.cyclictest), latency_text)


def latency(plc: Plc, milliseconds: float | None, cyclictest: bool) -> dict[str, Any]:
    """The lateness of each task: of all starts, or of those in the next `milliseconds`."""
    before = plc.lateness() if milliseconds is not None else None
    begin = time.monotonic()
    if milliseconds is not None:
        time.sleep(milliseconds / 1000)
    seconds = time.monotonic() - begin
    after, tasks = plc.lateness(), plc.tasks()
    if len(after) != len(tasks) or (before is not None and len(before) != len(after)):
        raise DeviceError("The program was replaced during the measurement. Measure again.", "program-changed")
    counted = after if before is None else [_since(*pair) for pair in zip(before, after, strict=True)]
    return {
        "seconds": None if before is None else round(seconds, 3),
        "tasks": [_task_document(*pair) for pair in zip(tasks, counted, strict=True)],
        "cyclictest": _cyclictest(tasks, seconds) if cyclictest else None,
    }


def _since(before: Sequence[Lateness], after: Sequence[Lateness]) -> list[Lateness]:
    """The starts that `after` counts and `before` does not. Raises DeviceError if the counts began again."""
    from plctool.link.services import Lateness

    known = {lateness.below_ns: lateness.count for lateness in before}
    if known.keys() - {lateness.below_ns for lateness in after}:
        raise DeviceError("The program was reset during the measurement. Measure again.", "program-changed")
    new = [Lateness(late.below_ns, (late.count - known.get(late.below_ns, 0)) % _COUNTS) for late in after]
    return [late for late in new if late.count]


def _task_document(task: TaskInfo, counted: Sequence[Lateness]) -> dict[str, Any]:
    starts = sum(lateness.count for lateness in counted)
    return {
        "name": task.name,
        "interval_us": task.interval_us,
        "starts": starts,
        "below_us": {name: _quantile(counted, share * starts) for name, share in QUANTILES.items()} if starts else {},
        "latest_us": task.jitter_us,
        "overruns": task.overruns,
        "histogram": [{"below_us": late.below_ns / 1000, "starts": late.count} for late in counted],
    }


def _quantile(counted: Sequence[Lateness], starts: float) -> float:
    """Where the class ends with which the sum of starts reaches a number [us]."""
    total = 0
    for lateness in counted:
        total += lateness.count
        if total >= starts:
            break
    return lateness.below_ns / 1000


def _cyclictest(tasks: Sequence[TaskInfo], seconds: float) -> dict[str, Any]:
    """What cyclictest measures on this machine in the interval of the fastest task, for as long [us]."""
    program = shutil.which("cyclictest")
    if program is None:
        raise UsageError("cyclictest was not found: sudo apt-get install rt-tests", "no-cyclictest")
    interval_us = min((task.interval_us for task in tasks if task.interval_us), default=_DEFAULT_INTERVAL_US)
    options = ["-q", "-m", f"-p{CYCLICTEST_PRIORITY}", f"-i{interval_us}", f"-D{max(seconds, _SHORTEST_S):.0f}"]
    done = subprocess.run([program, *options], capture_output=True, text=True)
    found = _CYCLICTEST.search(done.stdout)
    if found is None:
        said = (done.stderr.strip() or done.stdout.strip()).split("\n")[-1]
        raise UsageError(f"cyclictest did not measure: {said}", "cyclictest")
    names = ("min_us", "avg_us", "max_us")
    return {"interval_us": interval_us, **{name: int(text) for name, text in zip(names, found.groups(), strict=True)}}


def latency_text(document: dict[str, Any]) -> str:
    """A histogram for each task, and the figures of cyclictest."""
    if not document["tasks"]:
        return "The device has no tasks. Flash a program first."
    blocks = [_task_text(task, document["seconds"]) for task in document["tasks"]]
    if found := document["cyclictest"]:
        every = f"every {_time_text(found['interval_us'])}"
        blocks.append(
            f"cyclictest on this machine, {every}: at least {found['min_us']} us late, on average "
            f"{found['avg_us']} us, at most {found['max_us']} us"
        )
    return "\n\n".join(blocks)


def _task_text(task: dict[str, Any], seconds: float | None) -> str:
    period = "since the program was loaded" if seconds is None else f"in {seconds:.1f} s"
    every = f", every {_time_text(task['interval_us'])}" if task["interval_us"] else ""
    lines = [f"{task['name']}: {task['starts']} cycles {period}{every}"]
    rows = _octaves(task["histogram"])
    most = max((starts for _, starts in rows), default=1)
    for below_us, starts in rows:
        bar = "#" * max(1, round(_BAR * starts / most)) if starts else ""
        lines.append(f"  late by less than {_time_text(below_us):>8}  {starts:>10}  {bar}".rstrip())
    if task["starts"]:
        shares = ", ".join(f"{name} below {_time_text(us)}" for name, us in task["below_us"].items())
        lines.append(f"  {shares}; the latest since its start: {_time_text(task['latest_us'])}")
    return "\n".join(lines)


def _octaves(histogram: Sequence[dict[str, Any]]) -> list[tuple[float, int]]:
    """Classes joined to powers of 2 of a nanosecond, without gaps: where each ends [us], and its starts."""
    counts: dict[int, int] = {}
    for row in histogram:
        power = (round(row["below_us"] * 1000) - 1).bit_length()
        counts[power] = counts.get(power, 0) + row["starts"]
    return [(2**power / 1000, counts.get(power, 0)) for power in range(min(counts), max(counts) + 1)] if counts else []


def _time_text(us: float) -> str:
    """A time with three digits."""
    for unit, size in (("s", 1e6), ("ms", 1e3)):
        if us >= size:
            return f"{us / size:.3g} {unit}"
    return f"{us:.3g} us"
