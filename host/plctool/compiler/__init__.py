"""The compiler: IEC 61131-3 Structured Text in, an application image and its symbols out.

The parts are imported when they are first needed: `plctool.iec.types` alone must not cost the start-up of LLVM.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from plctool.compiler.base.garbage import no_collection
from plctool.compiler.base.level import Level
from plctool.compiler.sources.program_files import IoFiles, ProgramFiles, Sources, program_files
from plctool.compiler.syntax.diagnostics import CompileError
from plctool.errors import UsageError
from plctool.image.targets import DEFAULT_TARGET

if TYPE_CHECKING:
    from plctool.compiler.base.information import Information
    from plctool.compiler.base.source import Source
    from plctool.compiler.codegen.lower_unit import Options
    from plctool.compiler.front import CheckResult, Trees
    from plctool.compiler.image.build import BuildResult
    from plctool.compiler.kept.kept_build import KeptBuild
    from plctool.compiler.semantics.participants import Guest
    from plctool.compiler.semantics.python_functions import PythonFunctions
    from plctool.compiler.sources.imports import ImportedLibrary
    from plctool.compiler.sources.request import BuildRequest
    from plctool.compiler.syntax.warnings import WarningOptions
    from plctool.image.board import Board
    from plctool.image.file import ImageProperty
    from plctool.io.model import Description

__all__ = [
    "CompileError", "IoFiles", "Level", "ProgramFiles", "Sources", "build", "check_sources", "check_with_tests",
    "compile_sources", "io_sources", "library_sources", "load_io", "load_sources", "program_files",
    "source_date",
]  # fmt: skip


def load_sources(paths: Sequence[Path | str]) -> list[Source]:
    """The files named, and all sources in the folders named; of a project those that it names. Raises UsageError when
    there is nothing to read."""
    return program_files(paths).load_sources()


def source_date() -> int:
    """SOURCE_DATE_EPOCH of the environment: the time that images and exports have, in seconds since 1970; 0 without
    one. Raises UsageError."""
    text = os.environ.get("SOURCE_DATE_EPOCH", "0")
    if not (text.isascii() and text.isdigit() and int(text) <= 0xFFFF_FFFF):
        raise UsageError(
            f"SOURCE_DATE_EPOCH in the environment is {text!r}; it is a number of seconds since 1970, of 32 bits.",
            "bad-value",
        )
    return int(text)


def load_io(paths: Sequence[Path | str], files: IoFiles | None = None) -> Description | None:
    """The description of the inputs and outputs of a program; None if it has none. It serves one check. Raises
    UsageError for a file that cannot be read, and when it is not clear which one is meant."""
    return program_files(paths, files).load_io()


def _target(wanted: str | None, board: Board | None, io: Description | None) -> str:
    """The processor to compile for."""
    of_board = "" if board is None else board.target
    of_device = io.device.target if io is not None and io.device is not None else ""
    return wanted or of_board or of_device or DEFAULT_TARGET


def _check_device(board: Board | None, io: Description | None) -> None:
    """The vendor's description is not one of another processor. plcrt may run instead of any of them."""
    device = None if io is None else io.device
    if board is not None and device is not None and not board.is_program and device.target not in ("", board.target):
        raise UsageError(
            f"{device.path} describes a board with a {device.target}, {board.title} has a {board.target}; name one of "
            "the two.",
            "bad-target",
        )
    if board is not None and device is not None and not board.is_program and device.id not in (0, board.images_for):
        from plctool.image.file import target_name

        raise UsageError(
            f"{device.path} describes the device {target_name(device.id)}, {board.title} is "
            f"{target_name(board.images_for)}; build the firmware with the header that export-itf --device writes.",
            "bad-target",
        )


def io_sources(io: Description | None) -> list[Source]:
    """What messages about a description quote."""
    from plctool.compiler.base.source import Source

    return [] if io is None else [Source(path, text) for path, text in io.contents.items()]


def library_sources(libraries: Sequence[ImportedLibrary]) -> list[Source]:
    """What messages about libraries quote."""
    return [source for library in libraries for source in library.sources]


