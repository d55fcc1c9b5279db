"""Where commands take passwords from, and `plctool passwd`."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from fake_device import FakePlc

from plctool.core import lib
from plctool.link import passwords
from plctool.link.passwords import verifier_of

PORT = ("--port", "/dev/fake")
RIGHT, OTHER = "correct horse", "battery staple"


@pytest.fixture(autouse=True)
def nothing_is_given(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PLC_PASSWORD", raising=False)
    monkeypatch.delenv("PLC_NEW_PASSWORD", raising=False)
    monkeypatch.setattr(passwords, "_ITERATIONS", int(lib.PASSWORD_MIN_ITERATIONS))


@pytest.fixture
def types(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[str]]:
    """A user at a terminal who types these answers; returns what was asked, as it comes."""

    def use(*answers: str) -> list[str]:
        typed: Iterator[str] = iter(answers)
        asked: list[str] = []

        def getpass(prompt: str) -> str:
            asked.append(prompt)
            return next(typed)

        monkeypatch.setattr("plctool.cli.passwords.getpass", getpass)
        monkeypatch.setattr("plctool.cli.passwords._has_terminal", lambda: True)
        return asked

    return use


@pytest.fixture
def locked(plc: FakePlc) -> FakePlc:
    plc.password = verifier_of(RIGHT)
    return plc


def test_without_a_password_on_the_device_nobody_is_asked(tool: Any, plc: FakePlc, types: Any) -> None:
    asked = types()
    assert tool("status", *PORT).status == 0
    assert asked == []


def test_at_a_terminal_it_is_asked_for_once(tool: Any, locked: FakePlc, types: Any, image: Path) -> None:
    asked = types(RIGHT)
    assert tool("flash", *PORT, str(image)).status == 0
    assert len(asked) == 1


def test_the_environment_comes_before_the_terminal(
    tool: Any, locked: FakePlc, types: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = types()
    monkeypatch.setenv("PLC_PASSWORD", RIGHT)
    assert tool("status", *PORT).status == 0
    assert asked == []


def test_a_file_comes_before_the_environment(
    tool: Any, locked: FakePlc, scratch: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PLC_PASSWORD", OTHER)
    (scratch / "password").write_text(f"{RIGHT}\nand a comment\n")
    assert tool("status", *PORT, "--password-file", "password").status == 0


@pytest.mark.parametrize(("content", "words"), [(None, "cannot be read"), (b"", "is empty"), (b"\xff", "not UTF-8")])
def test_a_password_file_that_cannot_be_used(
    tool: Any, locked: FakePlc, scratch: Path, content: bytes | None, words: str
) -> None:
    if content is not None:
        (scratch / "password").write_bytes(content)
    done = tool("status", *PORT, "--password-file", "password")
    assert done.status == 2 and words in done.err


def test_a_password_in_the_environment_that_is_no_text(
    tool: Any, locked: FakePlc, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PLC_PASSWORD", os.fsdecode(b"schl\xfcssel"))
    done = tool("status", *PORT)
    assert done.status == 2 and "The password is not UTF-8" in done.err


def test_without_a_terminal_the_error_says_what_to_do(tool: Any, locked: FakePlc) -> None:
    done = tool("status", *PORT)
    assert done.status == 1
    assert "--password-file" in done.err and "PLC_PASSWORD" in done.err


def test_a_wrong_one_is_an_error(tool: Any, locked: FakePlc, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PLC_PASSWORD", OTHER)
    done = tool("status", *PORT, "--json")
    assert (done.status, done.json["error"]["code"]) == (1, "wrong-password")


def test_a_new_one_is_typed_twice(tool: Any, plc: FakePlc, types: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = types(RIGHT, RIGHT)
    done = tool("passwd", *PORT)
    assert (done.status, done.out) == (0, "The password is set.\n")
    assert len(asked) == 2
    monkeypatch.setenv("PLC_PASSWORD", RIGHT)
    assert tool("status", *PORT).status == 0


def test_two_that_differ_change_nothing(tool: Any, plc: FakePlc, types: Any) -> None:
    types(RIGHT, OTHER)
    assert tool("passwd", *PORT).status == 2
    assert plc.password == b""


def test_the_present_one_is_asked_for_first(tool: Any, locked: FakePlc, types: Any) -> None:
    asked = types(RIGHT, OTHER, OTHER)
    assert tool("passwd", *PORT).status == 0
    assert asked[0].startswith("Password of the device")
    types(OTHER)
    assert tool("passwd", "--remove", *PORT).out == "The device has no password now.\n"
    assert not any(locked.password)


def test_without_a_terminal_a_new_one_has_to_be_given(tool: Any, plc: FakePlc) -> None:
    done = tool("passwd", *PORT)
    assert done.status == 2 and "PLC_NEW_PASSWORD" in done.err
    assert plc.password == b""


def test_no_password_is_taken_from_the_arguments(tool: Any, plc: FakePlc) -> None:
    assert tool("passwd", RIGHT, *PORT).status == 2
