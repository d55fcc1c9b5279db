"""`plctool port-check` against the board, with its power switched."""

from __future__ import annotations

import os

import pytest

from plctool.device import Plc
from plctool.link.connection import Connection
from plctool.link.transports import make_link
from plctool.port_check import outcome_text, run_port_check

# On a host that nothing else uses (QUIET_HOST=1) QEMU's clock is the host's, and its line is faster than 115200 baud.
# On others it counts instructions, and its time stands still whenever it gets no processor.
QUIET = os.environ.get("QUIET_HOST") == "1"
CLOCK, BAUD, MAX_DRIFT = ("host", 115200, 0.05) if QUIET else ("follow", 9600, 0.9)
LINK = make_link("serial", "the board's", baud=BAUD)

# Configuration, its clock (without monitoring nothing looks at it), and what cannot be checked there.
CONFIGURATIONS = {
    "standard": (CLOCK, set()),
    "minimal": ("slow", {"clock", "timer", "retain, warm reset", "retain, cold reset", "stack headroom"}),
}


@pytest.mark.parametrize("config", CONFIGURATIONS)
def test_board_keeps_what_the_runtime_expects(make_board, tmp_path, monkeypatch, config):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    clock, missing = CONFIGURATIONS[config]
    board = make_board(config)
    board.power_on(clock)

    def power_cycle():
        board.power_off()
        board.power_on(clock)

    report = run_port_check(
        lambda: Plc(Connection(board.line())), link=LINK, max_drift=MAX_DRIFT, power_cycle=power_cycle
    )
    print(*map(outcome_text, report.outcomes), sep="\n")
    assert [(o.name, o.text) for o in report.outcomes if o.verdict == "failed"] == []
    assert {o.name for o in report.outcomes if o.verdict == "not available"} == missing
