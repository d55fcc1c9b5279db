"""The file `lock` of CiA 405 in a folder of DCFs: only one tool writes at a time, all may read."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from plctool.errors import UsageError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

FILE_NAME = "lock"
_LONGEST = 100  # characters of the name of a tool


@contextmanager
def locked(folder: Path, tool: str = "plctool") -> Iterator[None]:
    """Has the folder for this tool alone. Raises UsageError with the name of the tool that has it."""
    with (folder / FILE_NAME).open("a+", encoding="utf-8", errors="replace") as file:
        try:
            if fcntl is not None:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            file.seek(0)
            holder = file.read(_LONGEST).strip() or "Another tool"
            raise UsageError(f"{holder} has locked {folder}; export again when it has finished.", "locked") from None
        file.truncate(0)
        file.write(tool)
        file.flush()
        try:
            yield
        finally:
            file.truncate(0)
