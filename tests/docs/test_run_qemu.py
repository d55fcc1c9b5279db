"""docs/porting-family.md: a program that never ends in QEMU is ended, so that `meson setup` does not wait for ever."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

from prose import ROOT


def test_a_program_that_does_not_end_is_ended(tmp_path: Path) -> None:
    qemu = tmp_path / "qemu-system-arm"
    qemu.write_text("#!/bin/sh\nexec sleep 1000000\n")
    qemu.chmod(0o755)
    env = os.environ | {"PATH": f"{tmp_path}:{os.environ['PATH']}", "RUN_QEMU_SECONDS": "0.1"}
    command = [ROOT / "tests" / "target" / "run-qemu", "mps2-an385", "test.elf"]
    assert subprocess.run(command, env=env, check=False).returncode == 124
