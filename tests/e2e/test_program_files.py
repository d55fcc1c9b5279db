"""What a program on plcrt does with files; the rest of the promise is in tests/file_programs.py."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from changing import built
from file_programs import NO_ERROR, PROGRAM, WAITING, WRITE, Files, ProgramFiles

from plctool import connect
from plctool.device import Plc
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually


@pytest.fixture
def plc(plcrt: Plcrt, tmp_path: Path, tool) -> Iterator[Plc]:
    image = tool.build("files", PROGRAM)
    plcrt.stop()
    plcrt.options = ("--tcp", "0")
    plcrt.start()
    with connect(f"tcp:{plcrt.tcp}") as plc:
        plc.flash(image)
        yield plc


class TestPlcrt(ProgramFiles):
    open_files = 16


def test_tool_gets_what_the_program_wrote_and_is_refused_while_it_writes(plc: Plc, plcrt: Plcrt, tool) -> None:
    files = Files(plc, eventually)
    assert files.put("log.csv", b"1;2\n") == NO_ERROR
    link = ("--tcp", str(plcrt.tcp))
    tool.ok("files", "get", "log.csv", *link)
    assert (tool.folder / "log.csv").read_bytes() == b"1;2\n"
    assert files.open("log.csv", WRITE) == NO_ERROR
    done = tool("files", "put", "log.csv", "--name", "other", *link)
    assert done.status != 0 and "the program is writing a file" in done.err
    assert files.close(files.result) == NO_ERROR
    tool.ok("files", "put", "log.csv", "--name", "other", *link)


def test_functions_that_wait_do_all_of_it_in_one_cycle(plc: Plc, tool) -> None:
    plc.flash(tool.build("waiting", WAITING))
    plc.write({"Main.go": True})
    eventually(lambda: plc.read("Main.done"))
    assert plc.read("Main.wrong") == 0  # or the number of the check, from 1
    assert (plc.read("Main.opened"), plc.read("Main.refused")) == (16, 9984)


LOGGING = """
PROGRAM Main
VAR
    f : RTS_IEC_HANDLE; r : RTS_IEC_RESULT; cycles : UDINT; step : UDINT := 1; i : INT;
END_VAR
FOR i := 1 TO 300 DO // most of the time
    f := SysFileOpen('log', AM_READ, ADR(r));
    SysFileClose(f);
END_FOR
cycles := cycles + step;
END_PROGRAM
"""


def test_program_that_always_waits_is_changed_and_stopped_at_once(plc: Plc, tool) -> None:
    plc.flash(tool.build("logging", LOGGING))
    eventually(lambda: plc.read("Main.cycles") > 10)
    changed = built(tool.folder, LOGGING.replace("+ step", "+ step + step"), plc.symbols())
    plc.add_symbols(changed.symbols)
    plc.change(changed.image)
    for _ in range(5):
        plc.stop()
        assert plc.status().exception is None
        plc.start()
    cycles = plc.read("Main.cycles")
    eventually(lambda: plc.read("Main.cycles") > cycles)
