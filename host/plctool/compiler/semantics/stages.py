"""What a program is between the stages of its compilation; `front.py` leads from one to the next.

    Parsed    syntax trees
    Declared  names, types, classes, variables, tasks: all that the program declares
    Checked   typed bodies, and who calls whom
    Placed    a typed program with offsets and images of inputs and outputs, which `image/build.py` builds

Each is complete when it is made. A stage takes the previous one, so that nothing is checked that is not declared.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Sequence

from plctool.compiler.base.information import NO_INFORMATION, Information
from plctool.compiler.base.source import Source
from plctool.compiler.semantics.configuration import Application
from plctool.compiler.semantics.participants import Participant
from plctool.compiler.semantics.program import Program
from plctool.compiler.sources.imports import ImportedLibrary
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import Diagnostic, Diagnostics
from plctool.compiler.syntax.library import Library
from plctool.compiler.syntax.parser import ParsedText
from plctool.compiler.typed.nodes import TypedProgram
from plctool.compiler.typed.online_change import OnlineChange, Previous
from plctool.records import dataclass


@dataclass(frozen=True)
class Parsed:
    """A program as its sources have it. `syntax`: the syntax errors in them. `previous`: the program that it shall
    replace while that runs."""

    texts: Sequence[tuple[Source, ParsedText]]
    library: Library
    libraries: Sequence[ImportedLibrary]
    diagnostics: Diagnostics
    syntax: Sequence[Diagnostic] = ()
    information: Information = NO_INFORMATION
    previous: Previous | None = None

    @property
    def broken(self) -> bool:
        """True if a text, or a part of one, is not known, so that the program as a whole cannot be declared."""
        return bool(self.syntax) or any(source.absent or source.is_unreadable for source in self.sources)

    @property
    def sources(self) -> list[Source]:
        return [source for source, _ in self.texts]

    @property
    def has_tests(self) -> bool:
        """True if the program can be declared and has TEST blocks."""
        return not self.broken and any(isinstance(d, ast.TestDecl) for _, t in self.texts for d in t.declarations)


@dataclass(frozen=True)
class Declared:
    """A program whose bodies are not checked yet; they wait in its world."""

    program: Program
    application: Application
    sources: Sequence[Source]
    participants: Sequence[Participant]

    @property
    def diagnostics(self) -> Diagnostics:
        return self.program.world.diagnostics


@dataclass(frozen=True)
class Checked:
    """A program whose variables have no offsets yet."""

    program: Program
    application: Application
    sources: Sequence[Source]

    @property
    def diagnostics(self) -> Diagnostics:
        return self.program.world.diagnostics


@dataclass(frozen=True)
class Placed:
    """A program that can be built, if its diagnostics have no errors. `change`: how it takes the place of the previous
    one."""

    checked: Checked
    program: TypedProgram
    change: OnlineChange | None = None

    @property
    def diagnostics(self) -> Diagnostics:
        return self.checked.diagnostics
