"""Collects a release in `dist`: `tests/release.py MESON BUILD...`, after the wheel is there.

Adds the source archive, the firmware of each board of the builds as ELF (`plctool image --firmware` makes .hex or .bin
of it, with a program), and SHA256SUMS. Each ELF is read back as `plctool build --firmware` reads it.
"""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DIST = ROOT / "dist"
sys.path[:0] = [str(ROOT / "host"), str(ROOT / "build" / "host")]


def introspect(meson: str, what: str, build: Path) -> list[dict[str, object]]:
    found: list[dict[str, object]] = json.loads(subprocess.check_output([meson, "introspect", what, str(build)]))
    return found


def firmwares(meson: str, build: Path) -> list[Path]:
    """Builds all firmware of a bare-metal build and returns the ELF files."""
    names = [str(target["filename"][0]) for target in introspect(meson, "--targets", build)]  # type: ignore[index]
    elfs = [Path(name) for name in names if Path(name).match("firmware-*.elf")]
    subprocess.run(["ninja", "--quiet", "-C", str(build), *(str(elf.relative_to(build.resolve())) for elf in elfs)],
                   check=True)  # fmt: skip
    return elfs


def main() -> None:
    from plctool.image.board import read_firmware

    meson, *builds = sys.argv[1:]
    (wheel,) = DIST.glob("plctool-*.whl")
    version = wheel.name.split("-")[1]
    subprocess.run([sys.executable, "-c", "import mesonpy; mesonpy.build_sdist('dist')"], cwd=ROOT, check=True)
    for build in map(Path, builds):
        for elf in firmwares(meson, build):
            board = re.sub(r"\W+", "-", read_firmware(elf).board.name).lower()
            config = elf.stem.removeprefix("firmware-")
            shutil.copy(elf, DIST / f"plcrt-{version}-{board.replace('/', '-')}-{config}.elf")
    files = sorted(file for file in DIST.iterdir() if file.is_file() and file.name != "SHA256SUMS")
    sums = [f"{hashlib.sha256(file.read_bytes()).hexdigest()}  {file.name}\n" for file in files]
    (DIST / "SHA256SUMS").write_text("".join(sums))
    print(f"{DIST}: {len(files)} files of version {version}, and SHA256SUMS")


if __name__ == "__main__":
    main()
