"""What the port check found: one outcome per check, and the report that a vendor files."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

from plctool.errors import PlcError
from plctool.link.services import Identity
from plctool.link.transports import Link
from plctool.printable import one_line
from plctool.version import plctool_version

FORMAT = 1  # of the document; grows when something is named or meant otherwise than before

Result = tuple[str, dict[str, Any]]


class CheckFailed(Exception):
    """What a check found wrong, for people; `figures` as far as there are any."""

    def __init__(self, text: str, **figures: Any) -> None:
        super().__init__(text)
        self.figures = figures


class NotAvailable(Exception):
    """The controller is built without what a check looks at; that is no failure."""


@dataclass(frozen=True)
class Check:
    """Something to be checked. `limits` are those of its figures, by their names: a pair such as ("max", 0.01)."""

    name: str
    run: Callable[[], Result]
    limits: Mapping[str, tuple[str, Any]] = field(default_factory=dict)


@dataclass(frozen=True)
class Outcome:
    """One line of the report: `verdict` is "passed", "failed" or "not available"."""

    name: str
    verdict: str
    text: str
    seconds: float
    figures: dict[str, Any] = field(default_factory=dict)
    limits: Mapping[str, tuple[str, Any]] = field(default_factory=dict)

    def document(self) -> dict[str, Any]:
        limits = {name: dict([limit]) for name, limit in self.limits.items()}
        return vars(self) | {"limits": limits}


@dataclass(frozen=True)
class Report:
    """All that a vendor files: who was checked, when and with what, and how each check went."""

    identity: Identity
    target: str
    link: Link
    outcomes: list[Outcome]
    plctool: str = field(default_factory=plctool_version)
    date: datetime = field(default_factory=lambda: datetime.now(UTC))

    def count(self, verdict: str) -> int:
        return sum(outcome.verdict == verdict for outcome in self.outcomes)

    def document(self) -> dict[str, Any]:
        """For --json."""
        return {
            "format": FORMAT,
            "date": self.date.isoformat(timespec="seconds"),
            "plctool": self.plctool,
            **self.link.options,
            "device": vars(self.identity) | {"target": self.target},
            "checks": [outcome.document() for outcome in self.outcomes],
            "passed": self.count("passed"),
            "failed": self.count("failed"),
            "not_available": self.count("not available"),
        }


def outcome_text(outcome: Outcome) -> str:
    """The line of one check."""
    return f"{outcome.verdict:<15}{outcome.name:<30}{outcome.text}"


def summary_text(report: Report) -> str:
    """The last lines: who was checked, and how often each verdict was given."""
    who = report.identity
    missing = report.count("not available")
    options = "".join(f", {value} {name}" for name, value in report.link.options.items())
    tail = f", {missing} not available" if missing else ""
    return (
        f"{one_line(who.device_name)} of {one_line(who.vendor_name)}, version {one_line(who.version)}, serial number "
        f"{one_line(who.serial_number)}, runtime {one_line(who.runtime_version)}, {report.target}\n"
        f"{report.date:%Y-%m-%d %H:%M} UTC, plctool {report.plctool}{options}\n"
        f"{report.count('passed')} passed, {report.count('failed')} failed{tail}"
    )


def judge(check: Check) -> Outcome:
    """Runs a check; how it ends is its verdict."""
    begin = time.monotonic()
    try:
        verdict, (text, figures) = "passed", check.run()
    except NotAvailable as reason:
        verdict, text, figures = "not available", str(reason), {}
    except CheckFailed as failure:
        verdict, text, figures = "failed", str(failure), failure.figures
    except PlcError as error:
        verdict, text, figures = "failed", error.message, {}
    return Outcome(check.name, verdict, text, round(time.monotonic() - begin, 3), figures, check.limits)
