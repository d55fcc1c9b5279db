"""Processes that a test starts and that must not outlive it."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence
from functools import cache
from os import PathLike

Word = str | PathLike[str]


@cache
def _wrapper() -> tuple[str, ...]:
    """What makes the kernel end a process with the one that started it: setpriv, where it is the one of util-linux."""
    setpriv = shutil.which("setpriv")
    if setpriv is None:
        return ()
    wrapper = (setpriv, "--pdeathsig", "KILL", "--")
    tried = subprocess.run([*wrapper, "true"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)
    return wrapper if tried.returncode == 0 else ()


def ends_with_us(command: Sequence[Word]) -> list[Word]:
    """The command, as the same process, but killed when the thread that starts it ends, whatever ends that.

    A test that is killed itself has no chance to stop what it has started. Without setpriv (util-linux) the command
    is left as it is.
    """
    return [*_wrapper(), *command]
