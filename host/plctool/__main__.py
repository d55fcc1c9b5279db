"""The process of a command: `plctool`, or `python -m plctool`."""

from __future__ import annotations

import gc
import sys

from plctool.cli.main import main

_SHORT_LIVED = ("build", "check", "export")  # commands of which all that they make is needed until they end


def run() -> int:
    """Runs the command of the command line; returns the exit status of the process."""
    if sys.argv[1:2] and sys.argv[1] in _SHORT_LIVED:
        gc.disable()
    return main()


if __name__ == "__main__":
    sys.exit(run())
