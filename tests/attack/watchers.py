"""Hostile tools that force and trace on plcrt, and end in each way, also by a power cut."""

from __future__ import annotations

import random
import sys
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from campaign import NEWEST, STOPPED, Campaign, Case
from look import expect_running
from process import Runtime
from simulated import PLCRT

sys.path.append(str(Path(__file__).resolve().parents[1]))

from hostile_watcher import act, end_all

import plctool
from plctool.device import Plc
from plctool.errors import PlcError

COUNT = 120
ACTIONS = 60
ENDS = ("leaves", "vanishes", "loses the power of the controller", "kills its worker")
NAME = "good1"


@dataclass(frozen=True)
class Attack:
    """`seed` of what the tool does, and how it ends."""

    seed: int
    end: str


class Watchers(Campaign):
    name = "watcher"
    promise = "after forces and traces have ended, the program runs, or is stopped with the cause in the log"
    short = 4

    def cases(self) -> list[Case]:
        chooser = random.Random(self.shop.seed)
        attacks = [Attack(chooser.randrange(1 << 30), ENDS[number % len(ENDS)]) for number in range(COUNT)]
        return [Case(f"a tool with seed {a.seed} that forces and traces, and {a.end}", a) for a in attacks]

    def run(self, case: Case) -> str:
        attack: Attack = case.data
        flash = self.shop.folder / f"watcher-{attack.seed}.flash"
        flash.write_bytes(self.shop.history(PLCRT, NAME))
        try:
            with Runtime(self.shop, flash) as runtime:
                runtime.power_on()
                runtime.look("before the attack")
                return self._attacked(attack, runtime)
        finally:
            flash.unlink()

    def _attacked(self, attack: Attack, runtime: Runtime) -> str:
        with suppress(PlcError), plctool.connect(f"serial:{runtime.port}") as plc:
            self._abuse(plc, attack)
            if attack.end == "vanishes":
                plc._connection.close()
        if attack.end.startswith("loses"):
            runtime.power_off()
            runtime.power_on()
        elif attack.end.startswith("kills"):
            runtime.kill_worker()
        seen = runtime.look("after the attack")
        outcome = STOPPED if seen.exception and seen.causes else NEWEST
        runtime.ask(_recover, "while forces and traces were ended")
        expect_running(runtime.look("after forces and traces had ended"), self.shop, (NAME,))
        runtime.check_can_be_flashed()
        return outcome

    def _abuse(self, plc: Plc, attack: Attack) -> None:
        chooser = random.Random(attack.seed)
        for _ in range(ACTIONS):
            with suppress(PlcError):
                act(plc, plc._session, self.shop[NAME].crc, chooser)


def _recover(plc: Plc) -> None:
    """What was forced stays in the variables until they get their initial values again."""
    end_all(plc)
    plc.reset("cold")
    plc.start()
