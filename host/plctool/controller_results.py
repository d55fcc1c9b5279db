"""What operations of a controller return and raise."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from plctool.debug.kept_changes import KeptChanges
from plctool.debug.symbols import SourceLine
from plctool.errors import DeviceError, UsageError
from plctool.link.services import AppState


@dataclass(frozen=True)
class ExceptionInfo:
    """What stopped the program. `task` is None for initialisation code; the location is None without symbols. `calls`
    led there, the nearest first. `detail`: which index or value was outside, if that is known."""

    code: int
    name: str
    task: str | None
    pou: str | None = None
    file: str | None = None
    line: int | None = None
    calls: list[SourceLine] = field(default_factory=list)
    detail: str = ""

    def __str__(self) -> str:
        task = f" in task {self.task}" if self.task else ""
        place = f", {self.pou}, {self.file}:{self.line}" if self.file else ""
        calls = "".join(f", called from {c.pou}, {c.file}:{c.line}" for c in self.calls)
        detail = f": {self.detail}" if self.detail else ""
        return f"{self.name}{task}{place}{calls}{detail}"


class ProgramStopped(DeviceError):
    """The program ended with an exception."""

    def __init__(self, exception: ExceptionInfo) -> None:
        super().__init__(f"The program stopped: {exception}.", "exception")
        self.exception = exception


@dataclass(frozen=True)
class PlcStatus:
    """`state` is "run", "halted", "stop", "exception" or "none"; `image_crc` is 0 without application. `forced`: the
    names of the variables that are forced. `forbidden`: the operations that the program forbids now, of OPERATIONS.
    `boots`: it is what starts at power-up."""

    state: AppState
    image_crc: int
    image_size: int
    exception: ExceptionInfo | None
    forced: list[str] = field(default_factory=list)
    forbidden: list[str] = field(default_factory=list)
    boots: bool = True


@dataclass(frozen=True)
class FlashResult:
    """`skipped`: the controller had this very image already. `seconds` is the time the transfer took. `persistent`:
    what became of PERSISTENT values, None if the symbols of one of the programs are missing. `boots`: it is what starts
    at power-up."""

    bytes: int
    seconds: float
    skipped: bool
    state: AppState
    persistent: KeptChanges | None = None
    boots: bool = True


@dataclass(frozen=True)
class ChangeResult:
    """What an online change has done. `released`: the variables that were forced, and are removed. `ended`: the names
    of traces that recorded removed variables, "" of one of a tool."""

    bytes: int
    seconds: float
    state: AppState
    released: list[str] = field(default_factory=list)
    ended: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class OtherTool:
    """Another tool of this machine that uses the same line: how its user called it, and its process number."""

    tool: str
    pid: int

    def __str__(self) -> str:
        return f"{self.tool} (pid {self.pid})"


class Closed:
    """In place of what a controller that is closed has no more."""

    def __init__(self, message: str) -> None:
        self._message = message

    def __getattr__(self, name: str) -> Any:
        raise UsageError(self._message, "closed")
