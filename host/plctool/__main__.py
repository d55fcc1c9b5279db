"""The process of a command: `plctool`, or `python -m plctool`."""

from __future__ import annotations

import gc
import os
import sys

from plctool.errors import EXIT_INTERRUPTED

_SHORT_LIVED = ("build", "check", "export")  # commands of which all that they make is needed until they end


def run() -> int:
    """Runs the command of the command line; returns the exit status of the process."""
    try:
        return _run()
    except KeyboardInterrupt:
        return EXIT_INTERRUPTED


def _run() -> int:
    from plctool.cli.main import main  # late, as Ctrl-C may come meanwhile

    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # it was closed by who started this
            setattr(sys, name, open(os.devnull, "w"))  # noqa: SIM115
    if sys.argv[1:2] and sys.argv[1] in _SHORT_LIVED:
        gc.disable()
        status = main()
        sys.stderr.flush()
        os._exit(status)  # to take a large program's tree apart would take a sixth of the time of a build
    return main()


if __name__ == "__main__":
    sys.exit(run())
