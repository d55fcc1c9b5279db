"""The throughput of a line is that of the best download: a busy machine makes some of them slow, never one fast."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from plctool.port_check.checks import DOWNLOAD_TRIES, Checks
from plctool.port_check.report import CheckFailed

SIZE = 1152  # bytes: 0.1 s at 115200 baud


def checks(*seconds: float) -> tuple[Checks, list[float]]:
    """With a bench whose downloads take so long, and those that were not made."""
    left = list(seconds)
    bench: Any = SimpleNamespace(
        link=SimpleNamespace(options={"baud": "115200"}),
        flash=lambda text: SimpleNamespace(bytes=SIZE, seconds=left.pop(0)),
    )
    return Checks(bench, None, max_drift=0.01), left


def test_one_download_that_is_fast_enough_is_enough() -> None:
    check, left = checks(0.125, 9.0)
    assert check.throughput() == (
        "1152 bytes at 9216 bytes/s: 80 % of the byte rate", {"bytes": SIZE, "bytes_per_s": 9216, "share": 0.8}
    )  # fmt: skip
    assert left == [9.0]


def test_a_download_that_this_machine_held_up_is_made_again() -> None:
    check, left = checks(0.5, 0.25, 0.125, 9.0)
    assert "80 %" in check.throughput()[0]
    assert left == [9.0]


def test_a_line_that_is_never_fast_enough_fails_with_its_best() -> None:
    check, left = checks(*[0.5] * (DOWNLOAD_TRIES - 1), 0.25)
    with pytest.raises(CheckFailed, match="40 % of the byte rate; at least 50 % are expected"):
        check.throughput()
    assert left == []
