"""A disk of plcrt that takes nothing more: all that stores says so, the program runs on, and nothing that was stored is
lost. When the disk has room again, all of it is stored.

A limit of 0 bytes for what the process writes is that disk.
"""

from __future__ import annotations

import resource
import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from plctool import connect
from plctool.device import Plc
from plctool.errors import DeviceError
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually

PROGRAM = """
PROGRAM Main
VAR
    recipe : RECIPE_FILE; high : ALARM := (Text := 'too hot');
    save, hot, trip : BOOL;
    temperature : DINT := 1; cycles : UDINT; zero : DINT;
END_VAR
VAR RETAIN
    kept : DINT;
END_VAR
cycles := cycles + 1;
high(Condition := hot);
recipe.Add('Main.temperature', temperature);
recipe(xSave := save, sFileName := 'green.csv');
IF trip THEN zero := 1 / zero; END_IF
END_PROGRAM
"""
OTHER = "PROGRAM Main VAR n : INT; END_VAR n := n + 1; END_PROGRAM"

WORDS = ("its flash or disk cannot be read or written", "its flash has failed")


def recipe(temperature: int) -> bytes:
    return f"name,type,value\nMain.temperature,DINT,{temperature}\n".encode()


@contextmanager
def full_disk(plcrt: Plcrt) -> Iterator[None]:
    worker = plcrt.worker
    assert worker is not None
    resource.prlimit(worker, resource.RLIMIT_FSIZE, (0, resource.RLIM_INFINITY))
    yield
    with suppress(ProcessLookupError):  # the power has failed
        resource.prlimit(worker, resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))


@pytest.fixture
def plc(plcrt: Plcrt, tmp_path: Path, tool) -> Iterator[Plc]:
    """The program runs, has saved a recipe with the temperature 1, and the retain variable 5."""
    plcrt.stop()
    plcrt.options = ("--tcp", "0", "--dump", str(tmp_path / "own.dump"), "--metrics", str(tmp_path / "own.prom"))
    plcrt.start()
    with connect(f"tcp:{plcrt.tcp}") as plc:
        plc.flash(tool.build("main", PROGRAM))
        plc.write({"Main.kept": 5, "Main.save": True})
        eventually(lambda: plc.read("Main.recipe.xDone"))
        plc.stop()  # saves at once
        plc.start()
        plc.write({"Main.save": False})
        yield plc


def runs(plc: Plc) -> None:
    cycles = plc.read("Main.cycles")
    eventually(lambda: plc.read("Main.cycles") > cycles)
    assert str(plc.status().state) == "run"


def save(plc: Plc, temperature: int) -> bool:
    """True if the program has saved its recipe, False if that is an error."""
    plc.write({"Main.temperature": temperature, "Main.save": False})
    eventually(lambda: not plc.read("Main.recipe.xDone") and not plc.read("Main.recipe.xError"))
    plc.write({"Main.save": True})
    eventually(lambda: plc.read("Main.recipe.xDone") or plc.read("Main.recipe.xError"))
    return bool(plc.read("Main.recipe.xDone"))


def test_all_that_stores_says_so_and_is_as_before_until_there_is_room(plc: Plc, plcrt: Plcrt, tool) -> None:
    link = ("--tcp", plcrt.tcp)
    other = str(tool.build("other", OTHER))
    (tool.folder / "plc.cfg").write_text("[CmpApp]\nBootproject.Start=never\n")
    (tool.folder / "big.csv").write_bytes(b"1;2\n" * 5000)
    commands = (
        ("flash", *link, other),
        ("files", "put", "big.csv", *link),
        ("settings", "put", *link, "plc.cfg"),
    )
    with full_disk(plcrt):
        assert not save(plc, 2)
        assert plc.read("Main.recipe.eError") != 0 and plc.read("Main.recipe.eFileError") != 0
        for command in commands:
            done = tool(*command)
            assert done.status == 1, command
            assert any(words in done.err for words in WORDS), done.err
        with pytest.raises(DeviceError, match=WORDS[0]):
            plc.set_password("nine green bottles")
        plc.write({"Main.kept": 6, "Main.hot": True})
        eventually(lambda: any("Retain variables cannot be saved" in entry.text for entry in plc.log()))
        assert [alarm.name for alarm in plc.alarms()] == ["Main.high"]
        runs(plc)
        assert plc.read_file("green.csv") == recipe(1)
    assert save(plc, 3)
    assert plc.read_file("green.csv") == recipe(3)
    for command in commands[1:]:
        tool.ok(*command)
    tool.ok(*commands[0])


def test_power_that_fails_then_leaves_what_was_stored_before(plc: Plc, plcrt: Plcrt) -> None:
    with full_disk(plcrt):
        assert not save(plc, 2)
        plc.write({"Main.kept": 6})
        eventually(lambda: any("Retain variables cannot be saved" in entry.text for entry in plc.log()))
        assert plcrt.process is not None
        plcrt.process.send_signal(signal.SIGKILL)
        plcrt.process.wait()
    plcrt.stop()
    plcrt.start()
    with connect(f"tcp:{plcrt.tcp}") as again:
        eventually(lambda: str(again.status().state) == "run")
        assert again.read("Main.kept") == 5
        assert again.read_file("green.csv") == recipe(1)


def test_a_dump_has_no_room_and_leaves_no_half_of_it(plc: Plc, plcrt: Plcrt, tmp_path: Path) -> None:
    with full_disk(plcrt):
        plc.write({"Main.trip": True})
        eventually(lambda: plc.status().exception)
        eventually(lambda: any("The dump is not written to" in entry.text for entry in plc.log()))
    assert not (tmp_path / "own.dump").exists()
