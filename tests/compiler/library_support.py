"""Writes libraries into a folder, and checks programs that use them."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path

from plctool.compiler import check_with_tests, program_files
from plctool.compiler.front import CheckResult

MANIFEST = 'name = "{name}"\nversion = "{version}"\n[dependencies]\n{needs}\n'


def manifest(name: str, version: str = "1.0.0", **needs: str) -> str:
    """The text of a library.toml."""
    return MANIFEST.format(name=name, version=version, needs="".join(f'{n} = "{v}"\n' for n, v in needs.items()))


def library(folder: Path, name: str, sources: Mapping[str, str], version: str = "1.0.0", **needs: str) -> Path:
    """A library in a folder of its own."""
    home = folder / name
    for file, text in {"library.toml": manifest(name, version, **needs), **sources}.items():
        (home / file).parent.mkdir(parents=True, exist_ok=True)
        (home / file).write_text(text)
    return home


def zipped(path: Path, files: Mapping[str, str]) -> Path:
    """A .zip with these files."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in files.items():
            archive.writestr(name, text)
    return path


def check(folder: Path, text: str, *libraries: Path) -> CheckResult:
    """Checks a program of one file."""
    program = folder / "program"
    program.mkdir(exist_ok=True)
    (program / "main.st").write_text(text)
    files = program_files([program], libraries=libraries)
    return check_with_tests(files.load_sources(), libraries=files.load_libraries())


def messages(result: CheckResult, severity: str = "error") -> list[str]:
    """What is wrong, each with the name of its file."""
    return [f"{Path(d.file).name}:{d.line}: {d.message}" for d in result.diagnostics if d.severity == severity]
