"""The command line in this process, with a fake controller on its serial port where a test wants one."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parents[1] / "link"))

from done import Done, run_here
from fake_device import FakeDevice, FakeLine, FakePlc
from small_app import make_application

from plctool.debug.symbols import symbol_path
from plctool.link.transport import BlockTransport
from plctool.link.transports import TRANSPORTS, Link

Tool = Callable[..., Done]


@pytest.fixture(autouse=True)
def scratch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Commands run in a folder of their own, with a cache of their own, and have the port to themselves."""
    monkeypatch.setenv("PLCTOOL_GATEWAY", "off")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def tool(capsys: pytest.CaptureFixture[str]) -> Tool:
    """Runs plctool with the given words."""

    def run(*words: str) -> Done:
        return run_here(capsys, *words)

    return run


Opener = Callable[[Callable[[Link], BlockTransport]], None]


@pytest.fixture
def serial_opened_by(monkeypatch: pytest.MonkeyPatch) -> Opener:
    """Has serial links opened by a function of the test."""

    def use(function: Callable[[Link], BlockTransport]) -> None:
        monkeypatch.setitem(TRANSPORTS, "serial", replace(TRANSPORTS["serial"], open=function))

    return use


@pytest.fixture
def plc(serial_opened_by: Opener) -> FakePlc:
    """A fake controller without application on every port."""
    fake = FakePlc()
    fake.image = b""
    controller = FakeDevice(fake.handle)

    def open_transport(link: Link) -> BlockTransport:
        assert link.place == "/dev/fake"
        return FakeLine(controller, baud=int(link.options["baud"]))

    serial_opened_by(open_transport)
    return fake


@pytest.fixture
def image(scratch: Path) -> Path:
    """An image made by hand and its symbols."""
    data, symbols = make_application()
    path = scratch / "small.cdl"
    path.write_bytes(data)
    symbol_path(path).write_text(symbols.to_json())
    return path
