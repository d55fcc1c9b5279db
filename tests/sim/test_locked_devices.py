"""What a program denies and forbids leaves the device reachable, under each start policy, in virtual time.

Each combination of denied events occurs under each policy, with another set of forbidden operations.
All combinations of the three are in the campaign `combination` of tests/attack; `lock` adds what happens between.
"""

from __future__ import annotations

import random
import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from locking import EVENTS, POLICIES, Lock, Locked

from plctool.controller import OPERATIONS

ALL_EVENTS, ALL_OPERATIONS = (1 << len(EVENTS)) - 1, (1 << len(OPERATIONS)) - 1
SETS = random.Random(1).sample(range(ALL_OPERATIONS + 1), ALL_OPERATIONS + 1)


@pytest.mark.parametrize("policy", POLICIES)
def test_no_combination_locks_a_device(policy: str) -> None:
    place = list(POLICIES).index(policy)
    with Locked(policy) as device:
        device.check(Lock(policy, ALL_EVENTS, ALL_OPERATIONS))
        for denied in range(ALL_EVENTS + 1):
            device.check(Lock(policy, denied, SETS[denied * len(POLICIES) + place]))
