"""Which parameter of a device is meant, and of which type it is."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from plctool.cli.commands.io import _parameter
from plctool.errors import UsageError

GAIN = {"name": "gain", "id": 16, "type": "REAL"}


def meant(parameter: str, type_name: str | None = None) -> tuple[int, str]:
    io = {"devices": [{"name": "Analog", "parameters": [GAIN]}]}
    plc: Any = SimpleNamespace(symbols=lambda: SimpleNamespace(io=io))
    number, t = _parameter(plc, "analog", parameter, type_name)
    return number, str(t)


@pytest.mark.parametrize("parameter", ["gain", "GAIN", "16", "0x10"])
def test_one_of_the_description_has_its_type_however_it_is_named(parameter: str) -> None:
    assert meant(parameter) == (16, "REAL")


def test_a_number_that_the_description_has_not_is_one_all_the_same() -> None:
    assert meant("0x20") == (32, "UDINT")
    assert meant("0x20", "string[20]") == (32, "STRING[20]")


@pytest.mark.parametrize("name", ["12", "²", "STRING[0]", "STRING[256]", "STRING[-1]", "STRING[²]", "STRING[]", "FB"])
def test_what_is_no_type_of_a_parameter_is_refused(name: str) -> None:
    with pytest.raises(UsageError, match="A parameter cannot be"):
        meant("0x20", name)
