"""Commands on a controller: their JSON shapes, their output, their exit statuses."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest
from fake_device import DEVICE_NAME, FakeDevice, FakeLine, FakePlc
from serial.tools.list_ports_common import ListPortInfo
from small_app import make_application

from plctool.cli import connections
from plctool.cli.command_line import parser
from plctool.cli.commands.device import log_text
from plctool.cli.commands.scan import devices_text
from plctool.cli.links import all_links, can_interfaces
from plctool.controller_documents import utc_text
from plctool.core import lib
from plctool.errors import LinkError
from plctool.link.mdns import Announced
from plctool.link.transport import BlockTransport
from plctool.link.transports import Link

PORT = ("--port", "/dev/fake")


@pytest.fixture
def running(tool: Any, plc: FakePlc, image: Path) -> FakePlc:
    """The controller with the small application."""
    assert tool("flash", *PORT, str(image)).status == 0
    plc.tasks = [([0, 1, 10_000, 5, 7, 8, 6, 9, 3, 2], "Main")]
    return plc


# ---- flash -----------------------------------------------------------------------------------------------------------


def test_flash_tells_bytes_seconds_and_whether_it_was_needed(tool: Any, plc: FakePlc, image: Path) -> None:
    document = tool("flash", *PORT, str(image), "--json").json
    assert document["bytes"] == image.stat().st_size
    assert document["seconds"] > 0
    assert (document["skipped"], document["state"]) == (False, "run")
    assert tool("flash", *PORT, str(image), "--json").json["skipped"] is True
    assert tool("flash", *PORT, str(image), "--force", "--json").json["skipped"] is False


def test_flash_without_start(tool: Any, plc: FakePlc, image: Path) -> None:
    assert tool("flash", *PORT, "--no-start", str(image), "--json").json["state"] == "stop"


def test_flash_says_what_it_did_to_people(tool: Any, plc: FakePlc, image: Path) -> None:
    done = tool("flash", *PORT, str(image))
    assert done.status == 0
    assert f"{image.stat().st_size} bytes" in done.out
    assert "state: run" in done.out
    assert "already" in tool("flash", *PORT, str(image)).out


@pytest.mark.parametrize(("at", "words"), [(1, "has no program."), (0, "has the new program (CRC ")])
def test_ctrl_c_during_flash_says_what_is_on_the_device_now(
    tool: Any, plc: FakePlc, image: Path, monkeypatch: pytest.MonkeyPatch, at: int, words: str
) -> None:
    if at:
        monkeypatch.setattr("plctool.link.services.download", interrupt)
    else:
        monkeypatch.setattr(plc, "starts_downloads", False)
        monkeypatch.setattr("plctool.link.services.start_checked", interrupt)
    done = tool("flash", *PORT, str(image))
    assert (done.status, done.out) == (130, "")
    assert done.err.startswith("plctool: Interrupted. The device ") and words in done.err


def test_ctrl_c_during_the_flash_of_another_program_leaves_the_previous_one(
    tool: Any, running: FakePlc, image: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("plctool.link.services.download", interrupt)
    before = f"{running.crc:08X}"
    (image.parent / "other.cdl").write_bytes(make_application("2")[0])
    done = tool("flash", *PORT, "other.cdl")
    assert done.status == 130
    assert done.err == f"plctool: Interrupted. The device has still the previous program (CRC {before}), state: run.\n"


def interrupt(*arguments: Any, **words: Any) -> None:
    raise KeyboardInterrupt


def test_a_refused_image_exits_1_with_the_reason(tool: Any, plc: FakePlc, image: Path) -> None:
    plc.refuse = "the function 'sin' is missing"
    done = tool("flash", *PORT, str(image), "--json")
    assert done.status == 1
    assert done.json["error"]["code"] == "app-unresolved-reference"
    assert "'sin'" in done.json["error"]["message"]


def test_what_is_no_image_exits_2(tool: Any, plc: FakePlc, scratch: Path) -> None:
    (scratch / "bad.cdl").write_bytes(b"no image")
    done = tool("flash", *PORT, "bad.cdl")
    assert (done.status, done.out) == (2, "")
    assert done.err.startswith("plctool: ")
    assert done.err.count("\n") == 1


# ---- state -----------------------------------------------------------------------------------------------------------


def test_status_without_application(tool: Any, plc: FakePlc) -> None:
    assert tool("status", *PORT, "--json").json == {
        "state": "none", "image_crc": None, "exception": None, "program": None, "forced": [], "forbidden": [],
        "boot_project": None,
    }  # fmt: skip
    assert tool("status", *PORT).out == "state: none\n"


def test_a_crc_has_eight_digits(tool: Any, running: FakePlc, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(FakePlc, "crc", 0xABC)
    assert tool("status", *PORT, "--json").json["image_crc"] == "00000ABC"


def test_status_of_a_running_program_has_the_crc_that_build_printed(tool: Any, running: FakePlc) -> None:
    document = tool("status", *PORT, "--json").json
    assert (document["state"], document["image_crc"], document["exception"]) == ("run", f"{running.crc:08X}", None)
    assert document["forced"] == []


def test_status_shows_name_and_version_of_the_program(tool: Any, running: FakePlc) -> None:
    assert tool("status", *PORT, "--json").json["program"] == {"name": "demo", "version": "1.2"}
    assert "program: demo 1.2\n" in tool("status", *PORT).out


def test_status_of_a_firmware_without_application_information_leaves_the_program_out(
    tool: Any, running: FakePlc, monkeypatch: pytest.MonkeyPatch
) -> None:
    handlers = running._handlers()
    del handlers[(lib.SG_APPLICATION, lib.SRV_APP_READ_APPLICATION_INFO)]
    monkeypatch.setattr(running, "_handlers", lambda: handlers)
    assert tool("status", *PORT, "--json").json["program"] is None
    assert "program" not in tool("status", *PORT).out


def test_info_of_a_device_shows_what_it_has_of_its_program(tool: Any, running: FakePlc) -> None:
    document = tool("info", *PORT, "--json").json
    program = {"size": len(running.image), "crc": f"{running.crc:08X}", "target": "cortex-m3"}
    assert document == {"device": DEVICE_NAME, "state": "run", "info": {"project": "demo", "version": "1.2"}} | program
    out = tool("info", *PORT).out
    assert f"crc: {running.crc:08X}\ntarget: cortex-m3\nproject: demo\nversion: 1.2\n" in out


def test_info_of_a_device_without_program_shows_its_target(tool: Any, plc: FakePlc) -> None:
    assert tool("info", *PORT).out == f"device: {DEVICE_NAME}\nstate: none\ntarget: cortex-m3\n"


def test_info_of_an_image_and_a_device_at_once_is_refused(tool: Any, running: FakePlc) -> None:
    done = tool("info", "small.cdl", *PORT)
    assert (done.status, done.err) == (
        2, "plctool: Name small.cdl or a link, not both: each is described by its own command.\n",
    )  # fmt: skip


def test_info_without_a_link_describes_an_image_also_where_a_link_is_set(
    tool: Any, image: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PLC_LINK", "serial:/dev/fake")
    assert "device" not in tool("info", str(image), "--json").json


def test_status_after_an_exception_names_task_pou_file_and_line(tool: Any, running: FakePlc) -> None:
    running.state, running.operating = lib.AS_STOP, lib.OS_EXCEPTION
    running.exception = (lib.RTSEXCPT_DIVIDEBYZERO, 0x21, 0)
    document = tool("status", *PORT, "--json").json
    assert document["state"] == "exception"
    what = {"code": lib.RTSEXCPT_DIVIDEBYZERO, "name": "DIVIDEBYZERO", "task": "Main"}
    assert document["exception"] == what | {"pou": "Main", "file": "main.st", "line": 8, "calls": [], "detail": ""}
    assert "DIVIDEBYZERO in task Main, Main, main.st:8" in tool("status", *PORT).out


def test_start_stop_and_reset_tell_the_state_they_lead_to(tool: Any, running: FakePlc) -> None:
    assert tool("stop", *PORT, "--json").json["state"] == "stop"
    assert tool("start", *PORT, "--json").json["state"] == "run"
    assert tool("reset", "cold", *PORT, "--json").json["state"] == "stop"
    assert tool("reset", "origin", *PORT, "--json").json["state"] == "none"


def test_start_of_nothing_exits_1_and_says_what_to_do(tool: Any, plc: FakePlc) -> None:
    done = tool("start", *PORT)
    assert (done.status, done.out) == (1, "")
    assert "flash one first" in done.err


def test_tasks_have_their_times(tool: Any, running: FakePlc) -> None:
    (task,) = tool("tasks", *PORT, "--json").json["tasks"]
    assert task["name"] == "Main"
    assert [task[key] for key in ("cycles", "last_us", "avg_us", "min_us", "max_us", "jitter_us", "overruns")] == [
        5, 7, 8, 6, 9, 3, 2,
    ]  # fmt: skip
    heading, row = tool("tasks", *PORT).out.splitlines()
    assert heading.split()[:2] == ["name", "cycles"]
    assert row.split()[:2] == ["Main", "5"]


def test_tasks_of_an_empty_device_are_none(tool: Any, plc: FakePlc) -> None:
    assert tool("tasks", *PORT, "--json").json == {"tasks": [], "load_percent": None}
    assert tool("tasks", *PORT).status == 0


def test_the_shell_takes_its_command_as_words(tool: Any, running: FakePlc) -> None:
    assert tool("shell", *PORT, "say", "it").out.splitlines()[0] == "You said say it"
    assert tool("shell", *PORT, "?", "--json").json == {"command": "?", "answer": "You said ?\nand now\nall is said."}


@pytest.mark.parametrize(
    ("words", "result", "message"),
    [
        ("There is no such command; ? lists them.", lib.ERR_NO_OBJECT, "There is no such command; ? lists them."),
        ("You may not do this.", lib.ERR_NO_ACCESS_RIGHTS, "You may not do this."),
        ("go: error 0x504", lib.ERR_APP_NOT_LOADED, "There is no application on the device; flash one first."),
        ("go: error 0x2", lib.ERR_INVALID_STATE, "The device refused the go: it stopped with an exception, reset it"),
    ],
)
def test_a_command_that_the_shell_refuses_exits_1(
    tool: Any, running: FakePlc, words: str, result: int, message: str
) -> None:
    running.shell_refusals["go"] = words, result
    done = tool("shell", *PORT, "go")
    assert (done.status, done.out) == (1, "")
    assert done.err.startswith(f"plctool: {message}")


def test_log_entries_come_with_class_component_and_place(tool: Any, running: FakePlc) -> None:
    running.log = [
        (1, 1_500_000_000, lib.LOG_INFO, "CmpApp", "started"),
        (2, 2_000_000_000, lib.LOG_EXCEPTION, "CmpApp", "Main: DIVIDEBYZERO at code offset 0x21"),
    ]
    running.state, running.operating = lib.AS_STOP, lib.OS_EXCEPTION
    running.exception = (lib.RTSEXCPT_DIVIDEBYZERO, 0x21, 0)
    first, second = tool("log", *PORT, "--json").json["entries"]
    assert (first["time_s"], first["class"], first["component"], first["text"]) == (1.5, "info", "CmpApp", "started")
    assert (second["class"], second["pou"], second["file"], second["line"]) == ("exception", "Main", "main.st", 8)
    assert "main.st:8" in tool("log", *PORT).out


def test_a_kept_entry_shows_its_start_and_its_moment() -> None:
    entry = {
        "time_s": 1.5,
        "class": "info",
        "component": "CmpApp",
        "text": "started",
        "utc": utc_text(10**18),
        "start": 3,
    }
    line = "start 3    2001-09-09 01:46:40.000  info       CmpApp: started"
    assert log_text({"entries": [entry]}, clock=True) == line
    assert log_text({"entries": [{**entry, "utc": None}]}, clock=True) == line.replace(
        "2001-09-09 01:46:40.000", "             1.500000 s"
    )
    assert utc_text(2**63 - 1) == "2262-04-11 23:47:16.854"


LOG = [
    (1, 1_000_000_000, lib.LOG_DEBUG, "CmpApp", "trivial"),
    (2, 2_000_000_000, lib.LOG_INFO, "IecLog", "started"),
    (3, 3_000_000_000, lib.LOG_WARNING, "CmpApp", "slow"),
    (4, 4_000_000_000, lib.LOG_ERROR, "IecLog", "jammed"),
]


@pytest.mark.parametrize(
    ("options", "texts"),
    [
        ("", ["trivial", "started", "slow", "jammed"]),
        ("--class warning", ["slow", "jammed"]),
        ("--component ieclog", ["started", "jammed"]),
        ("--component IecLog --component CmpApp --class error", ["jammed"]),
        ("--component Nothing", []),
    ],
)
def test_log_shows_the_classes_and_components_that_are_asked_for(
    tool: Any, running: FakePlc, options: str, texts: list[str]
) -> None:
    running.log = LOG
    entries = tool("log", *PORT, *options.split(), "--json").json["entries"]
    assert [entry["text"] for entry in entries] == texts


def test_log_of_an_unknown_class_names_the_classes(tool: Any, running: FakePlc) -> None:
    done = tool("log", *PORT, "--class", "fatal")
    assert done.status == 2
    assert "exception" in done.err


def test_log_follows_what_is_added_and_a_device_that_restarts(
    tool: Any, running: FakePlc, monkeypatch: pytest.MonkeyPatch
) -> None:
    logs = iter([
        LOG,
        [*LOG[2:], (5, 5_000_000_000, lib.LOG_INFO, "IecLog", "added")],
        [(n, n * 1_000_000_000, lib.LOG_INFO, "IecLog", f"rolled {n}") for n in (9, 10)],
        [(1, 7_000_000, lib.LOG_INFO, "CmpApp", "new start")],
        [(1, 8_000_000, lib.LOG_INFO, "CmpApp", "one more start")],
    ])  # fmt: skip

    def next_log(seconds: float) -> None:
        running.log = next(logs, None)
        if running.log is None:
            raise KeyboardInterrupt

    running.log = LOG[:2]
    monkeypatch.setattr("plctool.cli.commands.device.time.sleep", next_log)
    done = tool("log", *PORT, "--follow", "--json", "--class", "info")
    assert done.status == 0
    texts = [json.loads(line)["text"] for line in done.out.splitlines()]
    assert texts == ["started", "slow", "jammed", "added", "rolled 9", "rolled 10", "new start", "one more start"]


def test_scan_lists_the_devices(tool: Any, plc: FakePlc) -> None:
    (found,) = tool("scan", *PORT, "--json").json["devices"]
    assert found["node_name"] == "press-3"
    assert (found["device_name"], found["target"], found["address"]) == ("Fake controller", "cortex-m3", "0001")
    assert "press-3" in tool("scan", *PORT).out


def test_a_scan_shows_what_only_some_devices_say() -> None:
    healthy, broken = {"node_name": "press"}, {"node_name": "oven", "problem": "a component failed to start"}
    assert devices_text({"devices": [healthy, broken]}).splitlines() == [
        "node_name  problem", "press", "oven       a component failed to start"
    ]  # fmt: skip


def test_a_long_scan_shows_state_and_program_of_each_device(tool: Any, running: FakePlc) -> None:
    (found,) = tool("scan", "--long", *PORT, "--json").json["devices"]
    assert (found["state"], found["program"], found["program_version"]) == ("run", "demo", "1.2")
    assert "demo" in tool("scan", "--long", *PORT).out


def test_a_long_scan_lists_a_device_that_wants_a_password(tool: Any, running: FakePlc) -> None:
    running.password = b"x" * 32
    (found,) = tool("scan", "--long", *PORT, "--json").json["devices"]
    assert (found["node_name"], found["state"], found["program"]) == ("press-3", "password-needed", "")


# ---- variables -------------------------------------------------------------------------------------------------------


def test_read_gives_values_by_the_names_asked_for(tool: Any, running: FakePlc) -> None:
    running.memory[0][:5] = (168).to_bytes(4, "little") + b"\1"
    running.memory[0][12:16] = (80).to_bytes(4, "little")
    running.memory[0][16:20] = b"abc\0"
    done = tool("read", *PORT, "Main.count", "Main.ok", "Main.name", "Main.pause", "--json")
    values = {"Main.count": 168, "Main.ok": True, "Main.name": "abc", "Main.pause": "T#80ms"}
    assert done.json == {"values": values, "consistent": True, "forced": []}


def test_read_shows_values_as_st_writes_them(tool: Any, running: FakePlc) -> None:
    running.memory[0][:5] = (168).to_bytes(4, "little") + b"\1"
    running.memory[0][16:20] = b"ab'\0"
    running.memory[0][28] = 7
    done = tool("read", *PORT, "Main.count", "Main.ok", "Main.name", "Main.list")
    assert done.out == "Main.count = 168\nMain.ok = TRUE\nMain.name = 'ab$''\nMain.list = [7, 0, 0]\n"
    assert done.err == ""


def test_read_says_when_the_values_are_not_of_one_cycle(tool: Any, running: FakePlc) -> None:
    running.disturbed = 1000
    assert "different cycles" in tool("read", *PORT, "Main.count", "Main.ok").err
    assert tool("read", *PORT, "Main.count", "Main.ok", "--json").json["consistent"] is False


def test_lists_are_written_as_a_whole(tool: Any, running: FakePlc) -> None:
    assert tool("write", *PORT, "Main.list := [1, 2(5)]").out == "Main.list = [1, 5, 5]\n"
    assert bytes(running.memory[0][28:34]) == bytes([1, 0, 5, 0, 5, 0])


def test_read_takes_patterns(tool: Any, running: FakePlc) -> None:
    running.memory[lib.APP_AREA_CODE] = bytearray(4)  # of a constant
    values = tool("read", *PORT, "Main.*", "--json").json["values"]
    assert {"Main.count", "Main.ok", "Main.name", "Main.list"} <= set(values)
    assert list(tool("read", *PORT, "main.C*", "Main.list[?]", "--json").json["values"]) == [
        "Main.count", "Main.list[1]", "Main.list[2]", "Main.list[3]",
    ]  # fmt: skip


def test_a_pattern_that_nothing_matches_exits_2(tool: Any, running: FakePlc) -> None:
    done = tool("read", *PORT, "Pump.*")
    assert done.status == 2
    assert done.err == "plctool: No variable matches Pump.*; 'plctool symbols' lists them.\n"


def test_watch_takes_patterns(tool: Any, running: FakePlc) -> None:
    line = tool("watch", *PORT, "Main.c*", "--count", "1", "--json").out
    assert json.loads(line)["values"] == {"Main.count": 0}


def test_read_of_an_unknown_name_exits_2_with_a_suggestion(tool: Any, running: FakePlc) -> None:
    done = tool("read", *PORT, "Main.coutn", "--json")
    assert done.status == 2
    assert "Main.count" in done.json["error"]["message"]


@pytest.mark.parametrize("command", ["read", "watch"])
def test_an_empty_name_is_called_empty(tool: Any, running: FakePlc, command: str) -> None:
    done = tool(command, *PORT, "")
    assert (done.status, done.err) == (2, "plctool: A name is empty; write for example Main.speed.\n")


def test_a_pattern_is_not_written_to(tool: Any, running: FakePlc) -> None:
    done = tool("write", *PORT, "Main.*=1")
    assert done.status == 2
    assert "Main.* stands for several variables; name one" in done.err


def test_read_without_application_exits_1(tool: Any, plc: FakePlc) -> None:
    assert tool("read", *PORT, "Main.count", "--json").status == 1


def test_read_with_the_symbols_of_another_image_exits_2(tool: Any, running: FakePlc, image: Path) -> None:
    running.image = running.image[:-1] + b"\0"
    running.image = running.image[:100] + b"\1\2\3\4" + running.image[104:]
    done = tool("read", *PORT, "--symbols", str(image.with_suffix(".sym")), "Main.count", "--json")
    assert done.status == 2
    assert done.json["error"]["code"] == "wrong-symbols"


def test_what_is_no_symbol_file_exits_2(tool: Any, running: FakePlc, scratch: Path) -> None:
    (scratch / "bytes.sym").write_bytes(b"\xff")
    for name, words in (
        ("bytes.sym", "is not a symbol file"),
        ("none.sym", "cannot be read: No such file or directory."),
    ):
        done = tool("read", *PORT, "Main.count", "--symbols", name)
        assert done.status == 2
        assert words in done.err


def test_write_understands_strings_and_shows_the_values_after(tool: Any, running: FakePlc) -> None:
    done = tool("write", *PORT, "Main.count=16#2A", "Main.pause=T#1s", "Main.name=a=b", "Main.ok=TRUE", "--json")
    values = {"Main.count": 42, "Main.pause": "T#1s", "Main.name": "a=b", "Main.ok": True}
    assert done.json == {"values": values, "forced": []}
    assert running.memory[0][0] == 42


@pytest.mark.parametrize("words", [("Main.count",), ("=5",), ("Main.count=many",), ("Main.nothing=1",)])
def test_write_of_nonsense_exits_2_and_writes_nothing(
    tool: Any, running: FakePlc, image: Path, words: tuple[str, ...]
) -> None:
    done = tool("write", *PORT, "Main.ok=1", *words)
    assert (done.status, running.writes) == (2, 0)


@pytest.fixture
def watched(running: FakePlc) -> tuple[str, ...]:
    return ("watch", *PORT, "Main.count", "--interval", "0")


def test_watch_as_json_gives_a_document_a_line(tool: Any, watched: tuple[str, ...]) -> None:
    samples = [json.loads(line) for line in tool(*watched, "--count", "3", "--json").out.splitlines()]
    assert [sample["values"] for sample in samples] == [{"Main.count": 0}] * 3
    assert all(sample["time_s"] >= 0 for sample in samples)


def test_watch_prints_a_line_a_reading_where_there_is_no_terminal(tool: Any, watched: tuple[str, ...]) -> None:
    lines = tool(*watched, "--count", "2").out.splitlines()
    assert len(lines) == 2
    assert all(line.endswith("Main.count = 0") for line in lines)


def test_watch_as_json_prints_each_reading_at_once_and_ends_well_at_ctrl_c(
    tool: Any, watched: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    naps = iter([None, None])

    def sleep(seconds: float) -> None:
        if next(naps, KeyboardInterrupt) is KeyboardInterrupt:
            raise KeyboardInterrupt

    monkeypatch.setattr("plctool.device.time.sleep", sleep)
    done = tool(*watched, "--json")
    assert done.status == 0
    assert len(done.out.splitlines()) == 2


@pytest.mark.parametrize("how", [(), ("--json",)])
def test_what_watch_prints_is_there_before_the_next_reading(
    tool: Any, watched: tuple[str, ...], scratch: Path, monkeypatch: pytest.MonkeyPatch, how: tuple[str, ...]
) -> None:
    there: list[int] = []
    monkeypatch.setattr(
        "plctool.device.time.sleep", lambda seconds: there.append(len((scratch / "out").read_text().splitlines()))
    )
    with (scratch / "out").open("w") as out:
        monkeypatch.setattr(sys, "stdout", out)
        assert tool(*watched, *how, "--count", "3").status == 0
    assert there[-2:] == [1, 2]


def test_ctrl_c_exits_130_without_a_word(tool: Any, watched: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(seconds: float) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("plctool.device.time.sleep", interrupt)
    done = tool(*watched)
    assert (done.status, done.out, done.err) == (130, "", "")


# ---- links -----------------------------------------------------------------------------------------------------------

DEVICE_COMMANDS = [
    ("flash", "small.cdl"), ("scan",), ("status",), ("start",), ("stop",), ("reset", "warm"), ("tasks",), ("log",),
    ("latency",), ("read", "Main.count"), ("write", "Main.count=1"), ("watch", "Main.count"),
]  # fmt: skip


@pytest.mark.parametrize("command", [c for c in DEVICE_COMMANDS if c != ("scan",)], ids=lambda c: c[0])
def test_every_device_command_without_a_link_exits_2(tool: Any, image: Path, command: tuple[str, ...]) -> None:
    done = tool(*command, "--json")
    assert done.status == 2
    assert "--port" in done.json["error"]["message"]


@pytest.mark.parametrize("command", DEVICE_COMMANDS, ids=lambda c: c[0])
def test_every_device_command_on_a_missing_port_exits_3(tool: Any, image: Path, command: tuple[str, ...]) -> None:
    done = tool(*command, "--port", "/dev/no-such-port", "--json")
    assert done.status == 3
    assert done.json["error"]["code"] == "open"
    people = tool(*command, "--port", "/dev/no-such-port")
    assert (people.status, people.out) == (3, "")
    assert people.err.count("\n") == 1
    assert "no such port" in people.err


@pytest.mark.parametrize("port", ["/dev/null", "/tmp"])
def test_what_is_no_serial_port_is_reported(tool: Any, port: str) -> None:
    done = tool("scan", "--port", port)
    assert (done.status, done.out) == (3, "")
    assert "it is not a serial port" in done.err


def test_a_silent_device_exits_3(tool: Any, serial_opened_by: Any) -> None:
    from fake_device import FakeDevice, FakeLine

    line = FakeLine(FakeDevice())
    line.cut = True
    serial_opened_by(lambda link: line)
    done = tool("status", *PORT, "--json")
    assert done.status == 3
    assert done.json["error"]["code"] == "no-answer"


def test_an_option_of_another_kind_of_link_exits_2(tool: Any) -> None:
    done = tool("status", "--tcp", "localhost", "--baud", "9600")
    assert (done.status, done.err) == (2, "plctool: A tcp link has no option 'baud'; it has none.\n")


@pytest.mark.parametrize("name", ["place", "scheme"])
def test_what_is_no_option_of_a_link_exits_2(tool: Any, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setenv("PLC_LINK", f"tcp:localhost?{name}=x")
    done = tool("status")
    assert done.status == 2
    assert f"A tcp link has no option '{name}'; it has none." in done.err


@pytest.fixture
def opened(plc: FakePlc, serial_opened_by: Any, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The serial links that are opened."""
    links: list[str] = []

    def open_line(link: Link) -> BlockTransport:
        links.append(str(link))
        return FakeLine(FakeDevice(plc.handle))

    serial_opened_by(open_line)
    return links


