"""Tests with faults: {attribute 'fault' := 'Tank=absent@T#5s'} before a TEST. During such a test the simulated devices
work while ADVANCE_TIME lets time pass: there the program calls the host, which has the devices.

What a task of the application copies between its inputs and outputs and parts of instances is copied there, too.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from plctool.compiler.base.source import Source
from plctool.compiler.semantics.assertions import LIVE, Bench
from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.conversions import load, place_of
from plctool.compiler.semantics.rules.control import check_body
from plctool.compiler.semantics.symbols import NOTHING
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import Diagnostics
from plctool.compiler.typed.nodes import Assign, Call, CallStatement, If, Pos, Pou, Statement, Task
from plctool.errors import UsageError, did_you_mean
from plctool.io.faults import Fault, parse_fault
from plctool.io.model import Connector, Description

START, FAULTS, PASS = 0, 1, 2
"""What the host is called for: a test starts, with its SETUP; its faults begin; time has passed."""
_HOST = "__devices"


def host_function() -> ast.PouDecl:
    """What calls the host: its number, and where its result would go."""
    lines = [ast.VarDecl(0, [(0, name)], None, ast.NamedType(0, t), None) for name, t in _PARAMETERS]
    block = ast.VarBlock(0, ast.Section.VAR_INPUT, set(), lines)
    return ast.PouDecl(0, ast.Unit.FUNCTION, _HOST, None, [block], [], {"external": "simpython"}, Source("", ""))


_PARAMETERS = (("number", "UDINT"), ("result", "LWORD"))


class TestDevices:
    """What tests with faults do besides their statements. Without such a test (`wanted`) nothing."""

    def __init__(self, bench: Bench) -> None:
        self.wanted = False
        self._bench = bench
        self._inputs: list[Pou] = []
        self._outputs: list[Pou] = []

    def take_copies(self, tasks: Sequence[Task]) -> None:
        """Notes what the tasks of the application do before and after their programs."""
        for task in tasks:
            self._inputs += [pou for pou in task.programs if pou.name == f"{task.name}.inputs"]
            self._outputs += [pou for pou in task.programs if pou.name == f"{task.name}.outputs"]

    def start(self, c: Checker, offset: int) -> list[Statement]:
        """Before the SETUP of a test with faults: as a cycle begins."""
        return [*_calls(self._inputs, c.pos(offset)), *_host(c, offset, START)]

    def begin_faults(self, c: Checker, offset: int) -> list[Statement]:
        """Before the first statement of such a test."""
        return _host(c, offset, FAULTS)

    def let_pass(self, c: Checker, offset: int) -> list[Statement]:
        """After the clock of the test was moved. What the test has written to an input its device measures."""
        if not self.wanted:
            return []
        pos = c.pos(offset)
        measured = [
            Assign(place_of(s.value), load(s.target), pos)
            for pou in self._inputs
            for s in pou.body
            if isinstance(s, Assign)
        ]
        given, got = _calls(self._outputs, pos), _calls(self._inputs, pos)
        live = load(self._bench.place(LIVE, pos))
        return [If([(live, [*given, *measured, *_host(c, offset, PASS), *got])], [], pos)]


def faults_of(decl: ast.TestDecl, description: Description | None, diagnostics: Diagnostics) -> tuple[Fault, ...]:
    """Those that stand before a TEST; what cannot be is reported."""
    faults = []
    for offset, text in decl.faults:
        try:
            fault = parse_fault(text)
        except UsageError as error:
            problem = error.message[:1].lower() + error.message[1:].removesuffix(".")
        else:
            device = _find(fault.device, description)
            problem = _without_device(fault, description) if device is None else _cannot_be(fault.fault, device)
            faults.append(fault if device is None else replace(fault, device=device.name))
        if problem:
            diagnostics.error(decl.source.pos(offset), "fault", problem)
    return tuple(faults)


def _find(name: str, description: Description | None) -> Connector | None:
    devices = [] if description is None else description.connectors
    return next((c for c in devices if c.name.casefold() == name.casefold()), None)


def _without_device(fault: Fault, description: Description | None) -> str:
    if description is None:
        hint = "write NAME.io.toml beside the program, or name one with --io"
        return f"there is no device {fault.device}, as there is no description of inputs and outputs; {hint}"
    names = [c.name for c in description.connectors]
    hint = did_you_mean(fault.device, names) or (f"; there are {', '.join(names)}" if names else "")
    return f"there is no device {fault.device} in the description{hint}"


def _cannot_be(fault: str, device: Connector) -> str:
    """Why a device cannot have a fault, "" if it can."""
    if not device.enabled:
        return f"{device.name} is not enabled; take enabled = false out of its description"
    if fault in device.faults:
        return ""
    possible = f"it can only be {', '.join(device.faults)}" if device.faults else "its clients are not simulated"
    return f"{device.name} cannot be '{fault}'; {possible}"


def _calls(pous: Sequence[Pou], pos: Pos) -> list[Statement]:
    return [CallStatement(Call(pou, [], NOTHING, pos), pos) for pou in pous]


def _host(c: Checker, offset: int, number: int) -> list[Statement]:
    arguments = [ast.Argument(offset, None, ast.Literal(offset, ast.LiteralKind.INT, n)) for n in (number, 0)]
    return check_body(c, [ast.ExprStmt(offset, ast.Call(offset, ast.Name(offset, _HOST), arguments))])
