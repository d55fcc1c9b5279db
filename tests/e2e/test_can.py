"""Three plcrt and several tools on one CAN bus, which is a hub of pseudo terminals."""

from __future__ import annotations

import io
import json
import os
import random
import re
import select
import sys
import threading
import tty
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, suppress
from pathlib import Path
from typing import Any

import pytest

import plctool
from plctool.cli.main import main
from plctool.errors import LinkError, PlcError
from plctool.image.file import image_crc
from plctool.link import services
from plctool.link.canbus import CanTransport, PythonCanBus, open_bus
from plctool.link.connection import Choice, Connection
from plctool.link.session import Session
from plctool.testing.can_hub import CanHub
from plctool.testing.plcrt import Plcrt

NODES = {1: "press", 2: "mixer", 77: "oven"}
TOOLS = 3
PATIENCE = 60.0  # for what is bound to happen [s]


@pytest.fixture(scope="module")
def hub(tmp_path_factory: pytest.TempPathFactory) -> Iterator[CanHub]:
    folder = tmp_path_factory.mktemp("can")
    with CanHub(len(NODES) + TOOLS) as hub, ExitStack() as stack:
        for (number, name), path in zip(NODES.items(), hub.paths[TOOLS:], strict=True):
            options = ("--can", f"slcan:{path}", "--node", str(number), "--name", name)
            stack.enter_context(Plcrt(folder / f"{name}.flash", *options))
        yield hub


class _Fixed(random.Random):
    """Chooses the same address twice, then others; calls `ended` before those."""

    def __init__(self, first: int, ended: Callable[[], None]) -> None:
        super().__init__()
        self.first = [first, first]
        self.ended = ended

    def randint(self, a: int, b: int) -> int:
        if self.first:
            return self.first.pop()
        self.ended()
        return super().randint(a, b)


TransportOf = Callable[..., CanTransport]


@pytest.fixture
def transport_of(hub: CanHub) -> Iterator[TransportOf]:
    """Makes a transport of a tool to a device. `first`: its first address; `claim`: how long it listens there [s]."""
    with ExitStack() as stack, pytest.MonkeyPatch.context() as patch:

        def make(tool: int, node: int, first: int | None = None, claim: float = 0.08) -> CanTransport:
            patch.setattr("plctool.link.canbus._CLAIM_TIME", claim)
            bus = PythonCanBus(open_bus(f"slcan:{hub.paths[tool]}", 500000, 0))
            chosen = None if first is None else _Fixed(first, patch.undo)
            transport = CanTransport("hub", bus, node, random_source=chosen)
            stack.callback(transport.close)
            patch.undo()
            return transport

        yield make


def link_of(hub: CanHub, tool: int, node: int | str | None = None) -> str:
    return f"can:slcan:{hub.paths[tool]}" + (f"?node={node}" if node is not None else "")


def options_of(hub: CanHub, tool: int, node: int | str | None = None) -> list[str]:
    return ["--can", f"slcan:{hub.paths[tool]}", *(["--node", str(node)] if node is not None else [])]


def devices(tool: Any, *options: str) -> list[dict[str, Any]]:
    """Those that answer to a scan in time."""
    done = tool("scan", *options, "--json")
    return list(done.json["devices"]) if done.status == 0 else []


def test_a_scan_lists_all_devices(hub: CanHub, tool: Any, eventually: Callable[..., Any]) -> None:
    expected = {(f"{number:04X}", name, f"node {number}") for number, name in NODES.items()}
    eventually(
        lambda: {(d["address"], d["node_name"], d["place"]) for d in devices(tool, *options_of(hub, 0))} == expected
    )


def test_a_long_scan_asks_each_device(hub: CanHub, tool: Any, eventually: Callable[..., Any]) -> None:
    expected = {(name, "none") for name in NODES.values()}
    eventually(lambda: {(d["node_name"], d["state"]) for d in devices(tool, "--long", *options_of(hub, 0))} == expected)


