"""Devices whose vendor has numbers for them: programs and checks are built for that device alone."""

from __future__ import annotations

from pathlib import Path

import pytest
from conftest import Tool

from plctool.errors import UsageError
from plctool.image.file import parse_image
from plctool.link.l7 import why
from plctool.link.services import Identity
from plctool.port_check.bench import target_of

DEVICE = "target = 'rv32imac'\nvendor_id = 0x1234\ndevice_id = 5\n"
IDENTITY = Identity("IO-16", "Acme", "node", "1", 0x1000, 0x12340005, "1.0.0.0", "1.0.0.0")


@pytest.fixture
def program(scratch: Path) -> Path:
    (scratch / "device.toml").write_text(DEVICE)
    (scratch / "main.io.toml").write_text("device = 'device.toml'\n")
    (scratch / "main.st").write_text("PROGRAM Main END_PROGRAM\n")
    return scratch / "main.st"


def test_image_is_for_the_device_and_info_shows_its_numbers(tool: Tool, program: Path) -> None:
    assert tool("build", str(program), "-o", "own.cdl").status == 0
    assert parse_image(Path("own.cdl").read_bytes()).device_id == 0x12340005
    assert tool("info", "own.cdl", "--json").json["target"] == "1234:0005"


def test_image_for_the_simulator_is_for_any(tool: Tool, program: Path) -> None:
    assert tool("build", str(program), "--target", "x86_64-linux", "-o", "any.cdl").status == 0
    assert parse_image(Path("any.cdl").read_bytes()).device_id == 0x9001
    assert tool("run", "any.cdl", "--cycles", "1").status == 0


def test_firmware_of_another_device_is_refused_before_it_is_flashed(tool: Tool, program: Path) -> None:
    Path("device.toml").write_text(DEVICE.replace("rv32imac", "cortex-m3"))
    done = tool("build", str(program), "--board", "mps2-an385/full")
    assert done.status == 2
    assert "describes the device 1234:0005, MPS2 AN385 (full) is cortex-m3; build the firmware with" in done.err


def test_refusal_of_a_device_names_both() -> None:
    refused = "The image is for device id 0x{}, this device is 0x{}: build it for this target."
    other, own = (why(1, refused.format(*numbers)) for numbers in (("9004", "12340005"), ("12340005", "9004")))
    assert "for cortex-m3, this device is 1234:0005: build it with the device.toml" in other
    assert "for 1234:0005, this device is cortex-m3: build it with --target cortex-m3" in own


def test_port_check_needs_the_file_of_the_device(scratch: Path) -> None:
    (scratch / "device.toml").write_text(DEVICE)
    (scratch / "other.toml").write_text(DEVICE.replace("5", "6"))
    assert target_of(IDENTITY, scratch / "device.toml") == "rv32imac"
    for device in (None, scratch / "other.toml"):
        with pytest.raises(UsageError, match=r"does not know the processor of 1234:0005; name the file .* by --device"):
            target_of(IDENTITY, device)
