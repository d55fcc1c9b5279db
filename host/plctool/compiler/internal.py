"""Bugs of the compiler itself: where in the program they show.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import traceback
from collections.abc import Iterator
from contextlib import contextmanager

from plctool.compiler.semantics.scope import Scope
from plctool.compiler.source import Source
from plctool.compiler.typed import Pos
from plctool.errors import InternalError, PlcError


@contextmanager
def bugs_reported() -> Iterator[None]:
    """Turns every exception that is not meant for people into an InternalError that names the place in the program."""
    try:
        yield
    except PlcError:
        raise
    except Exception as error:
        pos = position_of(error)
        where = f" at {pos.file}:{pos.line}" if pos is not None else ""
        raise InternalError(error, where) from error


def position_of(error: BaseException) -> Pos | None:
    """The place in the program that was being compiled, read from what the innermost functions were given; thus
    nothing has to be noted while all is well."""
    frames = [frame.f_locals for frame, _ in traceback.walk_tb(error.__traceback__)]
    for variables in reversed(frames):
        source = _source_of(variables.get("c") or variables.get("self"))
        for name, value in variables.items():
            pos = value if isinstance(value, Pos) else getattr(value, "pos", None)
            if name not in ("c", "self") and isinstance(pos, int) and not isinstance(value, int) and source is not None:
                pos = source.pos(pos)
            if isinstance(pos, Pos) and pos.file:
                return pos
    return None


def _source_of(checker: object) -> Source | None:
    """The text that a part of the front end checks."""
    scope = getattr(checker, "scope", None)
    return scope.source if isinstance(scope, Scope) else None
