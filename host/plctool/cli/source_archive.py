"""The sources of a program as one file, from which the same image can be made again."""

from __future__ import annotations

import io
import json
import os
import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

from plctool.archives import ArchiveError, read_archive
from plctool.errors import DeviceError, UsageError
from plctool.files import make_folder, write_atomically
from plctool.link.file_services import SOURCE_NAME

if TYPE_CHECKING:
    from plctool.cli.projects import Settings
    from plctool.compiler.sources.program_files import ProgramFiles
    from plctool.debug.symbols import SymbolTable

_FACTS = "plctool-source.json"
_FORMAT = 1
_BASE = "plctool-base.sym"
_NO_TIME = (1980, 1, 1, 0, 0, 0)  # the same sources are the same archive


@dataclass(frozen=True)
class Archive:
    """What a device keeps. `crc`: of the image that the sources make; `build`: the words after `plctool build`."""

    crc: int
    build: list[str]
    files: dict[str, bytes]

    def pack(self) -> bytes:
        out = io.BytesIO()
        facts = {"format": _FORMAT, "image_crc": self.crc, "build": self.build}
        with zipfile.ZipFile(out, "w") as file:
            for name, data in {_FACTS: json.dumps(facts).encode(), **dict(sorted(self.files.items()))}.items():
                info = zipfile.ZipInfo(name, _NO_TIME)
                info.compress_type, info.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
                file.writestr(info, data, compresslevel=9)
        return out.getvalue()

    def unpack(self, folder: Path) -> list[Path]:
        """Writes the files below a folder that is empty or new. Raises UsageError if it is not."""
        make_folder(folder)
        if any(folder.iterdir()):
            raise UsageError(f"{folder} is not empty; name another folder with -o.", "cannot-write")
        written = []
        for name, data in self.files.items():
            path = folder / name
            make_folder(path.parent)
            write_atomically(path, data)
            written.append(path)
        return written


def unpacked(data: bytes) -> Archive:
    """Raises DeviceError for what `pack` did not write: any tool may have put it on the device."""
    try:
        files = read_archive(data)
        return _archive(json.loads(files.pop(_FACTS, b"{}")), files)
    except ArchiveError as error:
        raise _refused(error.why) from None
    except RecursionError:
        raise _refused(f"has a {_FACTS} that is nested too deeply") from None
    except ValueError as error:
        raise _refused(f"has a {_FACTS} that cannot be read: {error}") from None


def _archive(facts: Any, files: dict[str, bytes]) -> Archive:
    """Raises ArchiveError unless the facts are those that `pack` writes."""
    if not isinstance(facts, dict) or facts.get("format") != _FORMAT:
        raise ArchiveError(f"has no {_FACTS} of format {_FORMAT}")
    crc, build = facts.get("image_crc"), facts.get("build")
    if type(crc) is not int or not 0 <= crc < 1 << 32:
        raise ArchiveError(f"has no CRC of an image in {_FACTS}")
    if not isinstance(build, list) or not all(isinstance(word, str) for word in build):
        raise ArchiveError(f"has no words after 'plctool build' in {_FACTS}")
    folders = {str(folder).casefold() for name in files for folder in PurePosixPath(name).parents}
    if both := next((name for name in files if str(PurePosixPath(name)).casefold() in folders), None):
        raise ArchiveError(f"has '{both}' as a file and as a folder")
    return Archive(crc, build, files)


def _refused(why: str) -> DeviceError:
    return DeviceError(
        f"{SOURCE_NAME} on the device {why}; put the sources there again with 'plctool source put', or get it as it is "
        f"with 'plctool files get {SOURCE_NAME}'.",
        "bad-source",
    )


