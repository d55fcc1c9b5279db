"""Random programs leave the same memory on every processor, run under QEMU's user mode, as on this machine."""

from __future__ import annotations

import functools
import shutil
import subprocess
from pathlib import Path

import pytest
from back_support import build
from test_back_random import Generator, meaningful, outcome

from plctool.core import lib
from plctool.image.file import parse_image

SEEDS = range(100, 116)
HARNESS = Path(__file__).with_name("emulate.c")
ARM = ["arm-none-eabi-gcc", "-mcpu=cortex-m4", "-mthumb"]
SYSTEMS = {
    "aarch64-linux": (["aarch64-linux-gnu-gcc", "-mgeneral-regs-only"], ["qemu-aarch64"]),
    "cortex-m0": (ARM, ["qemu-arm"]),
    "cortex-m3": (ARM, ["qemu-arm"]),
    "cortex-m4f": ([*ARM, "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"], ["qemu-arm"]),
    "rv32imac": (["riscv64-unknown-elf-gcc", "-march=rv32imac", "-mabi=ilp32"], ["qemu-riscv32"]),
}


@functools.cache
def expected(seed: int) -> list[object]:
    """(exception, memory) of each cycle on this machine."""
    return [(code, memory) for code, _, memory in outcome(Generator(seed).program(), 2)]


def application(number: int, image: bytes) -> tuple[list[str], str]:
    """Definitions of an application for apps.h, and its entry in the table."""
    parsed = parse_image(image)
    calls = [e.name for e in parsed.externals if e.name != "iecraise"]
    imports = ["(function)raise_exception" if e.name == "iecraise" else e.name for e in parsed.externals]
    code = ",".join(map(str, parsed.code))
    definitions = [
        *(f"extern void {name}(void);" for name in calls),
        f'static const u8 code{number}[] __attribute__((aligned(16), section(".text"))) = {{{code}}};',
        f"static const function imports{number}[] = {{{', '.join([*imports, '0'])}}};",
    ]
    entries = f"{parsed.functions[lib.CDL_FUNCTION_CODE_INIT]}, {parsed.tasks[0].entry}"
    return definitions, f"{{code{number}, {parsed.areas[0]}, {entries}, imports{number}}},"


@pytest.mark.parametrize("target", SYSTEMS)
def test_programs_mean_the_same_on_every_processor(target: str, tmp_path: Path) -> None:
    compiler, emulator = SYSTEMS[target]
    for tool in (compiler[0], emulator[0]):
        if shutil.which(tool) is None:
            pytest.skip(f"needs {tool}")
    builds = [build(Generator(seed).program(), target) for seed in SEEDS]
    definitions, table = [], []
    for number, built in enumerate(builds):
        lines, entry = application(number, built.image)
        definitions += lines
        table.append(entry)
    apps = [*dict.fromkeys(definitions), "static const app_t apps[] = {", *table, "};", ""]
    (tmp_path / "apps.h").write_text("\n".join(apps))
    flags = ["-O1", "-w", "-static", "-nostdlib", "-ffreestanding", "-fno-builtin", f"-I{tmp_path}"]
    subprocess.run([*compiler, *flags, "-o", tmp_path / "apps", HARNESS, "-lgcc"], check=True, capture_output=True)
    out = subprocess.run([*emulator, tmp_path / "apps"], check=True, capture_output=True, text=True, timeout=60).stdout
    found: dict[int, list[object]] = {}
    for line in out.splitlines():
        number, _, code, memory = line.split()
        clean = meaningful(builds[int(number, 16)].symbols, bytes.fromhex(memory))
        found.setdefault(int(number, 16), []).append((int(code, 16), clean))
    for number, seed in enumerate(SEEDS):
        assert found.get(number) == expected(seed), seed
