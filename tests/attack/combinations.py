"""Every combination of denied events and forbidden operations, under each start policy."""

from __future__ import annotations

import sys
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from multiprocessing import get_context
from pathlib import Path

from campaign import REFUSED, Campaign, Case, Fallen
from simulated import die_with_parent

sys.path.append(str(Path(__file__).resolve().parents[1]))

import locking
from locking import EVENTS, POLICIES, Lock, Locked

from plctool.controller import OPERATIONS
from plctool.errors import PlcError


class Combinations(Campaign):
    name = "combination"
    promise = "a device that refuses what its program says, and only that, is reachable and takes another program"
    short = 1

    def cases(self) -> list[Case]:
        """Each has all sets of forbidden operations."""
        return [
            Case(f"policy {policy}, denied events {denied:05b}", (policy, denied))
            for policy, denied in product(POLICIES, range(1 << len(EVENTS)))
        ]

    def prepare(self, cases: list[Case]) -> None:
        locking.built(locking.LOCK)
        locking.built(locking.NEXT)

    def run(self, case: Case) -> str:
        """In a process of its own, as this one never runs the runtime."""
        with ProcessPoolExecutor(1, get_context("fork"), die_with_parent) as pool:
            try:
                pool.submit(_check, *case.data).result()
            except (AssertionError, PlcError) as error:
                raise Fallen(f"{type(error).__name__}: {error}") from None
        return REFUSED


def _check(policy: str, denied: int) -> None:
    with Locked(policy) as device:
        for forbidden in range(1 << len(OPERATIONS)):
            lock = Lock(policy, denied, forbidden)
            try:
                device.check(lock)
            except AssertionError as error:
                raise AssertionError(f"{lock}: {error}") from None
