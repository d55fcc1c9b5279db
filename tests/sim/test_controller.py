"""What every controller does, whatever reaches it: in this process, by packets in this process, and a real plcrt."""

from __future__ import annotations

import platform
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import plctool
from plctool.cli.commands import device, flash, values
from plctool.compiler import compile_sources
from plctool.compiler.image.build import BuildResult
from plctool.controller import Controller
from plctool.core import lib
from plctool.device import Plc
from plctool.errors import DeviceError, UsageError
from plctool.link.connection import Connection
from plctool.link.services import AppState
from plctool.link.sim import SimTransport
from plctool.sim import Simulator
from plctool.testing.plcrt import Plcrt

PATIENCE = 30.0  # seconds
PROGRAM = """
TYPE Point : STRUCT x, y : INT; END_STRUCT END_TYPE
PROGRAM Main
VAR
    n, twice, divisor : DINT := 1;
    pause : TIME;
    name : STRING;
    flags : WORD;
    points : ARRAY[1..3] OF Point;
    to_point : REF_TO Point;
    leads : BOOL;
    ratio : REAL;
    loose, bound : REFERENCE TO DINT;
END_VAR
VAR CONSTANT limit : DINT := 42; END_VAR
VAR RETAIN kept : DINT := 7; END_VAR
VAR PERSISTENT counted : DINT := 8; END_VAR
n := n + 1 / divisor;
twice := 2 * n;
bound REF= kept;
IF leads THEN to_point := REF(points[2]); END_IF
END_PROGRAM
CONFIGURATION C
    TASK Cycle(INTERVAL := T#10ms);
    PROGRAM Main WITH Cycle : Main;
END_CONFIGURATION
"""

pytestmark = pytest.mark.skipif(
    platform.machine() not in ("x86_64", "aarch64"), reason="plctool does not compile for this machine"
)


def build(folder: Path, name: str, text: str) -> Path:
    source, image = folder / f"{name}.st", folder / f"{name}.cdl"
    source.write_text(text)
    built: BuildResult = compile_sources([source], target=f"{platform.machine()}-linux")
    built.write(image)
    return image


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Path]]:
    folder = tmp_path_factory.mktemp("images")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
        patch.setenv("PLCTOOL_GATEWAY", "off")
        changed = PROGRAM.replace("counted : DINT := 8", "counted : DINT := 9; more : INT")
        yield {"main": build(folder, "main", PROGRAM), "changed": build(folder, "changed", changed)}


def _simulator(image: Path, folder: Path) -> Iterator[Controller]:
    with Simulator.from_file(image) as plc:
        yield plc


def _packets(image: Path, folder: Path) -> Iterator[Controller]:
    with Simulator.from_file(image), Plc(Connection(SimTransport())) as plc:
        yield plc


def _plcrt(image: Path, folder: Path) -> Iterator[Controller]:
    with Plcrt(folder / "flash") as runtime, plctool.connect(f"serial:{runtime.port}") as plc:
        plc.flash(image)
        yield plc


@pytest.fixture(params=[_simulator, _packets, _plcrt], ids=lambda kind: kind.__name__[1:])
def plc(request: pytest.FixtureRequest, images: dict[str, Path], tmp_path: Path) -> Iterator[Controller]:
    """A controller that runs PROGRAM."""
    yield from request.param(images["main"], tmp_path)


def let_pass(plc: Controller) -> None:
    """Lets the controller make some cycles."""
    if lib.SimRunFor(50_000_000) == lib.ERR_OK:  # the controller is in this process
        return
    cycles, end = plc.tasks()[0].cycles, time.monotonic() + PATIENCE
    while plc.tasks()[0].cycles < cycles + 3 and plc.status().state is AppState.RUN and time.monotonic() < end:
        time.sleep(0.005)


def test_it_is_a_controller(plc: Controller) -> None:
    assert isinstance(plc, Controller)
    assert plc.others() == []


# ---- variables -------------------------------------------------------------------------------------------------------


def test_one_value_comes_alone_and_several_by_name(plc: Controller) -> None:
    assert plc.read("Main.kept") == 7
    assert plc.read("Main.kept", "main.LIMIT") == {"Main.kept": 7, "main.LIMIT": 42}
    assert plc.read_all(["Main.kept"]) == {"Main.kept": 7}


def test_what_is_written_is_read_again(plc: Controller) -> None:
    values = {
        "Main.pause": "T#80ms",
        "Main.name": "pump",
        "Main.points[3].y": -5,
        "Main.points[1]": {"x": 1, "y": 2},
        "Main.flags.9": True,
    }
    plc.write(values)
    assert plc.read_all(list(values)) == values
    assert plc.read("Main.flags") == 1 << 9


