"""`plctool flash --online-change`: builds a project against the program that runs, and lets it take its place.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plctool.cli import output
from plctool.cli.builds import build, compiled, project_of
from plctool.cli.connections import Progress
from plctool.cli.documents import Document
from plctool.cli.online_changes import change_document, change_text
from plctool.cli.previous_program import keep, keep_sources, settings_for_previous
from plctool.errors import PlcError, UsageError

if TYPE_CHECKING:
    from plctool.cli.projects import Settings
    from plctool.compiler.kept.kept_build import KeptBuild
    from plctool.controller import Controller
    from plctool.debug.symbols import SymbolTable

_POLL = 0.1  # how often the files of a project are looked at [s]


def change(plc: Controller, args: argparse.Namespace, kept: KeptBuild | None = None) -> Document:
    """Replaces the program that runs by the image or the project that the arguments name. With --dry-run it only says
    what that would do. `kept`: what the next change of the project uses again."""
    if args.back:
        return _change_back(plc, args)
    settings = project_of(args)
    if settings is None:
        if args.dry_run:
            raise UsageError("--dry-run is for a project: a plan is made of sources.", "usage")
        return _sent(plc, Path(args.image), not args.json)
    settings = replace(settings, base=_base_of(plc, settings))
    if args.dry_run:
        return change_document(compiled(settings))
    return _change_project(plc, settings, args, kept)


def _base_of(plc: Controller, settings: Settings) -> SymbolTable:
    """The symbols of the program that runs. Raises UsageError if they are neither known nor beside the image of the
    project."""
    from plctool.debug.symbols import find_symbols

    try:
        return plc.symbols()
    except UsageError as error:
        if error.code != "no-symbols":
            raise
    crc = plc.raw_status().image_crc
    try:
        return find_symbols(crc, settings.output)
    except UsageError:
        raise UsageError(
            f"This computer does not have the symbols of the program that runs (CRC {crc:08X}). Change it from the "
            "computer that flashed it, or download the program with 'plctool flash'.",
            "no-symbols",
        ) from None


def _change_project(plc: Controller, settings: Settings, args: argparse.Namespace, kept: KeptBuild | None) -> Document:
    from plctool.cli.fresh_image import fingerprint

    assert settings.base is not None
    if settings.base.made_of and settings.base.made_of == fingerprint(settings):
        return {"unchanged": f"{settings.base.image_crc:08X}"}
    document, warnings = build(settings, kept)
    output.print_warnings(args, warnings)
    plan: Document = document["change"]
    sent = _sent(plc, settings.output, not args.json)
    keep_sources(settings, settings.output)
    return plan | sent


def _change_back(plc: Controller, args: argparse.Namespace) -> Document:
    """Replaces the program that runs by the previous one."""
    if args.image is not None:
        raise UsageError("--back is for the program that the device had before; name no other one.", "usage")
    with settings_for_previous(plc.symbols()) as (settings, archive):
        if args.dry_run:
            return change_document(compiled(settings)) | {"back": f"{archive.crc:08X}"}
        document, _ = build(settings)
        plan: Document = document["change"]
        sent = _sent(plc, settings.output, not args.json)
        keep(replace(archive, crc=int(document["crc"], 16)))
    return plan | sent | {"back": f"{archive.crc:08X}"}


def _sent(plc: Controller, image: Path, shown: bool) -> Document:
    with Progress(shown) as progress:
        result = plc.change(image, progress=progress.show)
    return {
        "bytes": result.bytes,
        "seconds": round(result.seconds, 3),
        "state": str(result.state),
        "released": result.released,
        "ended": result.ended,
    }


def live_change_text(document: dict[str, Any]) -> str:
    """What an online change did, or would do."""
    if "unchanged" in document:
        return f"the device runs this program already (CRC {document['unchanged']})"
    lines = [f"back to the program with CRC {document['back']}"] if "back" in document else []
    lines += [change_text(document)] if "kept" in document else []
    lines += [f"no longer forced, since it is removed: {name}" for name in document.get("released", ())]
    lines += [
        f"trace {name or '(a tool)'} has ended, since a variable of it is removed or moves"
        for name in document.get("ended", ())
    ]
    if "seconds" in document:
        lines.append(f"changed: {document['bytes']} bytes in {document['seconds']:.2f} s; state: {document['state']}")
    return "\n".join(lines)


def watch(
    plc: Controller, args: argparse.Namespace, wait: Callable[[], None] = lambda: time.sleep(_POLL)
) -> Iterator[Document]:
    """Changes the program that runs as often as a file of the project is saved, until `wait` raises. What does not work
    is said, and the program goes on."""
    if project_of(args) is None:
        raise UsageError("--watch is for a project; name its folder.", "usage")
    from plctool.compiler.kept.kept_build import KeptBuild

    seen, kept = None, KeptBuild()
    while True:
        now = _state_of(args)
        if now != seen:
            seen = now
            try:
                yield change(plc, args, kept)
            except PlcError as error:
                _say(error)
        wait()


def _say(error: PlcError) -> None:
    is_compilers = hasattr(error, "diagnostics")  # these begin with their location
    output.say(error.message if is_compilers else f"plctool: {error.message}", sys.stderr, colours=is_compilers)


def _state_of(args: argparse.Namespace) -> list[tuple[Path, int, int]] | str:
    """The files of a project, each with its size and the time of its last change; or the mistake in its plc.toml,
    which `change` reports as well."""
    try:
        settings = project_of(args)
    except PlcError as error:
        return error.message
    found = []
    for file in sorted(set() if settings is None else set(settings.every_file())):
        try:
            status = file.stat()
        except OSError:  # an editor puts another one in its place just now
            continue
        found.append((file, status.st_mtime_ns, status.st_size))
    return found
