"""Makes the wheel for another system from that for this one: `make_wheel.py PLATFORM WHEEL OUTPUT`.

WHEEL: for this Linux. What is compiled stays in the folder build-wheel-PLATFORM. Zig's compiler (PyPI: ziglang) has the
C libraries of most systems; for the others there are Debian's compilers. Python's own library is not needed: modules
of the limited interface run with every Python from 3.11 on, which has their names.

Checks what can be checked elsewhere: what the module imports and exports, and for which processor it is.
"""

from __future__ import annotations

import argparse
import base64
import csv
import hashlib
import io
import os
import re
import shlex
import subprocess
import sys
import sysconfig
import zipfile
from dataclasses import dataclass
from pathlib import Path

from elftools.elf.elffile import ELFFile
from macholib.MachO import MachO
from macholib.SymbolTable import SymbolTable

ROOT = Path(__file__).resolve().parents[1]
SIM = Path("firmware/port/sim")
PLCRT = Path("firmware/port/linux/plcrt")
OF_THIS_LINUX = re.compile(r"(^|/)(_plccore\..*\.so|plcrt(\.\d)?)$|\.libs/|\.data/(scripts|data)/")
ZIG = [sys.executable, "-m", "ziglang"]
MESON, NINJA = (Path(sys.executable).with_name(name) for name in ("meson", "ninja"))
MINGW = "x86_64-w64-mingw32-"

# What is part of each system, or of Python.
OF_WINDOWS = re.compile(r"(python3|KERNEL32|msvcrt|api-ms-win-crt-[\w-]+)\.dll", re.IGNORECASE)
OF_MACOS = re.compile(r"/usr/lib/libSystem\.B\.dylib|(@rpath/)?_plccore\.abi3\.so")
OF_PYTHON = re.compile(r"_?Py|__clear_cache$")  # the latter is the compiler's, and of libSystem
OF_LINUX = re.compile(r"lib(c|m|pthread|dl|rt)\.so(\.\d+)?|ld-linux[\w-]*\.so\.\d")


@dataclass(frozen=True)
class Platform:
    """A system and its processor."""

    tag: str
    system: str  # as meson names it
    processor: str  # as meson names its family
    machine: str  # as its files name the processor
    target: str = ""  # as Zig names it
    gcc: str = ""  # Debian's compiler, where it is not Zig's
    cross: str = ""  # with it, the file for meson
    module: str = "_plccore.abi3.so"

    @property
    def has_plcrt(self) -> bool:
        return self.system == "linux"

    @property
    def compiler(self) -> list[str]:
        return [self.gcc] if self.gcc else [*ZIG, "cc", "-target", self.target]


# GNU's C library is that of Debian 11 and Ubuntu 20.04 (plcrt needs gettid, which came with 2.30), for 32-bit Arm that
# of Debian 12: Zig lacks functions of libgcc that programs use there.
PLATFORMS = {
    "aarch64-linux": Platform(
        "manylinux_2_31_aarch64", "linux", "aarch64", "EM_AARCH64", target="aarch64-linux-gnu.2.31"
    ),
    "armv7-linux": Platform(
        "manylinux_2_36_armv7l", "linux", "arm", "EM_ARM", gcc="arm-linux-gnueabihf-gcc", cross="armv7-linux.ini"
    ),
    "x86_64-musl": Platform("musllinux_1_2_x86_64", "linux", "x86_64", "EM_X86_64", target="x86_64-linux-musl"),
    "aarch64-musl": Platform("musllinux_1_2_aarch64", "linux", "aarch64", "EM_AARCH64", target="aarch64-linux-musl"),
    "arm64-macos": Platform("macosx_11_0_arm64", "darwin", "aarch64", "ARM64", target="aarch64-macos.11.0"),
    "x86_64-windows": Platform(
        "win_amd64", "windows", "x86_64", "pei-x86-64",
        gcc=f"{MINGW}gcc-posix", cross="x86_64-windows.ini", module="_plccore.pyd",
    ),
}  # fmt: skip


def run(*command: str | Path) -> str:
    """The output of a command, which has to succeed."""
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"{' '.join(map(str, command))}\n{done.stdout[-4000:]}{done.stderr[-4000:]}")
    return done.stdout


# ---- the firmware's libraries ----


def cross_file(platform: Platform) -> str:
    """A file for meson; nothing of the build is run."""
    return f"""\
[binaries]
c = {platform.compiler}
ar = {[*ZIG, "ar"]}
exe_wrapper = ['false']
[built-in options]
c_args = ['-Wno-c11-extensions', '-Wno-sign-compare'] # of macros of the C library
[properties]
skip_sanity_check = true
[host_machine]
system = '{platform.system}'
cpu_family = '{platform.processor}'
cpu = '{platform.processor}'
endian = 'little'
[project options]
host = false
"""


