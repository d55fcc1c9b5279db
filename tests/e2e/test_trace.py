"""Traces on plcrt: by the API, over a slow line, by tools that are killed, and over its restart."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from tracing import PROGRAM, Tracing

from plctool import connect
from plctool.device import Plc
from plctool.testing.plcrt import Plcrt


@pytest.fixture
def image(tmp_path: Path, tool) -> Path:
    (tmp_path / "tracing.st").write_text(PROGRAM)
    tool.ok("build", "tracing.st", "-o", "tracing.cdl")
    return tmp_path / "tracing.cdl"


@pytest.fixture
def link(plcrt: Plcrt) -> list[str]:
    plcrt.stop()
    plcrt.options = ("--tcp", "0")
    plcrt.start()
    return ["--tcp", plcrt.tcp]


class TestPlcrt(Tracing):
    @pytest.fixture
    def plc(self, plcrt: Plcrt, link: list[str], image: Path) -> Iterator[Plc]:
        with connect(f"tcp:{plcrt.tcp}") as plc:
            plc.flash(image)
            yield plc
