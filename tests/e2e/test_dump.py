"""Core dumps: taken from plcrt and read without it, and files that are damaged or hostile."""

from __future__ import annotations

import copy
import gzip
import json
import random
import shutil
import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parents[1]))

import wild_store

from plctool import connect
from plctool.dump_file import load, parse
from plctool.errors import PlcError, UsageError
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually

PROGRAM = """
TYPE Node : STRUCT value : DINT; next : POINTER TO Node; END_STRUCT END_TYPE
FUNCTION_BLOCK Divider
VAR_INPUT top, bottom : DINT; END_VAR
VAR_OUTPUT result : DINT; END_VAR
result := top / bottom;
END_FUNCTION_BLOCK
PROGRAM Main
VAR
    n : DINT := 3; first, second : Node; head : POINTER TO Node; divide : Divider; name : STRING := 'pump';
    r : REAL := 1.5;
    list : ARRAY[1..3] OF INT := [10, 20, 30]; nowhere : POINTER TO DINT;
END_VAR
VAR RETAIN kept : DINT := 42; END_VAR
first.value := 11; first.next := ADR(second); second.value := 22; head := ADR(first);
IF n > 0 THEN n := n - 1; END_IF
divide(top := 100, bottom := n);
END_PROGRAM
CONFIGURATION C RESOURCE R ON PLC TASK T(INTERVAL := T#10ms, PRIORITY := 1); PROGRAM Main WITH T : Main;
END_RESOURCE END_CONFIGURATION
"""


@pytest.fixture
def dump(tool, plcrt: Plcrt, tmp_path: Path) -> Path:
    plcrt.stop()
    plcrt.options = ("--tcp", "0")
    plcrt.start()
    (tmp_path / "main.st").write_text(PROGRAM)
    tool.ok("build", "main.st", "-o", "app.cdl")
    with connect(f"tcp:{plcrt.tcp}") as plc:
        plc.flash(tmp_path / "app.cdl")
        eventually(lambda: plc.status().exception)
    assert tool("dump", "--tcp", plcrt.tcp, "-o", "x.dump").status == 0
    return tmp_path / "x.dump"


def test_variables_and_calls_are_read_without_the_device(tool, plcrt, dump, tmp_path):
    before = None
    names = ["Main.n", "Main.head^.next^.value", "Main.name", "Main.list", "Main.r", "Main.kept", "Main.divide.*"]
    with connect(f"tcp:{plcrt.tcp}") as plc:
        before = plc.read_all(names)
        exception = plc.status().exception
    plcrt.stop()
    (tmp_path / "app.sym").unlink()
    (tmp_path / "app.cdl").unlink()
    found = load(dump)
    assert found.sample(names).values == before
    assert found.explained() == exception
    document = tool.ok("inspect", "x.dump", *names)
    assert document["values"] == before
    assert document["exception"]["pou"] == "Divider"
    assert [call["pou"] for call in document["exception"]["calls"]] == ["Main"]
    out = tool("inspect", "x.dump", "Main.kept", "--log").out
    assert "exception: DIVIDEBYZERO in task T\n" in out
    assert "Divider, main.st:6\n  called from Main, main.st:17\n" in out
    assert "Main.kept = 42\n" in out
    assert "division by zero at code offset" in out


def test_the_registers_of_a_fault_are_shown(tool, plcrt, dump):
    image = tool.build("wild", wild_store.PROGRAM)
    with connect(f"tcp:{plcrt.tcp}") as plc:
        plc.flash(image)
        eventually(lambda: plc.status().exception)
    tool.ok("dump", "--tcp", plcrt.tcp, "-o", "wild.dump")
    found = tool.ok("inspect", "wild.dump")["registers"]
    assert found["fault_address"] == wild_store.ADDRESS
    assert wild_store.VALUE in found.values()
    out = tool("inspect", "wild.dump").out
    assert "registers:\n" in out
    assert f"{wild_store.VALUE:x}" in out


def test_plcrt_writes_a_dump_when_the_program_stops(tool, plcrt, tmp_path):
    written = tmp_path / "own.dump"
    plcrt.stop()
    plcrt.options = ("--tcp", "0", "--dump", str(written))
    plcrt.start()
    image = tool.build("main", PROGRAM)
    names = ["Main.n", "Main.head^.next^.value", "Main.name", "Main.list", "Main.r", "Main.kept", "Main.divide.*"]
    with connect(f"tcp:{plcrt.tcp}") as plc:
        plc.flash(image)
        eventually(written.exists)
        before, exception, registers = plc.read_all(names), plc.status().exception, plc.registers()
        texts = [entry.text for entry in plc.log()]
        identity, tasks = plc.identity(), plc.tasks()
    assert f"A dump is in {written}" in texts
    found = load(written)
    assert found.sample(names).values == before
    assert (found.explained(), found.registers, found.identity) == (exception, registers, identity)
    assert [task.name for task in found.tasks] == [task.name for task in tasks]
    assert any("division by zero" in entry.text for entry in found.log)
    assert written.stat().st_mode & 0o777 == 0o600
    plcrt.stop()
    written.unlink()
    plcrt.start()  # the exception of the earlier run is no new one
    with connect(f"tcp:{plcrt.tcp}") as plc:
        assert plc.status().exception
    assert not written.exists()


