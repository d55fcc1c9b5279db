"""What the runtime adds on Cortex-M, in instructions: a task cycle, a task switch, the read of a variable."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BOARDS = {"mps2-an385": "build-cm3", "mps2-an386": "build-cm4f"}
FIRMWARE = "firmware/port/baremetal/firmware-{}.elf"
CONFIGS = ("standard", "full")  # the second one has lines of the board


def main() -> None:
    for machine, build, config in ((*board, config) for board in BOARDS.items() for config in CONFIGS):
        firmware = ROOT / build / FIRMWARE.format(config)
        print()
        if shutil.which("qemu-system-arm") is None:
            print(f"{machine}: left out, qemu-system-arm not found")
        elif not firmware.exists():
            print(f"{machine}: left out, there is no {firmware.relative_to(ROOT)}; `make all` builds it")
        else:
            sys.stdout.flush()
            subprocess.run([sys.executable, ROOT / "tests/target/overhead.py", machine, firmware], check=True)


if __name__ == "__main__":
    main()