def test_the_environment_names_the_link_of_commands_without_one(
    tool: Any, opened: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PLC_LINK", "serial:/dev/mine?baud=9600")
    assert tool("status").status == 0
    assert tool("status", "--baud", "19200").status == 0
    assert tool("status", *PORT).status == 0
    assert tool("scan").status == 0
    mine, fake = "serial:/dev/mine?baud", "serial:/dev/fake?baud"
    assert opened == [f"{mine}=9600", f"{mine}=19200", f"{fake}=115200", f"{mine}=9600"]


@pytest.mark.parametrize("flag", ["--port", "--tcp", "--udp", "--can"])
def test_an_empty_place_is_no_way_to_another_device(
    tool: Any, opened: list[str], monkeypatch: pytest.MonkeyPatch, flag: str
) -> None:
    """As a variable of a shell script that is not set."""
    monkeypatch.setenv("PLC_LINK", "serial:/dev/mine")
    done = tool("stop", flag, "")
    assert (done.status, opened) == (2, [])
    assert done.err.startswith(f"plctool: {flag} is followed by nothing; write for example ")


def test_the_project_names_the_link_where_the_environment_does_not(
    tool: Any, opened: list[str], scratch: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (scratch / "plc.toml").write_text('link = "serial:/dev/project"\n[other]\nlink = "x"\n')
    (scratch / "sources").mkdir()
    monkeypatch.chdir(scratch / "sources")
    assert tool("status").status == 0
    monkeypatch.setenv("PLC_LINK", "serial:/dev/mine")
    assert tool("status").status == 0
    assert opened == ["serial:/dev/project?baud=115200", "serial:/dev/mine?baud=115200"]


def test_a_port_of_the_project_begins_at_its_folder(
    tool: Any, opened: list[str], scratch: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (scratch / "plc.toml").write_text('link = "serial:plc.tty"\n')
    (scratch / "plc.tty").touch()
    (scratch / "sources").mkdir()
    monkeypatch.chdir(scratch / "sources")
    assert tool("status").status == 0
    assert opened == ["serial:../plc.tty?baud=115200"]


@pytest.mark.parametrize("command", ["status", "stop", "read Main.n", "scan", "log"])
def test_a_command_says_that_the_project_names_its_link(
    tool: Any, opened: list[str], scratch: Path, command: str
) -> None:
    (scratch / "plc.toml").write_text('link = "serial:/dev/project"\n')
    said = "plctool: the link is serial:/dev/project?baud=115200, from plc.toml\n"
    assert tool(*command.split()).err.count(said) == 1
    assert said not in tool(*command.split(), "--json").err
    assert said not in tool(*command.split(), *PORT).err


@pytest.mark.parametrize("url", ["socket://host:1", "loop://", "rfc2217://host:1"])
@pytest.mark.parametrize("kind", ["serial", "modbus", "can:slcan"])
def test_the_project_names_no_url(
    tool: Any, scratch: Path, monkeypatch: pytest.MonkeyPatch, url: str, kind: str
) -> None:
    (scratch / "plc.toml").write_text(f'link = "{kind}:{url}"\n')
    done = tool("status")
    assert done.status == 2
    assert f"{url} is a URL, which plc.toml cannot name" in done.err and f"PLC_LINK={kind}:{url}." in done.err


def test_a_link_of_the_project_writes_no_file(tool: Any, scratch: Path) -> None:
    (scratch / "victim").write_text("precious")
    for url in (f"spy://loop://?file={scratch}/victim", f"SPY://loop://?file={scratch}/victim"):
        (scratch / "plc.toml").write_text(f'link = "serial:{url}"\n')
        assert "is not a port" in (done := tool("status")).err and done.status == 2
        assert "is not a port" in (done := tool("status", "--port", url)).err and done.status == 2
    assert (scratch / "victim").read_text() == "precious"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("\nlink = 5", "plc.toml:2: link is not a text"),
        ("link = 5", 'write for example link = "serial:/dev/ttyS0"'),
        ("link = ", "is not TOML"),
        ('\nlink = "/dev/ttyS0"', "plc.toml:2: '/dev/ttyS0' is not a link; write for example serial:/dev/ttyS0"),
    ],
)
def test_a_wrong_link_of_the_project_exits_2_and_names_the_file(
    tool: Any, scratch: Path, text: str, words: str
) -> None:
    (scratch / "plc.toml").write_text(text)
    done = tool("status")
    assert (done.status, done.err.count("\n")) == (2, 1)
    assert "plc.toml" in done.err and words in done.err


def test_a_wrong_link_of_the_environment_exits_2_and_names_it(tool: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PLC_LINK", "ttyS0")
    done = tool("status")
    assert done.status == 2 and "PLC_LINK" in done.err


@pytest.fixture
def ports(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The serial ports of the machine."""
    names: list[str] = []
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: [ListPortInfo(name) for name in names])
    monkeypatch.setattr("plctool.cli.links.can_interfaces", list)
    monkeypatch.setenv("PLCTOOL_MDNS", "off")
    return names


def test_scan_without_a_link_looks_at_all_serial_ports(
    tool: Any, plc: FakePlc, serial_opened_by: Any, ports: list[str]
) -> None:
    def open_line(link: Link) -> BlockTransport:
        if link.place == "/dev/ttyS1":
            raise LinkError("Cannot open /dev/ttyS1: it is busy.", "open")
        line = FakeLine(FakeDevice(plc.handle))
        line.cut = link.place == "/dev/ttyS0"
        return line

    serial_opened_by(open_line)
    ports += ["/dev/ttyS0", "/dev/ttyS1", "/dev/ttyUSB3"]
    (found,) = tool("scan", "--json").json["devices"]
    assert (found["link"], found["node_name"]) == ("serial:/dev/ttyUSB3", "press-3")
    ports.pop()
    done = tool("scan")
    assert done.status == 3
    assert "No device answers on" in done.err and "Cannot open /dev/ttyS1: it is busy." in done.err


def test_scan_without_a_link_on_a_machine_without_serial_ports_exits_3(tool: Any, ports: list[str]) -> None:
    done = tool("scan")
    assert (done.status, done.err.count("\n")) == (3, 1)
    assert "no serial ports" in done.err


def test_scan_without_a_link_looks_at_can_interfaces_and_what_announces_itself(
    ports: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    ports.append("/dev/ttyS0")
    monkeypatch.setattr("plctool.cli.links.can_interfaces", lambda: ["can0"])
    announced = [Announced("press", "press.local", "192.168.1.5:11740")]
    monkeypatch.setattr("plctool.link.mdns.find_devices", lambda: announced)
    links = all_links(parser().parse_args(["scan", "--baud", "9600"]))
    assert [f"{link.scheme}:{link.place}" for link in links] == [
        "serial:/dev/ttyS0", "can:socketcan:can0", "tcp:192.168.1.5:11740",
    ]  # fmt: skip
    assert links[0].options["baud"] == 9600


def test_can_interfaces_that_are_up_are_found(tmp_path: Path) -> None:
    for name, kind, flags in (("can1", "280", "0x40081"), ("can0", "280", "0x40080"), ("eth0", "1", "0x1003")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "type").write_text(f"{kind}\n")
        (tmp_path / name / "flags").write_text(f"{flags}\n")
    assert can_interfaces(tmp_path) == ["can1"]


# ---- bugs ------------------------------------------------------------------------------------------------------------


def test_a_bug_is_one_sentence_with_a_hint(tool: Any, plc: FakePlc, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PLCTOOL_DEBUG", raising=False)
    monkeypatch.setattr(connections, "link_of", lambda args: 1 / 0)
    done = tool("status", *PORT)
    assert (done.status, done.out) == (1, "")
    assert "Internal error" in done.err
    assert "PLCTOOL_DEBUG=1" in done.err
    assert "Traceback" not in done.err
    assert json.loads(tool("status", *PORT, "--json").out)["error"]["code"] == "internal"


def test_a_bug_shows_its_traceback_on_demand(tool: Any, plc: FakePlc, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PLCTOOL_DEBUG", "1")
    monkeypatch.setattr(connections, "link_of", lambda args: 1 / 0)
    assert "ZeroDivisionError" in tool("status", *PORT).err
