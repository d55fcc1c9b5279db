"""What a device says of itself after an attack, and whether that keeps the promise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from campaign import Fallen
from workshop import GOOD_NAMES, Program, Workshop

from plctool.core import lib
from plctool.device import Plc
from plctool.link.services import AppState

LOOK_MS = 100  # in which a program that runs has a cycle


@dataclass(frozen=True)
class Seen:
    """`crc` is 0 without program. `cycles`: of its first task while time passed. `fault`: what is wrong in the values
    of a good program, "" when nothing is. `causes`: warnings and errors in the log."""

    state: AppState
    crc: int
    exception: str
    cycles: int
    fault: str
    causes: tuple[str, ...]

    def __str__(self) -> str:
        said = f"; log: {' / '.join(self.causes)}" if self.causes else "; nothing in the log"
        exception = f" {self.exception}" if self.exception else ""
        return f"{self.state}{exception}, CRC {self.crc:08X}{said}"


def look(plc: Plc, named: Callable[[Program], Plc], shop: Workshop, pass_time: Callable[[], None]) -> Seen:
    """Asks a device over its link. `pass_time` lets LOOK_MS pass."""
    status = plc.status()
    cycles, fault = 0, ""
    if status.state is AppState.RUN:
        before = plc.tasks()[0].cycles
        pass_time()
        cycles = plc.tasks()[0].cycles - before
        program = shop.by_crc(status.image_crc)
        if program and program.name in GOOD_NAMES:
            fault = _fault(named(program), program)
    exception = status.exception.name if status.exception else ""
    told = (lib.LOG_WARNING, lib.LOG_ERROR, lib.LOG_EXCEPTION)
    causes = tuple(entry.text for entry in plc.log() if entry.log_class in told)
    return Seen(plc.status().state, status.image_crc, exception, cycles, fault, causes)


def _fault(plc: Plc, program: Program) -> str:
    reading = plc.sample(["Main.me", "Main.first", "Main.kept", "Main.last"])
    values = reading.values
    if values["Main.me"] != GOOD_NAMES.index(program.name) + 1:
        return f"its initial value is that of program {values['Main.me']}"
    kept = {values["Main.first"], values["Main.last"], *values["Main.kept"]}
    return f"its retain variables are torn: {sorted(kept)}" if len(kept) > 1 and reading.consistent else ""


def expect_running(seen: Seen, shop: Workshop, names: tuple[str, ...]) -> str:
    """The name of the program that runs, which has to be one of `names`."""
    program = shop.by_crc(seen.crc)
    if seen.state is AppState.NONE:
        raise Fallen(f"the program is gone: {seen}")
    if seen.state is not AppState.RUN:
        raise Fallen(f"no program runs: {seen}")
    if program is None or program.name not in names:
        raise Fallen(
            f"{program.name if program else 'an unknown program'} runs instead of {' or '.join(names)}: {seen}"
        )
    if seen.cycles == 0:
        raise Fallen(f"{program.name} is said to run, but has no cycles: {seen}")
    if seen.fault:
        raise Fallen(f"{program.name} runs, but {seen.fault}")
    return program.name
