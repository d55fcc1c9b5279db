"""A component in C that denies events of plcrt, in combination with what the program denies and forbids."""

from __future__ import annotations

import random
import shutil
import sys
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from campaign import NEWEST, REFUSED, Campaign, Case, Fallen
from locks import SETTINGS
from process import Runtime
from simulated import PLCRT
from workshop import Workshop

sys.path.append(str(Path(__file__).resolve().parents[1]))

from locking import EVENTS, LOCK, MEMBERS, POLICIES
from vendor_component import cmp_list_of, merge, relink

from plctool.core import lib
from plctool.debug.symbols import load_symbols
from plctool.device import Plc
from plctool.errors import DeviceError
from plctool.link.services import AppState

HERE = Path(__file__).resolve().parent
COUNT = 120
PROGRAM = "lock of plcrt"
TARGET = "firmware/port/linux/plcrt"
DENIED = {  # events of AppEventIds.h that have an answer, and their numbers without the class
    "EVT_PrepareOnlineChange": 7,
    "EVT_PrepareDownload": 9,
    "EVT_DenyLoadBootproject": 18,
    "EVT_DenyStartBootproject": 20,
    "EVT_DenyStart": 23,
    "EVT_DenyStop": 24,
}
WORDS = ("the machine is locked", "forbids it", "denies it", *EVENTS)
ACTIONS = ("start", "stop", "warm", "cold", "flash", "power", "kill")


@dataclass(frozen=True)
class Denial:
    """What the component and the program deny and forbid, under a start policy, and what happens then."""

    number: int
    events: tuple[str, ...]
    policy: str
    denied: int
    forbidden: int
    actions: tuple[str, ...]

    @property
    def bits(self) -> int:
        return sum(1 << DENIED[event] for event in self.events)


class Components(Campaign):
    name = "component"
    promise = (
        "whatever a component in C denies, the device is reachable, and takes another program when it no longer does"
    )
    short = 2

    def cases(self) -> list[Case]:
        chooser = random.Random(self.shop.seed)
        cases = []
        for number in range(COUNT):
            denial = Denial(
                number,
                tuple(event for event in DENIED if chooser.random() < 0.5) or tuple(DENIED),
                chooser.choice(list(POLICIES)),
                chooser.choice((0, chooser.getrandbits(len(EVENTS)))),
                chooser.choice((0, chooser.getrandbits(len(MEMBERS) + 1))),
                tuple(chooser.choice(ACTIONS) for _ in range(chooser.randint(1, 5))),
            )
            cases.append(Case(f"{', '.join(denial.events)}, {denial.policy}: {', '.join(denial.actions)}", denial))
        return cases

    def prepare(self, cases: list[Case]) -> None:
        """Builds the firmware of the vendor."""
        self.shop.add({PROGRAM: LOCK})
        build = self.shop.plcrt.resolve().parents[3]
        folder = self.shop.folder / "vendor"
        folder.mkdir()
        shutil.copy(cmp_list_of(build, TARGET), folder)
        for file in ("AcmeLock.c", "AcmeLock.h"):
            shutil.copy(HERE / file, folder)
        merge(folder / "cmp_list.c", '#include "AcmeLock.h"\n#define PORT_COMPONENTS(X) X(AcmeLock)')
        self._plcrt = relink(build, TARGET, folder)

    def run(self, case: Case) -> str:
        denial: Denial = case.data
        flash = self.shop.folder / f"component-{denial.number}.flash"
        flash.write_bytes(self.shop.history(PLCRT, "good1"))
        lock = flash.with_suffix(".lock")
        lock.write_text("0")
        try:
            with Runtime(self.shop, flash, self._plcrt, {"ACME_LOCK": str(lock)}) as runtime:
                return _attack(self.shop, denial, runtime, lock)
        finally:
            flash.unlink()
            lock.unlink()


def _attack(shop: Workshop, denial: Denial, runtime: Runtime, lock: Path) -> str:
    runtime.power_on()
    runtime.ask(lambda plc: _put_on(shop, denial, plc), "while the lock was put on")
    lock.write_text(str(denial.bits))
    for action in denial.actions:
        _act(shop, action, runtime)
    outcome = NEWEST
    if _flash_or_be_denied(shop, runtime):
        if "EVT_PrepareDownload" in denial.events:
            raise Fallen("a download is taken that the component denies")
    else:
        outcome = REFUSED
        runtime.ask(_reset_origin, "at the reset to the origin")
        if not _flash_or_be_denied(shop, runtime):
            if "EVT_PrepareDownload" not in denial.events:
                raise Fallen("the component does not deny a download, and yet it is denied after a reset to the origin")
            lock.write_text(str(denial.bits & ~(1 << DENIED["EVT_PrepareDownload"])))
            if not _flash_or_be_denied(shop, runtime):
                raise Fallen("a download is denied that the component no longer denies")
    lock.write_text("0")
    runtime.ask(_start, "when the program was started")
    seen = runtime.look("after a program was flashed")
    if (seen.state, seen.crc) != (AppState.RUN, shop["good3"].crc) or not seen.cycles:
        raise Fallen(f"the program that was flashed does not run: {seen}")
    return outcome


def _put_on(shop: Workshop, denial: Denial, plc: Plc) -> None:
    plc.write_file(SETTINGS, f"[CmpApp]\n{POLICIES[denial.policy]}\n".encode())
    plc.flash(shop[PROGRAM].image, unchecked=True)
    plc.add_symbols(load_symbols(shop[PROGRAM].symbols))
    plc.write({"denied": denial.denied, "forbidden": denial.forbidden})


def _act(shop: Workshop, action: str, runtime: Runtime) -> None:
    """A device that refuses an action says so."""
    if action == "power":
        runtime.power_off()
        runtime.power_on()
        return
    if action == "kill":
        runtime.kill_worker()
        return

    def operate(plc: Plc) -> None:
        with suppress(DeviceError):
            if action == "flash":
                plc.flash(shop[PROGRAM].image, unchecked=True)
            elif action in ("warm", "cold"):
                plc.reset(action)
            else:
                getattr(plc, action)()

    runtime.ask(operate, f"at {action}")


def _flash_or_be_denied(shop: Workshop, runtime: Runtime) -> bool:
    """False if the download is denied, in words. That the start after it is denied is no matter."""

    def flash(plc: Plc) -> bool:
        try:
            plc.flash(shop["good3"].image, boot=True, unchecked=True)
        except DeviceError as error:
            if plc.status().image_crc == shop["good3"].crc:
                return True
            if error.result != lib.ERR_OPERATION_DENIED or not any(words in error.message for words in WORDS):
                raise Fallen(f"no program can be flashed any more: {error}") from None
            return False
        return True

    return runtime.ask(flash, "while a program was flashed")


def _reset_origin(plc: Plc) -> None:
    """Removes the program, if it is loaded: the component may have denied that."""
    if plc.status().state is not AppState.NONE:
        plc.reset("origin")


def _start(plc: Plc) -> None:
    if plc.status().state is not AppState.RUN:
        plc.start()
