"""Programs with a description of inputs and outputs, built in a folder of their own."""

from __future__ import annotations

from pathlib import Path

from plctool.compiler import CompileError, IoFiles, compile_sources
from plctool.compiler.image.build import BuildResult
from plctool.image.file import parse_image
from plctool.io.configuration import Configuration, parse_configuration


def build(folder: Path, program: str, description: str, device: str = "") -> BuildResult:
    """Builds `main.st` with `main.io.toml`, and `device.toml` if there is one."""
    (folder / "main.st").write_text(program)
    (folder / "main.io.toml").write_text(description)
    if device:
        (folder / "device.toml").write_text(device)
    files = IoFiles(device=folder / "device.toml" if device else None)
    return compile_sources([folder / "main.st"], io=files, limits=False)


def messages(folder: Path, program: str, description: str, device: str = "") -> list[str]:
    """`line: message` of each error, or of each warning if it can be built; with the name of another file in front."""
    try:
        found = build(folder, program, description, device).warnings
    except CompileError as error:
        found = error.diagnostics
    own = str(folder / "main.io.toml")
    return [f"{'' if d.file == own else Path(d.file).name + ':'}{d.line}: {d.message}" for d in found]


def configuration(built: BuildResult) -> Configuration:
    """What the image has."""
    image = parse_image(built.image)
    assert image.io is not None
    offset, size = image.io
    assert offset % 16 == 0
    return parse_configuration(image.code[offset : offset + size])


def addresses(built: BuildResult) -> dict[str, str]:
    """The address of each channel by its variable."""
    return {c["variable"]: c["address"] for c in built.symbols.io["channels"]}


__all__ = ["addresses", "build", "configuration", "messages"]
