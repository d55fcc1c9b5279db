"""Functions of a program that Python implements in the simulator, in place of what the program or the device has.

All of it happens in the syntax tree, before anything is checked: the body of such a function tells the simulator where
its parameters and its result are, and lets it call Python.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from plctool.compiler.base.source import Source
from plctool.compiler.semantics.participants import Files, Participant
from plctool.compiler.semantics.program import Program
from plctool.compiler.syntax import ast
from plctool.compiler.typed.nodes import Direction, Pou
from plctool.core import lib
from plctool.errors import UsageError, did_you_mean
from plctool.iec.types import ArrayType, StringType

_PASS, _CALL, _RESULT = "__pass", "__call", "__returned"
_PARAMETERS = (ast.Section.VAR_INPUT, ast.Section.VAR_OUTPUT, ast.Section.VAR_IN_OUT)


class PythonFunctions:
    """`names`: of functions, in any case. `units`: what they are declared as, in the same order, after the check."""

    def __init__(self, names: Iterable[str]) -> None:
        written = list(names)
        self._numbers = {name.casefold(): number for number, name in enumerate(written)}
        self._written = {name.casefold(): name for name in written}
        self.units: list[Pou] = []

    def begin(self, program: Program) -> Participant:
        """Returns the participant in the check of this program."""
        return _Calls(self, program)

    def rewritten(self, declarations: Sequence[ast.Declaration]) -> list[ast.Declaration]:
        """The declarations with these functions calling Python."""
        return [self._function(decl) if isinstance(decl, ast.PouDecl) else decl for decl in declarations]

    def interface(self) -> list[ast.Declaration]:
        """The functions of the simulator that the bodies call."""
        return [_external(_PASS, "simpass", "UDINT", "LWORD"), _external(_CALL, "simpython", "UDINT", "LWORD")]

    def finish(self, program: Program) -> None:
        """Notes what they are. Raises UsageError for one that is not declared, or that cannot be called in Python."""
        units = {s.decl.full_name.casefold(): s for s in program.world.names.functions()}
        for name in self._numbers:
            if name not in units:
                shown, known = self._written[name], [s.decl.full_name for s in units.values()]
                raise UsageError(f"There is no function {shown}{did_you_mean(shown, known) or '.'}", "unknown-function")
            info = program.world.declared.function(units[name], {})
            if info is not None:
                self.units.append(_callable(info.pou))

    def _function(self, decl: ast.PouDecl) -> ast.PouDecl:
        number = self._numbers.get(decl.full_name.casefold())
        if number is None or decl.keyword is not ast.Unit.FUNCTION:
            return decl
        parameters = [
            name
            for block in decl.blocks
            if block.keyword in _PARAMETERS
            for line in block.decls
            for _, name in line.names
        ]
        pos, blocks = decl.pos, [block for block in decl.blocks if block.keyword in _PARAMETERS]
        where = _number(pos, 0)
        if decl.result is not None:
            line = ast.VarDecl(pos, [(pos, _RESULT)], None, decl.result, None)
            blocks.append(ast.VarBlock(pos, ast.Section.VAR, set(), [line]))
            where = _address(pos, _RESULT)
        body = [_call(pos, _PASS, _number(pos, n), _address(pos, name)) for n, name in enumerate(parameters)]
        body.append(_call(pos, _CALL, _number(pos, number), where))
        if decl.result is not None:
            body.append(ast.Assign(pos, [ast.Name(pos, decl.name)], ast.Assigning.VALUE, ast.Name(pos, _RESULT)))
        attributes = {name: text for name, text in decl.attributes.items() if name not in ("external", "version")}
        return replace(decl, blocks=blocks, body=body, attributes=attributes)


class _Calls(Participant):
    """Puts calls of Python into one program."""

    def __init__(self, functions: PythonFunctions, program: Program) -> None:
        self._functions = functions
        self._program = program

    def after_parse(self, files: Files) -> Files:
        names = self._program.world.names
        names.register(self._functions.interface(), library=True)
        names.rewrite(self._functions.rewritten)
        return [(source, self._functions.rewritten(declarations)) for source, declarations in files]

    def after_declare(self) -> None:
        self._functions.finish(self._program)


def _callable(pou: Pou) -> Pou:
    if len(pou.parameters) > lib.SIM_MAX_PASSED:
        most = f"{len(pou.parameters)} parameters; at most {lib.SIM_MAX_PASSED} are possible"
        raise UsageError(f"{pou.name} cannot be a function in Python: it has {most}.", "python")
    for parameter in pou.parameters:
        t = parameter.variable.type
        if isinstance(t, StringType) and parameter.direction is not Direction.INPUT:
            what = "a STRING that it may write, whose length only the caller knows"
        elif isinstance(t, ArrayType) and parameter.variable.bounds:
            what = "an ARRAY[*]"
        else:
            continue
        raise UsageError(f"{pou.name} cannot be a function in Python: {parameter.variable.name} is {what}.", "python")
    return pou


def _external(name: str, external: str, *types: str) -> ast.PouDecl:
    lines = [ast.VarDecl(0, [(0, f"p{n}")], None, ast.NamedType(0, t), None) for n, t in enumerate(types)]
    block = ast.VarBlock(0, ast.Section.VAR_INPUT, set(), lines)
    return ast.PouDecl(0, ast.Unit.FUNCTION, name, None, [block], [], {"external": external}, Source("", ""))


def _call(pos: int, name: str, *values: ast.Expr) -> ast.Stmt:
    return ast.ExprStmt(pos, ast.Call(pos, ast.Name(pos, name), [ast.Argument(pos, None, v) for v in values]))


def _address(pos: int, name: str) -> ast.Expr:
    return ast.Call(pos, ast.Name(pos, "ADR"), [ast.Argument(pos, None, ast.Name(pos, name))])


def _number(pos: int, value: int) -> ast.Expr:
    return ast.Literal(pos, ast.LiteralKind.INT, value)