@pytest.mark.parametrize("value", [float("inf"), float("-inf"), float("nan")])
def test_a_real_is_a_float_also_where_it_is_no_number(plc: Controller, value: float) -> None:
    plc.write({"Main.ratio": value})
    read = plc.read("Main.ratio")
    assert isinstance(read, float) and str(read) == str(value)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda plc: plc.read(), "Name a variable"),
        (lambda plc: plc.read(["Main.n"]), "read_all takes a list"),
        (lambda plc: plc.read(None), "Write the names one by one"),
        (lambda plc: plc.read_all("Main.n"), "takes a list of names"),
        (lambda plc: plc.read_all([1]), "takes a list of names"),
        (lambda plc: plc.write("Main.n"), "takes names with values"),
        (lambda plc: plc.write("Main.n", 5), r"write takes a dict of names and values: write\(\{'Main.n': 5\}\)"),
        (lambda plc: plc.write({"Main.n": 5}, 6), "takes names with values"),
        (lambda plc: plc.write({1: 2}), "takes names with values"),
    ],
)
def test_arguments_of_other_kinds_are_refused_with_what_to_write(
    plc: Controller, call: Callable[[Any], object], words: str
) -> None:
    with pytest.raises(UsageError, match=words):
        call(plc)


def test_a_closed_one_says_so(plc: Controller) -> None:
    plc.close()
    plc.close()
    for call in (lambda: plc.read("Main.n"), plc.start, plc.status, plc.tasks, lambda: plc.write({"Main.n": 1})):
        with pytest.raises(UsageError, match="is closed"):
            call()


def test_a_pattern_follows_references(plc: Controller) -> None:
    let_pass(plc)
    assert plc.read("Main.*o*nd") == {"Main.bound": 7}
    assert plc.read("Main.loos?") == {"Main.loose": None}


def test_what_is_no_link_is_not_connected_to() -> None:
    with pytest.raises(UsageError, match="A link is a string"):
        plctool.connect(None)  # type: ignore[arg-type]


def test_a_sample_is_of_one_moment(plc: Controller) -> None:
    let_pass(plc)
    reading = plc.sample(["Main.n", "Main.twice", "Main.pause"])
    assert reading.consistent
    assert reading.values["Main.twice"] == 2 * reading.values["Main.n"]
    assert reading.texts["Main.pause"] == "T#0ms"


@pytest.mark.parametrize(
    ("values", "code"),
    [
        ({"Main.missing": 1}, "unknown-variable"),
        ({"Main.limit": 1}, "constant"),
        ({"Main.pause": "tomorrow"}, "bad-value"),
        ({"Main.points[4].x": 1}, "no-part"),
    ],
)
def test_what_cannot_be_written_is_refused_before_anything_is(
    plc: Controller, values: dict[str, object], code: str
) -> None:
    with pytest.raises(UsageError) as caught:
        plc.write({"Main.name": "no", **values})
    assert caught.value.code == code
    assert plc.read("Main.name") == ""


def test_a_pointer_to_nothing_is_an_error_and_to_a_variable_is_followed(plc: Controller) -> None:
    to_nothing = {"Main.name": "no", "Main.to_point^.x": 1}
    for action in (lambda: plc.read("Main.to_point^.x"), lambda: plc.write(to_nothing)):
        with pytest.raises(DeviceError) as caught:
            action()
        assert caught.value.code == "null"
    assert plc.read("Main.name") == ""
    plc.write({"Main.leads": True})
    let_pass(plc)
    plc.write({"Main.to_point^.x": 11})
    assert plc.read("Main.points[2].x") == plc.read("Main.to_point^.x") == 11


def test_symbols_are_those_of_the_image_that_is_there(plc: Controller) -> None:
    assert plc.symbols().image_crc == plc.status().image_crc


# ---- the application -------------------------------------------------------------------------------------------------


def test_start_and_stop_change_the_state(plc: Controller) -> None:
    plc.stop()
    assert plc.status().state is AppState.STOP
    plc.start()
    assert plc.status().state == "run"
    assert [task.name for task in plc.tasks()] == ["Cycle"]


@pytest.mark.parametrize(("option", "kept"), [("warm", 70), ("cold", 7)])
def test_reset_keeps_what_its_option_says(plc: Controller, option: str, kept: int) -> None:
    plc.write({"Main.kept": 70, "Main.counted": 80, "Main.name": "x"})
    plc.reset(option)
    assert plc.status().state == "stop"
    assert list(plc.read_all(["Main.kept", "Main.counted", "Main.name"]).values()) == [kept, 80, ""]


def test_a_reset_of_another_name_is_refused(plc: Controller) -> None:
    with pytest.raises(UsageError, match="warm, cold, origin"):
        plc.reset("hot")


def test_without_an_application_everything_says_so(plc: Controller) -> None:
    plc.reset("origin")
    assert (plc.status().state, plc.status().image_crc) == ("none", 0)
    for action in (plc.start, plc.stop, plc.reset, plc.symbols, lambda: plc.read("Main.n")):
        with pytest.raises(DeviceError) as caught:
            action()
        assert caught.value.code == "app-not-exist"


