"""The page of a real plcrt: over a link that is lost and found, through the gateway, with a password."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from conftest import Browser, Page

from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import PATIENCE


def run(folder: Path, *words: str, **environment: str) -> None:
    env = os.environ | {"XDG_CACHE_HOME": str(folder / "cache")} | environment
    subprocess.run(
        [sys.executable, "-m", "plctool", *words],
        cwd=folder,
        env=env,
        check=True,
        capture_output=True,
        timeout=PATIENCE,
    )


@pytest.fixture
def plcrt(folder: Path, tmp_path: Path) -> Iterator[Plcrt]:
    """Runs the program; its symbols are in the cache of `folder`."""
    with Plcrt(tmp_path / "plc.flash") as running:
        run(folder, "flash", "--port", running.port, "--no-gateway", "app.cdl")
        yield running


@pytest.mark.parametrize("options", [["--no-gateway"], []], ids=["own", "gateway"])
def test_a_lost_device_is_found_again(folder: Path, plcrt: Plcrt, options: list[str]) -> None:
    page = Page(folder, "--port", plcrt.port, *options, PLCTOOL_PATIENCE="1")
    with (browser := Browser(page)).socket:
        browser.ready().ask("show", names=["Main.n", "Main.still"], views=["tasks", "log", "io"])
        browser.until(lambda b: len(b.values) == 2 and {"tasks", "log", "io"} <= set(b.topics))
        plcrt.stop(signal.SIGKILL)
        browser.until(lambda b: not b.topics["link"]["connected"])
        assert browser.topics["link"]["message"]
        refused = browser.ask("write", name="Main.still", text="8")
        assert "error" in refused
        plcrt.start()
        browser.until(lambda b: b.topics["link"]["connected"])
        browser.values.clear()
        browser.until(lambda b: "Main.n" in b.values)
        assert "error" not in browser.ask("write", name="Main.still", text="8")
        browser.until(lambda b: b.values.get("Main.still", [""])[0] == "8")
    assert page.end() == 0


def test_another_program_is_shown_with_its_own_variables(folder: Path, plcrt: Plcrt) -> None:
    (folder / "other.st").write_text("PROGRAM Other VAR count : INT; END_VAR count := count + 1; END_PROGRAM")
    run(folder, "build", "other.st", "-o", "other.cdl")
    page = Page(folder, "--port", plcrt.port)
    with (browser := Browser(page)).socket:
        crc = browser.ready().topics["symbols"]["crc"]
        browser.ask("show", names=["Main.n", "Other.count"], views=[])
        run(folder, "flash", "--port", plcrt.port, "other.cdl")
        browser.until(lambda b: b.topics["symbols"]["crc"] not in (crc, None))
        browser.until(lambda b: b.values.get("Other.count", ["", False, None, ""])[2])
        assert browser.values["Main.n"][3]
    assert page.end() == 0


def test_a_device_with_a_password_gets_it(folder: Path, plcrt: Plcrt) -> None:
    run(folder, "passwd", "--port", plcrt.port, "--no-gateway", PLC_NEW_PASSWORD="a long one")
    page = Page(folder, "--port", plcrt.port, "--no-gateway", PLC_PASSWORD="a long one")
    with (browser := Browser(page)).socket:
        browser.ready().ask("show", names=["Main.n"], views=[])
        browser.until(lambda b: b.values)
    assert page.end() == 0
    with pytest.raises(AssertionError, match="password"):
        Page(folder, "--port", plcrt.port, "--no-gateway", PLC_PASSWORD="a wrong one")


def test_no_device_is_an_error_at_the_start(folder: Path) -> None:
    with pytest.raises(AssertionError, match="nothing\\.tty"):
        Page(folder, "--port", str(folder / "nothing.tty"))


def test_a_program_without_symbols_still_has_its_state(folder: Path, plcrt: Plcrt, tmp_path: Path) -> None:
    page = Page(folder, "--port", plcrt.port, XDG_CACHE_HOME=str(tmp_path / "empty"))
    with (browser := Browser(page)).socket:
        browser.until(lambda b: "status" in b.topics and "symbols" in b.topics)
        assert browser.topics["status"]["state"] == "run"
        assert browser.topics["symbols"]["crc"] is None
        assert "There are no symbols" in browser.topics["symbols"]["message"]
        assert browser.ask("children", path="", start=0)["error"] == "The symbols of the program are not known."
    assert page.end() == 0
