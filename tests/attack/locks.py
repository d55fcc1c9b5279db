"""Programs that deny events and forbid operations, under start policies and passwords, between power cuts."""

from __future__ import annotations

import os
import random
import signal
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from campaign import NEWEST, NOTHING, REFUSED, Campaign, Case, Fallen
from look import LOOK_MS
from simulated import Device, Ended, Flash, Geometry, violation
from workshop import PROVING_MS, Program, Workshop

sys.path.append(str(Path(__file__).resolve().parents[1]))

from locking import EVENTS, LOCK, MEMBERS, POLICIES
from online_programs import built

from plctool.core import lib
from plctool.debug.symbols import load_symbols
from plctool.device import Plc
from plctool.errors import DeviceError, LinkError, UsageError
from plctool.link.services import AppState

COUNT = 1_000
MOVED = "moved lock"  # the same program with its variables at other places
CHANGED = "changed lock"  # an online change of it
PROGRAMS = ("lock", MOVED, "good1", "dying")
MOST_LIVES, MOST_STEPS = 4, 8
FILES = 16 * 1024  # bytes of flash for Settings.cfg
GEOMETRY = Geometry(size=64 * 1024 + FILES)
MODES = (lib.SIM_CUT_BEFORE, lib.SIM_CUT_AFTER, lib.SIM_CUT_TORN)
MOST_OPERATIONS = 120  # the last flash operation before which a cut is planned
PASSWORDS = (None, "a lock of one machine", "another lock")
SETTINGS = "Settings.cfg"


@dataclass(frozen=True)
class Step:
    """`what` is a key of STEPS, `how` what it takes."""

    what: str
    how: object = None


@dataclass(frozen=True)
class Life:
    """From power on to power off. `cut`: the flash operation at which power fails, and the mode; None: after the last
    step. `dies`: the runtime dies instead. `stay_stopped`: as plcrt starts after several deaths."""

    steps: tuple[Step, ...]
    cut: tuple[int, int] | None
    dies: bool
    stay_stopped: bool


class Locks(Campaign):
    name = "lock"
    promise = "whatever a program denies and forbids, the device is reachable, and takes another program"
    short = 15

    def cases(self) -> list[Case]:
        return [Case(f"locks and steps, number {number}", number) for number in range(COUNT)]

    def prepare(self, cases: list[Case]) -> None:
        self.shop.add({"lock": LOCK, MOVED: LOCK.replace("trip : BOOL;", "more : LREAL; trip : BOOL;")})
        folder = self.shop.folder / "change of a lock"
        folder.mkdir()
        change = built(folder, LOCK.replace("zero := 0", "zero := 1 - 1"), load_symbols(self.shop["lock"].symbols))
        change.symbols.save(folder / "change.sym")
        self.shop.programs[CHANGED] = Program(CHANGED, change.image, folder / "change.sym")

    def run(self, case: Case) -> str:
        chooser = random.Random(f"{self.shop.seed} lock {case.data}")
        flash = Flash(GEOMETRY)
        known = [PASSWORDS[0]]
        after: Ended | None = None
        *lives, last = _lives(chooser)
        for life in lives:
            after = self._live(flash, life, known, after)
            known = _passwords(known, life, after)
        return self._settle(flash, last, known, after)

    def _live(self, flash: Flash, life: Life, known: list[str | None], after: Ended | None) -> Ended:
        ended = flash.power(partial(_go, self.shop, life, known), partial(_plan, life), after, life.stay_stopped)
        if ended.how == "hung" or (ended.how == "died" and not life.dies):
            raise Fallen(f"the runtime {ended.how} {ended.signal}".strip())
        return ended

    def _settle(self, flash: Flash, last: Life, known: list[str | None], after: Ended | None) -> str:
        """In the last life another program is flashed. It runs after the next loss of power."""
        ended = flash.power(partial(_unlock, self.shop, last, known), _give_files, after, last.stay_stopped)
        if ended.how != "used":
            raise Fallen(f"the runtime {ended.how} {ended.signal} when a program was flashed".strip())
        known = _passwords(known, last, Ended("used", ended.value[1:]))
        again = flash.power(partial(_check_runs, self.shop, known), _give_files)
        if again.how != "used":
            raise Fallen(f"the runtime {again.how} {again.signal} after a program was flashed".strip())
        outcome: str = ended.value[0]
        return outcome


