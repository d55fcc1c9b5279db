"""`plctool port-check` against the board, with its power switched."""

from __future__ import annotations

from plctool.device import Plc
from plctool.link.connection import Connection
from plctool.port_check import outcome_text, run_port_check

BAUD = 115200
MAX_DRIFT = 0.9  # the board's time stands still whenever QEMU gets no processor


def test_board_keeps_what_the_runtime_expects(board, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))

    def power_cycle():
        board.power_off()
        board.power_on()

    report = run_port_check(
        lambda: Plc(Connection(board.line())), baud=BAUD, max_drift=MAX_DRIFT, power_cycle=power_cycle
    )
    print(*map(outcome_text, report.outcomes), sep="\n")
    failed = [(o.name, o.text) for o in report.outcomes if o.verdict == "failed"]
    assert failed == []
