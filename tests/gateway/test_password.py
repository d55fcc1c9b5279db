"""Tools that share a device with a password: each gives it, and none gets in by what another one has opened."""

from __future__ import annotations

import pytest
from served import Served

import plctool
from plctool.core import lib
from plctool.debug.symbols import symbol_path
from plctool.device import Plc
from plctool.errors import DeviceError
from plctool.gateway.frames import Frame, Kind, Request
from plctool.link import bintag, l7, passwords
from plctool.link.passwords import verifier_of

RIGHT, WRONG = "correct horse", "battery staple"


@pytest.fixture(autouse=True)
def locked(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PLC_PASSWORD", raising=False)
    monkeypatch.setattr(passwords, "_ITERATIONS", int(lib.PASSWORD_MIN_ITERATIONS))
    served.plc.password = verifier_of(RIGHT)


def tool(served: Served, password: str | None) -> Plc:
    return plctool.connect(f"serial:{served.line.name}", symbols=symbol_path(served.image), password=password)


@pytest.mark.parametrize(("password", "code"), [(None, "password-needed"), (WRONG, "wrong-password")])
def test_a_tool_without_the_password_is_refused_and_the_other_works_on(
    served: Served, password: str | None, code: str
) -> None:
    with tool(served, RIGHT) as owner, tool(served, password) as stranger:
        assert owner.read("Main.count") == 0
        for _ in range(2):
            with pytest.raises(DeviceError) as refused:
                stranger.write({"Main.count": 1})
            assert refused.value.code == code
        assert owner.read("Main.count") == 0


def test_tools_with_the_password_share_one_login(served: Served) -> None:
    with tool(served, RIGHT) as first, tool(served, RIGHT) as second:
        first.write({"Main.count": 5})
        logins = served.plc.requests.count((lib.SG_DEVICE, lib.SRV_DEV_LOGIN))
        assert second.read("Main.count") == 5
        assert served.plc.requests.count((lib.SG_DEVICE, lib.SRV_DEV_LOGIN)) == logins


@pytest.mark.parametrize("kind", [Kind.EXCHANGE, Kind.STREAM])
def test_a_tool_that_guesses_the_generation_gets_nothing(served: Served, kind: Kind) -> None:
    with tool(served, RIGHT) as owner:
        owner.read("Main.count")
        status = l7.encode(l7.Message(lib.SG_APPLICATION, lib.SRV_APP_READ_STATUS, served.plc.LOGIN, bintag.encode([])))
        before = list(served.plc.requests)
        for generation in range(5):
            guest = served.guest()
            guest.send(Frame(kind, 9, Request(generation, 1.0, status).encode()), 5)
            assert guest.receive(30).kind is Kind.FAILED
        assert served.call(served.guest(), "application", generation=1).kind is Kind.FAILED
        assert served.plc.requests == before


def test_a_changed_password_is_needed_by_all(served: Served) -> None:
    with tool(served, RIGHT) as owner, tool(served, RIGHT) as other:
        other.read("Main.count")
        owner.set_password(WRONG)
        with pytest.raises(DeviceError) as refused:
            other.read("Main.count")
        assert refused.value.code == "wrong-password"
    with tool(served, WRONG) as later:
        assert later.read("Main.count") == 0


def test_the_gateway_logs_in_again_with_the_password_of_the_tool_that_asks(served: Served) -> None:
    with tool(served, RIGHT) as owner:
        owner.read("Main.count")
        served.device.restart()
        with tool(served, None) as stranger, pytest.raises(DeviceError):
            stranger.read("Main.count")
        assert owner.read("Main.count") == 0
