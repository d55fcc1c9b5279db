"""Random programs leave the same memory on every processor, run under QEMU's user mode, as on this machine."""

from __future__ import annotations

import functools
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from shares import share
from test_back_random import Generator, meaningful, outcome

from plctool.compiler.codegen.lower_unit import Options
from plctool.compiler.image.build import BuildResult, build_program
from plctool.core import lib
from plctool.debug.symbols import SymbolTable
from plctool.image.file import parse_image
from plctool.image.targets import find_target

SEEDS = range(100, 116)
HARNESS = Path(__file__).with_name("emulate.c")
ARM = ["arm-none-eabi-gcc", "-mcpu=cortex-m4", "-mthumb"]
SYSTEMS = {
    "aarch64-linux": (["aarch64-linux-gnu-gcc", "-mgeneral-regs-only"], ["qemu-aarch64"]),
    "armv7-linux": (["arm-linux-gnueabihf-gcc"], ["qemu-arm"]),
    "cortex-m0": (ARM, ["qemu-arm"]),
    "cortex-m3": (ARM, ["qemu-arm"]),
    "cortex-m4f": ([*ARM, "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"], ["qemu-arm"]),
    "rv32imac": (["riscv64-unknown-elf-gcc", "-march=rv32imac", "-mabi=ilp32"], ["qemu-riscv32"]),
}


@functools.cache
def expected(seed: int) -> list[tuple[int, bytes]]:
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


def watchable(symbols: SymbolTable, memory: bytes) -> bytes:
    """The data area without what a level may leave out."""
    data = bytearray(len(memory))
    for leaf in (leaf for variable in symbols.variables.values() for leaf in variable.leaves()):
        data[leaf.offset : leaf.offset + leaf.size] = memory[leaf.offset : leaf.offset + leaf.size]
    return bytes(data)


def emulated(builds: list[BuildResult], target: str, folder: Path) -> dict[int, list[tuple[int, bytes]]]:
    """(exception, memory) of each cycle of some applications, by their numbers."""
    compiler, emulator = SYSTEMS[target]
    for tool in (compiler[0], emulator[0]):
        if shutil.which(tool) is None:
            pytest.skip(f"needs {tool}")
    definitions, table = [], []
    for number, built in enumerate(builds):
        lines, entry = application(number, built.image)
        definitions += lines
        table.append(entry)
    apps = [*dict.fromkeys(definitions), "static const app_t apps[] = {", *table, "};", ""]
    (folder / "apps.h").write_text("\n".join(apps))
    flags = ["-O1", "-w", "-static", "-nostdlib", "-ffreestanding", "-fno-builtin", f"-I{folder}"]
    subprocess.run([*compiler, *flags, "-o", folder / "apps", HARNESS, "-lgcc"], check=True, capture_output=True)
    out = subprocess.run([*emulator, folder / "apps"], check=True, capture_output=True, text=True, timeout=60).stdout
    found: dict[int, list[tuple[int, bytes]]] = {}
    for line in out.splitlines():
        number, _, code, memory = line.split()
        clean = meaningful(builds[int(number, 16)].symbols, bytes.fromhex(memory))
        found.setdefault(int(number, 16), []).append((int(code, 16), clean))
    return found


@pytest.mark.parametrize(
    ("target", "options"),
    [
        *((target, {}) for target in SYSTEMS),
        ("cortex-m3", {"opt_level": 3}),
        ("cortex-m3", {"size": True}),
        ("rv32imac", {"size": True}),
    ],
    ids=str,
)
def test_programs_mean_the_same_on_every_processor(target: str, options: dict[str, Any], tmp_path: Path) -> None:
    chosen = Options(find_target(target), **options)
    seeds = share(SEEDS, 4, len(f"{target}{options}"))
    builds = [build_program(Generator(seed).program(), chosen) for seed in seeds]
    found = emulated(builds, target, tmp_path)
    for number, seed in enumerate(seeds):
        here, there = ([(code, watchable(builds[number].symbols, memory)) for code, memory in cycles]
                       for cycles in (expected(seed), found[number]))  # fmt: skip
        assert there == here, seed
