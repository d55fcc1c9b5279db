"""Tries a wheel as a user would get it, in new environments without a compiler: `tests/wheel.py WHEEL PYTHON...`.

Pythons that are not on this machine are left out, but there has to be one.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

PROGRAM = """PROGRAM Main VAR n : INT; END_VAR n := n + 1; END_PROGRAM
TEST 'counts'
VAR m : Main; END_VAR
m(); ASSERT_EQ(m.n, 1);
END_TEST
"""
TYPED = "import plctool\nplc: plctool.Plc = plctool.connect('sim:')\nvalue: int = plc.stop()\n"


def run(*command: str | Path, folder: Path) -> str:
    """The output of a command that has to succeed."""
    env = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "PLCRT", "CC")}
    done = subprocess.run(list(map(str, command)), cwd=folder, env=env, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}")
    return done.stdout


def version_of(python: str) -> str:
    """Such as `3.12`; "" if there is no such Python."""
    try:
        said = subprocess.run([python, "-c", "import sys; print('%d.%d' % sys.version_info[:2])"],
                              capture_output=True, text=True, check=True)  # fmt: skip
    except (OSError, subprocess.CalledProcessError):
        return ""
    return said.stdout.strip()


def check(wheel: Path, python: str, folder: Path) -> None:
    """Installs the wheel and builds, runs and tests a program with it."""
    run(python, "-m", "venv", "env", folder=folder)
    bin = folder / "env" / "bin"
    run(bin / "pip", "install", "--quiet", "--only-binary", ":all:", wheel, "pytest", "mypy", folder=folder)
    (folder / "project").mkdir()
    (folder / "project" / "main.st").write_text(PROGRAM)
    run(bin / "plctool", "build", "project", folder=folder)
    values = run(bin / "plctool", "run", "app.cdl", "--cycles", "5", "--get", "Main.n", folder=folder)
    assert "Main.n = 5" in values, values
    assert run(bin / "plcrt", "--version", folder=folder).startswith("plcrt ")
    assert "1 passed" in run(bin / "python", "-m", "pytest", "project", folder=folder)
    (folder / "typed.py").write_text(TYPED)
    mypy = subprocess.run([bin / "mypy", "typed.py"], cwd=folder, capture_output=True, text=True, check=False)
    assert "typed.py:3" in mypy.stdout and "missing library stubs" not in mypy.stdout, mypy.stdout
    assert list((folder / "env").rglob("plctool-*.dist-info/licenses/LICENSE")), "the licence is missing"


def main() -> None:
    wheel, pythons = Path(sys.argv[1]).resolve(), sys.argv[2:]
    found = {version: python for python in pythons if (version := version_of(python))}
    assert found, f"none of {', '.join(pythons)} was found"
    for version, python in found.items():
        with tempfile.TemporaryDirectory() as folder:
            check(wheel, python, Path(folder))
        print(f"{wheel.name}: works with Python {version}")


if __name__ == "__main__":
    main()
