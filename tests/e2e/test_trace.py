"""Traces on plcrt: by the API, over a slow line, by tools that are killed, and over its restart."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from tracing import PROGRAM, Tracing

from plctool import connect
from plctool.device import Plc
from plctool.testing.plcrt import Plcrt


@pytest.fixture
def image(tmp_path: Path, tool) -> Path:
    (tmp_path / "tracing.st").write_text(PROGRAM)
    tool.ok("build", "tracing.st", "-o", "tracing.cdl")
    return tmp_path / "tracing.cdl"


@pytest.fixture
def link(plcrt: Plcrt) -> list[str]:
    plcrt.stop()
    plcrt.options = ("--tcp", "0")
    plcrt.start()
    return ["--tcp", plcrt.tcp]


class TestPlcrt(Tracing):
    @pytest.fixture
    def plc(self, plcrt: Plcrt, link: list[str], image: Path) -> Iterator[Plc]:
        with connect(f"tcp:{plcrt.tcp}") as plc:
            plc.flash(image)
            yield plc


def test_the_tool_records_to_each_kind_of_file(tool, link, image, tmp_path):
    tool.ok("flash", *link, "tracing.cdl")
    document = tool.ok("trace", *link, "Main.n", "Main.wave", "Main.half", "--samples", "20")
    assert (document["task"], document["lost"], document["complete"]) == ("Fast", 0, True)
    n = document["values"]["Main.n"]
    assert n == list(range(n[0], n[0] + 20))
    assert [column["type"] for column in document["columns"]] == ["DINT", "LREAL", "BOOL"]
    done = tool("trace", *link, "Main.n", "Main.pause", "Main.half", "--samples", "5", "-o", "trace.csv")
    assert done.out == "5 samples of 3 values in trace.csv\n"
    rows = [line.split(",") for line in (tmp_path / "trace.csv").read_text().splitlines()]
    assert rows[0] == ["time_ms", "Main.n", "Main.pause", "Main.half"]
    assert [float(row[0]) for row in rows[1:]] == sorted(float(row[0]) for row in rows[1:])
    assert all(row[2].startswith("T#") and row[3] in ("0", "1") for row in rows[1:])
    assert tool("trace", *link, "Main.n", "--samples", "4", "-o", "trace.json").status == 0
    assert len(json.loads((tmp_path / "trace.json").read_text())["values"]["Main.n"]) == 4
    assert tool("trace", *link, "Main.n", "Main.half", "--time", "T#100ms", "-o", "trace.html").status == 0
    page = (tmp_path / "trace.html").read_text()
    assert "@DATA@" not in page
    assert '"Main.half"' in page
    assert "http" not in page.replace("http-equiv", "")
    printed = tool("trace", *link, "Main.n", "--samples", "3", "-o", "-").out.splitlines()
    assert [line.partition(",")[0] for line in printed][:2] == ["time_ms", "0"]


def test_the_tool_plots_on_the_terminal(tool, link, image):
    tool.ok("flash", *link, "tracing.cdl")
    out = tool(
        "trace", *link, "Main.wave", "Main.half", "--samples", "60", "--trigger", "Main.wave>0.9", "--pre", "50%"
    ).out
    assert "Main.wave = " in out
    assert "Main.half = " in out
    assert any("\u2800" < character <= "\u28ff" for character in out)


def test_a_trace_that_stays_is_listed_opened_and_ended(tool, plcrt, link, image):
    tool.ok("flash", *link, "tracing.cdl")
    assert tool("trace", *link, "--list").out == "nothing is traced\n"
    assert tool("trace", *link, "Main.n", "Main.wave", "--name", "night", "--persistent").status == 0
    assert tool.ok("trace", *link, "--list")["traces"][0]["columns"] == ["Main.n", "Main.wave"]
    for signal_number in (signal.SIGKILL, signal.SIGTERM):  # power-off, and the end of plcrt
        plcrt.stop(signal_number)
        plcrt.start()
        link[1] = plcrt.tcp
        found = tool.ok("trace", *link, "--open", "night")
        assert found["values"]["Main.n"][:3] == [1, 2, 3]
    assert tool("trace", *link, "--end", "night").out == "night has ended\n"
    assert tool("trace", *link, "--open", "night").status == 2
    plcrt.stop(signal.SIGKILL)
    plcrt.start()
    link[1] = plcrt.tcp
    assert tool.ok("trace", *link, "--list") == {"traces": []}


def test_a_tool_that_is_killed_at_any_moment_leaves_nothing_that_others_cannot_end(tool, plcrt, link, image, tmp_path):
    tool.ok("flash", *link, "tracing.cdl")
    command = [sys.executable, "-c", "from plctool.__main__ import main; main()", "trace", *link, "Main.n"]
    command += ["--name", "night", "--persistent"]
    environment = os.environ | {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    with connect(f"tcp:{plcrt.tcp}", symbols=image.with_suffix(".sym")) as plc:
        for milliseconds in range(0, 600, 75):
            with subprocess.Popen(
                command, cwd=tmp_path, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
            ) as victim:
                with suppress(subprocess.TimeoutExpired):
                    victim.wait(milliseconds / 1000)
                victim.send_signal(signal.SIGKILL)
            names = [config.name for config in plc.traces()]
            assert names in ([], ["night"])
            if names or any(file.name == "trace.night" for file in plc.files().files):
                assert tool("trace", *link, "--end", "night").status == 0
            assert [file.name for file in plc.files().files if file.name.startswith("trace.")] == []
            assert len(plc.trace(["Main.n"], samples=3)) == 3


def test_wrong_arguments_are_refused_with_what_to_do(tool, link, image):
    tool.ok("flash", *link, "tracing.cdl")
    for arguments, words in {
        (): "Name what is to be traced",
        ("Main.x",): "There is no variable Main.x",
        ("Main.n", "-o", "trace.doc"): "name it .csv, .json, .html or .png",
        ("Main.n", "-o", "main.st"): "has the name of a source",
        ("Main.n", "--samples", "5", "--time", "T#1s"): "choose one",
        ("Main.n", "--follow", "--samples", "5"): "leave out --samples",
        ("Main.n", "--keep"): "add --name",
        ("Main.n", "--name", "a b", "--keep"): "cannot be a name",
        ("Main.n", "--pre", "half", "--trigger", "Main.half"): "neither a number of samples nor a share",
        ("Main.n", "--pre", "10"): "need a trigger",
        ("Main.n", "--every", "0"): "is not a number above 0",
        ("--list", "--open", "x"): "stands alone",
        ("Main.n", "--list"): "stands alone",
        ("--end", "none"): "There is no trace none",
    }.items():
        done = tool("trace", *link, *arguments)
        assert (done.status, words in done.err) == (2, True), (arguments, done.err)
