"""Tries wheels in a Python of Debian for another processor, by QEMU's user mode: `tests/wheel_elsewhere.py WHEEL...`.

Debian's Python is fetched and unpacked in build-wheel-trial, not installed. For 64-bit Arm a program is built, run and
tested, as tests/wheel.py does; for 32-bit Arm, for which PyPI has no llvmlite, the simulator's module runs. Of a wheel
for musl only plcrt runs. Exit status 77: it cannot be done here, for the reason that is printed.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path

from debian_kernel import apt_settings
from wheel import PROGRAM

ROOT = Path(__file__).resolve().parents[1]
KEPT = ROOT / "build-wheel-trial"
SKIPPED = 77
MODULE_WORKS = """\
import _plccore
assert _plccore.lib.SimStart() == 0
print("module for pointers of", _plccore.ffi.sizeof("void *"))
"""


@dataclass(frozen=True)
class Machine:
    """A processor for Debian, QEMU and PyPI."""

    debian: str
    emulator: str
    has_llvmlite: bool = False
    packages: tuple[str, ...] = ()


MACHINES = {
    "aarch64": Machine("arm64", "qemu-aarch64", True, ("python3", "libstdc++6", "zlib1g")),
    "armv7l": Machine("armhf", "qemu-arm", False, ("python3", "python3-cffi-backend", "zlib1g")),
    "x86_64": Machine("amd64", "qemu-x86_64"),
}


def skip(reason: str) -> None:
    print(f"The wheel was not tried: {reason}")
    sys.exit(SKIPPED)


def attempt(command: list[str], folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    env = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "PLC"))} | environment
    return subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, check=False)


def run(command: list[str], folder: Path, **environment: str) -> str:
    """The output of a command that has to succeed."""
    done = attempt(command, folder, **environment)
    if done.returncode:
        sys.exit(f"{' '.join(command)}\n{done.stdout[-4000:]}{done.stderr[-4000:]}")
    return done.stdout


# ---- a Python for the processor ----


def make_root(machine: Machine) -> Path:
    """A folder with Debian's Python, fetched once."""
    folder = KEPT / machine.debian
    root = folder / "root"
    if (root / "complete").exists():
        return root
    settings = {"APT_CONFIG": str(apt_settings(machine.debian, folder))}
    attempt(["apt-get", "-qq", "update"], folder, **settings)  # a part of the lists may be enough
    wanted = ["apt-get", "-qq", "-y", "--no-install-recommends", "--download-only", "install", *machine.packages]
    done = attempt(wanted, folder, **settings)
    if done.returncode:
        skip(f"Debian's Python for {machine.debian} cannot be fetched: {done.stderr.strip()}")
    for package in (folder / "cache/archives").glob("*.deb"):
        run(["dpkg-deb", "--extract", str(package), str(root)], folder)
    (root / "complete").touch()
    return root


# ---- the trial ----


class Trial:
    """A wheel in a Python."""

    def __init__(self, machine: Machine, root: Path, folder: Path) -> None:
        self.folder, self.site = folder, folder / "site"
        self.root, self.emulator = root, [machine.emulator, "-L", str(root)]

    def python(self, *words: str) -> str:
        python = [*self.emulator, str(self.root / "usr/bin/python3.11"), *words]
        packages = f"{self.site}:{self.root}/usr/lib/python3/dist-packages"
        return run(python, self.folder, PYTHONHOME=str(self.root / "usr"), PYTHONPATH=packages, HOME=str(self.folder))

    def plcrt(self, *words: str) -> str:
        (program,) = self.site.glob("bin/plcrt")
        return run([*self.emulator, str(program), *words], self.folder)


def install(wheel: Path, machine: str, site: Path, folder: Path) -> None:
    """With what it needs from PyPI, as pip on that machine would."""
    tags = ("manylinux_2_31", "manylinux_2_28", "manylinux2014")
    platforms = [f"--platform={tag}_{machine}" for tag in tags]
    run([sys.executable, "-m", "pip", "install", "--quiet", "--only-binary=:all:", "--python-version=3.11",
         "--implementation=cp", *platforms, f"--target={site}", str(wheel), "pytest"], folder)  # fmt: skip


def unpack(wheel: Path, site: Path) -> None:
    """The wheel alone."""
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)
    (site / "bin").mkdir()
    for program in site.glob("*.data/scripts/*"):
        shutil.copy(program, site / "bin")
        (site / "bin" / program.name).chmod(0o755)


def check_tool(trial: Trial) -> None:
    """A program is built for this processor, runs in the simulator, and its TEST block passes."""
    (trial.folder / "project").mkdir()
    (trial.folder / "project/main.st").write_text(PROGRAM)
    trial.python("-m", "plctool", "build", "project", "--target", "aarch64-linux")
    values = trial.python("-m", "plctool", "run", "app.cdl", "--cycles", "5", "--get", "Main.n")
    assert "Main.n = 5" in values, values
    assert "1 passed" in trial.python("-m", "pytest", "-p", "no:cacheprovider", "project")


def check_module(trial: Trial) -> None:
    """The simulator's module is loaded, which needs its C library and all names of Python."""
    assert trial.python("-c", MODULE_WORKS).startswith("module ")


def check_tools(*names: str) -> None:
    for name in names:
        if shutil.which(name) is None:
            skip(f"needs {name}: ./bootstrap.sh --tests")


def try_plcrt(wheel: Path, machine: Machine) -> None:
    """Of a wheel for musl, which is in the program."""
    check_tools(machine.emulator)
    with tempfile.TemporaryDirectory() as folder:
        unpack(wheel, Path(folder) / "site")
        assert run([machine.emulator, "site/bin/plcrt", "--version"], Path(folder)).startswith("plcrt ")
    print(f"{wheel.name}: plcrt starts")


def try_wheel(wheel: Path, name: str, machine: Machine) -> None:
    check_tools(machine.emulator, "apt-get", "dpkg-deb")
    with tempfile.TemporaryDirectory() as folder:
        trial = Trial(machine, make_root(machine), Path(folder))
        if machine.has_llvmlite:
            install(wheel, name, trial.site, trial.folder)
            check_tool(trial)
        else:
            unpack(wheel, trial.site)
            check_module(trial)
        assert trial.plcrt("--version").startswith("plcrt ")
    print(f"{wheel.name}: works with Debian's Python for {machine.debian}")


def main() -> None:
    for wheel in (Path(argument).resolve() for argument in sys.argv[1:]):
        name = re.sub(r".*linux_\d+_\d+_", "", wheel.stem)
        if "musllinux" in wheel.name:
            try_plcrt(wheel, MACHINES[name])
        else:
            try_wheel(wheel, name, MACHINES[name])


if __name__ == "__main__":
    main()
