"""Attacks by a tool that is connected to plcrt, does what makes no sense, and ends in some way."""

from __future__ import annotations

import random
from abc import abstractmethod
from dataclasses import dataclass

from campaign import Campaign, Case
from process import Runtime
from simulated import PLCRT

COUNT = 120
PROGRAM = "good1"


@dataclass(frozen=True)
class Attack:
    """`seed` of what the tool does, and how it ends."""

    seed: int
    end: str


class HostileTools(Campaign):
    """`tool`: what it is; `ends`: the ways in which it ends, in turn."""

    tool = ""
    ends: tuple[str, ...] = ()

    def cases(self) -> list[Case]:
        chooser = random.Random(self.shop.seed)
        attacks = [Attack(chooser.randrange(1 << 30), self.ends[number % len(self.ends)]) for number in range(COUNT)]
        return [Case(f"{self.tool} with seed {a.seed} that {a.end}", a) for a in attacks]

    def run(self, case: Case) -> str:
        attack: Attack = case.data
        flash = self.shop.folder / f"{self.name}-{attack.seed}.flash"
        flash.write_bytes(self.shop.history(PLCRT, PROGRAM))
        try:
            with Runtime(self.shop, flash) as runtime:
                runtime.power_on()
                runtime.look("before the attack")
                return self.attacked(attack, runtime)
        finally:
            flash.unlink()

    @abstractmethod
    def attacked(self, attack: Attack, runtime: Runtime) -> str:
        """Attacks and looks; returns the outcome."""
