"""Runners: the runtime on a virtual clock for other processors, compiled here and run in QEMU."""

from __future__ import annotations

import atexit
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from plctool.testing.children import ends_with_us

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent / "runner"
FIRMWARE = ROOT / "firmware"
TIMEOUT = 120.0  # of one batch [s]; it takes a few on a quiet machine

_WARNINGS = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-O1"]
_ALTERNATIVES = ("CmpScheduleEmbedded.c",)  # in place of what the simulator has
_PORTABLE = [
    source
    for folder in ("app", "core", "cycle", "load", "sys")
    for source in sorted((FIRMWARE / "src" / folder).glob("*.c"))
    if source.name not in _ALTERNATIVES
]
_OF_SIMULATOR = (
    *("SimBench.c", "SimClock.c", "SimEvent.c", "SimMain.c", "SimNet.c", "SimPower.c", "SimRun.c", "SimSram.c"),
    *("SimStart.c", "SimTarget.c", "SimTimers.c"),
)
_BARE_SOURCES = [
    *_PORTABLE,
    *(FIRMWARE / "port/sim" / name for name in _OF_SIMULATOR),
    FIRMWARE / "port/baremetal/common/CmpCompilerCalls.c",
    FIRMWARE / "port/baremetal/blank/SysAtomic.c",  # nothing here can come in between
    *(HERE / "bare").glob("*.c"),
]
_OF_PLCTOOL = ("SimBoards.c", "SimBuses.c", "SimCanBus.c", "SimCanopen.c", "SimModbus.c", "SimWire.c")
_HOSTED_SOURCES = [
    *_PORTABLE,
    *(FIRMWARE / "src").glob("comm/*.c"),
    *(s for s in (FIRMWARE / "src/io").glob("*.c") if not any(bus in s.name for bus in ("Canopen", "Modbus"))),
    *(s for s in (FIRMWARE / "port/sim").glob("*.c") if s.name not in (*_OF_PLCTOOL, "SimMemory.c")),
    FIRMWARE / "port/linux/SysMem.c",
]
_OF_LINUX = [
    *(FIRMWARE / "port/linux" / name for name in ("IecStack.c", "IecStackSwitch.S", "SysDebug.c", "SysExcept.c")),
    FIRMWARE / "port/sim/SimMemory.c",
]
_OF_WINDOWS = sorted((FIRMWARE / "port/windows").glob("*.c"))
_ARM_SOURCES = [
    FIRMWARE / "port/baremetal/common/CmpCompilerCalls.c",
    *(FIRMWARE / "port/baremetal/cortexm" / name for name in ("IecCall.c", "ThumbStep.c")),
]
# Picolibc keeps the clock to itself unless a flag says that there is one.
_BARE_FLAGS = [
    "--specs=picolibc.specs", "--oslib=semihost", "--crt0=hosted", "-Wl,--gc-sections",
    "-D_POSIX_TIMERS", "-D_POSIX_MONOTONIC_CLOCK", "-D_POSIX_C_SOURCE=200809L",
    f"-I{HERE / 'bare'}", f"-I{FIRMWARE / 'port/baremetal/common'}",
    "-Wl,--defsym=__stack_size=64K",
]  # fmt: skip


def _memory(flash: int, ram: int) -> list[str]:
    """Linker symbols: 4 MiB for the program and 4 MiB of RAM."""
    return [f"-Wl,--defsym=__flash={flash},--defsym=__flash_size=4M,--defsym=__ram={ram},--defsym=__ram_size=4M"]


