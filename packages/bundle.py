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
import subprocess
import sys
import tomllib
from pathlib import Path

PYTHON = "/usr/bin/python3"
PLACE = "/usr/lib/plctool"
NOT_FOR_USERS = {"dev"}
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
    """All extras for users, as pip wants them."""
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
    """Leaves out commands of packages, the runtime, which is a Debian package of its own, and what only compilers and
    type checkers read; modules are no commands."""
    for path in sorted(packages.glob("bin")):
        subprocess.run(["rm", "-r", str(path)], check=True)
    for path in packages.rglob("*"):
        if path.suffix in {".a", ".pyi", ".c", ".h"} and path.is_file():
            path.unlink()
        elif path.suffix == ".py" and (text := path.read_bytes()).startswith(b"#!"):
            path.write_bytes(text[text.index(b"\n") + 1 :])
            path.chmod(0o644)


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
