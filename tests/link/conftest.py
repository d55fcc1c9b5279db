"""Request ids from a fixed seed: a bad line damages bytes by position, so every run has to send the same ones. On the
virtual clocks of these tests no device is late because the machine is busy."""

from __future__ import annotations

import random

import pytest


@pytest.fixture(autouse=True)
def same_request_ids_in_every_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("secrets.randbits", random.Random(1).getrandbits)


@pytest.fixture(autouse=True)
def usual_patience(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PLCTOOL_PATIENCE")