@dataclass(frozen=True)
class Runner:
    """How to compile the runner for a target and how to run it."""

    target: str
    compiler: str
    flags: tuple[str, ...]
    command: tuple[str, ...]  # the program's path follows
    bare: bool = True
    family: str = "cortexm"  # of port/baremetal, if bare
    windows: bool = False

    def missing(self) -> list[str]:
        """The tools that are not installed."""
        return [tool for tool in (self.compiler, self.command[0]) if shutil.which(tool) is None]

    def skip_without_tools(self) -> None:
        """Skips the test when the cross compiler or QEMU is not installed."""
        if missing := self.missing():
            import pytest

            pytest.skip(f"needs {' and '.join(missing)}: ./bootstrap.sh --cross")

    def compile(self, folder: Path, main: Path = HERE / "runner.c", *extra: str) -> Path:
        """A program of the runtime with `main`, in `folder`; `extra`: more flags."""
        program = folder / f"{main.stem}-{self.target}{'.exe' if self.windows else ''}"
        include = [f"-I{FIRMWARE / name}" for name in ("include", "port/sim", "src/app", "src/cycle")]
        flags = [*(_BARE_FLAGS if self.bare else []), *self.flags, *_WARNINGS, *include, *extra]
        entry = FIRMWARE / "port/baremetal" / self.family / "IecCall.c"
        hosted = [*_HOSTED_SOURCES, *(_OF_WINDOWS if self.windows else _OF_LINUX)]
        hosted += _ARM_SOURCES if "arm" in self.compiler else []
        sources = [main, *([*_BARE_SOURCES, entry] if self.bare else hosted)]
        objects = folder / f"{program.name}-objects"
        objects.mkdir()
        for number, source in enumerate(sources):  # one at a time, which a cache of compilations needs
            compiled = [flag for flag in flags if not flag.startswith(("-Wl,", "--oslib", "--crt0", "-static"))]
            target = objects / f"{number}.o"
            subprocess.run([*_cache(), self.compiler, *compiled, "-c", "-o", target, source], check=True)
        subprocess.run([self.compiler, *flags, "-o", program, *sorted(objects.iterdir()), "-lm"], check=True)
        return program

    def compile_alone(self, folder: Path, sources: Sequence[Path], *extra: str) -> Path:
        """A program without the runtime."""
        program = folder / f"{sources[0].stem}-{self.target}"
        flags = [*(_BARE_FLAGS if self.bare else []), *self.flags, *extra]
        subprocess.run([self.compiler, *flags, "-o", program, *sources, "-lm"], check=True)
        return program

    def compile_object(self, folder: Path, source: Path, *extra: str) -> Path:
        """The object file of one source, without the runtime."""
        target = folder / f"{source.stem}-{self.target}.o"
        flags = [*(_BARE_FLAGS if self.bare else []), *self.flags, *extra]
        compiled = [flag for flag in flags if not flag.startswith("-Wl,")]
        subprocess.run([self.compiler, *compiled, "-c", "-o", target, source], check=True)
        return target

    def run(self, batch: bytes, folder: Path) -> bytes:
        """The results of a batch, see runner.c."""
        folder.mkdir(exist_ok=True)
        (folder / "batch").write_bytes(batch)
        command = ends_with_us([*self.command, _compile_once(self)])
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=TIMEOUT)
        if done.returncode:
            raise RuntimeError(f"the runner for {self.target} failed: {done.stdout}{done.stderr}")
        return (folder / "results").read_bytes()


@cache
def _cache() -> list[str]:
    """What comes before a compiler that need not compile again what it compiled before: meson does the same."""
    return ["ccache"] if shutil.which("ccache") else []


@cache
def _compile_once(runner: Runner) -> Path:
    """The runner's program, for all tests of this process."""
    folder = Path(tempfile.mkdtemp(prefix="runner-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return runner.compile(folder)


def _cortex_m(target: str, flags: tuple[str, ...], machine: str) -> Runner:
    qemu = (
        "qemu-system-arm", "-M", machine, "-display", "none", "-monitor", "none", "-serial", "null",
        "-semihosting-config", "enable=on,target=native", "-kernel",
    )  # fmt: skip
    return Runner(target, "arm-none-eabi-gcc", ("-mthumb", *flags, *_memory(0, 0x20000000)), qemu)


RUNNERS = {
    runner.target: runner
    for runner in (
        # There is no board with a Cortex-M0 and enough memory in QEMU; a Cortex-M3 runs its code. No port is for it.
        _cortex_m("cortex-m0", ("-mcpu=cortex-m0",), "mps2-an385"),
        _cortex_m("cortex-m3", ("-mcpu=cortex-m3",), "mps2-an385"),
        _cortex_m("cortex-m4f", ("-mcpu=cortex-m4", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"), "mps2-an386"),
        # As the Cortex-M4F in all but a few instructions.
        _cortex_m("cortex-m7", ("-mcpu=cortex-m7", "-mfloat-abi=hard", "-mfpu=fpv5-sp-d16"), "mps2-an500"),
        Runner(
            "rv32imac",
            "riscv64-unknown-elf-gcc",
            ("-march=rv32imac", "-mabi=ilp32", *_memory(0x80000000, 0x80400000)),
            ("qemu-system-riscv32", "-M", "virt", "-bios", "none", "-display", "none", "-monitor", "none",
             "-serial", "null", "-semihosting-config", "enable=on,target=native", "-kernel"),
            family="riscv",
        ),
        Runner("aarch64-linux", "aarch64-linux-gnu-gcc", ("-static", "-pthread"), ("qemu-aarch64",), bare=False),
        Runner("armv7-linux", "arm-linux-gnueabihf-gcc", ("-static", "-pthread"), ("qemu-arm",), bare=False),
        Runner("x86_64-windows", "x86_64-w64-mingw32-gcc-posix",
               ("-static", "-pthread", f"-I{FIRMWARE / 'port/windows'}"), ("wine",), bare=False, windows=True),
    )
}  # fmt: skip
