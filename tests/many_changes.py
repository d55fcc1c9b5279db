"""Random online changes in a row, each checked against a download of the same image: `make changes`.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

from online_programs import Source, built, carried, edited, random_source

from plctool import Simulator
from plctool.compiler.image.build import BuildResult
from plctool.image.file import parse_image

MOST_LINES = 20  # else the program grows for ever
MEASURED = 5  # each so many changes the program is compiled as for a download, too, and its room compared


class Summary(NamedTuple):
    """`room`: the most memory that a changed program took, in terms of the largest download so far."""

    changes: int
    room: float


def values(plc: Simulator) -> dict[str, Any]:
    """All but pointers."""
    return plc.read_all([name for name in plc.symbols().variables if not name.startswith("Main.to")])


def run(folder: Path, count: int, seed: int, tell: Callable[[int, float], None] = lambda done, room: None) -> Summary:
    """Raises AssertionError for a change that is refused, or does not do what it promises."""
    random = Random(seed)
    source, room = random_source(random), 0.0
    result = built(folder, source.text)
    largest = size_of(result)
    with Simulator(result.image, result.symbols) as plc:
        for done in range(count):
            plc.run_for(10 * random.randrange(1, 5))
            before, had, cycles = values(plc), source.types, plc.tasks()[0].cycles
            source = edited(random, source, 100 * (done + 1))
            source = Source(source.lines[:MOST_LINES], source.members[:MOST_LINES], source.step)
            result = built(folder, source.text, plc.symbols())
            assert result.change is not None and result.change.problems == [], result.change
            plc.add_symbols(result.symbols)
            plc.change(result.image)
            check(plc, result, before, had, source)
            assert plc.tasks()[0].cycles >= cycles and plc.tasks()[0].overruns == 0
            if done % MEASURED == 0:
                largest = max(largest, size_of(built(folder, source.text)))
                room = max(room, size_of(result) / largest)
            tell(done + 1, room)
    return Summary(count, room)


def check(plc: Simulator, result: BuildResult, before: dict[str, Any], had: dict[str, str], source: Source) -> None:
    """Each variable has what it had, as far as its type allows that, and new ones what a download of the same image
    gives them."""
    now = values(plc)
    with Simulator(result.image, result.symbols, start=False) as other:
        other.restart()
        initial = values(other)
    for name, value in initial.items():
        wanted = value
        if name in before:
            wanted = carried(name.removeprefix("Main."), before[name], value, had, source.types)
        assert now[name] == wanted, (name, now[name], wanted)


def size_of(result: BuildResult) -> int:
    return sum(parse_image(result.image).areas.values())


def main() -> int:
    parser = argparse.ArgumentParser(prog="make changes")
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    begin = time.monotonic()

    def tell(done: int, room: float) -> None:
        if done % 100 == 0:
            seconds = time.monotonic() - begin
            print(
                f"{done} changes in {seconds:.0f} s, up to {room:.2f} times the room of the largest download",
                flush=True,
            )

    with tempfile.TemporaryDirectory() as folder:
        summary = run(Path(folder), args.count, args.seed, tell)
    print(f"{summary.changes} changes, none refused, nothing lost; {summary.room:.2f} times the room of a download")
    return 0


if __name__ == "__main__":
    sys.exit(main())
