"""What packages add to plcrt and plctool; `make deb-test` tries them as a whole."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from test_plcrt_process import run_plcrt

from plctool.core import lib

PACKAGES = Path(__file__).parents[2] / "packages"
UNIT = (PACKAGES / "debian" / "plcrt@.service").read_text()


@pytest.fixture(scope="module")
def usage() -> str:
    return run_plcrt("--help").stdout


def test_the_manual_page_has_each_option_with_its_words(usage: str, tmp_path: Path) -> None:
    (tmp_path / "help").write_text(usage)
    page = subprocess.run(
        [sys.executable, str(PACKAGES / "plcrt_manual.py"), str(tmp_path / "help")],
        capture_output=True,
        text=True,
        check=True,
    ).stdout.replace(r"\-", "-")
    options = re.findall(r"^  (--[a-z-]+)", usage, re.MULTILINE)
    assert options
    for option in options:
        assert re.search(rf"^\.B {option}( [A-Zp]\S*)?\n\w", page, re.MULTILINE), option
    assert "\n.B --no-supervisor\nruns the controller" in page


def test_the_unit_uses_options_that_plcrt_has(usage: str) -> None:
    command = re.search(r"^ExecStart=(.*)$", UNIT, re.MULTILINE)
    assert command
    for option in re.findall(r"--[a-z-]+", command[1]):
        assert f"  {option} " in usage


def test_the_unit_waits_for_as_long_as_an_end_may_take() -> None:
    """PORT_END_MS of rts_config_port.h, after which the supervisor kills the controller."""
    config = (PACKAGES.parent / "firmware/port/linux/rts_config_port.h").read_text()
    end_ms = re.search(r"#define PORT_END_MS (\d+)", config)
    wait_s = re.search(r"^TimeoutStopSec=(\d+)$", UNIT, re.MULTILINE)
    assert end_ms and wait_s and int(wait_s[1]) * 1000 > int(end_ms[1])


def test_the_unit_serves_at_the_address_that_the_documentation_says() -> None:
    assert f"127.0.0.1:{int(lib.TCP_PORT)}" in (PACKAGES / "main.conf").read_text()
    assert "PLCRT_OPTIONS=--tcp\n" in UNIT
