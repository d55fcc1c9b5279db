"""Programs with a fault, new ones and ones that had proven themselves, on plcrt."""

from __future__ import annotations

from contextlib import suppress
from functools import partial
from pathlib import Path

from campaign import BEFORE, ITSELF, STOPPED, Campaign, Case, Fallen
from faults import FAULTS, MACHINE_CODE, PLACES, frame, source, with_machine_code
from look import Seen, expect_running
from process import Runtime, eventually
from simulated import PLCRT, Device, Flash
from workshop import PROVING_MS

from plctool.device import Plc
from plctool.errors import DeviceError
from plctool.link.services import AppState

ENOUGH = 20  # cycles of a program that goes on whatever it did


class BadPrograms(Campaign):
    name = "program"
    promise = "a bad program is stopped with the cause in the log, and the previous one runs at the next start"
    short = 10

    def cases(self) -> list[Case]:
        cases = []
        for place in PLACES:
            for fault, what in FAULTS.items():
                for proven in (False,) if what.always else (False, True):
                    title = f"{fault} in {place} of a {'proven' if proven else 'new'} program"
                    cases.append(Case(title, (fault, place, proven)))
            for fault in MACHINE_CODE:
                cases.append(Case(f"{fault} in {place} of a new program", (fault, place, False)))
        return cases

    def prepare(self, cases: list[Case]) -> None:
        sources = {}
        for fault, place, proven in (case.data for case in cases):
            text = frame(place) if fault in MACHINE_CODE else source(fault, place, proven)
            sources[_name(fault, place, proven)] = text
        self.shop.add(sources)
        for fault, place, proven in (case.data for case in cases):
            if fault in MACHINE_CODE:
                name = _name(fault, place, proven)
                self.shop.add_image(name, with_machine_code(self.shop[name].image, fault, place), name)

    def run(self, case: Case) -> str:
        fault, place, proven = case.data
        name = _name(fault, place, proven)
        flash = self.shop.folder / f"{name}.flash"
        flash.write_bytes(self._content(name, place, proven))
        try:
            with Runtime(self.shop, flash) as runtime:
                return self._proven(runtime, name, place) if proven else self._new(runtime, name, place)
        finally:
            flash.unlink()

    def _content(self, name: str, place: str, proven: bool) -> bytes:
        """What the flash holds: a good program, and after it the bad one if it has proven itself."""
        if not proven:
            return self.shop.history(PLCRT, "good1")
        flash = Flash(PLCRT)
        flash.load(self.shop.history(PLCRT, "good1"))
        ended = flash.power(partial(self._prove, name, trip=place in ("initial value", "FB_Init")))
        assert ended.how == "used", f"{name}: {ended}"
        return flash.content()

    def _prove(self, name: str, device: Device, trip: bool) -> None:
        device.plc.flash(self.shop[name].image, unchecked=True)
        device.run(PROVING_MS)
        assert device.plc.status().state is AppState.RUN, f"{name}: {device.plc.status()}"
        if trip:
            device.named(self.shop[name].symbols).write({"trip": True})
            device.run(2000)

    def _new(self, runtime: Runtime, name: str, place: str) -> str:
        runtime.power_on()
        runtime.ask(partial(_flash, self.shop[name].image), "while the bad program was flashed")
        if place == "FB_Exit":
            runtime.check_can_be_flashed()
            return self._after_its_end(runtime)
        seen = _last(runtime)
        if seen.crc != self.shop[name].crc and seen.causes:
            expect_running(seen, self.shop, ("good1",))  # plctool started it, and it says why it had to be
            runtime.check_can_be_flashed()
            return BEFORE
        _check_stopped(seen, self.shop[name].crc)
        runtime.power_off()
        runtime.power_on()
        again = runtime.look("after the next start")
        if seen.state is AppState.RUN and again.crc == self.shop[name].crc:
            outcome = ITSELF
        else:
            expect_running(again, self.shop, ("good1",))
            outcome = BEFORE
        runtime.check_can_be_flashed()
        return outcome

    def _proven(self, runtime: Runtime, name: str, place: str) -> str:
        runtime.power_on()
        if PLACES[place].in_cycle or place == "FB_Exit":
            runtime.ask(lambda plc: _trip(plc, self.shop[name].symbols), "while the fault was set off")
        if place == "FB_Exit":
            runtime.check_can_be_flashed()
            return self._after_its_end(runtime)
        seen = _last(runtime)
        _check_stopped(seen, self.shop[name].crc)
        runtime.power_off()
        runtime.power_on()
        again = _last(runtime)
        _check_stopped(again, self.shop[name].crc)
        runtime.check_can_be_flashed()
        return ITSELF if seen.state is AppState.RUN else STOPPED

    def _after_its_end(self, runtime: Runtime) -> str:
        """The bad program went when it was replaced; the good one stays."""
        runtime.power_off()
        runtime.power_on()
        expect_running(runtime.look("after the next start"), self.shop, ("good3",))
        return STOPPED


def _name(fault: str, place: str, proven: bool) -> str:
    return f"{fault} {place} {'proven' if proven else 'new'}".replace(" ", "_")


def _flash(image: bytes, plc: Plc) -> None:
    with suppress(DeviceError):  # it could not be started
        plc.flash(image, unchecked=True)


def _trip(plc: Plc, symbols: Path) -> None:
    Plc(plc._connection, symbols).write({"trip": True})


def _last(runtime: Runtime) -> Seen:
    """What becomes of a bad program: it stops, or does so many cycles that it will go on."""

    def question() -> Seen | None:
        seen = runtime.look("after the fault")
        done = seen.state is not AppState.RUN or runtime.ask(lambda plc: plc.tasks()[-1].cycles, "") > ENOUGH
        return seen if done else None

    return eventually(question, "the bad program neither runs nor stops")


def _check_stopped(seen: Seen, crc: int) -> None:
    """The bad program is there, and what says why if it does not run."""
    if seen.state is AppState.NONE:
        raise Fallen(f"the program is gone: {seen}")
    if seen.state is not AppState.RUN and not seen.causes:
        raise Fallen(f"nothing says why the program is stopped: {seen}")
    if seen.crc != crc:
        raise Fallen(f"the bad program is not there: {seen}")