def build_firmware(platform: Platform, folder: Path) -> None:
    """The simulator's libraries, and plcrt where it runs."""
    cross, build = folder / "cross.ini", folder / "build"
    text = (ROOT / "cross" / platform.cross).read_text() if platform.cross else cross_file(platform)
    if not build.exists() or not cross.exists() or cross.read_text() != text:
        cross.write_text(text)
        wipe = ["--wipe"] if build.exists() else []
        run(MESON, "setup", *wipe, "--buildtype=release", build, ROOT, "--cross-file", cross)
    targets = run(NINJA, "-C", build, "-t", "targets", "all")
    facts = {str(SIM / path) for path in re.findall(r"libboard_facts_\w+\.a", targets)}
    wanted = [*sorted(facts), str(SIM / "librts_sim_bus.a"), str(SIM / "librts_sim.a")]
    run(NINJA, "-C", build, *wanted, *([str(PLCRT)] if platform.has_plcrt else []))


# ---- the module ----


def include_folders(platform: Platform) -> list[Path]:
    folders = [ROOT / "firmware/include", ROOT / SIM]
    return [*folders, ROOT / "firmware/port/windows"] if platform.system == "windows" else folders


def write_module(platform: Platform, folder: Path) -> Path:
    """Its source, which the compiler's idea of sizes is part of."""
    source = folder / "_plccore.c"
    run(sys.executable, ROOT / "host/make_plccore.py", "--cc", shlex.join(platform.compiler), "--include",
        *include_folders(platform), "--output", source, "--depfile", folder / "_plccore.c.d")  # fmt: skip
    return source


def compile_c(platform: Platform, source: Path, result: Path) -> Path:
    flags = ["-O2", "-std=gnu99", "-fPIC", "-DPy_LIMITED_API=0x030B0000", "-include", ROOT / "packages/pyconfig.h"]
    include = [*include_folders(platform), Path(sysconfig.get_paths()["include"])]
    run(*platform.compiler, *flags, *(f"-I{path}" for path in include), "-c", source, "-o", result)
    return result


def python_library(module: Path, folder: Path) -> Path:
    """An import library of python3.dll with the names that the module uses."""
    names = re.findall(r"__imp_(_?Py\w+)", run(MINGW + "nm", "-u", module))
    definition = folder / "python3.def"
    definition.write_text("LIBRARY python3.dll\nEXPORTS\n" + "".join(f"{name}\n" for name in names))
    library = folder / "libpython3.a"
    run(MINGW + "dlltool", "-d", definition, "-l", library)
    return library


def system_flags(platform: Platform, module: Path, folder: Path) -> list[str | Path]:
    """How the names of Python are left to it."""
    if platform.system == "windows":
        return ["-static", python_library(module, folder)]
    return ["-undefined", "dynamic_lookup"] if platform.system == "darwin" else []


def whole(platform: Platform, archives: list[Path]) -> list[str]:
    """Flags of the linker, with which it takes all of archives."""
    if platform.system == "darwin":
        return [f"-Wl,-force_load,{archive}" for archive in archives]
    return ["-Wl,--whole-archive", *map(str, archives), "-Wl,--no-whole-archive"]


def link_module(platform: Platform, folder: Path) -> Path:
    """The module, with all that its simulator needs."""
    port = folder / "build" / SIM
    boards = compile_c(platform, ROOT / SIM / "SimBoards.c", folder / "boards.o")
    module = compile_c(platform, write_module(platform, folder), folder / "_plccore.o")
    archives = whole(platform, [port / "librts_sim_bus.a", *sorted(port.glob("libboard_facts_*.a"))])
    result = folder / platform.module
    run(*platform.compiler, "-shared", "-s", "-o", result, module, boards, *archives, port / "librts_sim.a",
        *system_flags(platform, module, folder), "-pthread", "-lm")  # fmt: skip
    return result


# ---- what can be checked here ----


@dataclass(frozen=True)
class Facts:
    """What a linked file says of itself."""

    machine: str
    needed: set[str]
    exported: set[str]


def facts_of_elf(path: Path) -> Facts:
    with path.open("rb") as file:
        elf = ELFFile(file)
        dynamic, symbols = elf.get_section_by_name(".dynamic"), elf.get_section_by_name(".dynsym")
        needed = {tag.needed for tag in dynamic.iter_tags("DT_NEEDED")} if dynamic else set()
        exported = {s.name for s in symbols.iter_symbols() if s["st_shndx"] != "SHN_UNDEF"} if symbols else set()
        return Facts(elf["e_machine"], needed, exported)


# Of mach-o/loader.h, nlist.h and mach/machine.h.
CPU_TYPE_ARM64 = 0x0100000C
LC_CODE_SIGNATURE = 0x1D
ORDINAL_UNKNOWN = 0  # as Zig has it for names that it did not find


