"""PLCTOOL_PATIENCE holds for the tool that has it, also if another one started the gateway."""

from __future__ import annotations

import pytest
from served import Served

from plctool.errors import LinkError


def seconds_until_given_up(served: Served) -> float:
    """On the virtual clock of the line, which is cut."""
    begin = served.line.now()
    with pytest.raises(LinkError, match=r"No device answers|does not answer"):
        served.connect().status()
    return served.line.now() - begin


def test_a_device_may_be_silent_for_as_long_as_each_tool_says(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    served.line.cut = True
    seconds_until_given_up(served)  # from now on the device is known to be silent
    usual = seconds_until_given_up(served)
    monkeypatch.setenv("PLCTOOL_PATIENCE", "12")
    long = seconds_until_given_up(served)
    monkeypatch.setenv("PLCTOOL_PATIENCE", "3")
    assert long == pytest.approx(4 * usual, rel=0.2)
    assert seconds_until_given_up(served) == pytest.approx(usual, rel=0.1)


@pytest.mark.parametrize("nonsense", [0, 1e9])
def test_a_factor_that_makes_no_sense_is_one(served: Served, nonsense: float) -> None:
    guest = served.guest(patience=nonsense)
    assert served.call(guest, "others").document["tools"] == []
    assert [tool.patience for tool in served.gateway.tools()] == [1.0]
