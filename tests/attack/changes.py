"""Online changes whose CRC is right and whose list of steps is not."""

from __future__ import annotations

import random
import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from campaign import BEFORE, ITSELF, REFUSED, STOPPED, Campaign, Case, Fallen
from faults import with_crc
from images import CYCLE_LIMIT_MS, KERNEL_CALLS, WORDS
from look import Seen, expect_running
from simulated import Device, Ended, Flash, Geometry, violation
from verdict import check_can_be_flashed, look_again, look_at
from workshop import PROVING_MS, Workshop

sys.path.append(str(Path(__file__).resolve().parents[1]))

from changing import BODY, VARIABLES, grown, program
from online_programs import built

from plctool.core import ffi, lib
from plctool.debug.symbols import load_symbols
from plctool.errors import DeviceError
from plctool.image.file import parse_image
from plctool.link.services import AppState

COUNT = 3_000
OLD, NEW = "moving", "moved"
STEP = ffi.sizeof("CDL_CHANGE_STEP")
FIELDS = {"to": 4, "size": 4, "from": 4, "kind": 1, "area": 1, "from_area": 1}
HEAD = ("init", "offset", "size")  # of the list
VALUES = {"Main.fixed": 7, "Main.kept": 9, "Main.text": "before", "Main.p^": 7}


class Changes(Campaign):
    name = "change"
    promise = "a list of steps may hold anything: it is refused, or its program runs, or dies and is given up"
    short = 20

    def cases(self) -> list[Case]:
        """One number of the list in half of them, up to four in the others."""
        return [Case(f"an online change with another list, number {number}", number) for number in range(COUNT)]

    def prepare(self, cases: list[Case]) -> None:
        self.shop.add({OLD: program()})
        variables = VARIABLES.replace("gone : LINT := 5;", "")
        text = grown(BODY, variables, "VAR more : ARRAY[0..40] OF DINT := [41(6)]; END_VAR")
        folder = self.shop.folder / NEW
        folder.mkdir()
        self.shop.add_image(NEW, built(folder, text, load_symbols(self.shop[OLD].symbols)).image, OLD)

    def run(self, case: Case) -> str:
        chooser = random.Random(f"{self.shop.seed} change {case.data}")
        good = self.shop[NEW].image
        image = hostile(good, Places.of(good), chooser, 1 if case.data % 2 else chooser.randrange(1, 5))
        geometry = Geometry()
        flash = Flash(geometry)
        flash.load(self.shop.history(geometry, OLD))
        ended = flash.power(partial(_change, self.shop, image))
        if ended.how == "hung":
            raise Fallen("the runtime hung")
        outcome = REFUSED
        if ended.how == "used" and ended.value is None:
            expect_running(look_again(self.shop, flash), self.shop, (OLD,))
        else:
            outcome = self._judge(flash, ended, int.from_bytes(image[int(lib.CDL_CRC_OFFSET) :][:4], "little"))
        check_can_be_flashed(self.shop, flash)
        return outcome

    def _judge(self, flash: Flash, ended: Ended, crc: int) -> str:
        """The change was taken: its program may run, or have been given up for the previous one."""
        seen: Seen = look_again(self.shop, flash, after=ended)
        if seen.crc == crc and seen.state is AppState.RUN:
            return ITSELF
        if seen.crc == crc and seen.state is not AppState.NONE and (seen.causes or seen.exception):
            return STOPPED
        expect_running(seen, self.shop, (OLD,))
        return BEFORE


@dataclass(frozen=True)
class Places:
    """Where an image has the head of its online change, and its steps."""

    head: int
    steps: list[int]

    @staticmethod
    def of(data: bytes) -> Places:
        image = parse_image(data)
        change = image.change
        assert change is not None
        init = int(lib.CDL_CHANGE_NO_INIT) if change.init is None else change.init
        head = data.index(b"".join(n.to_bytes(4, "little") for n in (change.base, init, change.place)))
        steps, at = [], data.index(image.code) + change.place
        for step in change.steps:
            steps.append(at)
            at += STEP + len(step.data) + -len(step.data) % 4
        return Places(head, steps)


def hostile(good: bytes, places: Places, chooser: random.Random, faults: int) -> bytes:
    """The image of the change with so many numbers of its list exchanged, or steps in another order."""
    while True:
        image = bytearray(good)
        for _ in range(faults):
            _spoil(chooser, image, places)
        changed = with_crc(image)
        if changed != good and not any(image.count(call) > good.count(call) for call in KERNEL_CALLS):
            return changed


def _spoil(chooser: random.Random, image: bytearray, places: Places) -> None:
    chance, step = chooser.random(), chooser.choice(places.steps)
    if chance < 0.1:
        _exchange(chooser, image, places.head + int(ffi.offsetof("CDL_CHANGE", chooser.choice(HEAD))), 4)
    elif chance < 0.2:
        other = chooser.choice(places.steps)
        image[step : step + STEP] = image[other : other + STEP]
    else:
        name = chooser.choice(list(FIELDS))
        _exchange(chooser, image, step + int(ffi.offsetof("CDL_CHANGE_STEP", name)), FIELDS[name])


def _exchange(chooser: random.Random, image: bytearray, at: int, size: int) -> None:
    near = int.from_bytes(image[at : at + size], "little") + chooser.choice((-64, -8, -4, -1, 1, 4, 8, 64))
    value = chooser.choice((chooser.choice(WORDS), near, chooser.getrandbits(32)))
    image[at : at + size] = (value % (1 << 8 * size)).to_bytes(size, "little")


def _change(shop: Workshop, image: bytes, device: Device) -> Seen | None:
    """Changes the program and lets it run; what there is then, None when the change was refused."""
    lib.SimSetCycleLimit(CYCLE_LIMIT_MS)
    try:
        device.plc.change(image, unchecked=True)
    except DeviceError:
        expect_running(look_at(shop, device), shop, (OLD,))
        values = device.named(shop[OLD].symbols).read(*VALUES)
        if values != VALUES:
            raise Fallen(f"the change was refused, and yet variables have changed: {values}") from None
        return None
    device.run(PROVING_MS)
    seen = look_at(shop, device)
    if violation():
        raise Fallen(f"the flash was used against its rules: {violation()}")
    return seen