# ---- what happens ----


def _lives(chooser: random.Random) -> list[Life]:
    """The first one begins with a program that locks the device."""
    lives = []
    for number in range(chooser.randint(1, MOST_LIVES)):
        steps = [_step(chooser, chooser.choice(list(STEPS))) for _ in range(chooser.randint(1, MOST_STEPS))]
        if number == 0:
            steps = [Step("flash", ("lock", True)), _step(chooser, "settings"), _step(chooser, "lock"), *steps]
        cut = (chooser.randint(1, MOST_OPERATIONS), chooser.choice(MODES)) if chooser.random() < 0.5 else None
        lives.append(Life(tuple(steps), cut, chooser.random() < 0.2, chooser.random() < 0.2))
    return lives


def _step(chooser: random.Random, what: str) -> Step:
    choices: dict[str, Callable[[], object]] = {
        "lock": lambda: {
            "denied": _bits(chooser, len(EVENTS)),
            "forbidden": _bits(chooser, len(MEMBERS) + 1),
            "failing": _bits(chooser, len(EVENTS)) if chooser.random() < 0.2 else 0,
            "hanging": _bits(chooser, len(EVENTS)) if chooser.random() < 0.05 else 0,
        },
        "flash": lambda: (chooser.choice(PROGRAMS), chooser.choice((None, True, False))),
        "reset": lambda: chooser.choice(("warm", "cold", "origin")),
        "settings": lambda: chooser.choice(list(POLICIES.values())),
        "password": lambda: chooser.choice(PASSWORDS),
        "shell": lambda: chooser.choice(("reload", "stopprg", "startprg", "resetprg", "resetprgcold")),
        "time": lambda: chooser.choice((1, 50, 1500, PROVING_MS)),
    }
    return Step(what, choices[what]() if what in choices else None)


def _bits(chooser: random.Random, count: int) -> int:
    """None, all, or any."""
    return chooser.choice((0, (1 << count) - 1, chooser.getrandbits(count), chooser.getrandbits(count)))


STEPS: dict[str, Callable[[Workshop, Device, Plc, object], object]] = {
    "lock": lambda shop, device, plc, how: plc.write(how),
    "flash": lambda shop, device, plc, how: plc.flash(shop[how[0]].image, boot=how[1], unchecked=True),
    "change": lambda shop, device, plc, how: plc.change(shop[CHANGED].image, unchecked=True),
    "boot": lambda shop, device, plc, how: plc.create_boot_project(),
    "start": lambda shop, device, plc, how: plc.start(),
    "stop": lambda shop, device, plc, how: plc.stop(),
    "cycle": lambda shop, device, plc, how: plc.cycle(),
    "reset": lambda shop, device, plc, how: plc.reset(how),
    "force": lambda shop, device, plc, how: plc.force({"denied": 0x1F}),
    "trip": lambda shop, device, plc, how: plc.write({"trip": True}),
    "settings": lambda shop, device, plc, how: plc.write_file(SETTINGS, f"[CmpApp]\n{how}\n".encode()),
    "no settings": lambda shop, device, plc, how: plc.delete_file(SETTINGS),
    "password": lambda shop, device, plc, how: _set_password(device, plc, how),
    "shell": lambda shop, device, plc, how: plc.shell(how),
    "time": lambda shop, device, plc, how: device.run(how),
}


def _give_files() -> None:
    lib.SimSetFileStore(FILES)


def _plan(life: Life) -> None:
    _give_files()
    if life.cut:
        lib.SimFlashCut(*life.cut)


def _go(shop: Workshop, life: Life, known: list[str | None], device: Device) -> list[object]:
    """The device may refuse any step, but answers to the end. Returns what was tried and done with the password."""
    _take_steps(shop, life, login(shop, device, known), device)
    if life.dies:
        os.kill(os.getpid(), signal.SIGKILL)
    return device.marks


