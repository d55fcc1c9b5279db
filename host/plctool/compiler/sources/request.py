"""What to build, from which files and with which options.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from plctool.compiler.base.level import Level
from plctool.compiler.sources.program_files import ProgramFiles
from plctool.compiler.syntax.warnings import ALL_WARNINGS, WarningOptions, warning_options
from plctool.debug.symbols import SymbolTable


@dataclass(frozen=True)
class BuildRequest:
    """`target`: the processor; None: that of the board, of the device of a description, else x86_64-linux. `checks`:
    all, none, or names of run-time checks. `warnings`: those that are wanted. `board`: one that plctool knows, such as
    mps2-an385/standard, to whose target and limits the program is held, so that another `target` is refused.
    `firmware`: the ELF file of any board's firmware, which says the same. Without `limits` the program may need more
    than any device has. `dialect`: iec, codesys or twincat, where systems disagree about what a program means; None:
    that of the files. `no_pass`: passes of the code generator that are left out; `dump_after`: the pass whose result is
    kept. `base`: the program whose place it shall take while that runs. `cache`: code that has not changed comes from
    the user's cache folder. `device_id`: the device that the image is for, 0 for that of the board or of the device of
    a description."""

    files: ProgramFiles
    target: str | None = None
    level: Level = 2
    checks: str = "all"
    debug: bool = False
    warnings: WarningOptions = ALL_WARNINGS
    board: str | None = None
    firmware: Path | None = None
    limits: bool = True
    dialect: str | None = None
    no_pass: tuple[str, ...] = ()
    dump_after: str | None = None
    base: SymbolTable | None = None
    cache: bool = False
    device_id: int = 0


def request_of(files: ProgramFiles) -> BuildRequest:
    """Returns what the project of these files asks for; without a project the defaults."""
    project, default = files.project, BuildRequest(files)
    if project is None:
        return default
    return BuildRequest(
        files,
        target=project.target,
        level=default.level if project.level is None else project.level,
        checks=default.checks if project.checks is None else project.checks,
        debug=project.debug,
        warnings=warning_options(project.no_warn, as_errors=project.werror),
        board=project.board,
        dialect=project.dialect,
    )