def test_an_exception_names_task_and_line_and_needs_a_reset(plc: Controller) -> None:
    plc.write({"Main.divisor": 0})
    let_pass(plc)
    status = plc.status()
    assert status.state is AppState.EXCEPTION and status.exception
    found = status.exception
    line = PROGRAM[: PROGRAM.index("n := n")].count("\n") + 1
    assert (found.name, found.task, found.pou, found.line) == ("DIVIDEBYZERO", "Cycle", "Main", line)
    assert any(entry.error == found.code for entry in plc.log() if entry.log_class == lib.LOG_EXCEPTION)
    with pytest.raises(DeviceError, match="reset it first") as caught:
        plc.start()
    assert caught.value.code == "invalid-state"
    plc.reset()
    plc.start()
    assert plc.status().state == "run"


def test_flash_replaces_the_program_and_says_what_became_of_persistent_values(
    plc: Controller, images: dict[str, Path]
) -> None:
    plc.write({"Main.counted": 80})
    steps: list[tuple[int, int]] = []
    result = plc.flash(images["changed"], progress=lambda done, total: steps.append((done, total)))
    size = images["changed"].stat().st_size
    assert (result.bytes, result.skipped, result.state) == (size, False, "run")
    assert steps[-1] == (size, size)
    assert result.persistent
    assert (result.persistent.kept, result.persistent.new) == (["Main.counted"], ["Main.more"])
    assert plc.read("Main.counted", "Main.more") == {"Main.counted": 80, "Main.more": 0}


def test_flash_of_what_is_there_is_skipped_unless_forced(plc: Controller, images: dict[str, Path]) -> None:
    plc.write({"Main.name": "x"})
    assert plc.flash(images["main"]).skipped
    assert plc.read("Main.name") == "x"
    assert not plc.flash(images["main"].read_bytes(), force=True, start=False).skipped
    assert (plc.status().state, plc.read("Main.name")) == ("stop", "")


def test_a_damaged_image_is_refused_here_or_by_the_controller_and_the_program_runs_on(
    plc: Controller, images: dict[str, Path]
) -> None:
    damaged = bytearray(images["changed"].read_bytes())
    damaged[200] ^= 1
    with pytest.raises(UsageError) as wrong:
        plc.flash(bytes(damaged))
    assert wrong.value.code == "bad-image"
    crc = plc.status().image_crc
    with pytest.raises(DeviceError, match="The device refused the download") as caught:
        plc.flash(bytes(damaged), unchecked=True)
    assert caught.value.code == "crc-failed"
    assert (plc.status().state, plc.status().image_crc) == ("run", crc)


def test_what_commands_do_is_the_same_document(plc: Controller, images: dict[str, Path]) -> None:
    flashed = flash.flash(plc, images["changed"], start=False)
    assert {k: flashed[k] for k in ("skipped", "state", "others")} == {"skipped": False, "state": "stop", "others": []}
    assert device.start(plc) == device.status(plc)
    assert device.status(plc)["state"] == "run"
    document, texts = values.write(plc, {"Main.pause": "80ms", "Main.points[1].x": "16#2A"})
    assert document["values"] == {"Main.pause": "T#80ms", "Main.points[1].x": 42}
    assert values.read(plc, list(texts)) == ({**document, "consistent": True}, texts)
    assert [task["name"] for task in device.tasks(plc)["tasks"]] == ["Cycle"]
    plc.write({"Main.divisor": 0})
    let_pass(plc)
    exception = device.status(plc)["exception"]
    last = next(e for e in reversed(device.log(plc)["entries"]) if e["class"] == "exception")
    assert exception["pou"] == "Main"
    assert [last[key] for key in ("pou", "file", "line")] == [exception[key] for key in ("pou", "file", "line")]
    assert device.reset(plc, "origin")["state"] == "none"


def test_log_entries_come_once(plc: Controller) -> None:
    entries = plc.log()
    assert entries
    assert [entry.handle for entry in entries] == sorted({entry.handle for entry in entries})
    assert all(entry.component and entry.text for entry in entries)
    assert plc.log(entries[-1].handle) == []


def test_starts_and_stops_are_in_the_log_that_is_kept(plc: Controller) -> None:
    plc.stop()
    let_pass(plc)
    kept = plc.log(kept=True)
    assert [entry.text for entry in kept if "Application" in entry.text][-2:] == [
        "Application started",
        "Application stopped",
    ]
    assert kept[-1].start == 1 and kept[-1].utc_ns is not None
    assert plc.log(kept[-1].handle, kept=True) == []
    assert all(entry.utc_ns for entry in plc.log())


@pytest.mark.parametrize("address", ["%MD10000", "%IX9000.0"])
def test_an_address_where_the_program_has_no_memory_is_told_of(plc: Controller, address: str) -> None:
    with pytest.raises(DeviceError, match="The program has no memory at"):
        plc.read(address)
    assert plc.read("Main.points[1].x") == 0
