"""Network variables in the simulator: when they are sent, what is received, and what bad packets do."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

sys.path.append(str(Path(__file__).parents[1]))

from netvar_programs import PROGRAM, SIZE, count_in, telegram

from plctool.compiler import compile_sources
from plctool.compiler.image.build import BuildResult
from plctool.sim import Simulator
from plctool.sim_net import Network


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> BuildResult:
    path = tmp_path_factory.mktemp("program") / "app.st"
    path.write_text(PROGRAM)
    return compile_sources([path])


@pytest.fixture(scope="module")
def shared(built: BuildResult) -> Iterator[Simulator]:
    with Simulator(built.image, built.symbols) as simulator:
        simulator.run_cycles(10)
        yield simulator


@pytest.fixture
def plc(built: BuildResult) -> Iterator[Simulator]:
    with Simulator(built.image, built.symbols) as simulator:
        simulator.write({"Main.to.sAddr": "10.0.0.9"})
        simulator.run_cycles(10)
        yield simulator


def sent(plc: Simulator, ms: float) -> list[int]:
    plc.run_for(ms)
    return [count_in(datagram.data) for datagram in plc.udp_receive()]


def test_list_is_sent_at_first_then_in_its_interval(plc: Simulator) -> None:
    plc.write({"Main.out.count": 5, "Main.interval": "T#100ms", "Main.sends": True})
    assert 9 <= len(sent(plc, 1000)) <= 11
    plc.write({"Main.sends": False})
    plc.run_for(100)
    plc.udp_receive()
    assert sent(plc, 1000) == []


def test_list_is_sent_on_change_and_by_event(plc: Simulator) -> None:
    plc.write({"Main.onChange": True, "Main.sends": True})
    assert sent(plc, 1000) == [0]
    plc.write({"Main.out.count": 6})
    assert sent(plc, 1000) == [6]
    plc.write({"Main.event": True})
    assert sent(plc, 1000) == [6]


def test_simulators_share_a_list(built: BuildResult) -> None:
    network = Network()
    with Simulator(built.image, built.symbols) as one, Simulator(built.image, built.symbols) as two:
        network.connect(one, "10.0.0.1")
        network.connect(two, "10.0.0.2")
        one.write({"Main.to.sAddr": "255.255.255.255", "Main.interval": "T#50ms", "Main.sends": True})
        one.write({"Main.out.name": "saw", "Main.out.count": -3})
        network.run_for(500)
        assert (two.read("Main.in.name"), two.read("Main.in.count")) == ("saw", -3)
        assert two.read("Main.receiver.udiLost") == 0 and not two.read("Main.receiver.xTimeOut")
        one.write({"Main.sends": False})
        network.run_for(1500)
        assert two.read("Main.receiver.xTimeOut")


def test_lost_telegrams_are_counted_and_a_new_beginning_is_not(plc: Simulator) -> None:
    for counter in (65534, 65535, 0, 3, 4, 3):
        plc.udp_send(telegram(counter, counter=counter), 1202)
        plc.run_cycles(3)
    assert (plc.read("Main.receiver.udiLost"), plc.read("Main.receiver.udiReceived")) == (2, 6)


def counts(plc: Simulator) -> tuple[int, ...]:
    names = ("net.udiReceived", "net.udiBad", "receiver.udiReceived", "receiver.udiBad")
    return tuple(int(plc.read(f"Main.{name}")) for name in names)


CHANGES = st.lists(st.tuples(st.integers(0, SIZE - 1), st.integers(0, 255)), max_size=3)
GOOD = telegram(1)


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(changes=CHANGES, size=st.one_of(st.just(SIZE), st.integers(0, SIZE), st.integers(0, 600)), random=st.binary())
def test_bad_packets_are_refused_and_counted(shared: Simulator, changes, size: int, random: bytes) -> None:
    packet = bytearray(GOOD)
    for at, value in changes:
        packet[at] = value
    packet = bytes((packet + random * 600)[:size]) if random else bytes(packet[:size])
    whole = len(packet) == SIZE and packet[:8] == GOOD[:8] and packet[10:12] == b"\0\0" and packet[14:16] == GOOD[14:16]
    listed = (
        len(packet) > 20
        and packet[:8] == GOOD[:8]
        and packet[10:12] == b"\0\0"
        and int.from_bytes(packet[14:16], "little") == len(packet) <= 276
    )
    before = counts(shared)
    values = shared.read("Main.in.count")
    shared.udp_send(packet, 1202)
    shared.run_cycles(6)
    after = counts(shared)
    assert (after[0] - before[0], after[1] - before[1]) == ((1, 0) if listed else (0, 1))
    is_seven = listed and packet[8:10] == GOOD[8:10]
    good = whole and is_seven and packet[12:14] == GOOD[12:14]
    assert (after[2] - before[2], after[3] - before[3]) == (int(good), int(is_seven and not good))
    assert good or shared.read("Main.in.count") == values
