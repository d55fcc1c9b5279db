"""The program that a command is for: its settings, its image, built first if it is not fresh, or in this process."""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plctool.cli import io_documents, output
from plctool.cli.documents import Document, diagnostic_document
from plctool.cli.online_changes import change_document, change_text, check_possible
from plctool.cli.overwriting import check_no_way_out, check_not_read, check_output
from plctool.errors import counted
from plctool.printable import one_line

if TYPE_CHECKING:
    from plctool.cli.projects import Settings
    from plctool.compiler.image.build import BuildResult
    from plctool.compiler.kept.kept_build import KeptBuild
    from plctool.compiler.sources.program_files import ProgramFiles
    from plctool.debug.symbols import SymbolTable
    from plctool.sim import Simulator


def settings_with_dialect(args: argparse.Namespace) -> Settings:
    from plctool.cli.projects import settings_of

    settings = settings_of(args)
    print_dialect(args, settings)
    return settings


def print_dialect(args: argparse.Namespace, settings: Settings) -> None:
    """Says which dialect was taken because of the files."""
    if settings.dialect_file is not None and not args.json:
        name, file = settings.dialect, settings.dialect_file
        output.say(f"plctool: {one_line(file.name)} makes this a program for --dialect {name}.", sys.stderr)


def image_of(args: argparse.Namespace) -> Path:
    """Returns the image that the arguments name. Builds that of a project first if it is not fresh."""
    return fresh_image(args, project_of(args))


def fresh_image(args: argparse.Namespace, settings: Settings | None) -> Path:
    if settings is None:
        return Path(args.image)
    from plctool.cli.fresh_image import is_fresh

    if not is_fresh(settings):
        document, warnings = build(settings)
        output.print_warnings(args, warnings)
        if not args.json:
            output.say(f"Built {build_text(document)}", sys.stderr)
    return settings.output


def project_of(args: argparse.Namespace) -> Settings | None:
    """Returns the project that the arguments name instead of an image, or that of the current folder if they name
    neither. None: they name an image."""
    from plctool.cli.projects import needed_project, settings_of_project
    from plctool.project import project_named

    file = needed_project() if args.image is None else project_named([args.image])
    if file is None:
        return None
    settings = settings_of_project(file)
    print_dialect(args, settings)
    return settings


def program_to_run(args: argparse.Namespace) -> Path | Built:
    """The image that the arguments name, or the project, compiled for this machine."""
    settings = project_of(args)
    if settings is None:
        return Path(args.image)
    built, warnings = built_for_here(settings)
    output.print_warnings(args, warnings)
    return built


# ---- images ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Built:
    """A program that was compiled from `files`, and is in none itself."""

    image: bytes
    symbols: SymbolTable
    files: ProgramFiles


def built_for_here(settings: Settings) -> tuple[Built, list[str]]:
    """A program compiled for this machine, whatever it is for otherwise, and the warnings as users read them."""
    from plctool.image.targets import host_target

    result = _compile(settings, host_target())
    return Built(result.image, result.symbols, settings.files), result.rendered_warnings


def simulator(program: Path | Built) -> Simulator:
    """A simulator that runs a program."""
    from plctool.sim import Simulator

    if isinstance(program, Path):
        return Simulator.from_file(program)
    return Simulator(program.image, program.symbols)


def build(settings: Settings, kept_build: KeptBuild | None = None) -> tuple[Document, list[str]]:
    """Compiles to an image and the symbol file beside it. Returns the document and the warnings as users read them.
    `kept_build`: what the next build in this process uses again. A build whose files are there already only gives its
    report again.

    Raises CompileError when the program has errors, UsageError when the image would overwrite one of its files. Files
    appear complete or not at all.
    """
    from plctool.cli.fresh_image import fingerprint
    from plctool.cli.kept_reports import kept_report
    from plctool.debug.symbols import symbol_path
    from plctool.files import make_folder

    output = settings.output
    inputs = settings.every_file
    check_output(output, inputs(), f"-o {output.stem}.cdl", is_image=True)
    check_not_read(symbol_path(output), inputs(), f"-o {output.stem}-image.cdl")
    _check_way_of(settings)
    made_of = fingerprint(settings)  # before the sources are read: a change during the build makes the image stale
    kept = kept_report(settings, made_of)
    report = None if kept is None else kept.find()
    if report is not None:
        return report
    result = _compile(settings, settings.target, kept_build)
    if result.change is not None:
        check_possible(result.change)
    result.symbols.made_of = made_of
    if settings.own_folder:
        make_folder(output.parent)
    result.write(output)
    channels = result.symbols.io.get("channels", [])
    document = {
        "image": str(output),
        "symbols": str(symbol_path(output)),
        "crc": f"{result.crc:08X}",
        "size": len(result.image),
        "target": result.symbols.target,
        "needs": {name: need.known for name, need in result.needs.items()},
        "warnings": [diagnostic_document(w) for w in result.warnings],
    }
    if settings.dump_after is not None:
        document["dump"] = [line for text in result.dumps for line in text.expandtabs().splitlines()]
    if result.change is not None:
        document["change"] = change_document(result)
    if channels:
        document["io"] = io_documents.summary(result.symbols.io)
    if kept is not None and fingerprint(settings) == made_of:
        kept.keep(document, result.rendered_warnings)
    return document, result.rendered_warnings


def _check_way_of(settings: Settings) -> None:
    """Refuses links out of the project, and out of the current folder if there is no project."""
    from plctool.debug.symbols import symbol_path

    output = settings.output
    if not settings.output_named:
        check_no_way_out(output, settings.files.root or Path(), f"-o {output.stem}-image.cdl")
    folder = None if settings.output_named else settings.files.root
    check_no_way_out(symbol_path(output), folder or output.parent, f"-o {output.stem}-image.cdl")


def compiled(settings: Settings) -> BuildResult:
    """What `build` would write."""
    return _compile(settings, settings.target)


def _compile(settings: Settings, target: str | None, kept_build: KeptBuild | None = None) -> BuildResult:
    from plctool.compiler import build

    is_own = target == settings.target  # else it is for this machine, whatever board the program is for
    request = settings if is_own else replace(settings, target=target, board=None, firmware=None)
    return build(request, kept=kept_build)


def build_text(document: dict[str, Any]) -> str:
    """What was built, and how old inputs may be."""
    lines = [*document.get("dump", ())]
    lines.append(f"{document['image']}: {document['size']} bytes, CRC {document['crc']}")
    if io := document.get("io"):
        lines.append(f"{counted(io['channels'], 'channel')} of inputs and outputs")
        if oldest := io["oldest_input"]:
            lines[-1] += f"; oldest input: {oldest['channel']}, up to {io_documents.age_text(oldest['age_us'])}"
        lines += [f"line {line['name']} is {line['load']:.0%} in use" for line in io["lines"]]
    if "change" in document:
        lines.append(change_text(document["change"]))
    return "\n".join(lines)
