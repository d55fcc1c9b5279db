"""What a command on sources works with: what its arguments say, and where they say nothing, what the project says."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from plctool.cli.links import project_link
from plctool.compiler import IoFiles, Level, ProgramFiles, program_files
from plctool.compiler.sources.dialect_of_files import dialect_of_files
from plctool.compiler.sources.project import Project
from plctool.compiler.syntax.warnings import WarningOptions, warning_options
from plctool.errors import UsageError
from plctool.project import DEFAULT_IMAGE, PROJECT_FILE, find_project

DEFAULT_LEVEL: Level = 2


@dataclass(frozen=True)
class Settings:
    """`files`: what the program is made of; `output_named`: the command line says where `output` is; `own_folder`: the
    project says so, so that its folder may be made; `dialect_file`: that for which the dialect was taken; the others as
    in `compile_sources`."""

    files: ProgramFiles
    warnings: WarningOptions
    output: Path = Path(DEFAULT_IMAGE)
    output_named: bool = False
    own_folder: bool = False
    target: str | None = None
    level: Level = DEFAULT_LEVEL
    checks: str = "all"
    debug: bool = False
    board: str | None = None
    firmware: Path | None = None
    limits: bool = True
    dialect: str | None = None
    dialect_file: Path | None = None

    def every_file(self) -> Iterator[Path]:
        """All that is read."""
        yield from self.files.every_file()
        if self.firmware is not None:
            yield self.firmware


def settings_of(args: argparse.Namespace) -> Settings:
    """The settings of a command that has the arguments of `build`, or some of them. Raises UsageError if it names no
    sources and there is no project, CompileError for mistakes in the project file."""
    files = program_files(args.sources or [needed_project()], IoFiles(args.io, args.device), args.library)
    project = files.project
    if project is not None and project.link:  # a mistake in it is said before a device is wanted
        project_link(project.file, project.link_line, project.link)
    return Settings(
        files,
        _warnings(args, project),
        output_named=getattr(args, "output", None) is not None,
        own_folder=project is not None and getattr(args, "output", None) is None,
        board=_board(args, project),
        firmware=getattr(args, "firmware", None),
        limits=not getattr(args, "no_limits", False),
        **_with_dialect(files, _of_build(args, project)),
    )


def _with_dialect(files: ProgramFiles, chosen: dict[str, Any]) -> dict[str, Any]:
    """What was chosen, with the dialect of the files when none was."""
    found = None if "dialect" in chosen else dialect_of_files(files.source_files)
    return chosen if found is None else {**chosen, "dialect": found[0], "dialect_file": found[1]}


def settings_of_project(file: Path) -> Settings:
    """The settings of a command that has none of these arguments."""
    return settings_of_sources([file])


def settings_of_sources(sources: list[Path]) -> Settings:
    """The same for sources, or without any the project of the current folder."""
    nothing = argparse.Namespace(sources=sources, io=None, device=None, no_warn=[], werror=None, library=[])
    return settings_of(nothing)


def needed_project() -> Path:
    """The project of the current folder. Raises UsageError if there is none."""
    file = find_project()
    if file is None:
        raise UsageError(
            f"There is no project here ({PROJECT_FILE}, in this folder or one above it): name the sources, "
            "or make a project with 'plctool new NAME'.",
            "no-project",
        )
    return file


def _warnings(args: argparse.Namespace, project: Project | None) -> WarningOptions:
    """Names that are not wanted add up."""
    names = [*args.no_warn, *(project.no_warn if project is not None else ())]
    werror = args.werror
    if werror is None:
        werror = project is not None and project.werror
    return warning_options(names, as_errors=werror)


def _board(args: argparse.Namespace, project: Project | None) -> str | None:
    """The board that is named; that of the project unless another one, a target or a device is asked for."""
    board: str | None = getattr(args, "board", None)
    asked = board or any(getattr(args, name, None) for name in ("firmware", "target", "device"))
    return board if asked or project is None else project.board


def _of_build(args: argparse.Namespace, project: Project | None) -> dict[str, Any]:
    """Those that were chosen: by the arguments, else by the project. A board has its own target."""
    chosen = {}
    has_board = getattr(args, "board", None) or getattr(args, "firmware", None)
    for name in ("output", "target", "level", "checks", "debug", "dialect"):
        value = getattr(args, name, None)
        if value is None and project is not None and not (name == "target" and has_board):
            value = getattr(project, name)
        if value is not None:
            chosen[name] = value
    return chosen
