"""What a program asks about its tasks, in the simulator; the promise is in tests/task_calls.py."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from task_calls import PROGRAM, TaskCalls

from plctool.compiler import compile_sources
from plctool.compiler.image.build import BuildResult
from plctool.controller import Controller
from plctool.sim import Simulator


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> BuildResult:
    path = tmp_path_factory.mktemp("program") / "app.st"
    path.write_text(PROGRAM)
    return compile_sources([path])


@pytest.fixture
def plc(built: BuildResult) -> Iterator[Simulator]:
    with Simulator(built.image, built.symbols) as simulator:
        yield simulator


class TestSimulator(TaskCalls):
    def wait(self, plc: Controller, condition: Callable[[], Any]) -> None:
        assert isinstance(plc, Simulator)
        while not condition():
            plc.run_for(10, check=False)
