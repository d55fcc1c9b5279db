"""Reports of builds and checks in the user's cache folder: what was built or checked already is not compiled again.

A report is found by a hash of all that the build or check depends on. That of a build is used only while image and
symbol file are the ones that this build has written. So no image comes from the cache, only what the build has said
about it.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import json
import os
import sys
import zlib
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plctool.cli.documents import Document
from plctool.errors import UsageError
from plctool.files import MAX_BINARY, cache_folder, read_regular

if TYPE_CHECKING:
    from plctool.cli.projects import Settings
    from plctool.compiler.codegen.object_cache import ObjectCache

LIMIT = 20 << 20  # bytes of all reports
_LARGEST = 64 << 20  # bytes of one that is unpacked
_FASTEST = 1  # of zlib

Report = tuple[Document, list[str]]
"""The document of a build or check, and its diagnostics as users read them."""


def report_folder() -> ObjectCache:
    """Returns where the reports are."""
    from plctool.compiler.codegen.object_cache import ObjectCache

    return ObjectCache(cache_folder() / "reports", LIMIT)


@dataclass(frozen=True)
class KeptReport:
    """The place of the report of one build or check. `files`: what it has written."""

    folder: ObjectCache
    key: str
    files: tuple[Path, ...]

    def find(self) -> Report | None:
        """Returns the report; None if there is none, or if a file that was written has changed."""
        from plctool.debug.symbols import cache_path

        packed = self.folder.get(self.key)
        if packed is None:
            return None
        try:
            found = json.loads(zlib.decompressobj().decompress(packed, _LARGEST))
            hashes, document, warnings = found["files"], found["document"], found["warnings"]
            # Commands that know the CRC only need the copy of the symbols.
            has_copy = not self.files or cache_path(int(document["crc"], 16)).exists()
        except (ValueError, TypeError, KeyError, zlib.error, RecursionError):
            return None
        texts = isinstance(warnings, list) and all(isinstance(text, str) for text in warnings)
        if not (texts and has_copy and isinstance(document, dict) and hashes == self._hashes() and None not in hashes):
            return None
        return document, warnings

    def keep(self, document: Document, warnings: list[str]) -> None:
        """Keeps the report of a build or check that has just ended."""
        text = json.dumps({"files": self._hashes(), "document": document, "warnings": warnings})
        self.folder.put(self.key, zlib.compress(text.encode(), _FASTEST))

    def _hashes(self) -> list[str | None]:
        return [_hash(file) for file in self.files]


def kept_report(settings: Settings, made_of: str) -> KeptReport | None:
    """Returns the place of the report of a build; None if such a build is made each time. `made_of`: the fingerprint of
    sources and options."""
    from plctool.compiler import source_date
    from plctool.debug.symbols import symbol_path

    if settings.base is not None or settings.dump_after is not None:
        return None
    facts = ("build", source_date(), settings.firmware, settings.device_id, str(settings.output))
    return _place(settings, made_of, facts, (settings.output, symbol_path(settings.output)))


def kept_check(settings: Settings) -> KeptReport | None:
    """Returns the place of the report of a check; None if there are files that cannot be read, and if nothing is
    kept."""
    from plctool.cli.fresh_image import fingerprint

    if not settings.cache:
        return None
    try:
        return _place(settings, fingerprint(settings), ("check",), ())
    except UsageError:
        return None


def _place(settings: Settings, made_of: str, others: tuple[object, ...], files: tuple[Path, ...]) -> KeptReport | None:
    """`others`: what the report depends on besides sources, options and plctool."""
    folder = report_folder()
    if not settings.cache or not folder.usable():
        return None
    project = settings.files.project
    facts = (
        *(made_of, _code(), sys.version, settings.warnings, None if project is None else _hash(project.file)),
        *others,
        *(str(file) for file in settings.every_file()),  # as diagnostics name them
    )
    key = sha256(repr(facts).encode(errors="surrogatepass")).hexdigest()
    return KeptReport(folder, key, files)


def _hash(file: Path) -> str | None:
    try:
        return sha256(read_regular(file, MAX_BINARY)).hexdigest()
    except (OSError, UsageError):
        return None


def _code() -> list[tuple[str, int, int]]:
    """Returns the files of this plctool and of the module in C, each with its size and the time of its last change."""
    import _plccore

    found = []
    todo = [str(Path(__file__).parents[1])]
    native: Any = _plccore.__file__
    if native:
        found.append(_state(native, os.stat(native)))
    while todo:
        with os.scandir(todo.pop()) as entries:
            for entry in entries:
                if entry.is_dir(follow_symlinks=False):
                    todo += [entry.path] if entry.name != "__pycache__" else []
                else:
                    found.append(_state(entry.path, entry.stat()))
    return sorted(found)


def _state(path: str, status: os.stat_result) -> tuple[str, int, int]:
    return path, status.st_size, status.st_mtime_ns
