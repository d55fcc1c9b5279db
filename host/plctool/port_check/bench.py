"""The bench of the port check: a controller under test, programs for it, and what it reports about them."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any

from plctool.controller import FlashResult
from plctool.core import lib
from plctool.device import Plc
from plctool.errors import DeviceError, UsageError
from plctool.link.services import AppState, Identity, TaskInfo
from plctool.link.transports import Link
from plctool.port_check.report import CheckFailed, NotAvailable

INTERVAL_US = 10_000  # of the programs' task
TASK = "Cycle"
PATIENCE = 15.0
NO_SERVICE = ("l7-unknowncmdgroup", "l7-unknowncmd")  # codes of DeviceError: the controller is built without a service

_CYCLES = "Main.n"


def target_of(identity: Identity, device: Path | None = None) -> str:
    """The target that plctool compiles for a controller. `device`: the device.toml of a device that takes programs
    for itself alone. Raises UsageError when there is none."""
    from plctool.image.file import target_name
    from plctool.image.targets import TARGETS
    from plctool.io.description import load_device

    for target in TARGETS.values():
        if getattr(lib, target.device_id) == identity.target_id:
            return target.name
    described = load_device(device)[0] if device is not None else None
    if described is not None and described.id == identity.target_id:
        return described.target
    name = target_name(identity.target_id)
    raise UsageError(
        f"plctool does not know the processor of {name}; name the file that has these numbers by --device device.toml.",
        "unknown-target",
    )


def program(variables: str, body: str, interval: str = "T#10ms") -> str:
    """A program Main that counts its cycles in `n`, in a cyclic task."""
    return f"""
PROGRAM Main
VAR
    n : DINT;
END_VAR
{variables}
n := n + 1;
{body}
END_PROGRAM
CONFIGURATION Config
    RESOURCE Res ON PLC
        TASK {TASK}(INTERVAL := {interval}, PRIORITY := 1);
        PROGRAM Main WITH {TASK} : Main;
    END_RESOURCE
END_CONFIGURATION
"""


class Bench:
    """The controller under test, its target, and where programs for it are built. `device_id`: what images for it are
    for, 0 for any device with this processor."""

    def __init__(
        self, connect: Callable[[], Plc], plc: Plc, target: str, folder: Path, link: Link, device_id: int = 0
    ) -> None:
        self.plc = plc
        self.target = target
        self.link = link
        self._connect = connect
        self._folder = folder
        self._device_id = device_id
        self._built: dict[tuple[str, str], Path] = {}

    def reconnect(self) -> None:
        """A new link, after the controller was without power."""
        self.plc.close()
        self.plc = self._connect()

    def flash(self, text: str, description: str = "", device: Path | None = None) -> FlashResult:
        """Builds a program, with its inputs and outputs if it has some, and starts it with its initial values."""
        return self.plc.flash(self.build(text, description, device), force=True)

    def build(self, text: str, description: str = "", device: Path | None = None) -> Path:
        """The image of a program; its symbols are beside it. `description`: of its inputs and outputs, on the board of
        the file `device`."""
        from plctool.compiler import IoFiles, compile_sources
        from plctool.debug.symbols import symbol_path

        if (text, description) not in self._built:
            source = self._folder / f"check{len(self._built)}.st"
            source.write_text(text)
            described = source.with_suffix(".io.toml")
            if description:
                described.write_text(description)
            io = IoFiles(described, device) if description else IoFiles(wanted=False)
            built = compile_sources([source], target=self.target, limits=False, io=io, device_id=self._device_id)
            image = source.with_suffix(".cdl")
            image.write_bytes(built.image)
            built.symbols.save(symbol_path(image))
            self._built[text, description] = image
        return self._built[text, description]

    # ---- what a controller may be built without ----

    @cached_property
    def has_monitoring(self) -> bool:
        """Whether variables can be read. A program has to be on the controller."""
        try:
            self.plc.read(_CYCLES)
        except DeviceError as error:
            if error.code not in NO_SERVICE:
                raise
            return False
        return True

    def need_monitoring(self) -> None:
        """Ends a check that cannot do without."""
        if not self.has_monitoring:
            raise NotAvailable("no monitoring in this configuration")

    def tasks(self) -> list[TaskInfo]:
        """Statistics of the tasks; ends the check of a controller that has none."""
        try:
            return self.plc.tasks()
        except DeviceError as error:
            if error.code not in NO_SERVICE:
                raise
            raise NotAvailable("no task information in this configuration") from None

    def log(self) -> list[Any]:
        """The entries, none of a controller that has no log."""
        try:
            return list(self.plc.log())
        except DeviceError as error:
            if error.code not in NO_SERVICE:
                raise
            return []

    # ---- waiting ----

    def wait(self, question: Callable[[], bool], what: str, patience: float = PATIENCE) -> float:
        """Asks until the condition holds; returns the seconds it took. Fails with `what` when patience is over."""
        begin = time.monotonic()
        while not question():
            if time.monotonic() - begin > patience:
                raise CheckFailed(f"{what} within {patience:.0f} s.")
            time.sleep(0.02)
        return time.monotonic() - begin

    def wait_until_it_runs(self, cycles: int = 3, *, fails: bool = False) -> None:
        """Waits for so many cycles; without monitoring, for the state that the controller reports. `fails`: it runs
        for a moment, and may have failed when the controller is asked."""
        if self.has_monitoring:
            self.wait(lambda: bool(self.plc.read(_CYCLES) >= cycles), "The program does not run: no cycles")
        elif (state := self.plc.status().state) is not AppState.RUN and not (fails and state is AppState.EXCEPTION):
            raise CheckFailed(f"The program does not run: its state is {state}.")

    def cycles(self) -> int:
        return int(self.plc.read(_CYCLES))
