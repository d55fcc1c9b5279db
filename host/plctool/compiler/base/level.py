"""How much is optimised.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from typing import Literal

Level = int | Literal["s"]
"""0 .. 3, or "s" for small code."""
