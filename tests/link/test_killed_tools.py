"""A tool that is killed between any two packets of an operation leaves a device that is as before, or done."""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import pytest
from small_app import make_application

from plctool.core import lib
from plctool.device import Plc
from plctool.errors import DeviceError
from plctool.image.file import image_crc
from plctool.link.connection import Connection
from plctool.link.sim import SimTransport

pytestmark = pytest.mark.skipif(platform.machine() != "x86_64", reason="the application's code is for x86-64")

OLD, NEW = make_application("1")[0], make_application("2", 9000)[0]
PASSWORD = "nine green bottles"
IDLE_NS = 6_000_000_000  # after which a device has forgotten a silent tool

State = tuple[str, int]
OLD_RUNS, NEW_RUNS = ("run", image_crc(OLD)), ("run", image_crc(NEW))
OLD_STOPPED, NEW_STOPPED = ("stop", image_crc(OLD)), ("stop", image_crc(NEW))
EMPTY = ("none", 0)


class Killed(BaseException):
    """What ends a tool; nothing catches it."""


class MortalTransport(SimTransport):
    """Takes `packets` packets, then the tool is killed."""

    def __init__(self, packets: int) -> None:
        self._left = packets

    def send(self, *packets: bytes) -> None:
        for packet in packets:
            if not self._left:
                raise Killed
            self._left -= 1
            super().send(packet)


@dataclass(frozen=True)
class Operation:
    """`before`: with which of the two states the device begins; `ends`: those that it may be in afterwards."""

    run: Callable[[Plc], object]
    before: State
    ends: set[State]


OPERATIONS = {
    "flash": Operation(lambda plc: plc.flash(NEW), OLD_RUNS, {OLD_RUNS, NEW_RUNS}),
    "flash of a stopped program": Operation(lambda plc: plc.flash(NEW), OLD_STOPPED, {OLD_STOPPED, NEW_RUNS}),
    "flash of the program it has": Operation(lambda plc: plc.flash(OLD), OLD_STOPPED, {OLD_STOPPED, OLD_RUNS}),
    "flash --force": Operation(lambda plc: plc.flash(OLD, force=True), OLD_RUNS, {OLD_RUNS}),
    "first flash": Operation(lambda plc: plc.flash(NEW), EMPTY, {EMPTY, NEW_RUNS}),
    "flash --no-start": Operation(lambda plc: plc.flash(NEW, start=False), OLD_RUNS, {OLD_RUNS, NEW_STOPPED}),
    "stop": Operation(lambda plc: plc.stop(), OLD_RUNS, {OLD_RUNS, OLD_STOPPED}),
    "start": Operation(lambda plc: plc.start(), OLD_STOPPED, {OLD_RUNS, OLD_STOPPED}),
    "reset warm": Operation(lambda plc: plc.reset("warm"), OLD_RUNS, {OLD_RUNS, OLD_STOPPED}),
    "reset cold": Operation(lambda plc: plc.reset("cold"), OLD_RUNS, {OLD_RUNS, OLD_STOPPED}),
    "reset origin": Operation(lambda plc: plc.reset("origin"), OLD_RUNS, {OLD_RUNS, EMPTY}),
}


@pytest.fixture(autouse=True)
def runtime() -> Iterator[None]:
    yield
    lib.SimStop()


def power_on(state: State) -> None:
    """A controller in that state."""
    lib.SimStop()
    assert lib.SimFlashConfigure(1 << 20, 4096, 8, 0xFF) == lib.ERR_OK
    assert lib.SimStart() == lib.ERR_OK
    if state != EMPTY:
        with Plc(Connection(SimTransport())) as plc:
            plc.flash(OLD, start=state == OLD_RUNS)


def killed_everywhere(before: State, run: Callable[[Plc], object]) -> Iterator[int]:
    """Carries out an operation again and again, with a tool that is killed after one packet, two, .. Yields when the
    device has forgotten the tool; ends when the tool has come to its end."""
    for packets in range(1000):
        power_on(before)
        try:
            run(Plc(Connection(MortalTransport(packets))))
            return
        except Killed:
            lib.SimLinkReset()
            assert lib.SimAdvance(IDLE_NS) == lib.ERR_OK
            yield packets
    raise AssertionError("the operation does not end")


@pytest.mark.parametrize("name", OPERATIONS)
def test_a_killed_tool_leaves_the_program_as_it_was_or_as_it_shall_be(name: str) -> None:
    operation, found = OPERATIONS[name], set[State]()
    for packets in killed_everywhere(operation.before, operation.run):
        with Plc(Connection(SimTransport())) as plc:
            status = plc.raw_status()
        state = (str(status.state), status.image_crc)
        assert state in operation.ends, f"killed after {packets} packets"
        found.add(state)
    assert found == operation.ends


def test_a_killed_tool_leaves_no_password_or_the_new_one() -> None:
    protected = set()
    for _ in killed_everywhere(OLD_RUNS, lambda plc: plc.set_password(PASSWORD)):
        with Plc(Connection(SimTransport()), ask_password=lambda: PASSWORD) as plc:
            assert plc.raw_status().state == "run"
            protected.add(plc._session.password)
    assert protected == {None, PASSWORD}
    with Plc(Connection(SimTransport())) as plc, pytest.raises(DeviceError, match="password"):
        plc.raw_status()
