"""The wall clock of the simulator: it follows virtual time, and each simulator has its own."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime, timedelta, timezone

import pytest

from plctool.errors import UsageError
from plctool.sim import Simulator

PROGRAM = """
PROGRAM Main
VAR now : DT; ms : SYSTIME; result : UDINT; END_VAR
now := UTC_NOW();
result := SysTimeRtcHighResGet(ms);
END_PROGRAM
"""


@pytest.fixture
def plc(tmp_path) -> Iterator[Simulator]:
    path = tmp_path / "app.st"
    path.write_text(PROGRAM)
    with Simulator.from_sources(path) as simulator:
        yield simulator


def now(plc: Simulator) -> datetime:
    plc.run_cycles(1)
    return datetime(1970, 1, 1, tzinfo=UTC) + timedelta(milliseconds=plc.read("Main.ms"))


def test_clock_begins_with_the_year_2000_and_follows_virtual_time(plc: Simulator) -> None:
    first = now(plc)
    assert first == datetime(2000, 1, 1, tzinfo=UTC)
    plc.run_for(seconds=3600)
    assert timedelta(hours=1) <= now(plc) - first < timedelta(hours=1, seconds=1)


def test_clock_is_set_from_the_host_and_goes_on_over_power_off(plc: Simulator) -> None:
    plc.set_clock(datetime(2026, 3, 29, 3, tzinfo=timezone(timedelta(hours=2))))
    plc.run_for(seconds=10)
    plc.restart()
    assert timedelta(seconds=10) <= now(plc) - datetime(2026, 3, 29, 1, tzinfo=UTC) < timedelta(seconds=11)


def test_time_before_1970_is_refused(plc: Simulator) -> None:
    with pytest.raises(UsageError, match="from 1970 on"):
        plc.set_clock(datetime(1969, 12, 31))
