"""What a campaign is: many cases, each an attack and a look at what is left."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

from workshop import Workshop

REFUSED = "refused"  # and what ran before goes on
NEWEST = "newest runs"
BEFORE = "one before runs"
ITSELF = "attacker runs"  # a hostile program that does no harm
STOPPED = "stopped, cause known"
NOTHING = "none was there"
OUTCOMES = (REFUSED, NEWEST, BEFORE, ITSELF, STOPPED, NOTHING)


class Fallen(Exception):
    """The promise did not hold."""


@dataclass(frozen=True)
class Case:
    """One attack. `title` says what is done, `data` is what the campaign needs for it."""

    title: str
    data: Any


class Campaign(ABC):
    """`name` is the first half of the ids of its cases, `promise` what it tries to break, `short` the number of cases
    of a short run, which are taken at random from all."""

    name: str
    promise: str
    short: int

    def __init__(self, shop: Workshop) -> None:
        self.shop = shop

    @abstractmethod
    def cases(self) -> list[Case]:
        """All cases, the same ones in the same order for one seed."""

    def prepare(self, cases: list[Case]) -> None:  # noqa: B027 (most need nothing)
        """Makes what the cases that will be run need, before workers are forked."""

    @abstractmethod
    def run(self, case: Case) -> str:
        """One of OUTCOMES. Raises Fallen."""
