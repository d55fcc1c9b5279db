"""The image that a command on a project works with: built first if the program, the options or plctool have changed.

The symbol file keeps a fingerprint of all that the image was made of. Modification times are not compared: a checkout
changes them without the program, a deleted file the program without them.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import TYPE_CHECKING

from plctool.errors import UsageError
from plctool.files import MAX_BINARY, read_regular
from plctool.version import plctool_version

if TYPE_CHECKING:
    from plctool.cli.projects import Settings


def fingerprint(settings: Settings) -> str:
    """Returns a number for all that an image is made of: plctool, the options, and the name and content of each file.
    Names begin at the project, so that a copy of its folder has the same. Raises UsageError for files that cannot be
    read."""
    project = settings.files.project
    folder = project.file.parent if project is not None else Path()
    digest = hashlib.sha256()
    options = (settings.target, settings.level, settings.checks, settings.debug, settings.board, settings.limits,
               settings.dialect, settings.no_pass, settings.files.info, settings.files.information)  # fmt: skip
    digest.update(repr((plctool_version(), options)).encode())
    for name, path in sorted((os.path.relpath(path, folder), path) for path in set(settings.every_file())):
        content = hashlib.sha256(_content(path)).hexdigest()
        digest.update(f"\0{name}\0{content}".encode(errors="surrogateescape"))
    return digest.hexdigest()


def _content(path: Path) -> bytes:
    try:
        return read_regular(path, MAX_BINARY)
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}.", "no-source") from None


def is_fresh(settings: Settings) -> bool:
    """True if the image of a project is there, and was made of what its files and options are now."""
    from plctool.debug.symbols import load_symbols, symbol_path
    from plctool.files import read_image
    from plctool.image.file import image_crc

    try:
        symbols = load_symbols(symbol_path(settings.output))
        if not symbols.made_of or symbols.image_crc != image_crc(read_image(settings.output)):
            return False
    except UsageError:
        return False
    return symbols.made_of == fingerprint(settings)
