"""What `plctool fmt` does with files: reads them, formats them, writes those that change."""

from __future__ import annotations

import difflib
import os
import stat
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import BinaryIO

from plctool.cli.documents import Document
from plctool.compiler import program_files
from plctool.compiler.base.garbage import no_collection
from plctool.compiler.formats import unreadable
from plctool.compiler.sources.project import read_project
from plctool.compiler.sources.source_files import READERS, TEXTS, encoding_of
from plctool.errors import PlcError, UsageError, listed
from plctool.files import check_inside, read_regular, write_atomically
from plctool.fmt.formatter import DEFAULT_WIDTH, Range, formatted
from plctool.project import find_project, project_named

MAX_FORMATTED = 2 << 20
"""Bytes of a file that is formatted; the compiler reads larger ones."""
CHANGED = ("formatted", "not formatted")
_INPUT = "<stdin>"  # the name of the standard input in messages
TEXT_ONLY = f"plctool fmt formats Structured Text in files {listed(TEXTS, 'and')}"


@dataclass(frozen=True)
class _Result:
    """A file before and after."""

    name: str
    before: bytes
    after: bytes
    diff: str = ""


def format_files(sources: Sequence[Path], ranges: Sequence[Range], *, writes: bool) -> Document:
    """Formats the files named, those in folders, or those of a project. Unless it `writes`, it only compares. A file
    that cannot be formatted is left as it is; the document says why."""
    files = list(_files(sources))
    if ranges and (len(files) != 1 or sources[0].is_dir()):
        raise UsageError("--lines is for one file; name it.", "usage")
    return _document([_entry(file, ranges, writes) for file in files])


def format_input(stream: BinaryIO, ranges: Sequence[Range], *, writes: bool) -> tuple[Document, bytes]:
    """Formats the standard input. Returns the document and the formatted bytes. Raises UsageError if that is not
    possible."""
    data = stream.read(MAX_FORMATTED + 1)
    result = _formatted(_INPUT, Path(_INPUT), data, _width(Path()), ranges)
    entry = _result_entry(result, writes)
    if writes:
        entry["formatted_text"] = _decoded(result.after)
    return _document([entry]), result.after


def _document(files: list[Document]) -> Document:
    return {"changed": sum(file["state"] in CHANGED for file in files), "files": files}


def _files(sources: Sequence[Path]) -> Iterator[Path]:
    """The files that the sources name, each once."""
    seen: set[Path] = set()
    for file in (file for source in sources for file in _files_of(source)):
        real = file.resolve()
        if real not in seen:
            seen.add(real)
            yield file


def _files_of(source: Path) -> Sequence[Path]:
    """A file, all sources in a folder, or those that a project names."""
    if project_named([source]) is not None:
        return program_files([source]).source_files
    if not source.is_dir():
        return [source]
    files = sorted(path for path in source.rglob("*") if path.suffix.lower() in READERS and path.is_file())
    if not files:
        raise UsageError(f"The folder {source} has no sources; {TEXT_ONLY}.", "no-source")
    for file in files:
        check_inside(file, source)
    return files


def _entry(file: Path, ranges: Sequence[Range], writes: bool) -> Document:
    if file.suffix.lower() not in TEXTS:
        return {"file": str(file), "state": "left"}
    try:
        result = _formatted(str(file), file, _content(file), _width(file.parent), ranges)
        if writes and result.after != result.before:
            _write(file, result.after)
    except PlcError as error:
        return {"file": str(file), "state": "refused", "message": error.message}
    return _result_entry(result, writes)


def _content(file: Path) -> bytes:
    try:
        return read_regular(file, MAX_FORMATTED)
    except OSError as error:
        raise UsageError(f"{file} cannot be read: {error.strerror}.", "no-source") from None


def _write(file: Path, data: bytes) -> None:
    """Writes a file that keeps its rights."""
    mode = stat.S_IMODE(os.stat(file).st_mode)
    write_atomically(file, data)
    os.chmod(file, mode)


def _formatted(name: str, path: Path, data: bytes, width: int, ranges: Sequence[Range]) -> _Result:
    if len(data) > MAX_FORMATTED:
        raise UsageError(f"{name} has more than {MAX_FORMATTED >> 20} MiB; split it.", "too-large")
    if why := unreadable.refusal(path, data):
        raise UsageError(f"{name}: {why}.", "no-source")
    mark, encoding = encoding_of(data)
    text = data[len(mark) :].decode(encoding, "replace")
    if mark + text.encode(encoding, "replace") != data:
        raise UsageError(f"{name} has characters that are not valid {encoding.upper()}; save it again.", "no-source")
    with no_collection():
        after = formatted(name, text, width, ranges)
    return _Result(name, data, mark + after.encode(encoding))


def _decoded(data: bytes) -> str:
    mark, encoding = encoding_of(data)
    return data[len(mark) :].decode(encoding)


def _result_entry(result: _Result, writes: bool) -> Document:
    if result.after == result.before:
        return {"file": result.name, "state": "unchanged"}
    if writes:
        return {"file": result.name, "state": "formatted"}
    return {"file": result.name, "state": "not formatted", "diff": "".join(_diff(result))}


def _diff(result: _Result) -> Iterable[str]:
    before, after = (_decoded(data).replace("\r\n", "\n").splitlines() for data in (result.before, result.after))
    for line in difflib.unified_diff(before, after, result.name, f"{result.name} (formatted)", lineterm=""):
        yield f"{line}\n"


@cache
def _width(folder: Path) -> int:
    """The length of lines that the project of a folder wants."""
    project = find_project(folder)
    return (read_project(project).line_length if project is not None else None) or DEFAULT_WIDTH
