"""Values that go from task to task on plcrt; the promise is in tests/task_links.py."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from task_links import PROGRAM, TaskLinks

from plctool import connect
from plctool.device import Plc
from plctool.testing.plcrt import Plcrt


@pytest.fixture
def plc(plcrt: Plcrt, tool) -> Iterator[Plc]:
    image = tool.build("links", PROGRAM)
    plcrt.stop()
    plcrt.options = ("--tcp", "0")
    plcrt.start()
    with connect(f"tcp:{plcrt.tcp}") as plc:
        plc.flash(image)
        yield plc


class TestPlcrt(TaskLinks):
    pass