def _take_steps(shop: Workshop, life: Life, plc: Plc, device: Device) -> None:
    for step in life.steps:
        try:
            STEPS[step.what](shop, device, plc, step.how)
        except (DeviceError, UsageError):
            pass  # a UsageError: the program has no such variable
        except LinkError as error:
            if lib.SimCommCycle() != lib.SIM_POWER_CUT:
                raise Fallen(f"no communication at {step}: {error}") from None
            raise
        device.run(LOOK_MS)
    if violation():
        raise Fallen(f"the flash was used against its rules: {violation()}")


def _set_password(device: Device, plc: Plc, password: object) -> None:
    assert password is None or isinstance(password, str)
    device.mark(("try", password))
    plc.set_password(password)
    device.mark(("set", password))


def _passwords(known: list[str | None], life: Life, ended: Ended) -> list[str | None]:
    """Those that the device may have: the last one that it took, and what it was asked to take after that. A runtime
    that died left no marks."""
    if ended.value is None:
        return [*known, *(step.how for step in life.steps if step.what == "password")]
    for what, password in ended.value:
        known = [password] if what == "set" else [*known, password]
    return known


# ---- the way out ----


def login(shop: Workshop, device: Device, known: list[str | None]) -> Plc:
    """A tool with a password that the device takes. Raises Fallen if it takes none of them."""
    refusals = []
    for password in dict.fromkeys(known):
        device.reconnect()
        plc = Plc(device.connection, None, lambda password=password: password)
        for name in ("lock", MOVED, CHANGED):
            plc.add_symbols(load_symbols(shop[name].symbols))
        try:
            plc.status()
            return plc
        except DeviceError as error:
            refusals.append(f"{password}: {error}")
            device.run(1000)  # a device takes no other password before
    raise Fallen(f"the device takes no password: {refusals}")


def _unlock(shop: Workshop, last: Life, known: list[str | None], device: Device) -> list[object]:
    """The outcome and the marks of the last life."""
    _take_steps(shop, last, login(shop, device, known), device)
    marks = device.marks
    plc = login(shop, device, _passwords(known, last, Ended("used", marks)))
    status = plc.status()
    if status.forbidden and status.state is not AppState.RUN:
        raise Fallen(f"a program that does not run forbids {status.forbidden}")
    outcome = NOTHING if status.state is AppState.NONE else NEWEST
    if not flash_or_be_denied(shop, plc, may_be_denied=status.state in (AppState.RUN, AppState.STOP)):
        outcome = REFUSED
        plc.reset("origin")
        flash_or_be_denied(shop, plc, may_be_denied=False)
    device.run(PROVING_MS)
    if plc.status().state is not AppState.RUN or plc.status().image_crc != shop["good3"].crc:
        raise Fallen(f"a program was flashed, and this is what there is: {plc.status()}")
    return [outcome, *marks]


def flash_or_be_denied(shop: Workshop, plc: Plc, may_be_denied: bool) -> bool:
    """Flashes a good program. Returns False if that is denied, in words. Raises Fallen for any other refusal."""
    try:
        plc.flash(shop["good3"].image, boot=True, unchecked=True)
        return True
    except DeviceError as error:
        if not may_be_denied or error.result != lib.ERR_OPERATION_DENIED:
            raise Fallen(f"no program can be flashed any more: {error}") from None
        if not any(words in error.message for words in ("forbids it", "denies it", *EVENTS)):
            raise Fallen(f"the device does not say who denies: {error}") from None
        return False


def _check_runs(shop: Workshop, known: list[str | None], device: Device) -> None:
    """The settings are those of the locks, so the program may wait for a start."""
    plc = login(shop, device, known)
    status = plc.status()
    waits = SETTINGS in [file.name for file in plc.files().files] and b"=never" in plc.read_file(SETTINGS)
    if (status.state, status.image_crc) != (AppState.STOP if waits else AppState.RUN, shop["good3"].crc):
        raise Fallen(
            f"after a loss of power the program that was flashed does not {'wait' if waits else 'run'}: {status}"
        )
    if waits:
        plc.start()
    before = plc.tasks()[0].cycles
    device.run(LOOK_MS)
    if plc.tasks()[0].cycles == before:
        raise Fallen("the program that was flashed has no cycles")