def test_a_device_is_chosen_by_number_or_name(hub: CanHub) -> None:
    for number, name in NODES.items():
        for node in (number, name):
            with plctool.connect(link_of(hub, 0, node)) as plc:
                assert plc.identity().node_name == name


def test_without_a_choice_they_are_listed(hub: CanHub, tool: Any, eventually: Callable[..., Any]) -> None:
    def is_said(said: str, *options: str) -> bool:
        done = tool("status", *options)
        return (done.status, said in done.err) == (3, True)

    eventually(lambda: is_said("1 (press), 2 (mixer), 77 (oven); say which one with --node", *options_of(hub, 0)))
    eventually(lambda: is_said("has the name kettle", *options_of(hub, 0, "kettle")))
    done = tool("status", *options_of(hub, 0, 99))
    assert (done.status, "No device answers" in done.err) == (3, True)
    done = tool("status", *options_of(hub, 0, "1,2"))
    assert (done.status, "Only 'flash' takes several devices" in done.err) == (2, True)


def test_several_devices_are_flashed_at_once(hub: CanHub, tool: Any, counter: Path) -> None:
    document = tool.ok("flash", *options_of(hub, 0, "1,mixer,77"), str(counter))
    assert [(d["node"], d["state"], d["skipped"]) for d in document["devices"]] == [
        ("1", "run", False),
        ("mixer", "run", False),
        ("77", "run", False),
    ]
    for node in NODES:
        assert tool.ok("status", *options_of(hub, 1, node))["state"] == "run"
    done = tool("flash", *options_of(hub, 0, "1,99"), str(counter), "--json")
    assert done.status == 3
    good, bad = json.loads(done.out)["devices"]
    assert (good["skipped"], bad["node"], bad["error"]["code"]) == (True, "99", "no-answer")


