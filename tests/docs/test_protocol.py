"""docs/protocol.md tells what is on the wire: every layout has its diagram, every service and element its place."""

from __future__ import annotations

import re
from pathlib import Path

from packet_diagrams import PROTOCOL, drawn, packets

from plctool.core import lib

HEADERS = PROTOCOL.parents[1] / "firmware" / "include"


def layouts(header: Path) -> set[str]:
    return set(re.findall(r"^\} (\w+);", header.read_text(), re.MULTILINE))


def test_diagrams_are_those_of_the_header() -> None:
    text = PROTOCOL.read_text()
    assert drawn(text) == text, "run tests/docs/packet_diagrams.py"


def test_every_layout_has_a_diagram() -> None:
    assert layouts(HEADERS / "CmpPackets.h") - packets(PROTOCOL.read_text()) == set()


def test_every_service_and_element_is_described() -> None:
    names = {name for name in dir(lib) if re.match(r"SRV_[A-Z0-9]+_|TAG_", name)}
    described = set(re.findall(r"\b(?:SRV|TAG)_\w+", PROTOCOL.read_text()))
    assert names - described == set()
