"""Lints: what is looked at in a whole program, stage by stage, and gives warnings.

Warnings about one statement are with the rule of its node; `syntax/warnings.py` has name, group and meaning of all.

The order counts: a lint that has the same cause as an earlier one asks `Diagnostics.has()`, and is silent.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from plctool.compiler.semantics.allocation import report_overlaps
from plctool.compiler.semantics.call_graph import report_shared_writes
from plctool.compiler.semantics.exports_to_c import has_methods_for_c
from plctool.compiler.semantics.guidelines import report_guidelines
from plctool.compiler.semantics.pitfalls import report_endless
from plctool.compiler.semantics.rules.control import report_unused
from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.stages import Checked
from plctool.compiler.semantics.symbols import VarSymbol
from plctool.compiler.semantics.uncalled_blocks import report_uncalled_blocks
from plctool.compiler.semantics.world import World
from plctool.compiler.syntax.guidelines import GROUP as GUIDELINES
from plctool.compiler.syntax.warnings import GROUP_OF
from plctool.compiler.typed.nodes import Storage

CHECKED, PLACED = "checked", "placed"


@dataclass(frozen=True)
class Lint:
    """`name`: of the warning, or of a group of them; `report` is called at the end of the stage. `of_device`: it is
    about the tasks of a device, so unit tests leave it out. `despite_errors`: it holds whatever is wrong elsewhere."""

    name: str
    stage: str
    report: Callable[[Checked], None]
    of_device: bool = False
    despite_errors: bool = False

    @property
    def group(self) -> str:
        """The group of warnings that it belongs to."""
        return GROUP_OF.get(self.name, self.name)


def _unused_variables(checked: Checked) -> None:
    world = checked.program.world
    elsewhere = world.names.members_in_tests()
    for scope in checked.program.checked:
        _use_for_c(world, scope)
        report_unused(scope, elsewhere)


def _use_for_c(world: World, scope: Scope) -> None:
    """Counts instances as used if components in C call their methods; those on the stack are not offered to C."""
    for symbol in scope.names.values():
        if isinstance(symbol, VarSymbol) and not symbol.used and symbol.variable is not None:
            lasts = symbol.variable.storage in (Storage.AREA, Storage.SELF)
            symbol.used = lasts and not symbol.constant and has_methods_for_c(world, symbol.type)


def _unused_programs(checked: Checked) -> None:
    if checked.application.tasks:
        checked.program.programs.report_unused()


def _no_program(checked: Checked) -> None:
    names = checked.program.world.names
    if not (checked.application.tasks or names.tests or names.program_symbols()) and checked.sources:
        message = "there is no PROGRAM, so nothing would run"
        checked.diagnostics.warning(checked.sources[0].pos(0), "no-program", message)


LINTS = (
    Lint("uncalled", CHECKED, lambda c: report_uncalled_blocks(c.program.world.pous, c.diagnostics), of_device=True),
    Lint("unused", CHECKED, _unused_variables, despite_errors=True),
    Lint("unused", CHECKED, _unused_programs, of_device=True, despite_errors=True),
    Lint("endless", CHECKED, lambda c: report_endless(c.program.world.loops, c.diagnostics)),
    Lint("task", CHECKED, lambda c: c.program.world.calls.report_shared(c.application.tasks), despite_errors=True),
    Lint("no-program", CHECKED, _no_program),
    Lint(GUIDELINES, CHECKED, report_guidelines),
    Lint("shared", PLACED, lambda c: report_shared_writes(c.application.tasks, c.diagnostics), of_device=True),
    Lint(
        "written-input",
        PLACED,
        lambda c: c.program.world.io.report_written_inputs(c.program.world.pous, c.diagnostics),
        of_device=True,
    ),
    Lint("overlap", PLACED, lambda c: report_overlaps(c.program.world.allocation.variables, c.diagnostics)),
)


def report(stage: str, checked: Checked) -> None:
    """Runs the lints of a stage."""
    for lint in LINTS:
        left_out = (lint.of_device and checked.application.of_tests) or (
            checked.diagnostics.errors and not lint.despite_errors
        )
        if lint.stage == stage and not left_out:
            lint.report(checked)
