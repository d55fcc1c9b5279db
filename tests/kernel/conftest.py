"""A plcrt on the kernel of the virtual machine, and programs with a description."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from plctool.compiler import IoFiles, compile_sources
from plctool.device import Plc, connect
from plctool.testing.plcrt import Plcrt


@pytest.fixture(scope="module")
def image(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """PROGRAM with DESCRIPTION of the module that asks."""
    return build(tmp_path_factory.mktemp("program"), request.module.PROGRAM, request.module.DESCRIPTION)


@pytest.fixture(scope="module")
def event_image(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """EVENT_PROGRAM with EVENT_DESCRIPTION of the module that asks."""
    return build(tmp_path_factory.mktemp("events"), request.module.EVENT_PROGRAM, request.module.EVENT_DESCRIPTION)


def build(folder: Path, program: str, description: str) -> Path:
    (folder / "main.st").write_text(program)
    (folder / "main.io.toml").write_text(description)
    compile_sources([folder / "main.st"], io=IoFiles(device=None)).write(folder / "main.cdl")
    return folder / "main.cdl"


@pytest.fixture
def plc(tmp_path: Path) -> Iterator[Plc]:
    """By TCP, which needs no gateway: to start one takes an emulated processor long."""
    with Plcrt(tmp_path / "plc.flash", "--tcp", "0") as plcrt, connect(f"tcp:{plcrt.tcp}") as plc:
        yield plc
