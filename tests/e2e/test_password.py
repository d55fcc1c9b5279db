"""A device with a password: the real tool and the real runtime, over a serial line, a gateway and TCP."""

from __future__ import annotations

import random
import signal
import subprocess
import threading
import time

import pytest

import plctool
from plctool.core import lib
from plctool.errors import DeviceError, PlcError
from plctool.link import passwords
from plctool.testing.plcrt import find_plcrt

RIGHT, OTHER = "correct horse", "battery staple"


@pytest.fixture(autouse=True)
def environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PLC_PASSWORD", raising=False)
    monkeypatch.delenv("PLC_NEW_PASSWORD", raising=False)


def set_password(tool, link, monkeypatch, new, present=None):
    monkeypatch.setenv("PLC_NEW_PASSWORD", new)
    with_password(monkeypatch, present)
    assert tool.ok("passwd", *link) == {"password": True}
    with_password(monkeypatch, None)


def with_password(monkeypatch, password):
    if password is None:
        monkeypatch.delenv("PLC_PASSWORD", raising=False)
    else:
        monkeypatch.setenv("PLC_PASSWORD", password)


def test_with_a_password_every_command_needs_it(tool, link, counter, monkeypatch):
    tool.ok("flash", *link, str(counter))
    set_password(tool, link, monkeypatch, RIGHT)
    for words in (["status"], ["log"], ["tasks"], ["stop"], ["read", "Main.count"], ["flash", str(counter)],
                  ["shell", "rtsinfo"], ["passwd", "--remove"]):  # fmt: skip
        done = tool(*words, *link, "--json")
        assert (done.status, done.json["error"]["code"]) == (1, "password-needed"), words
    assert "PLC_PASSWORD" in done.json["error"]["message"]
    with_password(monkeypatch, RIGHT)
    assert tool.ok("status", *link)["state"] == "run"
    assert tool.ok("read", "Main.count", *link)["values"]["Main.count"] > 0
    assert tool.ok("flash", "--force", *link, str(counter))["state"] == "run"


def test_a_wrong_password_is_refused_and_the_right_one_then_works(tool, link, monkeypatch):
    set_password(tool, link, monkeypatch, RIGHT)
    with_password(monkeypatch, OTHER)
    done = tool("status", *link, "--json")
    assert (done.status, done.json["error"]["code"]) == (1, "wrong-password")
    with_password(monkeypatch, RIGHT)
    assert tool.ok("status", *link)["state"] == "none"


def test_changed_and_removed(tool, link, monkeypatch):
    set_password(tool, link, monkeypatch, RIGHT)
    set_password(tool, link, monkeypatch, OTHER, present=RIGHT)
    with_password(monkeypatch, RIGHT)
    assert tool("status", *link).status == 1
    with_password(monkeypatch, OTHER)
    assert tool.ok("passwd", "--remove", *link) == {"password": False}
    with_password(monkeypatch, None)
    assert tool.ok("status", *link)["state"] == "none"


def test_passwords_come_from_files(tool, plcrt):
    (tool.folder / "old").write_text(f"{RIGHT}\nsecond line\n")
    (tool.folder / "new").write_text(f"{OTHER}\n")
    assert tool.ok("passwd", "--port", plcrt.port, "--new-password-file", "old")["password"]
    assert tool.ok(
        "passwd", "--port", plcrt.port, "--password-file", "old", "--new-password-file", "new"
    )["password"]  # fmt: skip
    assert tool("status", "--port", plcrt.port, "--password-file", "old").status == 1
    assert tool.ok("status", "--port", plcrt.port, "--password-file", "new")["state"] == "none"


@pytest.mark.parametrize("password", ["short", "x" * 257])
def test_a_password_of_a_bad_length_is_not_set(tool, plcrt, monkeypatch, password):
    monkeypatch.setenv("PLC_NEW_PASSWORD", password)
    done = tool("passwd", "--port", plcrt.port)
    assert done.status == 2 and "8 to 256 characters" in done.err
    assert tool.ok("status", "--port", plcrt.port)


def test_scan_needs_none(tool, link, monkeypatch, eventually):
    set_password(tool, link, monkeypatch, RIGHT)
    found = eventually(lambda: (done := tool("scan", *link, "--json")).status == 0 and done.json)
    assert len(found["devices"]) == 1


def test_a_tool_of_the_gateway_that_gives_none_is_refused_while_another_works(tool, plcrt, counter, monkeypatch):
    link = f"serial:{plcrt.port}"
    with plctool.connect(link, password=RIGHT, tool="owner") as owner:
        owner.flash(counter)
        owner.set_password(RIGHT)
        assert owner.status().state == "run"
        for password, code in ((None, "password-needed"), (OTHER, "wrong-password")):
            with plctool.connect(link, password=password, tool="stranger") as stranger:
                for use in (stranger.status, stranger.stop, stranger.identity, lambda: stranger.flash(counter)):
                    with pytest.raises(DeviceError) as refused:
                        use()
                    assert refused.value.code == code
        assert owner.status().state == "run"
        with plctool.connect(link, password=RIGHT, tool="colleague") as colleague:
            assert colleague.status().state == "run"


