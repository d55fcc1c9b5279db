"""plctool with all that it needs from PyPI, in a virtual environment for the system's Python:
`packages/bundle.py PROJECT FOLDER` makes

- `venv`, what becomes /usr/lib/plctool: packages are installed with pip, of wheels only;
- `command`, what becomes /usr/bin/plctool;
- `bash`, `zsh`, `fish` and `plctool.1`: completions and the manual page;
- `depends`, the Depends that the version of Python makes necessary, as a line of substvars.

It runs in an environment that has pip and meson-python.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

PYTHON = "/usr/bin/python3"
PLACE = "/usr/lib/plctool"
# Only PNG files of traces need the extra plot. Its packages are large, and lintian has complaints about them.
NOT_FOR_USERS = {"dev", "plot"}
FOR_DEVELOPERS = {"tests", "test", "docs", "examples"}
FOR_COMPILERS = {".a", ".pyi", ".c", ".h", ".pxd", ".pyx"}
SHELLS = ("bash", "zsh", "fish")

COMMAND = f"""\
#!/bin/sh
exec {PLACE}/bin/python3 -P -m plctool "$@"
"""


def system_python() -> tuple[int, int]:
    """The version of the Python that plctool will run on."""
    query = "import json, sys; print(json.dumps(sys.version_info[:2]))"
    major, minor = json.loads(subprocess.check_output([PYTHON, "-c", query]))
    return major, minor


def make_venv(venv: Path, version: tuple[int, int]) -> Path:
    """An environment of the system's Python, without packages; the folder for them."""
    name = "python{}.{}".format(*version)
    packages = venv / "lib" / name / "site-packages"
    packages.mkdir(parents=True)
    (venv / "bin").mkdir()
    (venv / "bin" / "python3").symlink_to(f"/usr/bin/{name}")
    (venv / "pyvenv.cfg").write_text(
        f"home = /usr/bin\ninclude-system-site-packages = false\nversion = {version[0]}.{version[1]}\n"
    )
    return packages


def extras(project: Path) -> str:
    """Returns the extras in the package, as pip wants them."""
    names = tomllib.loads((project / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    return ",".join(sorted(set(names) - NOT_FOR_USERS))


def pip(*arguments: str) -> None:
    subprocess.run([sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check", *arguments], check=True)


def install(project: Path, packages: Path, wheels: Path, version: tuple[int, int]) -> None:
    pip("wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", str(wheels), str(project))
    (wheel,) = wheels.glob("plctool-*.whl")
    pip("install", "--target", str(packages), "--no-compile", "--only-binary=:all:",
        "--python-version", "{}.{}".format(*version), f"{wheel}[{extras(project)}]")  # fmt: skip


def strip(packages: Path) -> None:
    """Removes what plctool never reads: commands, tests, documents and examples of other packages, and files for
    compilers and type checkers. Removes the #! lines and executable bits of modules."""
    others = [path for path in packages.iterdir() if path.name != "plctool"]
    folders = [packages / "bin", packages / "share"]
    folders += [path for other in others for path in other.rglob("*") if path.name in FOR_DEVELOPERS and path.is_dir()]
    for folder in folders:
        shutil.rmtree(folder, ignore_errors=True)
    for path in packages.rglob("*"):
        if path.is_file():
            strip_file(path)


def strip_file(path: Path) -> None:
    if path.suffix in FOR_COMPILERS:
        path.unlink()
        return
    path.chmod(0o644)
    if path.suffix == ".py" and (text := path.read_bytes()).startswith(b"#!"):
        path.write_bytes(text[text.index(b"\n") + 1 :])


def run_plctool(packages: Path, *arguments: str) -> str:
    environment = {"PYTHONPATH": str(packages), "PATH": "/usr/bin:/bin", "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.check_output([PYTHON, "-m", "plctool", *arguments], env=environment, text=True)


def main() -> None:
    project, folder = (Path(argument).resolve() for argument in sys.argv[1:3])
    version = system_python()
    folder.mkdir(parents=True)
    packages = make_venv(folder / "venv", version)
    install(project, packages, folder / "wheels", version)
    strip(packages)
    (folder / "command").write_text(COMMAND)
    (folder / "command").chmod(0o755)
    for shell in SHELLS:
        (folder / shell).write_text(run_plctool(packages, "completion", shell))
    (folder / "plctool.1").write_text(run_plctool(packages, "man"))
    major, minor = version
    (folder / "depends").write_text(
        f"plctool:Depends=python3 (>= {major}.{minor}~), python3 (<< {major}.{minor + 1})\n"
    )


if __name__ == "__main__":
    main()