def symbol_name(name: bytes) -> str:
    return name.rstrip(b"\0").decode().removeprefix("_")


def facts_of_mach_o(path: Path) -> Facts:
    macho = MachO(str(path))
    (header,) = macho.headers
    needed = {name for _, _, name in header.walkRelocatables()}
    symbols = SymbolTable(macho, header)
    unknown = {symbol_name(name) for at, name in symbols.undefsyms if at.n_desc >> 8 & 0xFF == ORDINAL_UNKNOWN}
    if strange := sorted(name for name in unknown if not OF_PYTHON.match(name)):
        sys.exit(f"{path.name} needs {', '.join(strange)}, which macOS does not have.")
    if not any(command.cmd == LC_CODE_SIGNATURE for command, _, _ in header.commands):
        sys.exit(f"{path.name} is not signed: macOS on Arm does not load it.")
    exported = {symbol_name(name) for _, name in symbols.extdefsyms}
    return Facts("ARM64" if header.header.cputype == CPU_TYPE_ARM64 else "", needed, exported)


def facts_of_pe(path: Path) -> Facts:
    said = run(MINGW + "objdump", "-p", path)
    machine = re.search(r"file format (\S+)", said)
    exported = {name for name in ("PyInit__plccore",) if name in said}
    return Facts(machine[1] if machine else "", set(re.findall(r"DLL Name: (\S+)", said)), exported)


def check(platform: Platform, path: Path, exports: set[str]) -> None:
    """A file is for its platform, and needs nothing but Python and what each such system has."""
    reader, known = {
        "linux": (facts_of_elf, OF_LINUX),
        "darwin": (facts_of_mach_o, OF_MACOS),
        "windows": (facts_of_pe, OF_WINDOWS),
    }[platform.system]
    facts = reader(path)
    if facts.machine != platform.machine:
        sys.exit(f"{path.name} is for {facts.machine or 'another processor'}, not for {platform.machine}.")
    if strange := sorted(name for name in facts.needed if not known.fullmatch(name)):
        sys.exit(f"{path.name} needs {', '.join(strange)}, which such a system may not have.")
    if missing := sorted(exports - facts.exported):
        sys.exit(f"{path.name} lacks {', '.join(missing)}.")


# ---- the wheel ----


def recorded(files: dict[str, bytes], record: str) -> bytes:
    """The file RECORD of a wheel."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    for name, data in files.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
        writer.writerow([name, f"sha256={digest}", len(data)])
    writer.writerow([record, "", ""])
    return text.getvalue().encode()


def files_of(wheel: Path, platform: Platform, tag: str, parts: dict[str, Path]) -> dict[str, bytes]:
    """Those of a wheel for this Linux that are for all systems, and the parts of a platform."""
    with zipfile.ZipFile(wheel) as archive:
        files = {name: archive.read(name) for name in archive.namelist() if not OF_THIS_LINUX.search(name)}
    files = {name: data for name, data in files.items() if not name.endswith("/RECORD")}
    about = next(name for name in files if name.endswith(".dist-info/WHEEL"))
    files[about] = re.sub(rb"(?m)^Tag: .*\n", b"", files[about]) + f"Tag: {tag}\n".encode()
    files |= {name: path.read_bytes() for name, path in parts.items()}
    record = about.replace("WHEEL", "RECORD")
    files[record] = recorded(files, record)
    return files


def write_wheel(path: Path, files: dict[str, bytes]) -> None:
    """Programs may be executed."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            entry = zipfile.ZipInfo(name)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = (0o100755 if ".data/scripts/" in name else 0o100644) << 16
            archive.writestr(entry, data)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("platform", choices=PLATFORMS)
    parser.add_argument("wheel", type=Path)
    parser.add_argument("output", type=Path)
    args = parser.parse_args()
    platform = PLATFORMS[args.platform]
    tag = f"cp311-abi3-{platform.tag}"
    name, version = args.wheel.name.split("-")[:2]
    wheel, output = args.wheel.resolve(), args.output.resolve()
    folder = ROOT / f"build-wheel-{args.platform}"
    folder.mkdir(exist_ok=True)
    os.chdir(folder)  # where Zig leaves what it makes beside
    build_firmware(platform, folder)
    module = link_module(platform, folder)
    check(platform, module, {"PyInit__plccore"})
    parts = {platform.module: module}
    if platform.has_plcrt:
        plcrt = folder / "build" / PLCRT
        check(platform, plcrt, set())
        parts[f"{name}-{version}.data/scripts/plcrt"] = plcrt
    files = files_of(wheel, platform, tag, parts)
    result = output / f"{name}-{version}-{tag}.whl"
    write_wheel(result, files)
    print(f"{result.name}: {len(files)} files, module of {len(files[platform.module])} bytes")


if __name__ == "__main__":
    main()