def test_a_tool_that_came_in_before_the_password_has_to_give_it(plcrt):
    link = f"serial:{plcrt.port}"
    with plctool.connect(link) as before, plctool.connect(link, password=RIGHT) as owner:
        before.status()
        owner.set_password(RIGHT)
        with pytest.raises(DeviceError) as refused:
            before.status()
        assert refused.value.code == "password-needed"
        assert owner.status()


def test_clients_on_other_lines_lose_their_login(plcrt):
    plcrt.stop()
    plcrt.options = ("--tcp", "0")
    plcrt.start()
    with plctool.connect(f"tcp:{plcrt.tcp}") as before, plctool.connect(f"serial:{plcrt.port}") as owner:
        before.status()
        owner.set_password(RIGHT)
        with pytest.raises(DeviceError) as refused:
            before.status()
        assert refused.value.code == "password-needed"


def test_strangers_who_guess_all_the_time_do_not_keep_the_owner_out(plcrt, eventually, monkeypatch):
    # All compute in this process, and the owner has CHANNEL_SETTLE_MS for it.
    monkeypatch.setattr(passwords, "_ITERATIONS", int(lib.PASSWORD_MIN_ITERATIONS))
    plcrt.stop()
    plcrt.options = ("--tcp", "0")
    plcrt.start()
    link = f"tcp:{plcrt.tcp}"
    with plctool.connect(link) as owner:
        owner.set_password(RIGHT)
    over = threading.Event()
    guesses = []

    def guess(number):
        while not over.is_set():
            try:
                with plctool.connect(link, password=f"{OTHER} {number}") as plc:
                    plc.status()
            except PlcError as error:
                guesses.append(error.code)

    strangers = [threading.Thread(target=guess, args=(number,)) for number in range(6)]
    for stranger in strangers:
        stranger.start()
    try:
        while "wrong-password" not in guesses:
            time.sleep(0.01)
        assert eventually(lambda: gets_in(link))
    finally:
        over.set()
        for stranger in strangers:
            stranger.join()


def gets_in(link):
    """All channels may be busy for a moment, and that of the owner may be given away before the password is proved."""
    try:
        with plctool.connect(link, password=RIGHT) as owner:
            return owner.status().state == "none"
    except PlcError:
        return False


def test_it_survives_a_kill_and_plcrt_can_reset_it(tool, plcrt, counter, monkeypatch):
    tool.ok("flash", "--port", plcrt.port, str(counter))
    set_password(tool, ["--port", plcrt.port], monkeypatch, RIGHT)
    plcrt.stop(signal.SIGKILL)
    plcrt.start()
    assert tool("status", "--port", plcrt.port).status == 1
    plcrt.stop()
    reset = [find_plcrt(), "--flash", str(plcrt.flash), "--reset-password"]
    done = subprocess.run(reset, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, "") and "is removed" in done.stdout
    again = subprocess.run(reset, capture_output=True, text=True, timeout=60)
    assert again.returncode == 0 and "There is no password" in again.stdout
    mistyped = plcrt.flash.with_suffix(".mistyped")
    wrong = subprocess.run([*reset, "--flash", str(mistyped)], capture_output=True, text=True, timeout=60)
    assert wrong.returncode != 0 and "No such file" in wrong.stderr and not mistyped.exists()
    plcrt.start()
    assert tool.ok("status", "--port", plcrt.port)["state"] == "run"


@pytest.mark.parametrize("seed", range(3))
def test_a_kill_while_it_is_changed_leaves_the_old_or_the_new_one(plcrt, seed):
    def connect(password):
        return plctool.connect(f"serial:{plcrt.port}", password=password, gateway=False)

    with connect(None) as plc:
        plc.set_password(RIGHT)
    rng = random.Random(seed)
    password, asked = RIGHT, threading.Event()

    def change():
        try:
            with connect(RIGHT) as plc:
                plc.status()
                asked.set()
                plc.set_password(OTHER)
        except PlcError:
            pass  # the device went away

    changing = threading.Thread(target=change)
    changing.start()
    assert asked.wait(60)
    time.sleep(rng.uniform(0, 0.08))  # any moment will do
    plcrt.stop(signal.SIGKILL)
    plcrt.start()
    changing.join()
    worked = []
    for password in (None, RIGHT, OTHER):
        try:
            with connect(password) as plc:
                plc.status()
            worked.append(password)
        except DeviceError:
            pass
    assert worked in ([RIGHT], [OTHER])
