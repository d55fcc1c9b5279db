"""Calls whose target depends on the class of the instance, which is only known when the program runs.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from plctool.compiler.diagnostics import Diagnostics
from plctool.compiler.semantics.call_graph import CallGraph
from plctool.compiler.semantics.queries import Queries
from plctool.compiler.semantics.symbols import ClassInfo, FunctionInfo, Member
from plctool.compiler.typed import Dispatch, Pos, Pou


class Dispatches:
    """The dispatches of a program, and who calls through them."""

    def __init__(self) -> None:
        self.queries = Queries()
        self._dispatches: dict[tuple[ClassInfo, str], Dispatch] = {}
        self._own_calls: list[tuple[Pou, Dispatch, Pos]] = []
        self._other_calls: list[tuple[Pou, Pou, Dispatch | None, Pos]] = []

    def dispatch(self, cls: ClassInfo, key: str, function: Pou) -> Dispatch | None:
        """For a call of the member `key`, or of the body for "", of an instance of `cls` or of a class that conforms;
        None when there is only `cls`."""
        if not cls.is_interface and not cls.number:
            return None
        return self._dispatches.setdefault((cls, key), Dispatch(function))

    def note_own_call(self, caller: Pou | None, dispatch: Dispatch, pos: Pos) -> None:
        """A call on the own instance, which counts as recursion when it leads back."""
        if caller is not None:
            self._own_calls.append((caller, dispatch, pos))

    def note_other_call(self, caller: Pou | None, function: Pou, dispatch: Dispatch | None, pos: Pos) -> None:
        """A call on an instance through a pointer, which may be the own one or not."""
        if caller is not None:
            self._other_calls.append((caller, function, dispatch, pos))

    def find_targets(self, classes: Iterable[ClassInfo], signature: Callable[[Member], FunctionInfo]) -> None:
        """Finds the targets of all dispatches among the classes that have instances."""
        present = list(classes)
        self.queries.finish(cls for cls in present if cls.number)
        for (cls, key), dispatch in self._dispatches.items():
            for other in present:
                if cls.type is None or other.type is None or not other.type.conforms(cls.type):
                    continue
                assert other.block is not None
                member = other.find(key) if key else None
                if not key:
                    dispatch.targets[other.number] = other.block.pou
                elif member is not None and not member.abstract:
                    dispatch.targets[other.number] = signature(member).pou

    def report_calls(self, calls: CallGraph, diagnostics: Diagnostics) -> None:
        """Notes who calls whom, now that the targets are known, and warns of what may be recursion."""
        for caller, dispatch, pos in self._own_calls:
            for target in dispatch.targets.values():
                calls.add(caller, target, pos)
        for caller, function, dispatch_of, pos in self._other_calls:
            targets = [function] if dispatch_of is None else list(dispatch_of.targets.values())
            if caller in targets:
                message = f"{caller.name} may call itself here: the calls have to fit the stack of the controller"
                diagnostics.warning(pos, "recursion", message)
