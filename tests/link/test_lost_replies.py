"""What the device has done, though its reply is lost with the channel, is done."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from fake_device import FakeDevice, FakeLine, FakePlc, make_image

from plctool.core import lib
from plctool.errors import DeviceError
from plctool.link import services
from plctool.link.connection import Connection
from plctool.link.session import Session


class Forgetful:
    """A controller with an application, whose channel ends right after the next request was carried out."""

    def __init__(self) -> None:
        self.plc = FakePlc()
        self.plc.image, self.plc.state = make_image(1000), lib.AS_RUN
        self.device = FakeDevice(self.handle)
        self.session = Session(Connection(FakeLine(self.device)))
        self.forgets: Callable[[], bool] = lambda: False

    def handle(self, message: bytes) -> bytes:
        reply = self.plc.handle(message)
        if self.forgets():
            self.forgets = lambda: False
            self.device.restart()
        return reply


def test_reset_origin() -> None:
    bench = Forgetful()
    services.read_status(bench.session)
    bench.forgets = lambda: bench.plc.state == lib.AS_NONE
    services.reset(bench.session, lib.RESET_OPTION_ORIGIN)
    assert bench.plc.state == lib.AS_NONE


def test_a_reset_of_a_device_without_an_application_is_refused() -> None:
    bench = Forgetful()
    bench.plc.image, bench.plc.state = b"", lib.AS_NONE
    with pytest.raises(DeviceError):
        services.reset(bench.session, lib.RESET_OPTION_ORIGIN)


def test_what_is_refused_at_once_was_not_done() -> None:
    def refused() -> None:
        raise DeviceError("there is no such file", "no-object", lib.ERR_NO_OBJECT)

    with pytest.raises(DeviceError):
        Forgetful().session.finish(refused, lib.ERR_NO_OBJECT)


def test_the_shell_gets_a_new_channel_when_the_old_one_has_ended() -> None:
    bench = Forgetful()
    first = services.run_shell(bench.session, "rtsinfo")
    bench.device.restart()
    assert services.run_shell(bench.session, "rtsinfo") == first
