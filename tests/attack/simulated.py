"""The runtime in a child process, on a virtual clock and a flash that outlives the child.

A program that kills the runtime kills a child only. The flash is memory shared with the children, so what the next
one starts from is what the previous one left, as with a real device. This process itself never runs the runtime.
"""

from __future__ import annotations

import ctypes
import os
import pickle
import resource
import select
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from plctool.core import ffi, lib
from plctool.device import Plc
from plctool.errors import PlcError
from plctool.link.connection import Connection
from plctool.link.services import LogEntry
from plctool.link.sim import SimTransport

T = TypeVar("T")

CPU_LIMIT = 60  # of one child [s]; a child that needs longer hangs
WALL_LIMIT = 600.0  # the same for one that sleeps [s], on a machine that is busy


@dataclass(frozen=True)
class Geometry:
    """What a flash is like; sizes in bytes. One that is not mapped is read through a function, which can fail."""

    size: int = 64 * 1024
    sector: int = 1024
    unit: int = 8
    erased: int = 0xFF
    mapped: bool = True


PLCRT = Geometry(4 << 20, 4096)  # that of plcrt's flash file, whose content can be exchanged with it


@dataclass(frozen=True)
class Ended:
    """How a life of the device ended. `value`: what its use returned. `how`: "used", "cut" (a planned power cut; value
    as far as it came), "died" (of `signal`, or with an exit status), or "hung"."""

    how: str
    value: Any = None
    signal: str = ""


class Device:
    """In the child: the runtime after its start, and the way to talk to it."""

    def __init__(self) -> None:
        self.connection = Connection(SimTransport())
        self.plc = Plc(self.connection)
        self.marks: list[Any] = []

    def named(self, symbols: Path) -> Plc:
        """The same controller, whose variables have names."""
        return Plc(self.connection, symbols)

    def reconnect(self) -> None:
        """What a tool does that starts again: also after a cut in its own messages."""
        lib.SimLinkReset()
        self.__init__()  # type: ignore[misc]

    def run(self, ms: float) -> None:
        """Lets virtual time pass. A power cut ends the life here."""
        if lib.SimAdvance(round(ms * 1e6)) == lib.SIM_POWER_CUT:
            raise PowerCut

    def mark(self, what: Any) -> None:
        """Notes how far a life came; a cut returns the marks."""
        self.marks.append(what)

    def log(self) -> list[LogEntry]:
        return self.plc.log()


class PowerCut(Exception):
    """The planned cut happened."""


class Flash:
    """The flash of a simulated device."""

    def __init__(self, geometry: Geometry) -> None:
        self.geometry = geometry
        lib.SimFlashSetMapped(geometry.mapped)
        result = lib.SimFlashConfigure(geometry.size, geometry.sector, geometry.unit, geometry.erased)
        assert result == lib.ERR_OK, f"no flash: {result}"

    def load(self, content: bytes) -> None:
        assert lib.SimFlashLoad(content, len(content)) == lib.ERR_OK

    def content(self) -> bytes:
        return bytes(ffi.buffer(lib.SimFlashData(), self.geometry.size))

    def power(
        self,
        use: Callable[[Device], Any],
        plan: Callable[[], None] = lambda: None,
        after: Ended | None = None,
        stay_stopped: bool = False,
    ) -> Ended:
        """One life: power on, `use`, power off. `plan` comes before power on, e.g. a cut. `after`: the life before,
        whose death is the reason of this start; `stay_stopped`: as plcrt starts then."""
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(reading)
            _live(writing, use, plan, after, stay_stopped)
        os.close(writing)
        return _await(child, reading)


def die_with_parent() -> None:
    """This process ends with the one that forked it, whatever ends that."""
    pr_set_pdeathsig = 1
    ctypes.CDLL(None).prctl(pr_set_pdeathsig, signal.SIGKILL)


def violation() -> str:
    """The first use of the flash against its rules, "" without one."""
    return bytes(ffi.string(lib.SimFlashViolation())).decode()


def _live(
    writing: int, use: Callable[[Device], Any], plan: Callable[[], None], after: Ended | None, stay: bool
) -> None:
    """The child; does not return."""
    die_with_parent()
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CPU, (CPU_LIMIT, CPU_LIMIT + 5))
    try:
        ended: Any = _use(use, plan, after, stay)
    except BaseException as error:
        ended = error
    with os.fdopen(writing, "wb") as pipe:
        pickle.dump(ended, pipe)
    os._exit(0)


def _use(use: Callable[[Device], Any], plan: Callable[[], None], after: Ended | None, stay: bool) -> Ended:
    plan()
    lib.SimFlashAtStart()
    _tell_cause(after, stay)
    result = lib.SimStart()
    if result == lib.SIM_POWER_CUT:
        return Ended("cut", [])
    if result != lib.ERR_OK:
        return Ended("died", None, f"start-up failed with error {result}")
    device = Device()
    try:
        ended = Ended("used", use(device))
        lib.SimFlashPowerOff()
        return ended
    except (PowerCut, PlcError):
        if lib.SimCommCycle() != lib.SIM_POWER_CUT:
            raise
        return Ended("cut", device.marks)


def _tell_cause(after: Ended | None, stay_stopped: bool) -> None:
    """Tells the runtime that it starts because it died, as a port does."""
    if after is None or after.how != "died":
        return
    text = ffi.new("char[]", f"signal {after.signal}".encode())
    start = ffi.new("SYS_START *")
    start.cause, start.stay_stopped = lib.SYS_START_CRASH, stay_stopped
    start.exception, start.task, start.code_offset = lib.RTSEXCPT_NOEXCEPTION, -1, lib.APP_NO_CODE_OFFSET
    start.text = text
    lib.SimSetStart(start)


def _await(child: int, reading: int) -> Ended:
    data = _read_all(reading, time.monotonic() + WALL_LIMIT)
    if data is None:
        os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    if data is None:
        return Ended("hung")
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        return Ended("hung") if number == signal.SIGXCPU else Ended("died", None, signal.Signals(number).name)
    if not data:
        return Ended("died", None, f"exit status {os.WEXITSTATUS(status)}")
    ended = pickle.loads(data)
    if isinstance(ended, BaseException):
        raise ended
    assert isinstance(ended, Ended)
    return ended


def _read_all(reading: int, until: float) -> bytes | None:
    """Everything up to the end of the pipe; None when that does not come in time."""
    parts = []
    with os.fdopen(reading, "rb", buffering=0) as pipe:
        while True:
            ready, _, _ = select.select([pipe], [], [], max(0.0, until - time.monotonic()))
            if not ready:
                return None
            part = pipe.read(1 << 16)
            if not part:
                return b"".join(parts)
            parts.append(part)
