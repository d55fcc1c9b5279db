"""Calls as statements: of function block instances and of programs, and with EN and ENO.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable, Container
from dataclasses import dataclass, field, replace

from plctool.compiler.semantics.checker import Checker, checks_statement
from plctool.compiler.semantics.conversions import elementary, load, place_of, same_type, whole
from plctool.compiler.semantics.generics import accepts, group_name, handed_bounds, kept
from plctool.compiler.semantics.once import kept_place
from plctool.compiler.semantics.rules.arguments import (
    bind,
    has_enable,
    input_value,
    packed,
    parameter_names,
    refer,
    referenced_place,
    size_of,
    split_enable,
    too_short,
)
from plctool.compiler.semantics.rules.callees import BlockCall, ProgramCall, resolve_statement
from plctool.compiler.semantics.rules.calls import body_dispatch, call, called_variable
from plctool.compiler.semantics.rules.members import bound_member, is_called_by_name, variable_value
from plctool.compiler.semantics.rules.places import changeable_place, named_place
from plctool.compiler.semantics.rules.pools import DELETE, delete
from plctool.compiler.semantics.symbols import ERROR, NOTHING, BlockInfo, ProgramInfo, Role
from plctool.compiler.syntax import ast
from plctool.compiler.typed.nodes import (
    Assign,
    BitPlace,
    Call,
    CallStatement,
    Const,
    DerefPlace,
    Direction,
    Expr,
    FbCall,
    If,
    Load,
    MemberPlace,
    Place,
    Statement,
    Unary,
    UnaryOp,
    Variable,
)
from plctool.compiler.typed.typed_nodes import is_unaligned, walk
from plctool.iec.types import BOOL, ReferenceType, StructType

# ---- instances and programs ----


@dataclass
class _Arguments:
    """What a call of a function block passes."""

    before: list[tuple[Variable, Place]] = field(default_factory=list)  # arguments that are described: ANY
    inputs: list[tuple[Variable, Expr]] = field(default_factory=list)
    in_outs: list[tuple[Variable, Place]] = field(default_factory=list)
    outputs: list[tuple[Variable, Place]] = field(default_factory=list)
    after: list[Assign] = field(default_factory=list)  # outputs that need a conversion


def program_call(c: Checker, call: ast.Call, program: ProgramInfo) -> list[Statement]:
    """`Prog(in := e, out => p)`: the inputs are assigned before, the outputs after."""
    pos = c.pos(call.pos)
    handed = program_arguments(c, call.args, program, call.pos)
    if handed is None:
        return []
    c.world.calls.add(c.scope.pou, program.pou, pos)
    before, behind = handed
    return [*before, CallStatement(Call(program.pou, [], NOTHING, pos), pos), *behind]


def program_arguments(
    c: Checker, args: list[ast.Argument], program: ProgramInfo, offset: int
) -> tuple[list[Statement], list[Statement]] | None:
    """The assignments before and after a call; None after an error."""
    names = [(symbol.name, direction) for symbol, direction in program.parameters]
    bound = bind(c, args, names, program.name, offset)
    if bound is None:
        return None
    before, behind, ok = list[Statement](), list[Statement](), True
    for i, (symbol, direction) in enumerate(program.parameters):
        if direction is Direction.IN_OUT and i not in bound:
            c.error(offset, "arguments", f"the VAR_IN_OUT {symbol.name} of {program.name} is missing")
            ok = False
    for i, argument in bound.items():
        (symbol, direction), pos = program.parameters[i], c.pos(argument.pos)
        if argument.value is None or symbol.variable is None:
            continue
        own = variable_value(symbol, pos)
        if direction is Direction.INPUT:
            e = input_value(c, argument.value, symbol.type, symbol.name)
            ok = ok and e.type is not ERROR
            before.append(Assign(place_of(own), e, pos))
            continue
        if direction is Direction.IN_OUT:
            e = input_value(c, argument.value, symbol.type, symbol.name)
            ok = ok and e.type is not ERROR
            before.append(Assign(whole(symbol.variable, pos), e, pos))
            continue
        taken = _taken(c, symbol.name, own, argument)
        ok = ok and taken is not None
        if taken is not None:
            behind.append(taken)
    return (before, behind) if ok else None


def block_call(c: Checker, call: ast.Call, instance: Expr) -> list[Statement]:
    """`fb(in := e, out => p)`"""
    if not isinstance(instance.type, StructType):
        for argument in call.args:
            if argument.value is not None:
                c.expr(argument.value)
        return []
    block = c.world.blocks[instance.type]
    if block.cls is not None and ast.Modifier.CLASS in block.cls.symbol.decl.modifiers:
        c.error(call.pos, "call", f"{block.type} is a CLASS and has no body; call one of its methods")
        return []
    names = [(p.variable.name, p.direction) for p in block.pou.parameters]
    bound = bind(c, [_by_own_name(a, block) for a in call.args], names, block.type.name, call.pos)
    if bound is None:
        return []
    place, pos = place_of(instance), c.pos(call.pos)
    handed = _block_arguments(c, block, bound, call, place)
    if handed is None:
        return []
    before, named = kept_place(c, place) if handed.after or handed.before else ([], place)
    described = [s for variable, argument in handed.before for s in _description(c, named, variable, argument)]
    for taken in handed.after:
        for part in walk(taken.value):
            if isinstance(part, MemberPlace) and part.base is place:
                part.base = named
    statement = FbCall(block.pou, named, handed.inputs, handed.in_outs, handed.outputs, pos)
    statement.dispatch = body_dispatch(c, block, place)
    if not isinstance(place, DerefPlace):
        c.world.calls.add(c.scope.pou, block.pou, pos)
    if isinstance(place, DerefPlace) or statement.dispatch is not None:
        c.world.dispatches.note_other_call(c.scope.pou, block.pou, statement.dispatch, pos)
    return [*before, *described, statement, *handed.after]


def _description(c: Checker, instance: Place, variable: Variable, argument: Place) -> list[Statement]:
    own = MemberPlace(instance, variable.offset, variable.type, argument.pos)
    return kept(own, argument, size_of(c, argument))


def _block_arguments(
    c: Checker, block: BlockInfo, bound: dict[int, ast.Argument], call: ast.Call, instance: Place
) -> _Arguments | None:
    handed, ok = _Arguments(), True
    for i, parameter in enumerate(block.pou.parameters):
        variable, argument = parameter.variable, bound.get(i)
        if parameter.direction is Direction.IN_OUT:
            place = _block_in_out(c, variable, argument, block, call)
            ok = ok and place is not None
            if place is not None:
                handed.in_outs.append((variable, place))
                handed.inputs += handed_bounds(variable, place, place.pos)
        elif (group := block.members[variable.name.casefold()].group) != "":
            place = _block_any(c, variable, group, argument, block, call)
            ok = ok and place is not None
            if place is not None:
                handed.before.append((variable, place))
        elif argument is None or argument.value is None:
            continue
        elif parameter.direction is Direction.INPUT:
            e = input_value(c, argument.value, variable.type, variable.name)
            ok = ok and e.type is not ERROR
            handed.inputs.append((variable, e))
        else:
            ok = _block_output(c, variable, argument, instance, handed) and ok
    return handed if ok else None


def _block_in_out(
    c: Checker, variable: Variable, argument: ast.Argument | None, block: BlockInfo, call: ast.Call
) -> Place | None:
    if argument is None or argument.value is None:
        c.error(call.pos, "arguments", f"the VAR_IN_OUT {variable.name} of {block.type} is missing")
        return None
    name, constant = variable.name, block.members[variable.name.casefold()].constant
    if constant and not isinstance(c.expr(argument.value), Load):
        c.error(argument.pos, "place", f"the instance keeps the address of {name}, so it needs a variable")
        return None
    place = referenced_place(c, argument.value, variable.type, name, output=False, constant=constant)
    if place is not None and is_unaligned(place):
        c.error(argument.pos, "type", packed(place, f"the VAR_IN_OUT {name} of an instance"))
        return None
    short = "" if place is None else too_short(c, place, variable.type)
    if short:
        c.error(argument.pos, "type", f"the VAR_IN_OUT {name} is {variable.type}, {short}")
        return None
    return place


def _block_any(
    c: Checker, variable: Variable, group: str, argument: ast.Argument | None, block: BlockInfo, call: ast.Call
) -> Place | None:
    """The variable that an input or output of type ANY_... stands for; the instance keeps its address."""
    name = variable.name
    if argument is None or argument.value is None:
        c.error(call.pos, "arguments", f"{name} of {block.type} is missing: every call gives {group} a variable")
        return None
    if argument.output:
        place = changeable_place(c, argument.value, f"the output {name}", f"be given to the output {name}")
    else:
        place = named_place(c, argument.value, f"the instance keeps the address of {name}, which")
    if place is None:
        return None
    if isinstance(place, BitPlace):
        c.error(argument.pos, "type", f"a single bit has no address, so it cannot be given to {name}")
        return None
    if is_unaligned(place):
        c.error(argument.pos, "type", packed(place, name))
        return None
    if not accepts(group, place.type) and place.type is not variable.type:
        c.error(argument.pos, "type", f"{name} takes {group_name(group)}, not {place.type}")
        return None
    return place


def _block_output(c: Checker, variable: Variable, argument: ast.Argument, instance: Place, handed: _Arguments) -> bool:
    """`q => target`; with another type or NOT it is an assignment after the call."""
    value = load(MemberPlace(instance, variable.offset, variable.type, c.pos(argument.pos)))
    taken = _taken(c, variable.name, value, argument)
    if taken is None:
        return False
    target = taken.target
    if same_type(target.type, variable.type) and not argument.negated and not isinstance(target, BitPlace):
        handed.outputs.append((variable, target))
    else:
        handed.after.append(taken)
    return True


def _taken(c: Checker, name: str, value: Expr, argument: ast.Argument) -> Assign | None:
    """The assignment of an output to what is given for it."""
    assert argument.value is not None
    what, pos = f"the output {name}", c.pos(argument.pos)
    target = changeable_place(c, argument.value, what, f"take {what}")
    if target is None:
        return None
    if argument.negated:
        value = Unary(UnaryOp.NOT, c.coerce(value, BOOL), BOOL, pos)
    value = c.coerce(value, target.type)
    return None if value.type is ERROR else Assign(target, value, pos)


def _by_own_name(argument: ast.Argument, block: BlockInfo) -> ast.Argument:
    """With the name its parameter is declared by, for one that has two: RESET is R of a counter."""
    symbol = block.members.get((argument.name or "").casefold())
    return argument if symbol is None else replace(argument, name=symbol.name)


# ---- EN and ENO ----


@checks_statement(ast.ExprStmt)
def call_statement(c: Checker, statement: ast.ExprStmt) -> list[Statement]:
    """A call, or an action or program that is called by its name alone."""
    node = statement.value
    if isinstance(node, ast.Call) and isinstance(node.callee, ast.Name):
        special = c.special_calls.get(node.callee.name.upper())
        if special is not None:
            return special(node)
        if node.callee.name.upper() == DELETE:
            return delete(c, node)
    if not isinstance(node, ast.Call) and is_called_by_name(c, node):
        node = ast.Call(node.pos, node, [])
    if isinstance(node, ast.Call):
        return _called(c, node)
    e = c.expr(node)
    if isinstance(e, Load) and elementary(e.type) is not None:
        c.warning(statement.pos, "statement", "this reads a variable and does nothing with it; write an assignment")
    elif isinstance(e.type, StructType) and e.type in c.world.blocks and isinstance(node, ast.Name):
        c.error(statement.pos, "statement", f"{node.name} is an instance; a call of it is written {node.name}();")
    elif e.type is not ERROR:
        c.error(statement.pos, "statement", "this is a value, not a statement; write an assignment or a call")
    return []


def _called(c: Checker, node: ast.Call) -> list[Statement]:
    """A call of a program, of an instance or of a function."""
    if called_variable(c, node) is not None:
        return []
    match resolve_statement(c, node.callee):
        case ProgramCall(program):
            names = {symbol.name.casefold() for symbol, _ in program.parameters}
            return enabled(c, node, names, lambda plain: program_call(c, plain, program))
        case BlockCall(instance):
            block = c.world.blocks.get(instance.type) if isinstance(instance.type, StructType) else None
            members = block.members if block is not None else ()
            return enabled(c, node, members, lambda plain: block_call(c, plain, instance))
    return enabled(c, node, parameter_names(c, node), lambda plain: _function_statement(c, plain))


def _function_statement(c: Checker, node: ast.Call) -> list[Statement]:
    if _is_action_with_arguments(c, node):
        return _action_call(c, node)
    e = call(c, node, None)
    if isinstance(e, Call):
        return [CallStatement(e, e.pos)]
    if e.type is not ERROR:
        c.warning(node.pos, "unused", "the result of this call is not used")
    return []


def _is_action_with_arguments(c: Checker, node: ast.Call) -> bool:
    if not isinstance(node.callee, ast.Member) or not any(a.value for a in node.args):
        return False
    bound = bound_member(c, node.callee, called=True)
    return bound is not None and bound.callable is not None and bound.callable.decl.keyword is ast.Unit.ACTION


def _action_call(c: Checker, node: ast.Call) -> list[Statement]:
    """`fb.Action(in := e, out => p)`: the arguments are those of the block, which the action works on."""
    callee, before, after = node.callee, list[Statement](), list[Statement]()
    assert isinstance(callee, ast.Member)
    for a in node.args:
        if a.name is None:
            c.error(a.pos, "arguments", f"{callee.name} is an action; write the name of the input, name := value")
        elif (given := _in_out_of_action(c, callee, a)) is not None:
            before.extend(given)
        elif a.value is not None:
            own: ast.Expr = ast.Member(a.pos, callee.base, a.name, a.pos)
            if a.negated:
                own = ast.Unary(a.pos, ast.Operator.NOT, own)
            target, value = (a.value, own) if a.output else (own, a.value)
            statements = c.statement(ast.Assign(a.pos, [target], ast.Assigning.VALUE, value))
            (after if a.output else before).extend(statements)
    return [*before, *_function_statement(c, ast.Call(node.pos, callee, [])), *after]


def _in_out_of_action(c: Checker, callee: ast.Member, argument: ast.Argument) -> list[Statement] | None:
    """`fb.Action(io := x)` lets the instance refer to x from now on, as a call of the block does; None for what is not
    a VAR_IN_OUT."""
    action = bound_member(c, callee, called=True)
    instance = None if action is None else action.place
    t = instance.type if isinstance(instance, Place) else None
    block = c.world.blocks.get(t) if isinstance(t, StructType) else None
    symbol = None if block is None else block.members.get((argument.name or "").casefold())
    if block is None or symbol is None or symbol.role is not Role.IN_OUT or symbol.variable is None:
        return None
    assert isinstance(instance, Place)
    variable = symbol.variable
    place = _block_in_out(c, variable, argument, block, ast.Call(argument.pos, callee, []))
    if place is None:
        return []
    address, pos = ReferenceType(variable.type), c.pos(argument.pos)
    slot = MemberPlace(instance, variable.offset, address, pos)
    bounds = [
        Assign(MemberPlace(instance, bound.offset, bound.type, pos), value, pos)
        for bound, value in handed_bounds(variable, place, pos)
    ]
    return [Assign(slot, refer(place, address), pos), *bounds]


def enabled(
    c: Checker, node: ast.Call, declared: Container[str], make: Callable[[ast.Call], list[Statement]]
) -> list[Statement]:
    """A call with EN and ENO: not executed unless EN is TRUE; ENO tells. Where the callee declares them itself they
    are variables like others."""
    if not has_enable(node, declared):
        return make(node)
    args, enable = split_enable(node, declared)
    statements = make(ast.Call(node.pos, node.callee, args, had_enable=True))
    pos = c.pos(node.pos)
    done: list[Statement] = []
    skipped: list[Statement] = []
    if enable.eno is not None:
        target = changeable_place(c, enable.eno, "ENO", "take ENO")
        if target is None:
            return []
        if target.type is not BOOL:
            c.error(enable.eno.pos, "type", f"ENO needs a BOOL variable, not {target.type}")
            return []
        done = [Assign(target, Const(1, BOOL, pos), pos)]
        skipped = [Assign(target, Const(0, BOOL, pos), pos)]
    if enable.en is None:
        return statements + done
    condition = c.condition(enable.en)
    return [] if condition.type is ERROR else [If([(condition, statements + done)], skipped, pos)]
