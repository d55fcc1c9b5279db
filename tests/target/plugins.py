"""Plugins of QEMU, which watch what the processor of a board does."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

HERE = Path(__file__).resolve().parent


def compiler() -> str | None:
    """The C compiler of this machine."""
    return shutil.which("cc") or shutil.which("gcc")


def compile_plugin(name: str, qemu: str, folder: Path) -> Path:
    """The plugin of a source beside this file, for the QEMU that is called so. Needs a compiler()."""
    plugin = folder / f"{name}.so"
    version = f"-DVERSION={_interface_version(qemu)}"
    command = [compiler() or "cc", "-O2", "-shared", "-fPIC", version, "-o", plugin, HERE / f"{name}.c"]
    subprocess.run(command, check=True)
    return plugin


def _interface_version(qemu: str) -> int:
    said = subprocess.run([qemu, "--version"], check=True, capture_output=True, text=True).stdout
    found = re.search(r"version (\d+)", said)
    assert found, said
    return 2 if int(found[1]) >= 9 else 1
