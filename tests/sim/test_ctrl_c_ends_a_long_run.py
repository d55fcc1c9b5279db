"""Ctrl-C ends a run, however much virtual time or how many cycles were asked for."""

from __future__ import annotations

import _thread
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from plctool.sim import Simulator

DAYS = 30
INTERVAL_MS = 10
RUNS: dict[str, Callable[[Simulator], None]] = {
    "time": lambda plc: plc.run_for(seconds=86400 * DAYS),
    "cycles": lambda plc: plc.run_cycles(86400 * DAYS * 1000 // INTERVAL_MS),
}


@pytest.mark.parametrize("run", RUNS)
def test_a_long_run_ends(tmp_path: Path, run: str) -> None:
    (tmp_path / "main.st").write_text("PROGRAM Main VAR n : UDINT; END_VAR n := n + 1; END_PROGRAM")
    with Simulator.from_sources(tmp_path) as plc:

        def interrupt() -> None:
            while not plc.now_ns:
                time.sleep(0)
            _thread.interrupt_main()

        user = threading.Thread(target=interrupt)
        with pytest.raises(KeyboardInterrupt):
            user.start()
            RUNS[run](plc)
        user.join()
        assert plc.now_ns < 86400 * DAYS * 10**9 / 2
