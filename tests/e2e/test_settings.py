"""Settings of a real plcrt: its file, what it refuses, and what a tool puts on it."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from plctool import connect
from plctool.testing.plcrt import Plcrt, find_plcrt
from plctool.testing.waiting import eventually

PATIENCE = 60


def run_plcrt(*options: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """One that ends by itself."""
    return subprocess.run(
        [find_plcrt(), *options], cwd=folder, capture_output=True, text=True, timeout=PATIENCE, check=False
    )


@pytest.fixture
def tcp(plcrt: Plcrt) -> Plcrt:
    """A plcrt that is restarted with TCP."""
    plcrt.stop()
    plcrt.options = ("--tcp", "0")
    plcrt.start()
    return plcrt


def state(plcrt: Plcrt) -> str:
    with connect(f"tcp:{plcrt.tcp}") as plc:
        return str(plc.status().state)


def test_a_file_gives_options_and_the_command_line_changes_them(tmp_path: Path, tool) -> None:
    config = tmp_path / "plc.cfg"
    config.write_text("[SysTarget]\nNodeName=press\n[CmpBlkDrvTcp]\nAddress=127.0.0.2:0\n")
    with Plcrt(tmp_path / "plc.flash", "--config", str(config), "--tcp", "127.0.0.3:0", "--name", "mill") as changed:
        assert changed.tcp.startswith("127.0.0.3:")
        assert tool.ok("scan", "--tcp", changed.tcp)["devices"][0]["node_name"] == "mill"


def test_a_value_that_only_plcrt_can_check_is_refused_with_its_line(tmp_path: Path) -> None:
    (tmp_path / "plc.cfg").write_text("[CmpBlkDrvTcp]\nAddress=300.0.0.1\n")
    done = run_plcrt("--config", "plc.cfg", "--flash", "f", folder=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith("plcrt: plc.cfg:2: --tcp 300.0.0.1 is not a valid address: write for example 11740")


def test_lines_that_are_not_valid_are_refused_in_the_same_words_by_plcrt_and_plctool(tmp_path: Path, tool) -> None:
    (tmp_path / "plc.cfg").write_text("[CmpRetian]\nSavePeriod=500\n[CmpLog]\nLogger.0.Filter=99\nhello\n")
    faults = [
        "plc.cfg:2: [CmpRetian] SavePeriod is not a setting: write [CmpRetain] SavePeriod if that is meant",
        "plc.cfg:4: [CmpLog] Logger.0.Filter=99 is not valid: give a number from 0 to 31",
        "plc.cfg:5: not a setting: write [Component], Key=Value, or a comment after ;",
    ]
    done = run_plcrt("--config", "plc.cfg", "--flash", "f", folder=tmp_path)
    assert (done.returncode, done.stderr.splitlines()) == (2, [f"plcrt: {fault}" for fault in faults])
    assert not (tmp_path / "f").exists()
    checked = tool("settings", "check", "plc.cfg")
    assert (checked.status, checked.err.splitlines()) == (1, [f"plctool: {fault}" for fault in faults])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--config", "none.cfg"], "none.cfg cannot be read: No such file or directory"),
        (["--config", "."], ". cannot be read: Is a directory"),
        (["--config", "large.cfg"], "large.cfg has more than 16384 bytes: remove comments"),
        (["--config", "good.cfg", "--config", "good.cfg"], "--config good.cfg is one too many"),
    ],
)
def test_a_file_that_cannot_be_used_is_named(tmp_path: Path, options: list[str], words: str) -> None:
    (tmp_path / "large.cfg").write_text(";" * 16385)
    (tmp_path / "good.cfg").write_text("")
    done = run_plcrt(*options, "--flash", "f", folder=tmp_path)
    assert done.returncode == 2 and words in done.stderr and done.stderr.count("\n") == 1


def test_what_help_config_prints_is_a_file_without_effect(tmp_path: Path, tool) -> None:
    done = run_plcrt("--help-config", folder=tmp_path)
    assert done.returncode == 0 and ";SavePeriod=1000" in done.stdout and "[CmpBlkDrvTcp]" in done.stdout
    (tmp_path / "all.cfg").write_text(done.stdout)
    assert tool.ok("settings", "check", "all.cfg")["settings"] == []


def test_all_of_plcrt_can_be_in_its_file(tmp_path: Path, tool, counter: Path) -> None:
    """Started by nothing but --config."""
    lines = ["[SysFlash]", "File=plc.flash", "[CmpBlkDrvTcp]", "Address=127.0.0.1:0", "[SysTarget]", "NodeName=press 7"]
    lines += ["[CmpApp]", "Bootproject.Start=never", "[SysMdns]", "Announce=no"]
    (tmp_path / "plc.cfg").write_text("\n".join(lines))
    for expected in ("none", "stop"):
        process = subprocess.Popen(
            [find_plcrt(), "--config", "plc.cfg"], cwd=tmp_path, stdout=subprocess.PIPE, text=True
        )
        assert process.stdout
        place = process.stdout.readline().removeprefix("tcp: ").strip()
        status = tool.ok("status", "--tcp", place)
        assert status["state"] == expected
        assert tool.ok("scan", "--tcp", place)["devices"][0]["node_name"] == "press 7"
        refused = tool("settings", "put", "plc.cfg", "--tcp", place)
        assert refused.status == 2 and "can only be in the file of plcrt --config" in refused.err
        (tmp_path / "put.cfg").write_text("[CmpApp]\nBootproject.Start=always\n")
        refused = tool("settings", "put", "put.cfg", "--tcp", place)
        assert refused.status == 1 and "This plcrt was started with --config" in refused.err
        if expected == "none":
            tool.ok("flash", "--tcp", place, str(counter))
        process.terminate()
        assert process.wait(timeout=PATIENCE) == 0
        process.stdout.close()


def test_what_a_tool_puts_counts_from_the_next_start_on(tcp: Plcrt, tool, counter: Path) -> None:
    link = ("--tcp", tcp.tcp)
    tool.ok("flash", *link, str(counter))
    (tool.folder / "never.cfg").write_text("[CmpApp]\nBootproject.Start=never\n")
    listed = tool.ok("settings", "list", *link)
    assert all(row["standard"] for row in listed["settings"])
    tool.ok("settings", "put", "never.cfg", *link)
    assert "[CmpApp] Bootproject.Start=never: " in tool("settings", "list", *link).out
    assert state(tcp) == "run"
    tcp.stop()
    tcp.start()
    assert state(tcp) == "stop"
    tool.ok("start", "--tcp", tcp.tcp)
    assert eventually(lambda: state(tcp) == "run")
    tool.ok("files", "delete", "Settings.cfg", "--tcp", tcp.tcp)
    tcp.stop()
    tcp.start()
    assert state(tcp) == "run"


def test_what_a_device_would_not_take_is_refused_before_it_is_sent(tcp: Plcrt, tool) -> None:
    (tool.folder / "large.cfg").write_text("[CmpLog]\n" + "; x\n" * 300)
    done = tool("settings", "put", "large.cfg", "--tcp", tcp.tcp)
    assert done.status == 2 and "large.cfg has 1209 bytes, a device takes 1024: remove comments." in done.err
    (tool.folder / "bad.cfg").write_text("[CmpLog]\nFilter=1\n")
    done = tool("settings", "put", "bad.cfg", "--tcp", tcp.tcp)
    assert done.status == 1 and "bad.cfg:2: [CmpLog] Filter is not a setting" in done.err
    assert "Settings.cfg" not in tool("files", "list", "--tcp", tcp.tcp).out
