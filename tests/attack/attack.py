"""The campaigns, one after the other, and their table. run.py starts this with the environment it needs."""

from __future__ import annotations

import argparse
import os
import random
import sys
import time
import traceback
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path

from bad_programs import BadPrograms
from campaign import OUTCOMES, Campaign, Case, Fallen
from changes import Changes
from combinations import Combinations
from components import Components
from cuts import Calls, Cuts
from debuggers import Debuggers
from images import Images
from kills import Kills
from locks import Locks
from pages import Pages
from records import Records
from sectors import Sectors
from simulated import die_with_parent
from watchers import Watchers
from workshop import Workshop, open_workshop

CAMPAIGNS: tuple[type[Campaign], ...] = (
    Kills, Cuts, Calls, BadPrograms, Images, Changes, Records, Sectors, Combinations, Locks, Components, Debuggers,
    Watchers, Pages,
)  # fmt: skip
SHOWN = 10  # failures of a campaign that are printed


@dataclass
class Result:
    """What came of a campaign. `fallen`: why, and `titles`: what was done, by number of the case."""

    campaign: Campaign
    outcomes: Counter[str] = field(default_factory=Counter)
    fallen: dict[int, str] = field(default_factory=dict)
    titles: dict[int, str] = field(default_factory=dict)
    seconds: float = 0.0

    @property
    def count(self) -> int:
        return sum(self.outcomes.values()) + len(self.fallen)


_at_work: Campaign | None = None  # of this process and those it forks
_cases: list[Case] = []


def attempt(number: int) -> tuple[int, str, str]:
    """Runs a case; its number, its outcome, and why the promise fell, if it did."""
    assert _at_work
    try:
        return number, _at_work.run(_cases[number]), ""
    except Fallen as reason:
        return number, "", str(reason)
    except Exception:
        return number, "", "the campaign itself failed:\n" + traceback.format_exc()


def run_campaign(campaign: Campaign, most: int | None, jobs: int) -> Result:
    """Its cases, or so many of them at random, side by side."""
    global _at_work, _cases
    begin = time.monotonic()
    _at_work, _cases = campaign, campaign.cases()
    numbers = list(range(len(_cases)))
    if most is not None and most < len(numbers):
        numbers = sorted(random.Random(campaign.shop.seed).sample(numbers, most))
    campaign.prepare([_cases[number] for number in numbers])
    result = Result(campaign)
    with ProcessPoolExecutor(jobs, get_context("fork"), die_with_parent) as pool:
        for number, outcome, reason in pool.map(attempt, numbers, chunksize=4):
            if outcome:
                result.outcomes[outcome] += 1
            else:
                result.fallen[number] = reason
                result.titles[number] = _cases[number].title
    result.seconds = time.monotonic() - begin
    fell = f", {len(result.fallen)} fell" if result.fallen else ""
    print(f"{campaign.name}: {result.count} cases in {result.seconds:.0f} s{fell}", flush=True)
    return result


def report(results: list[Result], replay: str) -> None:
    """One table, and each failure with the line that replays it."""
    for result in results:
        for number, reason in list(result.fallen.items())[:SHOWN]:
            print(f"\n{result.titles[number]}\n  {reason}\n  {replay} --replay {result.campaign.name}:{number}")
        if len(result.fallen) > SHOWN:
            print(f"\n... and {len(result.fallen) - SHOWN} more of {result.campaign.name}: ", end="")
            print(" ".join(str(number) for number in list(result.fallen)[SHOWN:]))
    heads = ("campaign", "cases", *OUTCOMES, "fell", "seconds")
    rows = [
        (r.campaign.name, str(r.count), *(str(r.outcomes[o]) for o in OUTCOMES), str(len(r.fallen)), f"{r.seconds:.0f}")
        for r in results
    ]
    widths = [max(len(row[i]) for row in (heads, *rows)) for i in range(len(heads))]
    print()
    for row in (heads, *rows):
        cells = zip(row, widths, strict=True)
        print("  ".join(cell.rjust(width) if i else cell.ljust(width) for i, (cell, width) in enumerate(cells)))
    cases, fallen = sum(r.count for r in results), sum(len(r.fallen) for r in results)
    print(f"\n{cases} attacks: the promise {f'fell {fallen} times' if fallen else 'held'}.")


def replay_case(shop: Workshop, name: str) -> int:
    kind, _, number = name.partition(":")
    campaign = next(c for c in CAMPAIGNS if c.name == kind)(shop)
    case = campaign.cases()[int(number)]
    print(case.title)
    campaign.prepare([case])
    try:
        print(campaign.run(case))
    except Fallen as reason:
        print(f"FELL: {reason}")
        return 1
    return 0


def parse(argv: list[str]) -> argparse.Namespace:
    names = ", ".join(campaign.name for campaign in CAMPAIGNS)
    parser = argparse.ArgumentParser(prog="tests/attack/run.py")
    parser.add_argument("--short", action="store_true", help="some cases of each campaign")
    parser.add_argument("--sample", type=int, metavar="N", help="N cases of each campaign")
    parser.add_argument("--only", metavar="NAMES", help=f"campaigns, separated by commas: {names}")
    parser.add_argument("--replay", metavar="ID", help="one case, such as cut:17")
    parser.add_argument("--seed", type=int, default=1, help="another one gives other random cases")
    parser.add_argument("--jobs", type=int, default=min(2, os.cpu_count() or 1), help="cases side by side")
    parser.add_argument("--build", help="the build folder; build, if not given")
    parser.add_argument("--sanitized", action="store_true", help="build-sanitized instead")
    return parser.parse_args(argv)


def main(argv: list[str]) -> int:
    args = parse(argv)
    shop, folder = open_workshop(Path(os.environ["PLCRT"]), args.jobs, args.seed)
    with folder:
        if args.replay:
            return replay_case(shop, args.replay)
        chosen = args.only.split(",") if args.only else [c.name for c in CAMPAIGNS]
        campaigns = [campaign(shop) for campaign in CAMPAIGNS if campaign.name in chosen]
        results = [run_campaign(c, c.short if args.short else args.sample, args.jobs) for c in campaigns]
        options = f"{' --sanitized' if args.sanitized else ''}{f' --seed {args.seed}' if args.seed != 1 else ''}"
        report(results, f"tests/attack/run.py{options}")
    return 1 if any(r.fallen for r in results) else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
