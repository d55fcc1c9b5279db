"""A tool that is killed between any two packets of a force, a trace or a page leaves what another tool can end."""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from test_killed_tools import Killed, MortalTransport

from plctool.compiler import compile_sources
from plctool.compiler.image.build import BuildResult
from plctool.core import lib
from plctool.device import Plc
from plctool.link.connection import Connection
from plctool.link.sim import SimTransport
from plctool.link.traces import TRACE_FILE, TraceOptions
from plctool.ui.live import Live, Target, Wanted

pytestmark = pytest.mark.skipif(platform.machine() != "x86_64", reason="the program's code is for x86-64")

PROGRAM = """
PROGRAM Main VAR n, a, b : DINT; END_VAR n := n + 1; a := n; b := n; END_PROGRAM
CONFIGURATION C RESOURCE R ON PLC TASK T(INTERVAL := T#10ms, PRIORITY := 1); PROGRAM Main WITH T : Main;
END_RESOURCE END_CONFIGURATION
"""
BOTH = {"Main.a": 5, "Main.b": 6}
FORGOTTEN_NS = (lib.TRACE_IDLE_MS + 6000) * 1_000_000  # after which a device has forgotten a silent tool and its trace
FILE_STORE = 1 << 17


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> BuildResult:
    source = tmp_path_factory.mktemp("watched") / "watched.st"
    source.write_text(PROGRAM)
    return compile_sources([source], target="x86_64-linux")


@pytest.fixture(autouse=True)
def runtime() -> Iterator[None]:
    yield
    lib.SimStop()
    lib.SimSetFileStore(0)


def tool(program: BuildResult, transport: SimTransport) -> Plc:
    plc = Plc(Connection(transport))
    plc.add_symbols(program.symbols)
    return plc


def killed_everywhere(
    program: BuildResult, before: Callable[[Plc], object], run: Callable[[Plc], object]
) -> Iterator[Plc]:
    """Carries out an operation again and again, by a tool that is killed after one packet, two, .. Yields another tool
    when the device has forgotten the first one, and after the whole operation."""
    lib.SimSetFileStore(FILE_STORE)
    for packets in range(1000):
        lib.SimStop()
        assert lib.SimFlashConfigure(1 << 20, 4096, 8, 0xFF) == lib.ERR_OK
        assert lib.SimStart() == lib.ERR_OK
        with tool(program, SimTransport()) as plc:
            plc.flash(program.image)
            before(plc)
        ended = True
        try:
            run(tool(program, MortalTransport(packets)))
        except Killed:
            ended = False
        lib.SimLinkReset()
        assert lib.SimAdvance(FORGOTTEN_NS) == lib.ERR_OK
        with tool(program, SimTransport()) as plc:
            assert plc.status().state == "run"
            yield plc
        if ended:
            return
    raise AssertionError("the operation does not end")


@pytest.mark.parametrize(
    ("before", "run"),
    [({}, lambda plc: plc.force(BOTH)), (BOTH, lambda plc: plc.unforce(list(BOTH))), (BOTH, lambda plc: plc.unforce())],
    ids=["force", "unforce", "unforce --all"],
)
def test_a_killed_tool_forces_all_or_nothing(program: BuildResult, before: dict[str, Any], run: Any) -> None:
    found = []
    for plc in killed_everywhere(program, lambda plc: plc.force(before) if before else None, run):
        forced = plc.forced()
        assert forced in ({}, BOTH)
        found.append(forced)
        plc.force({"Main.n": 7})
        plc.unforce()
        assert plc.forced() == {}
    assert found[0] == before and found[-1] == ({} if before else BOTH)


def test_the_trace_of_a_killed_tool_ends_by_itself(program: BuildResult) -> None:
    def trace(plc: Plc) -> None:
        running = plc.start_trace(["Main.n", "Main.a"], TraceOptions(samples=20))
        while not running.is_complete:
            assert lib.SimAdvance(50_000_000) == lib.ERR_OK
            running.poll()
        running.end()

    for plc in killed_everywhere(program, lambda plc: None, trace):
        assert plc.traces() == []


def test_a_kept_trace_of_a_killed_tool_is_there_or_not_and_can_be_ended(program: BuildResult) -> None:
    """As `plctool trace --persistent` makes one, and ends it."""

    def keep(plc: Plc) -> None:
        running = plc.start_trace(["Main.n"], TraceOptions(name="night", keep=True))
        plc.write_file(TRACE_FILE + "night", running.config.data)

    def end(plc: Plc) -> None:
        plc.delete_file(TRACE_FILE + "night")
        plc.end_trace("night")

    found = set()
    for before, run in ((lambda plc: None, keep), (keep, end)):
        for plc in killed_everywhere(program, before, run):
            files = [file.name for file in plc.files().files if file.name.startswith(TRACE_FILE)]
            names = [config.name for config in plc.traces()]
            assert names in ([], ["night"]) and files in ([], [TRACE_FILE + "night"])
            found.add((len(names), len(files)))
            if files:
                plc.delete_file(files[0])
            if names:
                plc.end_trace(names[0])
            assert plc.traces() == []
    assert found == {(0, 0), (1, 0), (1, 1)}


def test_a_killed_page_leaves_what_it_has_forced_and_nothing_else(program: BuildResult) -> None:
    def show(plc: Plc) -> None:
        readings = []

        def publish(topic: str, content: Any) -> None:
            readings.extend([content] if topic == "values" else [])
            if len(readings) == 3:
                live.end()

        live = Live(Target("the device", lambda: plc), publish)
        live.want(Wanted(1, frozenset(("Main.n", "Main.a")), frozenset(("tasks", "log", "io", "alarms"))))
        live.do(lambda plc: plc.force(BOTH))
        live.run(plc)

    found = []
    for plc in killed_everywhere(program, lambda plc: None, show):
        found.append(plc.forced())
        assert found[-1] in ({}, BOTH)
        assert plc.traces() == []
    assert found[0] == {} and found[-1] == BOTH
