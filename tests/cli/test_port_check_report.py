"""What the port check makes of how a check ends."""

from __future__ import annotations

import json
from datetime import UTC, datetime

import pytest

from plctool.errors import LinkError
from plctool.link.services import Identity
from plctool.link.transports import parse_link
from plctool.port_check.report import Check, CheckFailed, NotAvailable, Report, judge, outcome_text, summary_text

IDENTITY = Identity("Device", "Vendor", "node", "1", 0x1000, 0x9001, "1.0.0.0", "1.0.0.0")


def ends_with(error):
    def check():
        raise error

    return judge(Check("name", check))


@pytest.mark.parametrize(
    "error, verdict, text, figures",
    [
        (CheckFailed("too slow", rate=7), "failed", "too slow", {"rate": 7}),
        (NotAvailable("not built in"), "not available", "not built in", {}),
        (LinkError("The line is gone."), "failed", "The line is gone.", {}),
    ],
)
def test_the_end_of_a_check_is_its_verdict(error, verdict, text, figures):
    outcome = ends_with(error)
    assert (outcome.verdict, outcome.text, outcome.figures) == (verdict, text, figures)
    assert outcome_text(outcome).split() == [*verdict.split(), "name", *text.split()]


def test_report_counts_verdicts():
    good = judge(Check("good", lambda: ("fine", {"share": 0.7}), {"share": ("min", 0.5)}))
    outcomes = [good, ends_with(CheckFailed("bad")), ends_with(NotAvailable("silent"))]
    report = Report(
        IDENTITY,
        "x86_64-linux",
        parse_link("serial:/dev/ttyS0"),
        outcomes,
        "0.1.0",
        datetime(2026, 11, 21, 8, 5, tzinfo=UTC),
    )
    document = json.loads(json.dumps(report.document()))
    assert (document["format"], document["date"]) == (1, "2026-11-21T08:05:00+00:00")
    assert (document["plctool"], document["baud"], document["device"]["vendor_name"]) == ("0.1.0", 115200, "Vendor")
    assert document["checks"][0]["figures"] == {"share": 0.7}
    assert document["checks"][0]["limits"] == {"share": {"min": 0.5}}
    assert (document["passed"], document["failed"], document["not_available"]) == (1, 1, 1)
    who, when, counts = summary_text(report).split("\n")
    assert when == "2026-11-21 08:05 UTC, plctool 0.1.0, 115200 baud"
    assert who == "Device of Vendor, version 1.0.0.0, serial number 1, runtime 1.0.0.0, x86_64-linux"
    assert counts == "1 passed, 1 failed, 1 not available"
