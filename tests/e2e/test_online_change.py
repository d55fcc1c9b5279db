"""Online changes on plcrt; the rest of the promise is in tests/changing.py."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from changing import Changing, program
from online_programs import built

from plctool import connect
from plctool.device import Plc
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually


@pytest.fixture
def plc(plcrt: Plcrt, tmp_path: Path) -> Iterator[Plc]:
    plcrt.stop()
    plcrt.options = ("--tcp", "0")
    plcrt.start()
    result = built(tmp_path, program())
    with connect(f"tcp:{plcrt.tcp}") as plc:
        plc.add_symbols(result.symbols)
        plc.flash(result.image)
        eventually(lambda: plc.read("Main.n") > 5)
        yield plc


class TestPlcrt(Changing):
    pass


def test_changed_program_is_what_runs_after_power_off_and_has_its_retain_values(
    plc: Plc, plcrt: Plcrt, tmp_path: Path
) -> None:
    """Also at once, when nothing else was saved since."""
    plc.write({"Main.kept": 123})
    eventually(lambda: plc.read("Main.kept") == 123)
    result = built(tmp_path, program("n := n - 1;"), plc.symbols())
    plc.add_symbols(result.symbols)
    plc.change(result.image)
    plcrt.stop(signal.SIGKILL)
    plcrt.start()
    with connect(f"tcp:{plcrt.tcp}") as again:
        again.add_symbols(result.symbols)
        eventually(lambda: str(again.status().state) == "run")
        assert again.status().image_crc == result.crc
        assert again.read("Main.kept") == 123
        eventually(lambda: again.read("Main.n") < 0)
