"""Bugs of the compiler itself: where in the program they show.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from plctool.compiler.typed.nodes import Pos
from plctool.errors import InternalError, PlcError

_POSITION = "position_in_program"


def note_position(error: BaseException, pos: Pos) -> None:
    """Says that an exception was raised while what is at `pos` was compiled; the first to say so, who is the
    innermost, is right. It is called where an exception passes, so nothing has to be noted while all is well."""
    if pos.file and not hasattr(error, _POSITION):
        setattr(error, _POSITION, pos)


@contextmanager
def bugs_reported() -> Iterator[None]:
    """Turns every exception that is not meant for people into an InternalError that names the position in the
    program."""
    try:
        yield
    except PlcError:
        raise
    except Exception as error:
        pos: Pos | None = getattr(error, _POSITION, None)
        where = f" at {pos.file}:{pos.line}" if pos is not None else ""
        raise InternalError(error, where) from error
