"""Makes the wheel for Windows on x86-64 from that for Linux: `make_windows_wheel.py WHEEL BUILD MODULE OUTPUT`.

WHEEL: for Linux; BUILD: the build folder of cross/x86_64-windows.ini; MODULE: the source of _plccore. Python's own
library for Windows is not needed: the module names python3.dll, which every Python from 3.11 on has.

Checks what can be checked elsewhere than on Windows: what the module imports and exports.
"""

from __future__ import annotations

import base64
import csv
import hashlib
import io
import re
import subprocess
import sys
import sysconfig
import tempfile
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TAG = "cp311-abi3-win_amd64"
TOOLS = "x86_64-w64-mingw32-"
INCLUDE = [ROOT / "firmware/include", ROOT / "firmware/port/sim", ROOT / "firmware/port/windows"]
OF_LINUX = re.compile(r"(^|/)(_plccore\..*\.so|plcrt(\.\d)?)$|\.libs/|\.data/(scripts|data)/")
OF_WINDOWS = re.compile(r"(python3|KERNEL32|msvcrt|api-ms-win-crt-[\w-]+)\.dll", re.IGNORECASE)


def tool(name: str, *arguments: str | Path) -> str:
    """The output of a compiler tool, which has to succeed."""
    command = [TOOLS + name, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"{' '.join(command)}\n{done.stderr}")
    return done.stdout


def compile_module(source: Path, folder: Path) -> Path:
    include = [*INCLUDE, Path(sysconfig.get_paths()["include"])]
    flags = ["-O2", "-std=gnu99", "-DPy_LIMITED_API=0x030B0000", "-include", ROOT / "packages/windows/pyconfig.h"]
    result = folder / "_plccore.o"
    tool("gcc-posix", *flags, *(f"-I{path}" for path in include), "-c", source, "-o", result)
    return result


def python_library(module: Path, folder: Path) -> Path:
    """An import library of python3.dll with the names that the module uses."""
    names = re.findall(r"__imp_(_?Py\w+)", tool("nm", "-u", module))
    definition = folder / "python3.def"
    definition.write_text("LIBRARY python3.dll\nEXPORTS\n" + "".join(f"{name}\n" for name in names))
    library = folder / "libpython3.a"
    tool("dlltool", "-d", definition, "-l", library)
    return library


def link(build: Path, source: Path, folder: Path) -> Path:
    """The module, with all that its simulator needs."""
    port = build / "firmware/port/sim"
    whole = [port / "librts_sim_bus.a", *sorted(port.glob("libboard_facts_*.a"))]
    boards = folder / "boards.o"
    tool(
        "gcc-posix",
        "-O2",
        *(f"-I{path}" for path in INCLUDE),
        "-c",
        ROOT / "firmware/port/sim/SimBoards.c",
        "-o",
        boards,
    )
    module = compile_module(source, folder)
    result = folder / "_plccore.pyd"
    archives = ["-Wl,--whole-archive", *whole, "-Wl,--no-whole-archive", port / "librts_sim.a"]
    tool("gcc-posix", "-shared", "-s", "-static", "-o", result, module, boards, *archives,
         python_library(module, folder), "-pthread")  # fmt: skip
    return result


def check(module: Path) -> None:
    """The module needs nothing but Python and what each Windows has, and is one."""
    headers = tool("objdump", "-p", module)
    imported = set(re.findall(r"DLL Name: (\S+)", headers))
    if strange := sorted(name for name in imported if not OF_WINDOWS.fullmatch(name)):
        sys.exit(f"The module needs {', '.join(strange)}, which a Windows may not have.")
    if "python3.dll" not in imported or "PyInit__plccore" not in headers:
        sys.exit("The module is not one of Python.")


def recorded(files: dict[str, bytes], record: str) -> bytes:
    """The file RECORD of a wheel."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    for name, data in files.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
        writer.writerow([name, f"sha256={digest}", len(data)])
    writer.writerow([record, "", ""])
    return text.getvalue().encode()


def files_of(wheel: Path, module: Path) -> dict[str, bytes]:
    """Those of a wheel for Linux that are for all systems, and the module."""
    with zipfile.ZipFile(wheel) as archive:
        files = {name: archive.read(name) for name in archive.namelist() if not OF_LINUX.search(name)}
    files = {name: data for name, data in files.items() if not name.endswith("/RECORD")}
    about = next(name for name in files if name.endswith(".dist-info/WHEEL"))
    files[about] = re.sub(rb"(?m)^Tag: .*\n", b"", files[about]) + f"Tag: {TAG}\n".encode()
    files["_plccore.pyd"] = module.read_bytes()
    record = about.replace("WHEEL", "RECORD")
    files[record] = recorded(files, record)
    return files


def main() -> None:
    wheel, build, source, output = map(Path, sys.argv[1:])
    with tempfile.TemporaryDirectory() as folder:
        module = link(build, source, Path(folder))
        check(module)
        files = files_of(wheel, module)
    name = output / ("-".join(wheel.name.split("-")[:2]) + f"-{TAG}.whl")
    with zipfile.ZipFile(name, "w", zipfile.ZIP_DEFLATED) as archive:
        for path, data in files.items():
            archive.writestr(path, data)
    print(f"{name.name}: {len(files)} files, module of {len(files['_plccore.pyd'])} bytes")


if __name__ == "__main__":
    main()
