"""docs/protocol.md tells what is on the wire: every layout has its diagram, every service and element its place."""

from __future__ import annotations

import re
from pathlib import Path

from packet_diagrams import PROTOCOL, drawn, packets

from plctool.core import lib

HEADERS = PROTOCOL.parents[1] / "firmware" / "include"


ROW = re.compile(r"^\| ((?:`SRV_\w+`(?:, )?)+) \| (\w+) \|", re.MULTILINE)
SERVICE = re.compile(r"\{(SRV_\w+), RIGHT_(\w+), \w+\}")


def services() -> dict[str, str]:
    """The right that each service needs, as the tables of the components have it."""
    texts = [path.read_text() for path in (HEADERS.parent / "src").rglob("*.c")]
    return dict(found for text in texts for found in SERVICE.findall(text))


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


def test_every_service_has_a_row_in_the_table_of_a_component() -> None:
    assert {name for name in dir(lib) if re.match(r"SRV_[A-Z0-9]+_", name)} - set(services()) == set()


def test_rights_are_those_of_the_firmware() -> None:
    """RIGHT_STATE needs a login with a password only, which the text says."""
    rights = services()
    rows = [
        (name, right) for names, right in ROW.findall(PROTOCOL.read_text()) for name in re.findall(r"SRV_\w+", names)
    ]
    assert len(rows) > 30
    assert [(n, r) for n, r in rows if r != rights[n].lower().replace("state", "none")] == []