def test_a_dump_that_cannot_be_written_is_a_warning_and_the_program_stops_as_ever(tool, plcrt, tmp_path):
    plcrt.stop()
    plcrt.options = ("--tcp", "0", "--dump", str(tmp_path / "missing" / "own.dump"))
    plcrt.start()
    image = tool.build("main", PROGRAM)
    with connect(f"tcp:{plcrt.tcp}") as plc:
        plc.flash(image)
        eventually(lambda: plc.status().exception)
        eventually(lambda: any("The dump is not written to" in entry.text for entry in plc.log()))


def test_a_dump_of_plcrt_needs_symbols_of_its_program(tool, plcrt, tmp_path):
    written = tmp_path / "dumps" / "own.dump"
    written.parent.mkdir()
    plcrt.stop()
    plcrt.options = ("--tcp", "0", "--dump", str(written))
    plcrt.start()
    image = tool.build("main", PROGRAM)
    with connect(f"tcp:{plcrt.tcp}") as plc:
        plc.flash(image)
        eventually(written.exists)
    image.with_suffix(".sym").rename(tmp_path / "moved.sym")
    shutil.rmtree(tmp_path / "cache")  # of what was built and flashed here
    done = tool("inspect", str(written), "Main.n")
    assert (done.status, "symbol" in done.err) == (2, True), done.err
    assert tool("inspect", str(written), "Main.n", "--symbols", "moved.sym").status == 0


def test_what_the_dump_has_not_is_refused_as_by_read(tool, dump):
    for name, words in {
        "Main.x": "There is no variable Main.x",
        "Main.nowhere^": "NULL",
        "Main.list[4]": "has the elements 1 to 3",
    }.items():
        done = tool("inspect", "x.dump", name)
        assert (done.status != 0, words in done.err) == (True, True), done.err


def test_damaged_and_hostile_files_are_refused_in_words(tool, dump, tmp_path):
    for name, content in {
        "empty": b"",
        "text": b"not a dump",
        "cut": dump.read_bytes()[:-9],
        "bomb": gzip.compress(b"[" * (1 << 22)),
        "other": gzip.compress(b'{"format": "other"}'),
        "list": gzip.compress(b"[]"),
        "version": gzip.compress(b'{"format": "plctool dump", "version": 2}'),
        "bare": gzip.compress(b'{"format": "plctool dump", "version": 1}'),
    }.items():
        (tmp_path / name).write_bytes(content)
        done = tool("inspect", name)
        assert done.status == 2
        assert "dump" in done.err
    assert tool("inspect", "none").status == 2
    assert tool("dump", "--tcp", "127.0.0.1:1", "-o", "main.st").status == 2


def test_any_changed_dump_is_read_or_refused(dump):
    """Numbers, strings and parts of a dump are exchanged; what can still be read gives values or an error in words."""
    whole = json.loads(gzip.decompress(dump.read_bytes()))
    chance = random.Random(5)
    junk = [None, -1, 1 << 70, "x", [], {}, True, 0.5, [[1, 2]], {"a": 1}, "A" * 9, 0, 7]
    refused = 0
    for _ in range(300):
        changed = json.loads(json.dumps(whole))
        for _ in range(chance.randint(1, 3)):
            place, key = changed, chance.choice(list(changed))
            while isinstance(place[key], dict | list) and place[key] and chance.random() < 0.8:
                place = place[key]
                key = chance.choice(list(place)) if isinstance(place, dict) else chance.randrange(len(place))
            place[key] = copy.deepcopy(chance.choice(junk))
        try:
            found = parse(gzip.compress(json.dumps(changed).encode(), 1))
            found.explained()
            found.sample(["Main.*", "Main.head^.next^.value"])
        except PlcError as error:
            refused += isinstance(error, UsageError)
    assert refused > 50
    assert sys.getrecursionlimit() > 0


def test_a_dump_of_a_program_that_runs_has_its_variables(tool, plcrt, dump, tmp_path):
    (tmp_path / "main.st").write_text(PROGRAM.replace("n > 0", "n > 1"))
    tool.ok("build", "main.st", "-o", "app.cdl")
    tool.ok("flash", "--tcp", plcrt.tcp, "app.cdl")
    assert tool.ok("dump", "--tcp", plcrt.tcp)["exception"] is None
    found = tool.ok("inspect", "plc.dump", "Main.second.value")
    assert (found["values"], found["exception"]) == ({"Main.second.value": 22}, None)
