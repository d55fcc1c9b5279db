"""Logins with a password: the numbers of the RFC, and a session on a device that has one."""

from __future__ import annotations

import base64
import hashlib
import hmac

import pytest
from fake_device import FakeDevice, FakeLine, FakePlc
from hypothesis import given
from hypothesis import strategies as st
from shares import examples

from plctool.core import lib
from plctool.errors import DeviceError, LinkError, UsageError
from plctool.link import passwords, services
from plctool.link.connection import Connection
from plctool.link.passwords import proof_of, verifier_of
from plctool.link.session import Session
from plctool.link.wire import Layout

CHALLENGE = Layout("DEV_CHALLENGE")
RIGHT, WRONG = "correct horse", "battery staple"
SET = passwords._ITERATIONS  # of the passwords that this tool sets


@pytest.fixture(autouse=True)
def few_iterations(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(passwords, "_ITERATIONS", int(lib.PASSWORD_MIN_ITERATIONS))


def session_on(plc: FakePlc, password: str | None) -> Session:
    return Session(Connection(FakeLine(FakeDevice(plc.handle))), lambda: password)


@pytest.fixture
def plc() -> FakePlc:
    plc = FakePlc()
    plc.password = verifier_of(RIGHT)
    return plc


def test_the_keys_are_those_of_scram_sha_256() -> None:
    """RFC 7677, section 3, whose messages are text."""
    client_first = "n=user,r=rOprNGfwEbeRWgbNEkqO"
    nonce = "rOprNGfwEbeRWgbNEkqO%hvYDpWUa2RaTCAfuxFIlj)hNlF$k0"
    server_first = f"r={nonce},s=W22ZaJ0SNY7soEsUEjb6gQ==,i=4096"
    said = f"{client_first},{server_first},c=biws,r={nonce}".encode()
    key = passwords._client_key("pencil", base64.b64decode("W22ZaJ0SNY7soEsUEjb6gQ=="), 4096)
    signature = hmac.digest(hashlib.sha256(key).digest(), said, "sha256")
    proof = bytes(a ^ b for a, b in zip(key, signature, strict=True))
    assert base64.b64encode(proof) == b"dHzbZapWIk4jUhN+Ute9ytag9zjfMHgsqmmiz7AndVQ="


@given(st.text(min_size=8, max_size=40), st.binary(min_size=16, max_size=16))
@examples(20)
def test_a_proof_shows_the_key_of_the_verifier(password: str, nonce: bytes) -> None:
    verifier = verifier_of(password)
    challenge = nonce + verifier[32:]
    proof = proof_of(password, challenge)
    signature = hmac.digest(verifier[:32], challenge + proof[:16], "sha256")
    assert hashlib.sha256(bytes(a ^ b for a, b in zip(signature, proof[16:], strict=True))).digest() == verifier[:32]


def test_neither_verifier_nor_proof_contain_the_password_or_are_ever_the_same() -> None:
    first, second = verifier_of(RIGHT), verifier_of(RIGHT)
    assert first != second and RIGHT.encode() not in first
    challenge = bytes(16) + first[32:]
    assert proof_of(RIGHT, challenge) != proof_of(RIGHT, challenge)


def test_characters_count_not_how_they_were_composed() -> None:
    assert passwords.is_same("caf\u00e9 noir", "cafe\u0301 noir")
    assert not passwords.is_same("cafe noir", "caf\u00e9 noir")


@pytest.mark.parametrize("iterations", [0, 1, lib.PASSWORD_MIN_ITERATIONS, SET - 1, lib.PASSWORD_MAX_ITERATIONS + 1])
def test_a_challenge_with_fewer_iterations_than_this_tool_sets_is_not_answered(
    monkeypatch: pytest.MonkeyPatch, iterations: int
) -> None:
    monkeypatch.setattr(passwords, "_ITERATIONS", SET)
    with pytest.raises(LinkError, match="easier to guess"):
        proof_of(RIGHT, CHALLENGE.pack(iterations=iterations))


@pytest.mark.parametrize("password", ["", "1234567", "x" * 257])
def test_passwords_have_8_to_256_characters(password: str) -> None:
    with pytest.raises(UsageError, match="8 to 256"):
        verifier_of(password)


def test_no_password_is_all_zero() -> None:
    assert not any(verifier_of(None))


def test_a_session_logs_in_with_it(plc: FakePlc) -> None:
    session = session_on(plc, RIGHT)
    assert services.read_status(session).state == "none"
    assert session.password == RIGHT


def test_a_session_without_it_says_what_to_do(plc: FakePlc) -> None:
    with pytest.raises(DeviceError, match="PLC_PASSWORD") as refused:
        services.read_status(session_on(plc, None))
    assert refused.value.code == "password-needed"
    assert plc.wrong == 0


def test_a_wrong_one_is_tried_once(plc: FakePlc) -> None:
    with pytest.raises(DeviceError) as refused:
        services.read_status(session_on(plc, WRONG))
    assert (refused.value.code, plc.wrong) == ("wrong-password", 1)


def test_without_a_password_on_the_device_nobody_is_asked() -> None:
    def ask() -> str:
        raise AssertionError("asked")

    session = Session(Connection(FakeLine(FakeDevice(FakePlc().handle))), ask)
    services.read_status(session)
    assert session.password is None


def test_a_session_waits_for_the_pause_after_the_wrong_one_of_another(plc: FakePlc) -> None:
    """Also when the clock of a busy device runs at a sixth of ours."""
    plc.pauses = 40
    session = session_on(plc, RIGHT)
    services.read_status(session)
    assert 3.9 < session.connection.now() < 6


def test_a_pause_without_end_is_given_up(plc: FakePlc) -> None:
    plc.pauses = 1000
    with pytest.raises(DeviceError) as refused:
        services.read_status(session_on(plc, RIGHT))
    assert refused.value.code == "password-not-taken"
    assert plc.pauses > 900


def test_it_is_set_and_removed(plc: FakePlc) -> None:
    services.set_password(session_on(plc, RIGHT), WRONG)
    services.read_status(session_on(plc, WRONG))
    services.set_password(session_on(plc, WRONG), None)
    services.read_status(session_on(plc, None))


def test_a_firmware_without_passwords_says_so() -> None:
    plc = FakePlc()
    handlers = plc._handlers()
    del handlers[(lib.SG_USERMGR, lib.SRV_USER_SET_CREDENTIALS)]
    plc._handlers = lambda: handlers  # type: ignore[method-assign]
    with pytest.raises(DeviceError) as refused:
        services.set_password(session_on(plc, None), RIGHT)
    assert refused.value.code == "no-passwords"
