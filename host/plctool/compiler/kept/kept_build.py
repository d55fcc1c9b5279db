"""What a process that stays keeps of the last build of a program, so that the next one takes a fraction of the time.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from plctool.compiler.codegen.kept_code import KeptCode
from plctool.compiler.front import CheckResult, Trees
from plctool.compiler.kept.kept_program import KeptProgram, Observer
from plctool.compiler.kept.tree_cache import trees_of_user
from plctool.compiler.typed.nodes import Pou

if TYPE_CHECKING:
    from plctool.compiler.base.source import Source
    from plctool.compiler.image.build import BuildResult
    from plctool.compiler.sources.request import BuildRequest
    from plctool.compiler.typed.online_change import Previous


@dataclass
class KeptBuild:
    """Serves the builds of one program after each other. Images and messages are those of builds of their own."""

    trees: Trees = field(default_factory=trees_of_user)
    code: KeptCode = field(default_factory=KeptCode)
    changed: list[Pou] | None = None  # the units that the last check has found to differ; None: all may
    _program: KeptProgram | None = None
    _next: KeptProgram | None = None  # takes its place when its code is made
    _asked: object = None
    _based: bool = False
    _crc: int = 0

    def check(
        self,
        request: BuildRequest,
        sources: Sequence[Source],
        previous: Previous | None,
        whole: Callable[[Observer], CheckResult],
    ) -> CheckResult:
        """Checks the sources of a build. `whole` checks all of them."""
        kept = self._program
        self.forget()  # nothing is kept of what fails
        asked = _asked(request)
        follows = previous.crc == self._crc if previous is not None else not self._based
        if kept is not None and asked == self._asked and follows:
            result = kept.check(sources, previous, self.trees)
            if result is not None:
                self._next, self.changed = kept, kept.changed
                self._based = previous is not None
                return result
        observer = Observer()
        result = whole(observer)
        if KeptProgram.may_be_kept(result):
            self._next = KeptProgram(observer, result)
        self._asked, self._based = asked, previous is not None
        return result

    def built(self, result: BuildResult) -> None:
        """Keeps the program of which an image was made."""
        self._program, self._crc = self._next, result.crc

    def forget(self) -> None:
        """Forgets the program, so that the next one is compiled as a whole."""
        self._program = self._next = self.changed = None


def _asked(request: BuildRequest) -> object:
    """What a build depends on besides sources, inputs and outputs, libraries and the program that it replaces."""
    files = request.files
    options = (request.target, request.level, request.checks, request.debug, request.warnings, request.board)
    others = (request.firmware, request.dialect, request.no_pass, request.dump_after, request.device_id)
    return (*options, *others, files.info, files.information, files.root)
