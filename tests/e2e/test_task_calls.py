"""What a program on plcrt asks about its tasks; the rest of the promise is in tests/task_calls.py."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from task_calls import PROGRAM, TaskWatchdogs

from plctool import connect
from plctool.device import Plc
from plctool.testing.plcrt import Plcrt


@pytest.fixture
def plc(plcrt: Plcrt, tool) -> Iterator[Plc]:
    image = tool.build("tasks", PROGRAM)
    plcrt.stop()
    plcrt.options = ("--tcp", "0")
    plcrt.start()
    with connect(f"tcp:{plcrt.tcp}") as plc:
        plc.flash(image)
        yield plc


class TestPlcrt(TaskWatchdogs):
    LOOPS = 200_000_000
