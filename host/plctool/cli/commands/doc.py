"""`plctool doc`: pages of a library or program, made of its comments."""

from __future__ import annotations

import argparse
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from plctool.cli import output
from plctool.cli.documents import Document
from plctool.cli.parser import Parser
from plctool.errors import UsageError, counted
from plctool.files import file_path, make_folder, usable_path, write_atomically

if TYPE_CHECKING:
    from plctool.doc.pages import Title

_FORMATS = ("html", "markdown")


def doc_arguments(command: Parser) -> None:
    command.add_argument(
        "sources", nargs="*", type=usable_path, metavar="FILE.st|DIR|FILE.zip",
        help="for a folder, all sources in it; a library (with library.toml); without any, the project of the current "
        "folder (plc.toml)",
    )  # fmt: skip
    command.add_argument(
        "-o", "--output", type=file_path, default=Path("doc"), metavar="DIR", help="where the pages go; default: doc"
    )
    command.add_argument("--format", choices=_FORMATS, default="html", help="of the pages; default: html")
    command.add_argument("--private", action="store_true", help="also what is PRIVATE or INTERNAL")
    command.set_defaults(action=_doc)


def _doc(args: argparse.Namespace) -> int:
    return output.show(args, document(args.sources, args.output, args.format, private=args.private), _text)


def _text(document: Document) -> str:
    return f"{counted(document['pages'], 'page')} in {document['index']}"


def document(paths: list[Path], folder: Path, form: str, *, private: bool) -> Document:
    """Writes the pages into a folder. Raises UsageError for sources with syntax errors, and before anything is
    written."""
    if find_spec("docutils") is None:
        raise UsageError("The pages need docutils; install it with: pip install 'plctool[doc]'", "not-installed")
    from plctool.cli.projects import needed_project
    from plctool.compiler import program_files
    from plctool.compiler.sources.library_files import is_library, read_library
    from plctool.doc.model import read_items
    from plctool.doc.pages import pages

    named = paths or [needed_project()]
    library = read_library(named[0]) if len(named) == 1 and is_library(named[0]) else None
    files = program_files(named)
    sources = files.load_sources() if library is None else library.sources
    items = read_items(sources, private=private)
    if not items:
        raise UsageError("These sources declare no block, function, type or global variable to write about.", "nothing")
    title = _title(named[0], files.info if library is None else library)
    made = pages(items, title, form)
    make_folder(folder)
    for name, text in made.items():
        write_atomically(folder / name, text.encode())
    index = folder / ("index.html" if form == "html" else "index.md")
    return {"index": str(index), "pages": sum(name.endswith(index.suffix) for name in made)}


def _title(path: Path, info: object) -> Title:
    from plctool.doc.pages import Title

    name = getattr(info, "project", "") or getattr(info, "name", "") or path.resolve().stem
    return Title(name, getattr(info, "version", ""), getattr(info, "description", ""))
