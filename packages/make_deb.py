"""Debian packages of plcrt and plctool: `packages/make_deb.py --meson MESON --plcrt PLCRT [--arch ARCH]...`.

Each architecture is built in a copy of the sources, in `build-deb`; the packages go to `dist`, and lintian looks at
them. PLCRT is one of this machine, whose `--help` becomes the manual page. plctool is packaged for the architecture of
this machine only: its compiler needs wheels for the Python that runs here.
"""

from __future__ import annotations

import argparse
import email.utils
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BUILDS = ROOT / "build-deb"
DIST = ROOT / "dist"
CROSS_FILES = {"arm64": "aarch64-linux", "armhf": "armv7-linux"}


def version() -> str:
    found = re.search(r"^  version: '([^']+)'", (ROOT / "meson.build").read_text(), re.MULTILINE)
    assert found
    return found[1]


def output(*command: str) -> str:
    return subprocess.check_output(command, cwd=ROOT, text=True).strip()


def copy_sources(folder: Path) -> None:
    """All that git has or could get, without what is ignored."""
    shutil.rmtree(folder, ignore_errors=True)
    for name in output("git", "ls-files", "-co", "--exclude-standard").splitlines():
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)
    shutil.copytree(ROOT / "packages" / "debian", folder / "debian")


def write_changelog(folder: Path) -> None:
    """Its date is that of the last commit, so that a build can be repeated."""
    date = email.utils.format_datetime(email.utils.parsedate_to_datetime(output("git", "log", "-1", "--format=%aD")))
    (folder / "debian" / "changelog").write_text(
        f"plctool ({version()}) unstable; urgency=medium\n\n  * See /usr/share/doc/plctool/CHANGELOG.md.gz.\n\n"
        f" -- The plctool authors <packages@plctool.invalid>  {date}\n"
    )


def build(arch: str, meson: str, help_text: Path) -> list[Path]:
    """Builds the packages of an architecture; returns them."""
    folder = BUILDS / arch / f"plctool-{version()}"
    copy_sources(folder)
    write_changelog(folder)
    environment = os.environ | {
        "PATH": f"{Path(meson).resolve().parent}:{os.environ['PATH']}",
        "PLCRT_HELP": str(help_text),
        "PLCRT_CROSS_FILE": str(folder / "cross" / f"{CROSS_FILES.get(arch, arch)}.ini"),
        "DEB_BUILD_OPTIONS": "nocheck noautodbgsym",
    }
    for old in folder.parent.glob("*.deb"):
        old.unlink()
    with (folder.parent / "log").open("w") as log:
        done = subprocess.run(
            ["dpkg-buildpackage", "-b", "-uc", "-us", "-d", f"-a{arch}"],
            cwd=folder, env=environment, stdout=log, stderr=subprocess.STDOUT, check=False,
        )  # fmt: skip
    if done.returncode != 0:
        sys.exit(f"The packages for {arch} were not built. The last lines of {folder.parent / 'log'}:\n"
                 + "\n".join((folder.parent / "log").read_text().splitlines()[-20:]))  # fmt: skip
    return sorted(path for path in folder.parent.glob("*.deb") if "-dbgsym_" not in path.name)


def check(packages: list[Path]) -> None:
    if not shutil.which("lintian"):
        print("lintian is not installed: the packages were not checked")
        return
    allow = ["--allow-root"] if os.geteuid() == 0 else []
    if subprocess.run(["lintian", "--fail-on", "error,warning", *allow, *map(str, packages)], check=False).returncode:
        sys.exit("lintian has complaints: see above")


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--meson", required=True)
    parser.add_argument("--plcrt", required=True)
    parser.add_argument("--arch", action="append")
    options = parser.parse_args()
    for tool in ("dpkg-buildpackage", "dh"):
        if not shutil.which(tool):
            sys.exit(f"{tool} is missing. Install it: sudo apt-get install debhelper dpkg-dev lintian")
    help_text = BUILDS / "plcrt-help"
    BUILDS.mkdir(exist_ok=True)
    DIST.mkdir(exist_ok=True)
    help_text.write_text(output(options.plcrt, "--help"))
    for arch in options.arch or [output("dpkg", "--print-architecture")]:
        packages = build(arch, options.meson, help_text)
        check(packages)
        for package in packages:
            shutil.copy2(package, DIST / package.name)
            print(f"dist/{package.name}: {package.stat().st_size // 1024} KiB")


if __name__ == "__main__":
    main()
