"""Long lists of equal cases: `make test` takes a share of each, `make test-whole` takes all."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TypeVar

Case = TypeVar("Case")

WHOLE = os.environ.get("TEST_WHOLE") == "1"


def share(cases: Sequence[Case], of: int, first: int = 0) -> list[Case]:
    """Returns one of `of` cases. Lists with another `first`, 0 to `of` - 1, have no case in common, and `of` of them
    have all."""
    return list(cases) if WHOLE else list(cases[first % of :: of])
