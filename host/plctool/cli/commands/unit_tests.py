"""`plctool test`: the unit tests of a program in this process."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from plctool.cli import output
from plctool.cli.arguments import add_io_files, add_sources, add_warnings, utf8
from plctool.cli.builds import settings_with_dialect
from plctool.cli.documents import Document
from plctool.cli.output import EXIT_FAILED, EXIT_OK
from plctool.cli.overwriting import check_no_way_out, check_output
from plctool.cli.parser import Parser
from plctool.files import file_path, write_atomically

if TYPE_CHECKING:
    from plctool.cli.projects import Settings
    from plctool.st_tests import Report as TestReport


def test_arguments(command: Parser) -> None:
    add_sources(command)
    command.add_argument(
        "-k",
        "--filter",
        default="*",
        type=utf8,
        metavar="PATTERN",
        help="only tests whose name contains PATTERN (or matches it, with * and ?)",
    )
    command.add_argument("--junit", type=file_path, metavar="FILE", help="write a report in JUnit's format as well")
    command.add_argument(
        "--coverage",
        type=file_path,
        metavar="DIR",
        help="say which lines ran, and write index.html and cobertura.xml into this folder",
    )
    command.add_argument("-O", dest="level", type=int, choices=range(4), default=0, help="optimisation; default: 0")
    add_warnings(command)
    add_io_files(command)
    command.set_defaults(action=_test)


def _test(args: argparse.Namespace) -> int:
    from plctool.st_tests import report_text

    document, report = test(settings_with_dialect(args), args.filter, args.junit, args.coverage)
    output.print_warnings(args, report.warning_texts())
    output.show(args, document, lambda d: report_text(report), colours=True)
    return EXIT_FAILED if report.failed else EXIT_OK


def test(settings: Settings, pattern: str, junit: Path | None, coverage: Path | None) -> tuple[Document, TestReport]:
    """Runs the unit tests of a program, and writes their report to `junit` as well, and which lines ran into the folder
    `coverage`."""
    from plctool import st_tests

    if junit:
        check_output(junit, settings.files.every_file(), "--junit report.xml")
    if coverage:
        check_output(coverage / "cobertura.xml", settings.files.every_file(), "--coverage coverage")
        for file in coverage.iterdir() if coverage.is_dir() else ():
            check_no_way_out(file, coverage, "--coverage new-folder")
    report = st_tests.run_tests(
        settings.files,
        pattern=pattern,
        level=int(settings.level),
        warnings=settings.warnings,
        coverage=coverage is not None,
        dialect=settings.dialect,
    )
    if junit:
        write_atomically(junit, st_tests.junit_xml(report))
    if coverage and report.coverage:
        report.coverage.write_reports(coverage)
    return report.document(), report
