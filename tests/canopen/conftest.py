"""A foreign device, PyPI canopen's LocalNode, on python-can's virtual bus, and plctool in this process."""

from __future__ import annotations

import itertools
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import canopen
import pytest

sys.path.append(str(Path(__file__).parents[1]))

from done import Done, run_here

VALVES = Path(__file__).parents[2] / "examples/canopen/valves.eds"
NODE = 5
_channels = itertools.count()


Tool = Callable[..., Done]


@pytest.fixture(autouse=True)
def scratch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Commands run in a folder of their own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PLC_LINK", raising=False)
    return tmp_path


@pytest.fixture
def channel() -> str:
    """A virtual bus for this test alone."""
    return f"canopen-{os.getpid()}-{next(_channels)}"


@pytest.fixture
def tool(channel: str, capsys: pytest.CaptureFixture[str]) -> Tool:
    """Runs `plctool canopen` on the bus of the test."""

    def run(*words: str) -> Done:
        return run_here(capsys, "canopen", *words, "--can", f"virtual:{channel}")

    return run


@pytest.fixture
def network(channel: str) -> Iterator[canopen.Network]:
    """The other end of the bus."""
    found = canopen.Network()
    found.connect(interface="virtual", channel=channel)
    yield found
    with suppress(Exception):
        found.disconnect()


@pytest.fixture
def device(network: canopen.Network) -> canopen.LocalNode:
    """Node 5, a valve terminal."""
    return network.create_node(NODE, str(VALVES))
