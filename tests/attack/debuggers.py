"""A hostile debugger on plcrt: traps anywhere, lists and conditions without sense, and its end in each state."""

from __future__ import annotations

import random
import sys
import time
from contextlib import suppress
from pathlib import Path

from campaign import NEWEST, STOPPED
from hostile_tools import PROGRAM, Attack, HostileTools
from look import expect_running
from process import Runtime, eventually

sys.path.append(str(Path(__file__).resolve().parents[1]))

from hostile_debugger import CODE, act

import plctool
from plctool.device import Plc
from plctool.errors import PlcError
from plctool.link.services import AppState

ACTIONS = 40
GONE_S = 7.0  # more than BP_ALIVE_MS


class Debuggers(HostileTools):
    name = "debugger"
    promise = "after a debugger has gone, the program runs on, or is stopped with the cause in the log"
    short = 6
    tool = "a debugger"
    ends = ("detaches", "vanishes", "vanishes while it is halted")

    def attacked(self, attack: Attack, runtime: Runtime) -> str:
        with suppress(PlcError), plctool.connect(f"serial:{runtime.port}") as plc:
            _debug(plc, attack)

        gone_by = time.monotonic() + (0 if attack.end == "detaches" else GONE_S)

        def is_alone() -> bool | None:
            state = runtime.ask(lambda plc: plc.status().state, "after the debugger had gone")
            return True if state != AppState.HALTED and time.monotonic() > gone_by else None

        eventually(is_alone, "the program is still halted after its debugger has gone")
        seen = runtime.look("after the debugger had gone")
        outcome = NEWEST
        if seen.exception and seen.causes:
            outcome = STOPPED
        else:
            expect_running(seen, self.shop, (PROGRAM,))
        runtime.check_can_be_flashed()
        return outcome


def _debug(plc: Plc, attack: Attack) -> None:
    chooser = random.Random(attack.seed)
    debugger = plc.breakpoints
    target = debugger._target
    for _ in range(ACTIONS):
        with suppress(PlcError):
            act(target, chooser)
    if attack.end == "detaches":
        debugger.close()
        return
    if attack.end.endswith("halted"):
        with suppress(PlcError):
            target.set(0, 0, None)
            target.temporary(range(0, CODE, 2))
            target.pause()
    plc._connection.close()  # nothing more is said: it is gone
