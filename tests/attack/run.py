#!/usr/bin/env python3
"""Attacks the promise "no power cut, bad program or bad packet can lose the program".

    tests/attack/run.py                  all campaigns
    tests/attack/run.py --short          some cases of each, in less than a minute
    tests/attack/run.py --only cut,call  these campaigns
    tests/attack/run.py --replay cut:17  one case, with everything that is said on the way
    tests/attack/run.py --seed 5         other random cases
    tests/attack/run.py --sanitized      with what is in build-sanitized instead of build
    tests/attack/run.py --help           more options

Each case ends with a look at the device: the newest good program runs, or the previous one where the new one died
before it proved itself, or it is stopped with communication up and the cause in the log. Anything else is a failure,
and the line that replays it is printed.
"""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))

from builds import become  # noqa: E402

become(HERE / "attack.py", "attack")
