"""A real `plcrt` process and the real `plctool` command, in a folder of their own."""

from __future__ import annotations

import os
import shutil
import signal
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from done import Done
from emulated import reason_to_skip
from plctool_commands import TARGET, build_for_plcrt, run_plctool

from plctool.testing import waiting
from plctool.testing.plcrt import Plcrt, find_plcrt

build_for_plcrt()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items if TARGET in os.environ else []:
        if reason := reason_to_skip(item.nodeid, os.environ[TARGET]):
            item.add_marker(pytest.mark.skip(reason=reason))


@dataclass
class Tool:
    """Runs plctool in `folder`."""

    folder: Path

    def __call__(self, *args: str, timeout: float = 120) -> Done:
        done = run_plctool(args, self.folder, os.environ | {"XDG_CACHE_HOME": str(self.folder / "cache")}, timeout)
        return Done(done.returncode, done.stdout, done.stderr)

    def ok(self, *args: str, timeout: float = 120) -> Any:
        """The JSON document of a command that has to succeed."""
        done = self(*args, "--json", timeout=timeout)
        assert done.status == 0, f"plctool {' '.join(args)}: exit {done.status}\n{done.out}\n{done.err}"
        return done.json

    def build(self, name: str, text: str, *options: str) -> Path:
        """Compiles a program; the path of its image."""
        source = self.folder / f"{name}.st"
        source.write_text(text)
        self.ok("build", str(source), "-o", f"{name}.cdl", *options)
        return self.folder / f"{name}.cdl"


@pytest.fixture
def tool(tmp_path: Path) -> Tool:
    return Tool(tmp_path)


@pytest.fixture
def plcrt(tmp_path: Path) -> Iterator[Plcrt]:
    with Plcrt(tmp_path / "plc.flash") as running:
        yield running


@pytest.fixture
def ordinary_plcrt(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Plcrt]:
    """A plcrt whose tasks have no real-time priority, so that endless loops leave the machine to others."""
    setpriv = shutil.which("setpriv")
    if setpriv and os.geteuid() == 0:
        script = tmp_path / "ordinary-plcrt"
        script.write_text(f'#!/bin/sh\nexec {setpriv} --bounding-set -sys_nice {find_plcrt()} "$@"\n')
        script.chmod(0o755)
        monkeypatch.setenv("PLCRT", str(script))
    with Plcrt(tmp_path / "plc.flash") as running:
        yield running


@pytest.fixture
def eventually() -> Callable[[Callable[[], Any]], Any]:
    return waiting.eventually


@pytest.fixture
def kill_worker(plcrt: Plcrt) -> Callable[[signal.Signals], None]:
    """Kills the worker with a signal, and waits for the next one."""

    def kill(number: signal.Signals) -> None:
        worker = waiting.eventually(lambda: plcrt.worker)
        assert worker
        os.kill(worker, number)
        waiting.eventually(lambda: plcrt.worker not in (None, worker))

    return kill


@pytest.fixture(params=["serial", "gateway", "tcp"])
def link(request: pytest.FixtureRequest, plcrt: Plcrt, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The arguments of a link to plcrt, each kind in turn."""
    if request.param == "tcp":
        plcrt.stop()
        plcrt.options = ("--tcp", "0")
        plcrt.start()
        return ["--tcp", plcrt.tcp]
    monkeypatch.setenv("PLCTOOL_GATEWAY", "on" if request.param == "gateway" else "off")
    return ["--port", plcrt.port]


COUNTER = """
PROGRAM Main
VAR
    count : DINT;
    step : DINT := 1;
    kept : DINT := 7;
    name : STRING := 'first';
    elapsed : TIME;
END_VAR
VAR RETAIN
    total : DINT;
END_VAR
    count := count + step;
    total := total + step;
    elapsed := elapsed + T#10ms;
END_PROGRAM
"""


@pytest.fixture
def counter(tool: Tool) -> Path:
    """The image of a program that counts."""
    return tool.build("counter", COUNTER)
