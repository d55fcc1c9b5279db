"""Hostile tools that force and trace on plcrt, and end in each way, also by a power cut."""

from __future__ import annotations

import random
import sys
from contextlib import suppress
from pathlib import Path

from campaign import NEWEST, STOPPED
from hostile_tools import PROGRAM, Attack, HostileTools
from look import expect_running
from process import Runtime

sys.path.append(str(Path(__file__).resolve().parents[1]))

from hostile_watcher import act, end_all

import plctool
from plctool.device import Plc
from plctool.errors import PlcError

ACTIONS = 60


class Watchers(HostileTools):
    name = "watcher"
    promise = "after forces and traces have ended, the program runs, or is stopped with the cause in the log"
    short = 4
    tool = "a tool that forces and traces,"
    ends = ("leaves", "vanishes", "loses the power of the controller", "kills its worker")

    def attacked(self, attack: Attack, runtime: Runtime) -> str:
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
        expect_running(runtime.look("after forces and traces had ended"), self.shop, (PROGRAM,))
        runtime.check_can_be_flashed()
        return outcome

    def _abuse(self, plc: Plc, attack: Attack) -> None:
        chooser = random.Random(attack.seed)
        for _ in range(ACTIONS):
            with suppress(PlcError):
                act(plc, plc._session, self.shop[PROGRAM].crc, chooser)


def _recover(plc: Plc) -> None:
    """What was forced stays in the variables until they get their initial values again."""
    end_all(plc)
    plc.reset("cold")
    plc.start()
