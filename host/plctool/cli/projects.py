"""What a command on sources works with: what its arguments say, and where they say nothing, what the project says."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from plctool.cli.links import project_link
from plctool.compiler import IoFiles, ProgramFiles, program_files
from plctool.compiler.sources.dialect_of_files import dialect_of_files
from plctool.compiler.sources.project import Project
from plctool.compiler.sources.request import BuildRequest, request_of
from plctool.compiler.syntax.guidelines import PROPOSED
from plctool.compiler.syntax.warnings import WarningOptions, warning_options
from plctool.errors import UsageError
from plctool.project import DEFAULT_IMAGE, PROJECT_FILE, find_project

DEFAULT_LEVEL = BuildRequest.level


@dataclass(frozen=True)
class Settings(BuildRequest):
    """`output_named`: the command line says where `output` is; `own_folder`: the project says so, so that its folder
    may be made; `dialect_file`: that for which the dialect was taken."""

    output: Path = Path(DEFAULT_IMAGE)
    output_named: bool = False
    own_folder: bool = False
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
    named = getattr(args, "output", None)
    return Settings(
        **vars(_request(args, files)),
        output=named or (project.output if project is not None else Path(DEFAULT_IMAGE)),
        output_named=named is not None,
        own_folder=project is not None and named is None,
        dialect_file=_dialect(args, files)[1],
    )


def _request(args: argparse.Namespace, files: ProgramFiles) -> BuildRequest:
    """What the project asks for, where the command line says nothing else. A board has its own target."""
    asked = request_of(files)
    has_board = getattr(args, "board", None) or getattr(args, "firmware", None)
    given = {name: getattr(args, name, None) for name in ("target", "level", "checks", "debug")}
    chosen: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    return replace(
        replace(asked, target=None) if has_board else asked,
        **chosen,
        warnings=_warnings(args, files, asked.warnings),
        board=_board(args, files.project),
        firmware=getattr(args, "firmware", None),
        limits=not getattr(args, "no_limits", False),
        dialect=_dialect(args, files)[0],
        no_pass=tuple(getattr(args, "no_pass", ())),
        dump_after=getattr(args, "dump_after", None),
        cache=not getattr(args, "no_cache", False),
    )


def _dialect(args: argparse.Namespace, files: ProgramFiles) -> tuple[str | None, Path | None]:
    """The dialect that is chosen; without a choice that of the files, and the file for which it is taken."""
    chosen = getattr(args, "dialect", None) or request_of(files).dialect
    found = dialect_of_files(files.source_files) if chosen is None else None
    return (chosen, None) if found is None else found


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


def _warnings(args: argparse.Namespace, files: ProgramFiles, asked: WarningOptions) -> WarningOptions:
    """Names that are not wanted add up."""
    werror = asked.as_errors if args.werror is None else args.werror
    guidelines = None
    if getattr(args, "guidelines", False):
        guidelines = PROPOSED if files.project is None else files.project.guidelines
    return warning_options([*args.no_warn, *asked.disabled], as_errors=werror, guidelines=guidelines)


def _board(args: argparse.Namespace, project: Project | None) -> str | None:
    """The board that is named; that of the project unless another one, a target or a device is asked for."""
    board: str | None = getattr(args, "board", None)
    asked = board or any(getattr(args, name, None) for name in ("firmware", "target", "device"))
    return board if asked or project is None else project.board
