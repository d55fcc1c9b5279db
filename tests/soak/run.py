#!/usr/bin/env python3
"""Starts soak.py with what is in a build folder. `run.py --help` says what it does."""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))

from builds import become  # noqa: E402

become(HERE / "soak.py", "soak")
