"""`plctool export`, `export-itf`: a program for other systems, its functions in C."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plctool.cli import io_documents, output
from plctool.cli.arguments import add_dialect, add_io_files, add_sources, add_warnings
from plctool.cli.builds import settings_with_dialect
from plctool.cli.documents import Document, diagnostic_document
from plctool.cli.output import table
from plctool.cli.overwriting import check_no_way_out, check_not_read
from plctool.cli.parser import Parser
from plctool.errors import UsageError
from plctool.files import file_path, write_atomically

if TYPE_CHECKING:
    from plctool.cli.projects import Settings


_MOST_M4 = 1 << 20  # bytes of an interface file


def export_arguments(command: Parser) -> None:
    add_sources(command)
    command.add_argument("-o", "--output", dest="xml", type=file_path, required=True, metavar="FILE.xml")
    add_warnings(command)
    add_io_files(command)
    command.set_defaults(action=_export)


def export_itf_arguments(command: Parser) -> None:
    add_sources(command)
    command.add_argument(
        "-o", "--output", type=file_path, default=Path(), metavar="DIR", help="default: the current folder"
    )
    command.add_argument("--force", action="store_true", help="also replace an implementation that is there already")
    command.add_argument(
        "--from", dest="m4", type=file_path, nargs="+", metavar="FILE.m4",
        help="read these interface and dependency files of a CODESYS component instead of sources",
    )  # fmt: skip
    add_dialect(command)
    add_io_files(command, "write the C header of this board instead")
    command.set_defaults(action=_export_itf)


def _export(args: argparse.Namespace) -> int:
    from plctool.compiler import source_date

    document, warnings = export(settings_with_dialect(args), args.xml, source_date())
    output.print_warnings(args, warnings)
    return output.show(args, document, lambda d: str(d["file"]))


def export(settings: Settings, output: Path, stamp: int) -> tuple[Document, list[str]]:
    """Writes a program as PLCopen XML; also what is left out, as users read it. `stamp`: when, in seconds since 1970.

    Raises CompileError when the program has errors, or a character that XML cannot hold; UsageError for a
    file that would be a source of the program itself.
    """
    from plctool.compiler import CompileError
    from plctool.compiler.base.internal import bugs_reported
    from plctool.compiler.front import check_sources, declared_names_asked_for
    from plctool.compiler.plcopen_export.inferred import with_types
    from plctool.compiler.plcopen_export.project import write_project
    from plctool.compiler.syntax.diagnostics import render
    from plctool.compiler.syntax.library import standard_library
    from plctool.iec.dialect import find_dialect

    files = settings.files
    check_not_read(output, files.every_file(), "-o exported.xml, in another folder")
    here = output.resolve()
    if output.suffix.lower() != ".xml":
        raise UsageError(f"PLCopen XML is written to a file whose name ends in .xml, not to {output}.", "bad-output")
    if any(path.is_dir() and here.is_relative_to(path.resolve()) for path in files.sources):
        message = f"{output} would be a source of this program itself; write it to another folder."
        raise UsageError(message, "bad-output")
    dialect = find_dialect(settings.dialect)
    sources, libraries = files.load_sources(), files.load_libraries()
    with bugs_reported():
        checked = check_sources(
            sources,
            warnings=settings.warnings,
            io=files.load_io(),
            libraries=libraries,
            dialect=dialect,
            information=files.information,
        )
        if checked.program is None:
            raise CompileError(checked.diagnostics, sources)
        declared = declared_names_asked_for(standard_library(), libraries, sources)
        sources = with_types(sources, checked.program.inferred)
        written = write_project(sources, files.info.project or output.stem, declared, stamp)
    if not written.ok:
        raise CompileError(written.diagnostics, sources)
    write_atomically(output, written.text.encode())
    document = {"file": str(output), "left_out": [diagnostic_document(d) for d in written.diagnostics]}
    return document, [render(d, sources) for d in written.diagnostics]


def _export_itf(args: argparse.Namespace) -> int:
    if args.m4 is not None:
        return output.show(args, export_m4(args.m4, args.output), m4_text)
    if args.device is not None:
        return output.show(args, export_board(args.device, args.output), lambda d: str(d["header"]))
    args.no_warn, args.werror = [], None
    return output.show(args, export_interface(settings_with_dialect(args), args.output, args.force), interface_text)


def export_interface(settings: Settings, folder: Path, force: bool) -> Document:
    """Writes the C header of the functions that are implemented in C and of what C calls and uses, and a C file for the
    former to fill in, unless there is one.

    Raises CompileError when the sources have errors, UsageError when there is nothing of either.
    """
    from plctool.compiler import CompileError, io_sources, library_sources
    from plctool.compiler.base.internal import bugs_reported
    from plctool.compiler.export_itf import export_interface as interface_of
    from plctool.compiler.front import check_sources
    from plctool.files import make_folder
    from plctool.iec.dialect import find_dialect
    from plctool.image.c_functions import version_text

    files, dialect = settings.files, find_dialect(settings.dialect)
    # A file of functions alone has not the programs that a description beside it names.
    io = None if files.project is None and files.io.description is None else files.load_io()
    sources, libraries = files.load_sources(), files.load_libraries()
    with bugs_reported():
        checked = check_sources(sources, io=io, libraries=libraries, dialect=dialect, information=files.information)
    if checked.program is None:
        raise CompileError(checked.diagnostics, [*sources, *io_sources(io), *library_sources(libraries)])
    functions, exports = checked.program.externals, checked.program.exports
    if not functions and not exports:
        raise UsageError(
            "No function is implemented in C; mark those that are by {attribute 'external' := 'name'}, and what C "
            "calls or uses by {attribute 'from_c'}.",
            "no-external",
        )
    named = files.sources[0] if files.project is None else files.project.file.parent
    interface = interface_of(named.resolve().stem, functions, exports)
    header, source = folder / interface.header_name, folder / interface.source_name
    written = bool(functions) and (force or not source.exists())
    for file in (header, source) if written else (header,):
        check_not_read(file, files.every_file(), "-o interface, a folder for it")
        check_no_way_out(file, folder, "-o interface, a folder for it")
    make_folder(folder)
    write_atomically(header, interface.header.encode("latin-1", "replace"))
    if written:
        write_atomically(source, interface.source.encode("latin-1", "replace"))
    return {
        "header": str(header),
        "source": str(source) if functions else "",
        "source_written": written,
        "functions": [
            {"interface": text, "signature": f"{signature:08X}", "version": version_text(version)}
            for text, signature, version in interface.functions
        ],
        "exports": [{"name": export.name, "signature": f"{export.signature:08X}"} for export in exports],
    }


def interface_text(document: dict[str, Any]) -> str:
    """The functions of a C interface, what C calls and uses, and the files."""
    lines = [table(rows, rows[0]) for rows in (document["functions"], document["exports"]) if rows]
    lines.append(document["header"])
    if document["source"]:
        kept = "" if document["source_written"] else " (kept as it is; --force replaces it)"
        lines.append(f"{document['source']}{kept}")
    return "\n".join(lines)


def export_m4(files: list[Path], folder: Path) -> Document:
    """Writes what a component of CODESYS needs here, from its m4 files. Raises UsageError with the line."""
    from plctool.compiler.semantics.declarations.functions import interface_text as text_of
    from plctool.files import make_folder, read_regular
    from plctool.image.c_functions import version_text
    from plctool.v3.component import export_component
    from plctool.v3.m4_interface import read_m4

    component = export_component([read_m4(str(f), read_regular(f, _MOST_M4).decode("latin-1")) for f in files])
    for name in component.files:
        check_not_read(folder / name, files, "-o interface, a folder for it")
        check_no_way_out(folder / name, folder, "-o interface, a folder for it")
    make_folder(folder)
    for name, text in component.files.items():
        write_atomically(folder / name, text.encode("latin-1", "replace"))
    functions = [(pou.external, pou) for pou in component.functions if pou.external is not None]
    return {
        "files": [str(folder / name) for name in component.files],
        "functions": [
            {
                "interface": text_of(external.name, pou),
                "signature": f"{external.signature:08X}",
                "version": version_text(external.version),
            }
            for external, pou in functions
        ],
    }


def m4_text(document: dict[str, Any]) -> str:
    """The functions that programs call, and the files."""
    rows = document["functions"]
    return "\n".join([*([table(rows, rows[0])] if rows else []), *document["files"]])


def export_board(device: Path, folder: Path) -> Document:
    """Writes the C header of a board from what its vendor says of it (`device.toml`)."""
    from plctool.files import make_folder
    from plctool.io.board_header import board_header

    name, text = board_header(io_documents.board_file(device))
    check_not_read(folder / name, [device], "-o interface, a folder for it")
    check_no_way_out(folder / name, folder, "-o interface, a folder for it")
    make_folder(folder)
    write_atomically(folder / name, text.encode("ascii"))
    return {"header": str(folder / name)}
