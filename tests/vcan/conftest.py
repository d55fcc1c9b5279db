"""A bus of a real kernel with three controllers."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from nodes import NODES

from plctool.compiler import compile_sources
from plctool.testing.plcrt import Plcrt

FD = "bitrate=500000/2000000"


@pytest.fixture(scope="module")
def image(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("program")
    source = folder / "counter.st"
    source.write_text(
        "PROGRAM Main VAR count : DINT; t : ARRAY[0..1999] OF DINT := [2000(3)]; END_VAR "
        "count := count + 1; END_PROGRAM"
    )
    compile_sources([source]).write(folder / "counter.cdl")
    return folder / "counter.cdl"


@pytest.fixture(scope="module", params=["classic", "fd"])
def bus(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A bus with three controllers; the link to it, to which options can be added."""
    folder = tmp_path_factory.mktemp("can")
    fd = request.param == "fd"
    interface = "vcan1" if fd else "vcan0"
    more = ("--bitrate", "500000/2000000") if fd else ()
    with ExitStack() as stack:
        for number, name in NODES.items():
            options = ("--can", interface, "--node", str(number), "--name", name, *more)
            stack.enter_context(Plcrt(folder / f"{name}.flash", *options))
        yield f"can:socketcan:{interface}?{FD + '&' if fd else ''}node="
