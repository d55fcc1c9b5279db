"""What Linux knows of processes."""

from __future__ import annotations

import time

PROCESS_CLOCK = 2  # CPUCLOCK_SCHED: what clock_getcpuclockid(3) makes of a process id


def processor_ns(pid: int) -> int:
    """Processor time of all threads so far, of those that have ended too: exactly, where /proc/PID/stat counts clock
    ticks."""
    return time.clock_gettime_ns(~pid << 3 | PROCESS_CLOCK)