def check_sources(paths: Sequence[Path | str]) -> CheckResult:
    """Every diagnostic of a program and its unit tests, without building it."""
    files = program_files(paths)
    return check_with_tests(
        files.load_sources(), load=files.load_io, libraries=files.load_libraries(), information=files.information
    )


@no_collection()
def check_with_tests(
    sources: Sequence[Source],
    warnings: WarningOptions | None = None,
    load: Callable[[], Description | None] = lambda: None,
    libraries: Sequence[ImportedLibrary] = (),
    dialect: str | None = None,
    trees: Trees | None = None,
    observers: Sequence[Guest] = (),
    max_errors: int | None = None,
    information: Information | None = None,
) -> CheckResult:
    """Checks a program as it is built, and once more as its unit tests see it. `warnings`: which are wanted; all.
    `load` gets the inputs and outputs for each of both. `dialect` as in `compile_sources`, the others as in
    `front.check_sources`; unit tests are checked without `observers`."""
    from plctool.compiler.base.information import NO_INFORMATION
    from plctool.compiler.base.internal import bugs_reported
    from plctool.compiler.front import Trees, check_sources
    from plctool.compiler.syntax.diagnostics import MAX_ERRORS
    from plctool.compiler.syntax.warnings import ALL_WARNINGS
    from plctool.iec.dialect import find_dialect

    check = partial(
        check_sources,
        sources,
        warnings=warnings or ALL_WARNINGS,
        libraries=libraries,
        dialect=find_dialect(dialect),
        trees=trees or Trees(),
        max_errors=max_errors or MAX_ERRORS,
        information=information or NO_INFORMATION,
    )
    with bugs_reported():
        result = check(io=load(), observers=observers)
        if not result.has_tests:
            return result
        from plctool.compiler.semantics.unit_tests import TestSuite

        tests = check(tests=TestSuite(), io=load())
    found = dict.fromkeys([*result.diagnostics, *tests.diagnostics])
    found_sorted = sorted(found, key=lambda d: (d.file, d.line, d.column, d.severity, d.message))
    return replace(result, program=result.program if tests.ok else None, diagnostics=found_sorted)


def compile_sources(
    paths: Sources,
    *,
    target: str | None = None,
    level: Level = 2,
    checks: str = "all",
    debug: bool = False,
    warnings: WarningOptions | None = None,
    io: IoFiles | None = None,
    libraries: Sequence[Path | str] = (),
    board: str | None = None,
    firmware: Path | None = None,
    limits: bool = True,
    python: PythonFunctions | None = None,
    dialect: str | None = None,
    device_id: int = 0,
) -> BuildResult:
    """Compiles a program as `build` does. `io`: its inputs and outputs; `libraries`: folders or .zips of those that it
    uses; both are in `ProgramFiles` already. Of a project its files are taken, not its options (`request_of`). The
    others as in `BuildRequest`. Raises what `build` raises.
    """
    from plctool.compiler.sources.request import BuildRequest
    from plctool.compiler.syntax.warnings import ALL_WARNINGS

    request = BuildRequest(
        program_files(paths, io, libraries),
        target=target,
        level=level,
        checks=checks,
        debug=debug,
        warnings=warnings or ALL_WARNINGS,
        board=board,
        firmware=firmware,
        limits=limits,
        dialect=dialect,
        device_id=device_id,
    )
    return build(request, python)


