"""plcrt killed at any moment, all of it or its worker, while it starts, takes a program, or runs one that is new."""

from __future__ import annotations

import random
import threading
import time
from contextlib import suppress
from dataclasses import dataclass

from campaign import BEFORE, NEWEST, NOTHING, Campaign, Case, Fallen
from look import expect_running
from process import Runtime
from simulated import PLCRT
from workshop import Workshop

import plctool
from plctool.errors import PlcError
from plctool.link.services import AppState

COUNT = 300
NEW = "large"  # what is downloaded
HISTORIES = (("good1",), ("good1", "good3"), ("good1", "dying"), ())


@dataclass(frozen=True)
class Kill:
    """`after`: when, in units of the time from the start of plcrt to the end of a download. `worker`: not all of
    plcrt. `names`: what the flash has had."""

    names: tuple[str, ...]
    after: float
    worker: bool
    number: int


class Kills(Campaign):
    name = "kill"
    promise = "a kill at any moment around a download leaves the old or the new program"
    short = 12

    def cases(self) -> list[Case]:
        chooser = random.Random(self.shop.seed)
        cases = []
        for number in range(COUNT):
            kill = Kill(
                chooser.choice(HISTORIES),
                chooser.uniform(0, 1.2) if number % 5 else chooser.uniform(1.2, 10),
                number % 4 == 3,
                number,
            )
            before = " and ".join(kill.names) or "nothing"
            who = "the worker" if kill.worker else "plcrt"
            cases.append(Case(f"after {before}, {who} killed at {kill.after:.2f} of a download", kill))
        return cases

    def prepare(self, cases: list[Case]) -> None:
        """Measures how long a download takes here and now."""
        flash = self.shop.folder / "kill.flash"
        with Runtime(self.shop, flash) as runtime:
            begin = time.monotonic()
            runtime.power_on()
            _flash(self.shop, runtime.port, threading.Event())
            self._seconds = time.monotonic() - begin

    def run(self, case: Case) -> str:
        kill: Kill = case.data
        flash = self.shop.folder / f"kill-{kill.number}.flash"
        flash.write_bytes(self.shop.history(PLCRT, *kill.names))
        try:
            with Runtime(self.shop, flash) as runtime:
                return self._run(kill, runtime)
        finally:
            flash.unlink()

    def _run(self, kill: Kill, runtime: Runtime) -> str:
        runtime.power_on()
        flashed = threading.Event()
        tool = threading.Thread(target=_flash, args=(self.shop, runtime.port, flashed))
        tool.start()
        tool.join(kill.after * self._seconds)  # any moment will do
        if kill.worker:
            runtime.kill_worker()
        else:
            runtime.power_off()
        tool.join()
        if kill.worker:
            self._check_worker_returned(runtime)
            runtime.power_off()
        runtime.power_on()
        seen = runtime.look("after the kill")
        good = tuple(name for name in kill.names if name != "dying")[-1:]
        if seen.state is AppState.NONE and not good and not flashed.is_set():
            outcome = NOTHING
        else:
            old_too = good if kill.worker or not flashed.is_set() else ()
            outcome = NEWEST if expect_running(seen, self.shop, (*old_too, NEW)) == NEW else BEFORE
        runtime.check_can_be_flashed()
        return outcome

    def _check_worker_returned(self, runtime: Runtime) -> None:
        seen = runtime.look("after the worker was killed")
        if seen.state is not AppState.RUN and seen.state is not AppState.NONE and not seen.causes:
            raise Fallen(f"after the worker was killed nothing says why the program is stopped: {seen}")


def _flash(shop: Workshop, port: str, flashed: threading.Event) -> None:
    """What a user does with plctool, as far as the device allows it."""
    with suppress(PlcError), plctool.connect(f"serial:{port}") as plc:
        plc.flash(shop[NEW].image, unchecked=True)
        flashed.set()
