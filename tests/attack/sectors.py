"""Sectors of the flash that lost their content."""

from __future__ import annotations

import random

from campaign import BEFORE, NEWEST, STOPPED, Campaign, Case, Fallen
from look import expect_running
from simulated import PLCRT, Flash, Geometry
from verdict import check_can_be_flashed, look_again

from plctool.link.services import AppState

GEOMETRIES = {"64 KiB": Geometry(), "plcrt": PLCRT}
HISTORIES = (("good1", "good2"), ("good1",))
PATTERNS = ("FF", "00", "random")


class Sectors(Campaign):
    name = "sector"
    promise = "a lost sector costs the program that is in it, and nothing else"
    short = 15

    def cases(self) -> list[Case]:
        return [
            Case(f"{', '.join(names)} in {where}: sector {sector} lost, {pattern}", (where, names, sector, pattern))
            for where, geometry in GEOMETRIES.items()
            for names in HISTORIES
            for sector in _used(self.shop.history(geometry, *names), geometry)
            for pattern in PATTERNS
        ]

    def run(self, case: Case) -> str:
        where, names, sector, pattern = case.data
        geometry = GEOMETRIES[where]
        content = bytearray(self.shop.history(geometry, *names))
        begin, end = sector * geometry.sector, (sector + 1) * geometry.sector
        hit = [name for name in names if _overlaps(content, self.shop[name].image, begin, end)]
        content[begin:end] = _garbage(pattern, geometry.sector, self.shop.seed + sector)
        flash = Flash(geometry)
        flash.load(bytes(content))
        outcome = self._judge(flash, [name for name in names if name not in hit], names[-1])
        check_can_be_flashed(self.shop, flash)
        return outcome

    def _judge(self, flash: Flash, left: list[str], newest: str) -> str:
        seen = look_again(self.shop, flash)
        if not left:
            if seen.state in (AppState.RUN, AppState.EXCEPTION) or not seen.causes:
                raise Fallen(f"a program that lost a sector: {seen}")
            return STOPPED
        return NEWEST if expect_running(seen, self.shop, (left[-1],)) == newest else BEFORE


def _used(content: bytes, geometry: Geometry) -> list[int]:
    """Sectors with anything in them, and a blank one."""
    blank = bytes([geometry.erased]) * geometry.sector
    sectors = range(geometry.size // geometry.sector)
    used = [s for s in sectors if content[s * geometry.sector : (s + 1) * geometry.sector] != blank]
    return sorted({*used, next(s for s in sectors if s not in used)})


def _overlaps(content: bytearray, image: bytes, begin: int, end: int) -> bool:
    at = content.find(image)
    assert at >= 0, "the image is in flash as it is"
    return at < end and begin < at + len(image)


def _garbage(pattern: str, size: int, seed: int) -> bytes:
    if pattern == "random":
        return random.Random(seed).randbytes(size)
    return bytes.fromhex(pattern) * size
