"""What plctool reads gives what is meant, or an error with its own words: first inputs of the fuzz targets, the same
with bytes changed and cut off, and what `make fuzz` has found."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from host_targets import READERS, TARGETS, Packets, Replies, ask, heard_packets, pieces, recorded_replies

from plctool.link.connection import Connection
from plctool.link.services import Identity
from plctool.link.session import Session

CORPUS = Path(__file__).parent / "corpus"
CHANGES = 20  # of each first input
MOST = 12  # first inputs that are changed


@pytest.mark.parametrize("name", TARGETS)
def test_first_inputs_and_changed_ones(name: str) -> None:
    target, rng = TARGETS[name], random.Random(1)
    inputs = [data for data in target.first() if data]
    assert inputs
    for data in inputs:
        target.run(data)
    for data in inputs[:MOST]:
        for _ in range(CHANGES):
            changed = bytearray(data)
            for _ in range(rng.randint(1, 4)):
                changed[rng.randrange(len(changed))] = rng.choice([0, 1, 0x7F, 0x80, 0xFF, rng.randrange(256)])
            target.run(bytes(changed[: rng.choice([len(changed), rng.randrange(len(changed))])]))


@pytest.mark.parametrize("name", TARGETS)
def test_findings(name: str) -> None:
    for path in sorted((CORPUS / f"host_{name}").glob("*")):
        TARGETS[name].run(path.read_bytes())


def test_packets_that_were_heard_make_a_whole_conversation() -> None:
    assert isinstance(ask(Connection(Packets(pieces(next(heard_packets()))))), Identity)


@pytest.mark.parametrize("number", range(7))
def test_replies_that_were_recorded_are_read_to_their_end(number: int) -> None:
    data = list(recorded_replies())[number]
    READERS[number](Session(Replies(pieces(data[1:]))))
