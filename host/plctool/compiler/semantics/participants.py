"""What takes part in the check of a program between its stages: unit tests, functions in Python, the tasks of a device.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from typing import Protocol

from plctool.compiler.base.source import Source
from plctool.compiler.semantics.configuration import Application, configure
from plctool.compiler.semantics.event_functions import declare_event_functions
from plctool.compiler.semantics.exports_to_c import declare_called_programs, declare_exports
from plctool.compiler.semantics.program import Program
from plctool.compiler.semantics.task_links import link_programs
from plctool.compiler.syntax import ast

Files = list[tuple[Source, list[ast.Declaration]]]
"""The declarations of each file."""


class Participant:
    """Takes part in one check. A step that it does not need changes nothing."""

    def after_parse(self, files: Files) -> Files:
        """Returns the files as their names shall become known."""
        return files

    def after_declare(self) -> Application | None:
        """Adds declarations, before bodies are checked. Returns the tasks if this participant decides them."""
        return None

    def after_check(self) -> None:
        """Looks at what is checked. No variable has an offset yet."""


class Guest(Protocol):
    """Makes its participant for each check."""

    def begin(self, program: Program) -> Participant:
        """Returns the participant in the check of this program."""


class DeviceTasks:
    """The tasks that the program has on a device, in place of those of unit tests."""

    def begin(self, program: Program) -> Participant:
        """Returns the participant in the check of this program."""
        return _DeviceTasks(program)


class _DeviceTasks(Participant):
    def __init__(self, program: Program) -> None:
        self._program = program
        self._application = Application()

    def after_declare(self) -> Application:
        world = self._program.world
        self._application = configure(world, self._program.config)
        self._application.events = declare_event_functions(world)
        link_programs(world, self._application.tasks)
        declare_called_programs(world)
        return self._application

    def after_check(self) -> None:
        world = self._program.world
        world.io.check_tasks(self._application.tasks, world.diagnostics)
        self._application.exports = declare_exports(world, self._program.programs.declared())
