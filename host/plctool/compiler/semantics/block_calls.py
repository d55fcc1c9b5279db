"""Calls of function block instances and of programs: they are statements, and their arguments stay where they are put.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from plctool.compiler.semantics.checker import load, place_of
from plctool.compiler.semantics.conversions import same_type
from plctool.compiler.semantics.instance_questions import InstanceQuestions
from plctool.compiler.semantics.open_arrays import handed_bounds
from plctool.compiler.semantics.symbols import ERROR, NOTHING, BlockInfo, GlobalSymbol, ProgramInfo, Role, VarSymbol
from plctool.compiler.syntax import ast
from plctool.compiler.typed import (
    Assign,
    BitPlace,
    Call,
    CallStatement,
    DerefPlace,
    Direction,
    Expr,
    FbCall,
    Load,
    MemberPlace,
    Place,
    Statement,
    Unary,
    UnaryOp,
    Variable,
)  # fmt: skip
from plctool.compiler.types import BOOL, StringType, StructType


@dataclass
class _Arguments:
    """What a call of a function block hands over."""

    inputs: list[tuple[Variable, Expr]] = field(default_factory=list)
    in_outs: list[tuple[Variable, Place]] = field(default_factory=list)
    outputs: list[tuple[Variable, Place]] = field(default_factory=list)
    after: list[Statement] = field(default_factory=list)  # outputs that need a conversion


class BlockCalls(InstanceQuestions):
    """Checks calls of what keeps its variables."""

    # ---- programs ----

    def program_call(self, call: ast.Call, program: ProgramInfo) -> list[Statement]:
        """`Prog(in := e, out => p)`: the inputs are assigned before, the outputs behind."""
        pos = self.pos(call.pos)
        handed = self.program_arguments(call.args, program, call.pos)
        if handed is None:
            return []
        self.world.calls.add(self.scope.pou, program.pou, pos)
        before, behind = handed
        return [*before, CallStatement(Call(program.pou, [], NOTHING, pos), pos), *behind]

    def program_arguments(
        self, args: list[ast.Argument], program: ProgramInfo, offset: int
    ) -> tuple[list[Statement], list[Statement]] | None:
        """The assignments before and behind a call; None after a diagnosis."""
        names = [(symbol.name, direction) for symbol, direction in program.parameters]
        bound = self.bind(args, names, program.name, offset)
        if bound is None:
            return None
        before, behind, ok = list[Statement](), list[Statement](), True
        for i, argument in bound.items():
            (symbol, direction), pos = program.parameters[i], self.pos(argument.pos)
            if argument.value is None or symbol.variable is None:
                continue
            own = self.variable(symbol, pos)
            if direction is Direction.INPUT:
                e = self.input(argument.value, symbol.type, symbol.name)
                ok = ok and e.type is not ERROR
                before.append(Assign(place_of(own), e, pos))
                continue
            taken = self._taken(symbol.name, own, argument)
            ok = ok and taken is not None
            if taken is not None:
                behind.append(taken)
        return (before, behind) if ok else None

    # ---- function blocks ----

    def called_instance(self, call: ast.Call) -> Expr | None:
        """The instance a call statement is about; None when it calls a function."""
        callee = call.callee
        if self.bound_member(callee, called=True) is not None:
            return None
        if isinstance(callee, ast.Name):
            symbol = self.scope.lookup(callee.name)
            if symbol is None and callee.name.upper() == "SUPER" and self.scope.cls is not None:
                return self.expr(ast.Deref(callee.pos, callee))
            if not isinstance(symbol, VarSymbol | GlobalSymbol) or (
                isinstance(symbol, VarSymbol) and symbol.role is Role.RESULT
            ):  # fmt: skip
                return None
        e = self.expr(callee)
        return e if (isinstance(e.type, StructType) and e.type in self.world.blocks) or e.type is ERROR else None

    def block_call(self, call: ast.Call, instance: Expr) -> list[Statement]:
        """`fb(in := e, out => p)`"""
        if not isinstance(instance.type, StructType):
            for argument in call.args:
                if argument.value is not None:
                    self.expr(argument.value)
            return []
        block = self.world.blocks[instance.type]
        if block.cls is not None and "CLASS" in block.cls.symbol.decl.modifiers:
            self.error(call.pos, "call", f"{block.type} is a CLASS and has no body; call one of its methods")
            return []
        names = [(p.variable.name, p.direction) for p in block.pou.parameters]
        bound = self.bind([_by_own_name(a, block) for a in call.args], names, block.type.name, call.pos)
        if bound is None:
            return []
        place, pos = place_of(instance), self.pos(call.pos)
        handed = self._block_arguments(block, bound, call, place)
        if handed is None:
            return []
        if not isinstance(place, DerefPlace):
            self.world.calls.add(self.scope.pou, block.pou, pos)
        statement = FbCall(block.pou, place, handed.inputs, handed.in_outs, handed.outputs, pos)
        statement.dispatch = self.body_dispatch(block, place)
        return [statement, *handed.after]

    def _block_arguments(
        self, block: BlockInfo, bound: dict[int, ast.Argument], call: ast.Call, instance: Place
    ) -> _Arguments | None:
        handed, ok = _Arguments(), True
        for i, parameter in enumerate(block.pou.parameters):
            variable, argument = parameter.variable, bound.get(i)
            if parameter.direction is Direction.IN_OUT:
                place = self._block_in_out(variable, argument, block, call)
                ok = ok and place is not None
                if place is not None:
                    handed.in_outs.append((variable, place))
                    handed.inputs += handed_bounds(variable, place, place.pos)
            elif argument is None or argument.value is None:
                continue
            elif parameter.direction is Direction.INPUT:
                e = self.input(argument.value, variable.type, variable.name)
                ok = ok and e.type is not ERROR
                handed.inputs.append((variable, e))
            else:
                ok = self._block_output(variable, argument, instance, handed) and ok
        return handed if ok else None

    def _block_in_out(
        self, variable: Variable, argument: ast.Argument | None, block: BlockInfo, call: ast.Call
    ) -> Place | None:
        if argument is None or argument.value is None:
            self.error(call.pos, "arguments", f"the VAR_IN_OUT {variable.name} of {block.type} is missing")
            return None
        name, constant = variable.name, block.members[variable.name.casefold()].constant
        if constant and not isinstance(self.expr(argument.value), Load):
            self.error(argument.pos, "place", f"the instance keeps the address of {name}, so it needs a variable")
            return None
        place = self.reference(argument.value, variable.type, name, output=False, constant=constant)
        if place is None or not isinstance(place.type, StringType) or not isinstance(variable.type, StringType):
            return place
        if place.type.length < variable.type.length:
            self.error(
                argument.pos, "type", f"the VAR_IN_OUT {variable.name} is {variable.type}, {place.type} is too short"
            )  # fmt: skip
            return None
        return place

    def _block_output(self, variable: Variable, argument: ast.Argument, instance: Place, handed: _Arguments) -> bool:
        """`q => target`; with another type or NOT it is an assignment after the call."""
        value = load(MemberPlace(instance, variable.offset, variable.type, self.pos(argument.pos)))
        taken = self._taken(variable.name, value, argument)
        if taken is None:
            return False
        target = taken.target
        if same_type(target.type, variable.type) and not argument.negated and not isinstance(target, BitPlace):
            handed.outputs.append((variable, target))
        else:
            handed.after.append(taken)
        return True

    def _taken(self, name: str, value: Expr, argument: ast.Argument) -> Assign | None:
        """The assignment of an output to what is given for it."""
        assert argument.value is not None
        what, pos = f"the output {name}", self.pos(argument.pos)
        target = self.target(argument.value, what, f"take {what}")
        if target is None:
            return None
        if argument.negated:
            value = Unary(UnaryOp.NOT, self.coerce(value, BOOL), BOOL, pos)
        value = self.coerce(value, target.type)
        return None if value.type is ERROR else Assign(target, value, pos)


def _by_own_name(argument: ast.Argument, block: BlockInfo) -> ast.Argument:
    """With the name its parameter is declared by, for one that has two: RESET is R of a counter."""
    symbol = block.members.get((argument.name or "").casefold())
    return argument if symbol is None else replace(argument, name=symbol.name)
