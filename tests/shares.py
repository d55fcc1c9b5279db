"""Long lists of equal cases and random values: `make test` takes a share of each, `make test-whole` takes all; `make
properties` tries all random values."""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable, Sequence
from typing import TypeVar

from hypothesis import settings

Case = TypeVar("Case")

FEWEST = 8  # values of a property in `make test`, unless it has fewer
FEWER = 5  # `make test` tries one of so many values

WHOLE = os.environ.get("TEST_WHOLE") == "1"


def share(cases: Sequence[Case], of: int, first: int = 0) -> list[Case]:
    """Returns one of `of` cases. Lists with another `first`, 0 to `of` - 1, have no case in common, and `of` of them
    have all."""
    return list(cases) if WHOLE else list(cases[first % of :: of])


def share_by_name(cases: Sequence[Case], name: Callable[[Case], str], of: int, part: int) -> list[Case]:
    """Returns one of `of` parts of the cases. The name of a case decides on its part, so it stays there when cases are
    added or removed."""
    return [case for case in cases if WHOLE or zlib.crc32(name(case).encode()) % of == part % of]


def examples(count: int) -> settings:
    """Returns the settings of a property for which `count` values are tried, or a fifth of them in `make test`."""
    return settings(max_examples=fewer(count))


def fewer(count: int) -> int:
    """Returns the number of random values to try, where `count` are tried in `make test-whole`."""
    return count if WHOLE else min(count, max(count // FEWER, FEWEST))
