"""What a program does with sockets in the simulator; the rest of the promise is in tests/socket_programs.py."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from socket_programs import FLOOD, LONG, NO_CONNECTION, PROGRAM, STEPS, ProgramSockets, check_flood, check_steps

from plctool.compiler import compile_sources
from plctool.compiler.image.build import BuildResult
from plctool.controller import Controller
from plctool.errors import UsageError
from plctool.sim import Simulator
from plctool.sim_net import Network


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> BuildResult:
    path = tmp_path_factory.mktemp("program") / "app.st"
    path.write_text(PROGRAM)
    return compile_sources([path])


@pytest.fixture
def plc(built: BuildResult) -> Iterator[Simulator]:
    with Simulator(built.image, built.symbols) as simulator:
        yield simulator


@pytest.fixture
def port() -> int:
    return 5000


def run_until(run: Callable[[], object], condition: Callable[[], Any]) -> None:
    for _ in range(2000):
        if condition():
            return
        run()
    raise AssertionError("the program does not come to an end")


class TestSimulator(ProgramSockets):
    def wait(self, plc: Controller, condition: Callable[[], Any]) -> None:
        assert isinstance(plc, Simulator)
        run_until(lambda: plc.run_cycles(1), condition)

    def stopped(self, plc: Controller, port: int) -> None:
        assert isinstance(plc, Simulator)
        plc.run_for(100)


def test_simulators_on_a_network_reach_each_other(built: BuildResult) -> None:
    network = Network()
    with Simulator(built.image, built.symbols) as one, Simulator(built.image, built.symbols) as two:
        network.connect(one, "10.0.0.1")
        network.connect(two, "10.0.0.2")
        one.write({"Main.port": 5000, "Main.serve": True, "Main.listen": True})
        two.write({"Main.port": 5000, "Main.address.sAddr": "10.0.0.1", "Main.listen": True})
        network.run_for(200)
        two.write({"Main.connect": True, "Main.talk": True})
        run_until(lambda: network.run_for(50), lambda: two.read("Main.got") == LONG)
        assert two.read("Main.good") and one.now_ns == two.now_ns
        one.write({"Main.to.sAddr": "10.0.0.255", "Main.toPort": 5000, "Main.shout": True})
        run_until(lambda: network.run_for(50), lambda: two.read("Main.datagrams") and one.read("Main.datagrams"))
        assert two.read("Main.receive.ipFrom.sAddr") == "10.0.0.1"
        one.write({"Main.serve": False})
        run_until(lambda: network.run_for(50), lambda: two.read("Main.clientRead.fetch.calls.code") == NO_CONNECTION)
        with pytest.raises(UsageError, match=r"10\.0\.0\.1 is in use"):
            network.connect(two, "10.0.0.1")


def test_host_sends_datagrams_and_gets_the_answers(plc: Simulator) -> None:
    plc.write({"Main.port": 5000, "Main.listen": True})
    run_until(lambda: plc.run_cycles(1), lambda: plc.read("Main.peer.xActive"))
    plc.udp_send(b"hello", 5000, sender=("10.0.0.9", 77))
    plc.run_for(200)
    (answer,) = plc.udp_receive()
    assert (answer.data, answer.to_ip, answer.to_port, answer.from_port) == (b"hello", "10.0.0.9", 77, 5000)
    with pytest.raises(UsageError, match="at most 2048 bytes"):
        plc.udp_send(bytes(2049), 5000)
    with pytest.raises(UsageError, match="is not an IPv4 address"):
        plc.udp_send(b"", 5000, sender=("nobody", 1))


def test_datagram_longer_than_the_buffer_is_an_error(plc: Simulator) -> None:
    plc.write({"Main.port": 5000, "Main.listen": True, "Main.small": 4})
    run_until(lambda: plc.run_cycles(1), lambda: plc.read("Main.peer.xActive"))
    plc.udp_send(b"hello", 5000)
    run_until(lambda: plc.run_cycles(1), lambda: plc.read("Main.receive.fetch.calls.code") == 6005)


def test_functions_of_syslibsockets_reach_each_other(tmp_path: Path) -> None:
    source = tmp_path / "steps.st"
    source.write_text(STEPS)
    with Simulator.from_sources(source) as plc:
        check_steps(plc, 5020, lambda condition: run_until(lambda: plc.run_cycles(1), condition))


def test_program_that_opens_and_never_closes_is_refused_past_the_limit(tmp_path: Path) -> None:
    source = tmp_path / "flood.st"
    source.write_text(FLOOD)
    with Simulator.from_sources(source) as plc:
        check_flood(plc, lambda condition: run_until(lambda: plc.run_cycles(1), condition), lambda: plc.run_for(100))
