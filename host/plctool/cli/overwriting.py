"""A file that a command writes must not replace one that it reads, or one that a user wrote by hand."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterable
from pathlib import Path

from plctool.errors import UsageError, with_article
from plctool.files import is_inside
from plctool.project import IMAGE_SUFFIX, SYMBOL_SUFFIX

_IMAGE = "image"


def check_output(output: Path, inputs: Iterable[Path], better: str, is_image: bool = False) -> None:
    """Refuses an output with the name of a source, a symbol file, a settings file or, unless it is one, an image; and
    one that is among `inputs`, which are looked at only if the file exists. `better`: what to type instead."""
    kind = _kind(output)
    if kind and not (is_image and kind == _IMAGE):
        raise UsageError(f"{output} has the name of {with_article(kind)}; write for example {better}.", "bad-output")
    check_not_read(output, inputs, better)


def check_no_way_out(output: Path, folder: Path, better: str) -> None:
    """For a file whose name the user did not give: refuses a link out of the folder that it goes to, or to a file of
    another kind. A checked-out project may contain such a link."""
    real = Path(os.path.realpath(output))
    if output.is_symlink() and not (is_inside(output, folder) and real.suffix.lower() == output.suffix.lower()):
        raise UsageError(
            f"{output} is a link to {real}, which is not written unless it is named; write for example {better}, or "
            "remove the link.",
            "bad-output",
        )


def check_not_read(output: Path, inputs: Iterable[Path], better: str) -> None:
    """The same for a file whose name is given: it is not among `inputs`, by whatever name."""
    if os.path.isfile(output) and any(_same(output, file) for file in inputs):
        raise UsageError(
            f"{output} is a file that this command reads, so it is not overwritten; write for example {better}.",
            "bad-output",
        )


def _kind(output: Path) -> str:
    from plctool.compiler.formats.twincat_projects import CONTAINERS, PLC_PROJECT
    from plctool.compiler.sources.source_files import SUFFIXES

    suffix = output.suffix.lower()
    if suffix in SUFFIXES:
        return "source"
    kinds = {
        IMAGE_SUFFIX: _IMAGE,
        SYMBOL_SUFFIX: "symbol file",
        ".toml": "settings file",
        **dict.fromkeys((PLC_PROJECT, *CONTAINERS), "project"),
    }
    return kinds.get(suffix, "")


def _same(one: Path, other: Path) -> bool:
    try:
        return os.path.samefile(one, other)
    except OSError:
        return False


def output_or(args: argparse.Namespace, default: str) -> Path:
    """The output that the arguments name, else `default` in the current folder. Raises UsageError if that is a link to
    elsewhere."""
    if args.output is None:
        check_no_way_out(Path(default), Path(), f"-o new-{default}")
    return Path(default) if args.output is None else args.output
