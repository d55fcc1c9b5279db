"""How often a controller is asked."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from plctool.debug.symbols import SymbolTable
from plctool.debug.variables import Reading, Symbol
from plctool.errors import DeviceError
from plctool.sim import Simulator
from plctool.testing.waiting import PATIENCE, eventually
from plctool.ui.live import Live, Target, Wanted


class Counted(Simulator):
    """Remembers what it was asked for."""

    def __init__(self, *args: Any, **words: Any) -> None:
        super().__init__(*args, **words)
        self.read_names: list[Sequence[str]] = []

    def sample_symbols(self, table: SymbolTable, symbols: dict[str, Symbol]) -> Reading:
        self.read_names.append(sorted(symbols))
        return super().sample_symbols(table, symbols)


@pytest.fixture
def live(folder: Path) -> Iterator[tuple[Live, Counted]]:
    """The loop in a thread of its own, which makes the simulator."""
    published: list[tuple[str, Any]] = []
    made: list[Counted] = []
    begun = Live(Target("counted", lambda: made[0]), lambda topic, content: published.append((topic, content)))

    def run() -> None:
        made.append(Counted.from_file(folder / "app.cdl"))
        begun.run(made[0])

    thread = threading.Thread(target=run)
    thread.start()
    eventually(lambda: ("link", {"name": "counted", "connected": True, "message": ""}) in published)
    yield begun, made[0]
    begun.end()
    thread.join(PATIENCE)
    assert not thread.is_alive()


def test_nothing_is_read_without_a_browser(live: tuple[Live, Counted]) -> None:
    loop, plc = live
    for _ in range(100):
        loop.do(lambda plc: None).result(PATIENCE)
    assert plc.read_names == []


def test_all_browsers_share_one_reading(live: tuple[Live, Counted]) -> None:
    loop, plc = live
    loop.want(Wanted(2, frozenset(["Main.n", "Main.still"])))
    eventually(lambda: len(plc.read_names) >= 3)
    assert plc.read_names[:3] == [["Main.n", "Main.still"]] * 3


def test_it_pauses_when_the_last_browser_has_left(live: tuple[Live, Counted]) -> None:
    loop, plc = live
    loop.want(Wanted(1, frozenset(["Main.n"])))
    eventually(lambda: plc.read_names)
    loop.want(Wanted())
    loop.do(lambda plc: None).result(PATIENCE)
    count = len(plc.read_names)
    for _ in range(100):
        loop.do(lambda plc: None).result(PATIENCE)
    assert len(plc.read_names) == count


def test_a_controller_that_refuses_is_asked_again_later(
    live: tuple[Live, Counted], monkeypatch: pytest.MonkeyPatch
) -> None:
    loop, plc = live
    asked: list[int] = []

    def refuse() -> None:
        asked.append(1)
        raise DeviceError("Not now.")

    monkeypatch.setattr(plc, "status", refuse)
    loop.want(Wanted(1, frozenset(["Main.n"])))
    eventually(lambda: len(asked) >= 2)
    assert len(plc.read_names) <= len(asked) + 1
    monkeypatch.undo()
    before = len(plc.read_names)
    eventually(lambda: len(plc.read_names) > before + 1)
