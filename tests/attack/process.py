"""A plcrt process under attack: killed as power fails, or in part, and asked until it answers."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TypeVar

from campaign import Fallen
from look import Seen, look
from workshop import Workshop

import plctool
from plctool.device import Plc
from plctool.errors import LinkError, PlcError
from plctool.testing.children import ends_with_us

T = TypeVar("T")
PATIENCE = 60.0  # with a machine that is busy [s]
ASK_EVERY = 0.02


def eventually(question: Callable[[], T | None], what: str) -> T:
    """Asks until there is an answer. Raises Fallen when there is none in time."""
    until = time.monotonic() + PATIENCE
    while (answer := question()) is None:
        if time.monotonic() > until:
            raise Fallen(what)
        time.sleep(ASK_EVERY)
    return answer


class Runtime:
    """Context manager around plcrt and a flash file. `plcrt`: another one than that of the workshop; `more` is added to
    its environment."""

    def __init__(
        self, shop: Workshop, flash: Path, plcrt: Path | None = None, more: Mapping[str, str] | None = None
    ) -> None:
        self.shop = shop
        self.flash = flash
        self.plcrt = plcrt or shop.plcrt
        self.environment = {**os.environ, **(more or {})}
        self.process: subprocess.Popen[str] | None = None
        self.port = ""

    def __enter__(self) -> Runtime:
        return self

    def __exit__(self, *exc: object) -> None:
        self.power_off()

    def power_on(self) -> None:
        """Raises Fallen when it does not come up."""
        command = [str(self.plcrt), "--flash", str(self.flash), "--serial", "pty"]
        self.process = subprocess.Popen(
            ends_with_us(command),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            process_group=0,
            env=self.environment,
        )
        assert self.process.stdout
        ready, _, _ = select.select([self.process.stdout], [], [], PATIENCE)
        line = self.process.stdout.readline() if ready else ""
        if not line.startswith("serial: "):
            self.power_off()
            raise Fallen(f"plcrt does not start{self.said}")
        self.port = line.removeprefix("serial: ").strip()

    said = ""

    def power_off(self) -> None:
        """Ends all of it at once, as a power cut does."""
        if self.process is None:
            return
        with suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        _, errors = self.process.communicate()
        self.said = f": {errors.strip()}" if errors.strip() else ""
        self.process = None

    def workers(self) -> list[int]:
        """The processes that plcrt has started."""
        assert self.process
        pid = self.process.pid
        try:
            return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
        except OSError:
            return []

    def kill_worker(self) -> None:
        """Does nothing when there is none at the moment, because it died by itself."""
        for worker in self.workers():
            with suppress(ProcessLookupError):
                os.kill(worker, signal.SIGKILL)

    def ask(self, question: Callable[[Plc], T], what: str) -> T:
        """What the device answers. It is asked again while it cannot be reached: it may just be on its way back."""

        def once() -> tuple[T] | None:
            try:
                with plctool.connect(f"serial:{self.port}") as plc:
                    return (question(plc),)
            except LinkError:
                self._check_is_there(what)
                return None

        return eventually(once, f"no communication {what}")[0]

    def _check_is_there(self, what: str) -> None:
        assert self.process
        if self.process.poll() is None:
            return
        status = self.process.returncode
        how = signal.Signals(-status).name if status < 0 else f"exit status {status}"
        raise Fallen(f"no communication {what}: plcrt ended with {how}")

    def look(self, what: str) -> Seen:
        """What the device says of itself."""

        def question(plc: Plc) -> Seen:
            named: list[Plc] = []

            def with_names(program: object) -> Plc:
                named.append(Plc(plc._connection, program.symbols))  # type: ignore[attr-defined]
                return named[-1]

            def pass_time() -> None:
                before = plc.tasks()[0].cycles
                until = time.monotonic() + PATIENCE
                while plc.status().state == "run" and plc.tasks()[0].cycles == before and time.monotonic() < until:
                    time.sleep(ASK_EVERY)

            return look(plc, with_names, self.shop, pass_time)

        return self.ask(question, what)

    def check_can_be_flashed(self) -> None:
        """The device takes a program, which runs after the next power cut."""
        try:
            self.ask(lambda plc: plc.flash(self.shop["good3"].image, unchecked=True), "while a program was flashed")
        except PlcError as error:
            raise Fallen(f"no program can be flashed any more: {error}") from None
        seen = self.look("after a program was flashed")
        if seen.crc != self.shop["good3"].crc or seen.state != "run":
            raise Fallen(f"the program that was flashed does not run: {seen}")
