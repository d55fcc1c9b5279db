"""Processes: one for a while, and what Linux knows of them."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

PROCESS_CLOCK = 2  # CPUCLOCK_SCHED: what clock_getcpuclockid(3) makes of a process id


def processor_ns(pid: int) -> int:
    """Processor time of all threads so far, of those that have ended too: exactly, where /proc/PID/stat counts clock
    ticks."""
    return time.clock_gettime_ns(~pid << 3 | PROCESS_CLOCK)


def is_alive(pid: int) -> bool:
    """Whether a process runs; one that is a zombie does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] not in "ZX"
    except OSError:
        return False


@contextmanager
def started(command: list[str], **options: Any) -> Iterator[subprocess.Popen[Any]]:
    """A process that is killed if it still runs at the end of the block."""
    with subprocess.Popen(command, **options) as process:
        try:
            yield process
        finally:
            process.kill()
