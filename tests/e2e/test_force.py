"""Forced variables on plcrt: by the tool, by two of them, by one that is killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from forcing import PROGRAM, Forcing

from plctool import connect
from plctool.device import Plc
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually


@pytest.fixture
def image(tmp_path: Path, tool) -> Path:
    (tmp_path / "forcing.st").write_text(PROGRAM)
    tool.ok("build", "forcing.st", "-o", "forcing.cdl")
    return tmp_path / "forcing.cdl"


@pytest.fixture
def link(plcrt: Plcrt) -> list[str]:
    plcrt.stop()
    plcrt.options = ("--tcp", "0")
    plcrt.start()
    return ["--tcp", plcrt.tcp]


class TestPlcrt(Forcing):
    @pytest.fixture
    def plc(self, plcrt: Plcrt, link: list[str], image: Path) -> Iterator[Plc]:
        with connect(f"tcp:{plcrt.tcp}") as plc:
            plc.flash(image)
            yield plc


def test_the_tool_forces_lists_and_ends(tool, link, image):
    tool.ok("flash", *link, "forcing.cdl")
    assert tool("forced", *link).out == "nothing is forced\n"
    done = tool("force", *link, "Main.n=5", "switch=TRUE", "%QW1=77", "Main.pause=T#2s")
    expected = "Main.n = 5 (forced)\nswitch = TRUE (forced)\n%QW1 = 16#004D (forced)\nMain.pause = T#2s (forced)\n"
    assert (done.status, done.out) == (0, expected)
    names = ["Main.n", "switch", "valve", "Main.pause"]
    assert tool.ok("forced", *link) == {"values": dict(zip(names, [5, True, 77, "T#2s"], strict=True)), "forced": names}
    assert tool.ok("status", *link)["forced"] == names
    assert "forced: Main.n, switch, valve, Main.pause\n" in tool("status", *link).out
    read = tool.ok("read", *link, "Main.n", "Main.b")
    assert (read["forced"], read["values"]["Main.n"]) == (["Main.n"], 5)
    assert "Main.n = 5 (forced)" in tool("watch", *link, "Main.n", "--count", "1").out
    assert tool("unforce", *link, "Main.n").status == 0
    assert tool("unforce", *link, "Main.n").err == ("plctool: Main.n is not forced; 'plctool forced' shows what is.\n")
    assert tool("unforce", *link, "--all").out == "switch, valve, Main.pause: not forced any more\n"
    assert tool("unforce", *link, "--all").out == "nothing was forced\n"
    assert tool("unforce", *link).status == 2
    assert tool("force", *link, "Main.name=x").status == 2
    assert tool.ok("status", *link)["forced"] == []


def test_a_download_ends_it(tool, link, image):
    tool.ok("flash", *link, "forcing.cdl")
    tool.ok("force", *link, "Main.n=5")
    assert tool.ok("flash", *link, "forcing.cdl", "--force")
    assert tool.ok("forced", *link)["forced"] == []


def test_a_tool_that_is_killed_at_any_moment_leaves_all_of_a_command_or_nothing(tool, plcrt, link, image, tmp_path):
    tool.ok("flash", *link, "forcing.cdl")
    command = [
        sys.executable,
        "-c",
        "from plctool.__main__ import main; main()",
        "force",
        *link,
        "Main.a=5",
        "Main.b=6",
    ]
    environment = os.environ | {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    with connect(f"tcp:{plcrt.tcp}", symbols=image.with_suffix(".sym")) as plc:
        for milliseconds in range(0, 600, 150):
            plc.unforce()
            with subprocess.Popen(
                [*command], cwd=tmp_path, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
            ) as victim:
                with pytest.raises(subprocess.TimeoutExpired):
                    victim.wait(milliseconds / 1000)
                    raise subprocess.TimeoutExpired(command, 0)  # it had come to its end
                victim.send_signal(signal.SIGKILL)
            assert plc.forced() in ({}, {"Main.a": 5, "Main.b": 6})
            cycles = plc.tasks()[0].cycles
            eventually(lambda cycles=cycles: plc.tasks()[0].cycles > cycles)


def test_a_lost_tool_leaves_what_it_has_forced(plcrt, link, image):
    with connect(f"tcp:{plcrt.tcp}") as plc:
        plc.flash(image)
        plc.force({"valve": 77})
    with connect(f"tcp:{plcrt.tcp}", symbols=image.with_suffix(".sym")) as plc:
        assert plc.forced() == {"valve": 77}
        assert plc.read("valve") == 77


def test_two_tools_force_at_once(plcrt, link, image):
    """Each its own variables; both see all of them."""

    def use(names: list[str]) -> None:
        with connect(f"tcp:{plcrt.tcp}", symbols=image.with_suffix(".sym")) as plc:
            for turn in range(30):
                plc.force(dict.fromkeys(names, turn))
                listed = plc.forced()
                assert [listed[name] for name in names] == [turn] * len(names)
                plc.unforce(names[:1])
                assert names[0] not in plc.forced()

    with connect(f"tcp:{plcrt.tcp}") as plc:
        plc.flash(image)
        with ThreadPoolExecutor() as pool:
            for done in [pool.submit(use, ["Main.a", "Main.b"]), pool.submit(use, ["Main.n", "valve"])]:
                done.result()
        assert set(plc.forced()) == {"Main.b", "valve"}
        assert plc.status().exception is None


def test_power_off_ends_it(plcrt, link, image):
    with connect(f"tcp:{plcrt.tcp}") as plc:
        plc.flash(image)
        plc.force({"Main.n": 5})
    plcrt.stop()
    plcrt.start()
    with connect(f"tcp:{plcrt.tcp}", symbols=image.with_suffix(".sym")) as plc:
        assert plc.forced() == {}
