"""What is wrong with a description, each with its location."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from plctool.files import Pos

CODE = "io"


@dataclass(frozen=True)
class Mistake:
    """One finding; `message` is one sentence that says what to do."""

    pos: Pos
    message: str
    severity: Literal["error", "warning"] = "error"


@dataclass
class Mistakes:
    """All findings of the files that belong to a description."""

    found: list[Mistake] = field(default_factory=list)

    def error(self, pos: Pos, message: str) -> None:
        """Something that cannot be built."""
        self.found.append(Mistake(pos, message))

    def warning(self, pos: Pos, message: str) -> None:
        """Something that is probably not meant."""
        self.found.append(Mistake(pos, message, "warning"))