def archive_of(settings: Settings, crc: int, target: str, base: SymbolTable | None = None) -> Archive:
    """The sources of an image with that CRC, made for a target. They are compiled again from the archive: raises
    UsageError unless that gives the same image. `base`: the symbols of the image that this one has replaced in an
    online change, which say where its variables are."""
    archive = collected(settings, crc, target)
    if base is not None:
        archive.files[_BASE] = base.to_json().encode()
        archive.build.extend(["--base", _BASE])
    with tempfile.TemporaryDirectory(prefix="plctool-source-") as folder:
        found = _built_crc(archive, Path(folder))
    if found != crc:
        raise UsageError(
            f"These sources do not make this image (CRC {crc:08X}, they make {found:08X}): build it again from them, "
            "with the options that are in plc.toml. Of a program with inputs and outputs the board is named there, by "
            "the name in device.toml, or by --board of 'plctool source put'.",
            "other-source",
        )
    return archive


def collected(settings: Settings, crc: int, target: str) -> Archive:
    """The sources as they are now, not compiled."""
    settings = replace(settings, target=settings.target or target)
    root = Path(os.path.commonpath(list(_folders(settings))))
    return Archive(crc, _words(settings, root), {_below(root, path): path.read_bytes() for path in _files(settings)})


@contextmanager
def unpacked_settings(archive: Archive, folder: Path) -> Iterator[Settings]:
    """The settings that build the program of an archive, unpacked into a folder, which is the current one meanwhile."""
    from plctool.cli.arguments import add_build_arguments
    from plctool.cli.online_changes import with_base
    from plctool.cli.parser import Parser
    from plctool.cli.projects import settings_of

    archive.unpack(folder)
    before = Path.cwd()
    os.chdir(folder)
    try:
        parser = Parser(prog="plctool build")
        add_build_arguments(parser)
        args = parser.parse_args([*archive.build, "--no-limits", "-o", "app.cdl"])
        yield with_base(settings_of(args), args)
    finally:
        os.chdir(before)


def _files(settings: Settings) -> Iterator[Path]:
    """All that is read or has to be there, each once, as paths of real files."""
    project = settings.files.project
    of_project = (project.file, project.io, project.device) if project is not None else ()
    every = (*settings.files.every_file(), *(path for path in of_project if path is not None))
    yield from dict.fromkeys(path.resolve() for path in every)


def _folders(settings: Settings) -> Iterator[Path]:
    """That contain all of it. A folder that was named keeps its name in the archive, because the image may have it."""
    yield from (path.parent for path in _files(settings))
    project = settings.files.project
    named = settings.files.sources if project is None else [project.file.resolve().parent]
    for path in (*named, *_named_libraries(settings.files)):
        yield path.resolve().parent if path.name else path.resolve()


def _named_libraries(files: ProgramFiles) -> list[Path]:
    """Those that the project does not name. Names that need no files are left out."""
    from plctool.compiler.sources.library_files import libraries_at

    known = files.project.libraries if files.project is not None else []
    return [path for path in files.libraries if path not in known and libraries_at(path)]


def _below(root: Path, path: Path) -> str:
    return path.resolve().relative_to(root).as_posix()


def _words(settings: Settings, root: Path) -> list[str]:
    """What makes the image, in the folder of the archive."""
    files, project = settings.files, settings.files.project
    named = files.sources if project is None else [project.file]
    words: list[Any] = [_below(root, path) for path in named]
    for path in _named_libraries(files):
        words += ["--library", _below(root, path)]
    if files.io.description not in (None, project and project.io):
        words += ["--io", _below(root, files.io.description)]
    if files.io.device not in (None, project and project.device):
        words += ["--device", _below(root, files.io.device)]
    words += ["--board", settings.board] if settings.board else ["--target", settings.target]
    words += [f"-O{settings.level}", "--checks", settings.checks]
    words += [] if settings.dialect is None else ["--dialect", settings.dialect]
    words += ["--debug" if settings.debug else "--no-debug"]
    words += ["--no-werror"] if settings.warnings.as_errors else []  # it may have been built so: the image is the same
    return list(map(str, words))


def _built_crc(archive: Archive, folder: Path) -> int:
    from plctool.cli.builds import compiled

    with unpacked_settings(archive, folder) as settings:
        return compiled(settings).crc
