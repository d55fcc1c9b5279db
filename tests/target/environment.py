"""What the tests run on. Environment: FIRMWARE_DIR (where firmware-*.elf are), QEMU_MACHINE,
FIRMWARE_CONFIG (the configuration of tests that do not ask for one)."""

from __future__ import annotations

import os
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FIRMWARE = Path(os.environ["FIRMWARE_DIR"]) if "FIRMWARE_DIR" in os.environ else None
MACHINE = os.environ.get("QEMU_MACHINE", "")
TARGETS = {
    "mps2-an385": "cortex-m3",
    "mps2-an386": "cortex-m4f",
    "mps2-an500": "cortex-m7",
    "lm3s6965evb": "cortex-m3",
    "netduinoplus2": "cortex-m4f",
    "virt": "rv32imac",
}
TARGET = TARGETS.get(MACHINE, "")
IS_RISCV = TARGET == "rv32imac"
HAS_FPU = TARGET in ("cortex-m4f", "cortex-m7")
CONFIG = os.environ.get("FIRMWARE_CONFIG", "standard")
IEC_STACK_SIZE = {"standard": 1024, "full": 2048, "can": 1024}[CONFIG]  # of a task [bytes]


def firmware(config: str) -> Path:
    """The runtime in one of its configurations."""
    assert FIRMWARE
    return FIRMWARE / f"firmware-{config}.elf"
