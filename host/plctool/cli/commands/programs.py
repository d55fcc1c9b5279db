"""`plctool build`, `check`, `new`: from sources to an image, their diagnostics, a project to begin with."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plctool.cli import output
from plctool.cli.arguments import add_build_arguments, add_io_files, add_sources, add_warnings
from plctool.cli.builds import build, build_text, compiled, settings_with_dialect
from plctool.cli.documents import Document, diagnostic_document
from plctool.cli.online_changes import change_document, change_text, with_base
from plctool.cli.output import EXIT_OK, EXIT_USAGE, table
from plctool.cli.overwriting import check_not_read, check_output
from plctool.cli.parser import Parser
from plctool.errors import UsageError
from plctool.files import file_path, usable_path, write_atomically
from plctool.project import IMAGE_SUFFIX
from plctool.templates import DEFAULT_TEMPLATE, TEMPLATES

if TYPE_CHECKING:
    from plctool.cli.projects import Settings
    from plctool.compiler.base.missing_names import Missing, Use
    from plctool.compiler.base.source import Source
    from plctool.compiler.syntax.diagnostics import Diagnostic


def build_arguments(command: Parser) -> None:
    add_build_arguments(command)
    command.set_defaults(action=_build)


def check_arguments(command: Parser) -> None:
    add_sources(command)
    command.add_argument(
        "--missing", action="store_true", help="print one table: the names it needs of libraries of other systems"
    )
    command.add_argument(
        "--sarif", type=file_path, metavar="FILE", help="write a report for code scanning (SARIF) as well"
    )
    command.add_argument("--junit", type=file_path, metavar="FILE", help="write a report in JUnit's format as well")
    command.add_argument(
        "--guidelines",
        action="store_true",
        help="hold the program to PLCopen's coding guidelines as well; plc.toml says to which forms and limits",
    )
    add_warnings(command)
    add_io_files(command)
    command.set_defaults(action=_check)


def new_arguments(command: Parser) -> None:
    command.add_argument(
        "folder", type=usable_path, metavar="NAME", help="of the project, and of the folder that is made for it"
    )
    kinds = "; ".join(f"{name}: {text}" for name, text in TEMPLATES.items())
    command.add_argument(
        "--template", choices=TEMPLATES, default=DEFAULT_TEMPLATE, help=f"{kinds}; default: {DEFAULT_TEMPLATE}"
    )
    command.set_defaults(action=_new)


def _build(args: argparse.Namespace) -> int:
    image = next((path for path in args.sources if path.suffix.lower() == IMAGE_SUFFIX), None)
    if image is not None:
        raise UsageError(f"{image} is not a source; to name the image that is built, write -o {image}.", "usage")
    settings = with_base(settings_with_dialect(args), args)
    if args.dry_run:
        planned = compiled(settings)
        output.print_warnings(args, planned.rendered_warnings)
        document = change_document(planned)
        output.show(args, document, change_text)
        return EXIT_USAGE if document["problems"] else EXIT_OK
    document, warnings = build(settings)
    output.print_warnings(args, warnings)
    if not args.json:
        document["warnings"] = []  # they are printed
    return output.show(args, document, build_text)


def _check(args: argparse.Namespace) -> int:
    settings = settings_with_dialect(args)
    if args.missing:
        document = missing(settings)
        output.show(args, document, missing_text)
        return EXIT_OK if all(name["stand_in"] for name in document["missing"]) else EXIT_USAGE
    document, texts = check(settings, CheckReports(args.sarif, args.junit))
    shown = document if args.json else {}  # there may be thousands
    output.show(args, shown, lambda _: "\n".join(texts), colours=True)
    return EXIT_USAGE if any(d["severity"] == "error" for d in document["diagnostics"]) else EXIT_OK


@dataclass(frozen=True)
class CheckReports:
    """The files that `check` writes for CI systems; None: not wanted."""

    sarif: Path | None = None
    junit: Path | None = None

    @property
    def wanted(self) -> bool:
        """True if there is a file to write."""
        return self.sarif is not None or self.junit is not None

    def check_names(self, inputs: Iterator[Path]) -> None:
        """Raises UsageError if a report would replace a file that is read, or one of another kind."""
        read = list(inputs)
        for file, option in ((self.sarif, "--sarif check.sarif"), (self.junit, "--junit check.xml")):
            if file is not None and file.suffix.lower() != ".xml":
                check_output(file, read, option)
            elif file is not None:
                check_not_read(file, read, option)

    def write(self, diagnostics: Sequence[Diagnostic], files: Sequence[str] = ()) -> None:
        """Writes those that are wanted; `files`: the sources that were checked."""
        from plctool.cli.check_reports import junit, sarif

        if self.sarif is not None:
            write_atomically(self.sarif, sarif(diagnostics))
        if self.junit is not None:
            write_atomically(self.junit, junit(diagnostics, files))


def check(settings: Settings, reports: CheckReports | None = None) -> tuple[Document, list[str]]:
    """Every diagnostic of a program, also as users read them, and the names it uses that nothing declares."""
    from plctool.cli.kept_reports import kept_check

    reports = reports or CheckReports()
    reports.check_names(settings.every_file())
    kept = None if reports.wanted else kept_check(settings)  # reports are made of what the check has found itself
    found = None if kept is None else kept.find()
    if found is not None:
        return found
    document, texts = _check_now(settings, reports)
    now = None if kept is None else kept_check(settings)
    if kept is not None and now is not None and now.key == kept.key:  # else a file has changed during the check
        kept.keep(document, texts)
    return document, texts


def _check_now(settings: Settings, reports: CheckReports) -> tuple[Document, list[str]]:
    from plctool.compiler.base.missing_names import missing_names
    from plctool.compiler.syntax.diagnostics import render_all

    diagnostics, sources, shown = _checked(settings)
    reports.write(diagnostics, [source.path for source in sources])
    document: Document = {"diagnostics": [diagnostic_document(d) for d in diagnostics]}
    if uses := _missing(diagnostics):
        document["missing"] = [_missing_document(m) for m in missing_names(uses)]
    return document, render_all(diagnostics, shown)


def missing(settings: Settings) -> Document:
    """The names of libraries of other systems that a program uses: those that nothing declares, and those that the
    standard library has. `other_errors`: how many there are besides."""
    from plctool.compiler.base.missing_names import missing_names
    from plctool.compiler.sources.stand_ins import library_of_stand_in, uses_of_stand_ins

    diagnostics, sources, _ = _checked(settings)
    absent = [_missing_document(m) | {"stand_in": False} for m in missing_names(_missing(diagnostics))]
    present = [
        _missing_document(m) | {"library": library_of_stand_in(m.name), "stand_in": True}
        for m in missing_names(uses_of_stand_ins(sources))
    ]
    others = sum(d.severity == "error" and not d.missing for d in diagnostics)
    return {"missing": absent + present, "other_errors": others}


def _checked(settings: Settings) -> tuple[list[Diagnostic], list[Source], list[Source]]:
    """Every diagnostic of a program, its sources, and all files that diagnostics are about."""
    from plctool.compiler import check_with_tests, io_sources, library_sources
    from plctool.compiler.kept.tree_cache import trees_of_user

    files = settings.files
    sources, libraries = files.load_sources(), files.load_libraries()
    result = check_with_tests(
        sources,
        settings.warnings,
        files.load_io,
        libraries,
        settings.dialect,
        trees=trees_of_user() if settings.cache else None,
        information=files.information,
    )
    return result.diagnostics, sources, [*sources, *io_sources(files.load_io()), *library_sources(libraries)]


def _missing(diagnostics: Sequence[Diagnostic]) -> list[Use]:
    from plctool.compiler.base.missing_names import Use

    return [Use(d.missing, d.file, d.line) for d in diagnostics if d.missing]


def _missing_document(name: Missing) -> Document:
    first = name.first
    return {"name": name.name, "library": name.library, "count": name.count, "file": first.file, "line": first.line}


def missing_text(document: dict[str, Any]) -> str:
    """What a program needs of libraries of other systems, a line for each name, and how much of it there is not."""
    names = document["missing"]
    rows = [
        {
            "name": n["name"],
            "library": n["library"] or "not known",
            "uses": n["count"],
            "stand-in": "yes" if n["stand_in"] else "no",
            "first at": f"{n['file']}:{n['line']}",
        }
        for n in names
    ]
    absent = [n for n in names if not n["stand_in"]]
    libraries = {n["library"] for n in absent if n["library"]}
    known = f", of which {sum(bool(n['library']) for n in absent)} seem to be of {len(libraries)} libraries"
    end = [f"{len(absent)} names are missing{known if libraries else ''}; {len(names) - len(absent)} have a stand-in."]
    if absent:
        end.append("Give their sources with the program or as a library (--library), or declare the names.")
    if others := document["other_errors"]:
        end.append(f"Errors about other things: {others}; 'plctool check' shows them.")
    return "\n".join([*([table(rows, rows[0])] if rows else []), *end])


def _new(args: argparse.Namespace) -> int:
    return output.show(args, new(args.folder, args.template), new_text)


def new(folder: Path, template: str) -> Document:
    """Makes a project."""
    from plctool.templates import new_project

    return {"folder": str(folder), "files": [str(file) for file in new_project(folder, template)]}


def new_text(document: dict[str, Any]) -> str:
    """What was made, and what to type next."""
    files = "\n".join(f"  {file}" for file in document["files"])
    folder = shlex.quote(document["folder"])
    return f"{files}\nNext: cd {folder}, then 'plctool test', 'plctool run --time T#5s', 'plctool build'."
