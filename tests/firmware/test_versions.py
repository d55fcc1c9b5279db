"""The version of a release is one number: what `meson.build` says is what the runtime tells its tools."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_runtime_and_package_have_the_same_version() -> None:
    package = re.search(r"^  version: '(\d+)\.(\d+)\.(\d+)'", (ROOT / "meson.build").read_text(), re.MULTILINE)
    runtime = re.search(r"RTS_VERSION = 0x([0-9A-F]{8})", (ROOT / "firmware/include/CmpDevice.h").read_text())
    assert package is not None
    assert runtime is not None
    assert [int(part) for part in package.groups()] + [0] == list(bytes.fromhex(runtime[1]))
