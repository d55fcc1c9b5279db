"""What a program on plcrt does with files; the rest of the promise is in tests/file_programs.py."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from file_programs import NO_ERROR, PROGRAM, WRITE, Files, ProgramFiles

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
