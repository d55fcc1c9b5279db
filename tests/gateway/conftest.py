"""Fixtures of a gateway in this process (`served.py`)."""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "link"))

from served import Gate, Served

from plctool.testing import waiting


@pytest.fixture(autouse=True)
def runtime(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A runtime folder of the test's own, with a short name: a socket's address has little room."""
    folder = Path(tempfile.mkdtemp(prefix="gw"))
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder))
    monkeypatch.delenv("PLCTOOL_GATEWAY", raising=False)
    yield folder
    shutil.rmtree(folder)


@pytest.fixture
def eventually() -> Callable[[Callable[[], Any]], Any]:
    return waiting.eventually


@pytest.fixture
def served(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Served]:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    served = Served(tmp_path)
    yield served
    served.close()


@pytest.fixture
def gate(served: Served) -> Iterator[Callable[[], Gate]]:
    """Puts a gate before the controller's services."""
    gates: list[Gate] = []

    def make() -> Gate:
        gates.append(Gate(served.plc.handle))
        served.device.handler = gates[-1]
        return gates[-1]

    yield make
    for made in gates:
        made.open()
