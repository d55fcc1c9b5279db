"""Network variables over CAN in the simulator: the frames of a list, and what happens to lists that are not whole."""

from __future__ import annotations

import struct
import sys
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from netvar_programs import OVER_CAN

from plctool.compiler import compile_sources
from plctool.compiler.image.build import BuildResult
from plctool.sim import Simulator

_DATA = struct.Struct("<?f11si")
FIRST = 0x340


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> BuildResult:
    path: Path = tmp_path_factory.mktemp("program") / "app.st"
    path.write_text(OVER_CAN)
    return compile_sources([path])


@pytest.fixture
def plc(built: BuildResult) -> Iterator[Simulator]:
    with Simulator(built.image, built.symbols) as simulator:
        simulator.run_cycles(10)
        yield simulator


def parts(count: int) -> list[bytes]:
    data = _DATA.pack(True, 1.5, b"press", count)
    return [data[i : i + 8] for i in range(0, len(data), 8)]


def put(plc: Simulator, *frames: tuple[int, bytes]) -> None:
    for part, data in frames:
        plc.can_send(FIRST + part, data)
    plc.run_for(30)


def whole(count: int) -> list[tuple[int, bytes]]:
    return list(enumerate(parts(count)))


def test_list_is_sent_in_frames_that_count_up(plc: Simulator) -> None:
    plc.write({"Main.out.running": True, "Main.out.speed": 1.5, "Main.out.name": "press", "Main.out.count": -3})
    plc.write({"Main.sends": True})
    plc.run_for(100)
    frames = plc.can_receive()
    assert [(f.id - 0x300, f.data) for f in frames] == whole(-3)
    assert plc.read("Main.sender.udiSent") == 1
    assert not plc.read("Main.sender.xError")


def test_list_is_sent_in_its_interval_on_change_and_by_event(plc: Simulator) -> None:
    plc.write({"Main.interval": "T#100ms", "Main.sends": True})
    plc.run_for(1000)
    assert 9 * 3 <= len(plc.can_receive()) <= 11 * 3
    plc.write({"Main.interval": "T#0ms"})
    plc.run_for(100)
    plc.can_receive()
    plc.write({"Main.onChange": True, "Main.out.count": 6})
    plc.run_for(200)
    assert len(plc.can_receive()) == 3
    plc.write({"Main.event": True})
    plc.run_for(200)
    assert len(plc.can_receive()) == 3


def test_list_is_received(plc: Simulator) -> None:
    put(plc, *whole(42))
    assert (plc.read("Main.in.count"), plc.read("Main.in.name"), plc.read("Main.in.speed")) == (42, "press", 1.5)
    assert (plc.read("Main.receiver.udiReceived"), plc.read("Main.receiver.udiLost")) == (1, 0)


@pytest.mark.parametrize("missing", [0, 1, 2])
def test_list_with_a_missing_frame_changes_nothing_and_is_counted_once(plc: Simulator, missing: int) -> None:
    put(plc, *whole(1))
    put(plc, *[frame for frame in whole(2) if frame[0] != missing])
    assert plc.read("Main.in.count") == 1
    put(plc, *whole(3))
    assert plc.read("Main.in.count") == 3
    assert (plc.read("Main.receiver.udiReceived"), plc.read("Main.receiver.udiLost")) == (2, 1)


def test_values_of_two_lists_are_not_mixed_by_up_to_two_lost_frames(plc: Simulator) -> None:
    lists = [_DATA.pack(True, value, name, value) for value, name in ((1, b"one"), (2, b"two"), (3, b"three"))]
    frames = [(i // 8, data[i : i + 8]) for data in lists for i in range(0, len(data), 8)]
    values = {(1, "one"), (2, "two"), (3, "three")}
    for lost in (*combinations(range(9), 1), *combinations(range(9), 2)):
        put(plc, *[frame for number, frame in enumerate(frames) if number not in lost])
        assert plc.read("Main.in.speed") == plc.read("Main.in.count")
        assert (plc.read("Main.in.count"), plc.read("Main.in.name")) in values


def test_frames_of_another_length_or_identifier_are_not_taken(plc: Simulator) -> None:
    put(plc, (0, b"\1" * 8), (1, b"\1" * 7), (2, b"\1" * 4), (3, b"\1" * 4), (-1, b"\1" * 8))
    assert plc.read("Main.receiver.udiReceived") == 0
    assert plc.read("Main.receiver.udiBad") == 1


def test_time_out_is_reported(plc: Simulator) -> None:
    put(plc, *whole(1))
    assert not plc.read("Main.receiver.xTimeOut")
    plc.run_for(1200)
    assert plc.read("Main.receiver.xTimeOut")


@pytest.mark.parametrize(("name", "value"), [("id", 0x7FE), ("size", 0), ("size", 257)])
def test_list_that_cannot_be_is_an_error(plc: Simulator, name: str, value: int) -> None:
    plc.write({f"Main.{name}": value, "Main.sends": True})
    plc.run_for(50)
    assert plc.read("Main.sender.uiErrorID") == 0x203
    assert plc.can_receive() == []


def test_two_simulators_share_a_list(built: BuildResult) -> None:
    with Simulator(built.image, built.symbols) as one, Simulator(built.image, built.symbols) as two:
        one.write({"Main.id": FIRST, "Main.sends": True, "Main.onChange": True, "Main.out.count": 77})
        for _ in range(10):
            one.run_for(20)
            for frame in one.can_receive():
                two.can_send(frame.id, frame.data)
            two.run_for(20)
        assert two.read("Main.in.count") == 77
