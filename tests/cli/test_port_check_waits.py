"""How the port check sees that a program runs which fails after some cycles."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from plctool.errors import DeviceError
from plctool.link.services import AppState
from plctool.link.transports import parse_link
from plctool.port_check.bench import NO_SERVICE, Bench
from plctool.port_check.report import CheckFailed


class WithoutMonitoring:
    """A controller that has a state, and no variables that can be read."""

    def __init__(self, state: AppState) -> None:
        self._state = state

    def status(self) -> Any:
        return SimpleNamespace(state=self._state)

    def read(self, name: str) -> Any:
        raise DeviceError(f"no {name}", next(iter(NO_SERVICE)))


def bench(state: AppState, folder: Path) -> Bench:
    plc: Any = WithoutMonitoring(state)
    return Bench(lambda: plc, plc, "cortex-m3", folder, parse_link("serial:/dev/ttyS0"))


@pytest.mark.parametrize("fails", [False, True])
@pytest.mark.parametrize("state", AppState)
def test_it_has_run_if_it_runs_or_has_failed_again(tmp_path: Path, state: AppState, fails: bool) -> None:
    if state is AppState.RUN or (fails and state is AppState.EXCEPTION):
        bench(state, tmp_path).wait_until_it_runs(fails=fails)
    else:
        with pytest.raises(CheckFailed, match=f"its state is {state}"):
            bench(state, tmp_path).wait_until_it_runs(fails=fails)