def test_ctrl_c_during_the_flash_of_several_says_what_each_has_now(
    hub: CanHub, tool: Any, counter: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    tool.ok("flash", *options_of(hub, 0, "1,mixer"), str(counter))
    tool.ok("reset", "origin", *options_of(hub, 0, "mixer"))
    crc = tool.ok("status", *options_of(hub, 0, "1"))["image_crc"]
    other = tool.build("other", "PROGRAM Main VAR n : DINT; END_VAR n := n + 2; END_PROGRAM")

    def interrupt(*arguments: Any, **words: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("plctool.link.services.download", interrupt)
    assert main(["flash", *options_of(hub, 0, "1,mixer"), str(other)]) == 130
    assert capsys.readouterr().err == (
        f"plctool: Interrupted. Node 1 has still the previous program (CRC {crc}), state: run. "
        "Node mixer has no program.\n"
    )


def test_each_of_several_downloads_has_a_progress_bar(hub: CanHub, tool: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    program = "PROGRAM Main VAR a : ARRAY[0..2999] OF DINT := [3000(9)]; END_VAR a[0] := a[1]; END_PROGRAM"
    shown = Terminal()
    monkeypatch.setattr(sys, "stderr", shown)
    monkeypatch.setenv("TERM", "xterm")
    assert main(["flash", *options_of(hub, 0, "1,mixer"), str(tool.build("bars", program))]) == 0
    drawn = re.sub(r"\x1b\[[\d;?]*[a-zA-Z]", "", shown.getvalue())
    assert set(re.findall(r"(\w+) +━+ +\d+/\d+ bytes", drawn)) == {"1", "mixer"}


def test_buses_with_other_identifiers_do_not_hear_each_other(
    tmp_path: Path, tool: Any, counter: Path, eventually: Callable[..., Any]
) -> None:
    with CanHub(3) as hub, ExitStack() as stack:
        for name, base in (("usual", "0x1F400000"), ("other", "0x10050000")):
            options = ("--can", f"slcan:{hub.paths[1 + (name == 'other')]}", "--node", "5", "--name", name)
            stack.enter_context(Plcrt(tmp_path / f"{name}.flash", *options, "--can-base", base))
        for name, words in (("usual", []), ("other", ["--can-base", "0x10050000"])):
            line = ["--can", f"slcan:{hub.paths[0]}", *words]
            assert [d["node_name"] for d in eventually(lambda line=line: devices(tool, *line))] == [name]
            assert tool.ok("flash", *line, "--node", "5", str(counter))["state"] == "run"
            assert tool.ok("status", *line, "--node", name)["state"] == "run"


def test_two_devices_with_one_number_say_so_and_are_both_listed(tmp_path: Path, tool: Any) -> None:
    with CanHub(3) as hub, ExitStack() as stack:
        ports = []
        for name, path in zip(("left", "right"), hub.paths[1:], strict=True):
            options = ("--can", f"slcan:{path}", "--node", "9", "--name", name)
            ports.append(stack.enter_context(Plcrt(tmp_path / f"{name}.flash", *options)).port)
        seen: set[str] = set()
        for _ in range(20):  # replies at the same moment damage each other
            with suppress(json.JSONDecodeError):
                seen |= {d["node_name"] for d in json.loads(tool("scan", *options_of(hub, 0), "--json").out)["devices"]}
            if len(seen) == 2:
                break
        assert seen == {"left", "right"}
        for port in ports:
            with plctool.connect(f"serial:{port}") as plc:
                assert "CAN: another device has the node number 9" in [entry.text for entry in plc.log()]


def test_one_tool_flashes_while_another_one_watches(
    hub: CanHub, transport_of: TransportOf, tool: Any, counter: Path
) -> None:
    """And a third one talks to a third device: three conversations on one bus."""
    big = tool.build(
        "big", "PROGRAM Main VAR a : ARRAY[0..2999] OF DINT := [3000(7)]; END_VAR a[0] := a[0] + 1; END_PROGRAM"
    )
    watching, flashed = threading.Event(), threading.Event()
    errors: list[PlcError] = []
    readings: list[int] = []

    def watch() -> None:
        try:
            with plctool.connect(link_of(hub, 1, "mixer")) as plc:
                for _, reading in plc.watch(["Main.count"], interval=0.0):
                    readings.append(reading.values["Main.count"])
                    watching.set()
                    if flashed.is_set():
                        return
        except PlcError as error:
            errors.append(error)

    def talk() -> None:
        session = Session(Connection(transport_of(2, 77)))
        data = random.Random(1).randbytes(3000)
        while not flashed.is_set():
            if services.echo(session, data) != data:
                errors.append(PlcError("the echo is another one", "echo"))

    with plctool.connect(link_of(hub, 0, "mixer")) as plc:
        plc.flash(counter)
    threads = [threading.Thread(target=watch, daemon=True), threading.Thread(target=talk, daemon=True)]
    for thread in threads:
        thread.start()
    assert watching.wait(PATIENCE)
    with plctool.connect(link_of(hub, 0, "press")) as plc:
        plc.flash(big)
        assert plc.read("Main.a[2999]") == 7
    flashed.set()
    for thread in threads:
        thread.join(PATIENCE)
    assert errors == []
    assert readings == sorted(readings)
    assert len(set(readings)) > 1


def test_two_tools_never_have_one_address(transport_of: TransportOf) -> None:
    """The second one finds the address taken and takes another one; the first one goes on."""
    first = transport_of(0, 1, first=200, claim=0.0)
    session = Session(Connection(first, Choice("1")))
    assert services.echo(session, b"hello") == b"hello"
    done = threading.Event()

    def go_on() -> None:
        while not done.is_set():
            assert services.echo(session, b"hello") == b"hello"

    thread = threading.Thread(target=go_on)
    thread.start()
    try:
        second = transport_of(1, 1, first=200, claim=30.0)  # on a busy machine the first one replies late
    finally:
        done.set()
        thread.join()
    assert first.local_address == b"\x00\xc8"
    assert second.local_address != b"\x00\xc8"


def test_a_collision_that_was_missed_is_noticed_and_mended(
    transport_of: TransportOf, eventually: Callable[..., Any]
) -> None:
    first = transport_of(0, 1, first=201, claim=0.0)
    session = Session(Connection(first, Choice("1")))
    assert services.echo(session, b"hello") == b"hello"
    second = transport_of(1, 2, first=201, claim=0.0)  # it does not listen before it begins
    other = Session(Connection(second, Choice("2")))

    def are_apart() -> bool:
        """Both may move away, and to the same address: each is asleep here while the other one claims it."""
        assert other.recover(lambda: services.echo(other, b"hello")) == b"hello"
        assert session.recover(lambda: services.echo(session, b"hello")) == b"hello"
        return first.local_address != second.local_address

    eventually(are_apart)


def test_an_adapter_belongs_to_one_tool(hub: CanHub, tool: Any) -> None:
    with plctool.connect(link_of(hub, 0, 1)) as plc:
        assert plc.identity().node_name == "press"
        done = tool("status", *options_of(hub, 0, 2))
        assert (done.status, done.err.count("\n")) == (3, 1)
        assert "another program uses it" in done.err
        assert plc.identity().node_name == "press"


def big_program(tool: Any, first: int) -> Path:
    """Its values are no loop that fills, and no run that packs well."""
    values = ", ".join(str(first + i * i % 65521 * 7) for i in range(8000))
    text = f"PROGRAM Main VAR a : ARRAY[0..7999] OF DINT := [{values}]; n : DINT; END_VAR n := n + a[0]; END_PROGRAM"
    return tool.build(f"big{first}", text)


@pytest.fixture
def lossy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[CanHub]:
    """A hub that may lose frames, with a device on its second adapter. Messages are short, so that a download has many,
    of which four have one reply."""
    monkeypatch.setattr("plctool.link.channel.WANTED_BUFFER", 2048)
    with CanHub(2) as hub, Plcrt(tmp_path / "lossy.flash", "--can", f"slcan:{hub.paths[1]}"):
        yield hub


def test_a_download_whose_frames_get_lost_arrives_whole(lossy: CanHub, tool: Any) -> None:
    image = big_program(tool, 3)
    with plctool.connect(link_of(lossy, 0, 1)) as plc:
        plc.identity()
        lossy.lose_one_in = 300
        assert plc.flash(image).state == "run"
        lossy.lose_one_in = 0
        assert plc.status().image_crc == image_crc(image.read_bytes())
        assert [plc.read(f"Main.a[{i}]") for i in (0, 7999)] == [3, 3 + 7999**2 % 65521 * 7]
    assert lossy.lost > 0


def test_a_bus_that_dies_during_a_download_leaves_the_previous_program(lossy: CanHub, tool: Any, counter: Path) -> None:
    image = big_program(tool, 4)

    def die_halfway(done: int, total: int) -> None:
        if done > total // 2:
            lossy.lose_one_in = 1

    with plctool.connect(link_of(lossy, 0, 1)) as plc:
        plc.flash(counter)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("plctool.link.services.ERASE_PATIENCE", 3.0)
            patch.setattr("plctool.link.connection._OPEN_PATIENCE", 2.0)  # the device waits 1 s for flow control
            with pytest.raises(LinkError, match=r"No device answers|does not answer any more"):
                plc.flash(image, progress=die_halfway)
        lossy.lose_one_in = 0
        status = plc.status()
        assert (status.state, status.image_crc) == ("run", image_crc(counter.read_bytes()))
        arrived: list[int] = []
        assert plc.flash(image, progress=lambda done, total: arrived.append(done)).state == "run"
        assert arrived[0] > image.stat().st_size // 2  # it goes on where it was
        assert plc.read("Main.a[0]") == 4


class _Adapter:
    """An SLCAN adapter on a pseudo terminal of its own, that says what a test wants."""

    def __init__(self) -> None:
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.path = os.ttyname(self._slave)
        self._received = b""

    def say(self, line: str) -> None:
        os.write(self._master, line.encode() + b"\r")

    def expects(self, *lines: str) -> None:
        """Waits for these lines, in this order and next to each other; fails when they do not come."""
        wanted = b"".join(line.encode() + b"\r" for line in lines)
        while wanted not in self._received:
            assert select.select([self._master], [], [], PATIENCE)[0], self._received
            self._received += os.read(self._master, 4096)
        self._received = self._received.partition(wanted)[2]

    def close(self) -> None:
        os.close(self._master)
        os.close(self._slave)


def test_bus_off_that_an_adapter_reports_is_ended_and_logged_once(tmp_path: Path) -> None:
    with closing(_Adapter()) as adapter, Plcrt(tmp_path / "off.flash", "--can", f"slcan:{adapter.path}") as plcrt:
        adapter.expects("C", "S6", "O")
        adapter.expects("F")
        adapter.say("F04")
        for _ in range(3):
            adapter.say("sb256000")
            adapter.expects("C", "S6", "O")
        with plctool.connect(f"serial:{plcrt.port}") as plc:
            said = [entry.text for entry in plc.log() if entry.text.startswith("CAN")]
    assert said == ["CAN: bus off; check the bit rate and the cable"]


def test_a_tool_opens_an_adapter_that_has_the_beginning_of_a_frame() -> None:
    """Of a tool that was killed."""
    with closing(_Adapter()) as adapter:
        line = os.open(adapter.path, os.O_WRONLY | os.O_NOCTTY)
        os.write(line, b"T1F40")
        os.close(line)
        open_bus(f"slcan:{adapter.path}", 500000, 0).shutdown()
        adapter.expects("T1F40O", "C", "S6")


def test_what_is_no_interface_expects(tool: Any) -> None:
    for place, status, said in (
        ("can0", 2, "is not a CAN interface"),
        ("teapot:can0", 2, "is not a CAN interface"),
        ("slcan:/dev/no-such-line", 3, "Cannot open CAN slcan:/dev/no-such-line"),
    ):
        done = tool("status", "--can", place)
        assert (done.status, said in done.err, done.err.count("\n")) == (status, True, 1), done.err


def test_wrong_options_of_plcrt_are_refused(tmp_path: Path) -> None:
    for options, said in (
        (("--node", "0"), "give 1 to 127"),
        (("--node", "128"), "give 1 to 127"),
        (("--bitrate", "fast"), "is not one of CAN"),
        (("--can-base", "0x123"), "is not a base"),
        (("--can", "slcan:/dev/null"), "cannot open CAN"),
        (("--can", "slcan:no-such-line"), "cannot open CAN"),
        (("--can", "no-such-interface"), "cannot open CAN"),
        (("--can", "slcan:pty", "--bitrate", "123456"), "SLCAN has no such bit rate"),
        (("--can", "slcan:pty", "--bitrate", "500000/3000000"), "SLCAN has no such data bit rate"),
    ):
        with pytest.raises(PlcError, match=said):
            Plcrt(tmp_path / "other.flash", *options).start()


def test_an_adapter_that_is_not_plugged_in_is_waited_for(tmp_path: Path) -> None:
    with Plcrt(tmp_path / "flash", "--can", "slcan:/dev/no-such-line") as plcrt:
        assert plcrt.process and plcrt.process.stderr
        assert "CAN slcan:/dev/no-such-line is missing (No such file or directory)" in plcrt.process.stderr.readline()
        with plctool.connect(f"serial:{plcrt.port}") as plc:
            assert any("CAN /dev/no-such-line is away" in entry.text for entry in plc.log())


def test_a_device_that_is_gone_expects(hub: CanHub) -> None:
    with pytest.raises(LinkError, match="No device answers"), plctool.connect(link_of(hub, 0, 55)) as plc:
        plc.identity()