@no_collection()
def build(request: BuildRequest, python: PythonFunctions | None = None, kept: KeptBuild | None = None) -> BuildResult:
    """Compiles a program. `python`: functions that Python implements, in the simulator. `kept`: what the next build in
    this process uses again.

    Raises CompileError when the program has errors, UsageError for options that make no sense and for a program that
    does not fit its device, InternalError when the compiler has a bug.
    """
    from plctool.compiler.base.internal import bugs_reported
    from plctool.compiler.front import check_sources
    from plctool.compiler.image.build import build_program
    from plctool.compiler.image.fit import board_meant, check_program_fits
    from plctool.compiler.image.online_change import previous_of
    from plctool.compiler.kept.tree_cache import trees_of_user
    from plctool.compiler.syntax.diagnostics import render_all
    from plctool.iec.dialect import find_dialect

    files = request.files
    system = find_dialect(_dialect_of(files) if request.dialect is None else request.dialect)
    description = files.load_io()
    board = _board(request)
    options = _options(request, board, description)
    _check_device(board, description)
    device = None if description is None else description.device
    if description is not None:
        description.board = board_meant(options.target, board, device)
    sources = files.load_sources()
    imported = files.load_libraries()
    shown = [*sources, *io_sources(description), *library_sources(imported)]
    previous = None if request.base is None else previous_of(request.base)

    def check(trees: Trees | None, observers: Sequence[Guest] = ()) -> CheckResult:
        return check_sources(
            sources,
            warnings=request.warnings,
            io=description,
            libraries=imported,
            python=python,
            dialect=system,
            information=files.information,
            trees=trees,
            observers=observers,
            previous=previous,
        )

    with bugs_reported():
        if kept is None:
            checked = check(trees_of_user() if request.cache else None)
        elif imported or description is not None or python is not None:
            kept.forget()
            checked = check(kept.trees)
        else:
            checked = kept.check(request, sources, previous, lambda observer: check(kept.trees, [observer]))
    if checked.program is None:
        raise CompileError(checked.diagnostics, shown)
    # No time of build: the same sources give the same image, so that its symbols are found again anywhere.
    info = replace(files.info, date=source_date(), properties=_properties_of(files.information))
    with bugs_reported():
        code, changed = (None, None) if kept is None else (kept.code, kept.changed)
        built = build_program(checked.program, options, info, change=checked.change, code=code, changed=changed)
    if kept is not None:
        kept.built(built)
    if request.limits:
        check_program_fits(built, options.target, board, device)
    found = checked.diagnostics
    return replace(built, warnings=found, rendered_warnings=render_all(found, shown), dumps=options.passes.dumps)


def _properties_of(information: Information) -> dict[str, ImageProperty]:
    """What components in C may ask for (AppProperties.h)."""
    from plctool.image.file import ImageProperty

    texts = {key.capitalize(): text for key, text in information.strings.items() if key in ("title", "company")}
    return {key: ImageProperty("T", text) for key, text in texts.items()} | {
        key: ImageProperty(found.kind.name[0], found.value) for key, found in information.properties.items()
    }


def _board(request: BuildRequest) -> Board | None:
    """The board that a program is for, if one is named."""
    from plctool.image.board import board_of, read_firmware

    if request.board is None and request.firmware is None:
        return None
    return board_of(request.board, None if request.firmware is None else read_firmware(request.firmware))


def _options(request: BuildRequest, board: Board | None, io: Description | None) -> Options:
    """What the code generator is asked for. Raises UsageError for a target that the board does not have."""
    from plctool.compiler.codegen.lower_unit import Options, parse_checks
    from plctool.compiler.codegen.object_cache import cache_of_user
    from plctool.compiler.codegen.passes import parse_passes
    from plctool.image.targets import find_target

    target = find_target(_target(request.target, board, io))
    stacks = None
    if request.firmware is not None and not target.hosted:
        from plctool.compiler.codegen.firmware_stacks import FirmwareStacks  # late, as it loads a reader of ELF files

        stacks = FirmwareStacks(request.firmware, target.machine)
    number, size = (2, True) if request.level == "s" else (request.level, False)
    passes = parse_passes(request.no_pass, request.dump_after)
    device = None if io is None or io.device is None or io.device.target != target.name else io.device
    own = request.device_id or (board.images_for if board is not None else device.id if device is not None else 0)
    options = Options(
        target,
        number,
        parse_checks(request.checks),
        request.debug,
        size,
        stacks,
        passes,
        cache_of_user() if request.cache else None,
        own,
    )
    if board is not None and board.target != target.name:
        raise UsageError(
            f"{board.title} has a {board.target}, not a {target.name}; leave the target out, or name a board that has "
            "it.",
            "bad-target",
        )
    return options


def _dialect_of(files: ProgramFiles) -> str | None:
    from plctool.compiler.sources.dialect_of_files import dialect_of_files

    found = dialect_of_files(files.source_files)
    return None if found is None else found[0]
