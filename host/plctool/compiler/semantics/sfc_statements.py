"""The statements that a Sequential Function Chart becomes: what it does in a cycle.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections import defaultdict

from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.rules.members import bound_member
from plctool.compiler.semantics.rules.places import named_place
from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.sfc import (
    BEFORE,
    FIRES,
    RUNNING,
    STATE,
    Action,
    actions_of,
    hidden_name,
    is_sequential,
    keys,
)
from plctool.compiler.semantics.symbols import MemberSymbol, VarSymbol
from plctool.compiler.semantics.world import World
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import did_you_mean


def statements_of(world: World, decl: ast.PouDecl, scope: Scope) -> list[ast.Stmt]:
    """The body of a unit; of a chart what it does in a cycle."""
    if decl.chart is None:
        return decl.body
    if not decl.chart.valid:
        return []
    evolution, execution = _Evolution(decl, decl.chart), _Execution(world, decl, decl.chart, scope)
    return [*decl.body, *evolution.statements(), *execution.statements()]


def _name(pos: int, name: str) -> ast.Expr:
    return ast.Name(pos, name)


def _part(pos: int, step: ast.Step, member: str) -> ast.Expr:
    """`step.member`"""
    return ast.Member(pos, _name(pos, step.name), member, pos)


def _assign(pos: int, target: ast.Expr, value: ast.Expr) -> ast.Stmt:
    return ast.Assign(pos, [target], ast.Assigning.VALUE, value)


def _bool(pos: int, value: bool) -> ast.Expr:
    return ast.Literal(pos, ast.LiteralKind.BOOL, int(value))


def _integer(pos: int, value: int) -> ast.Expr:
    return ast.Literal(pos, ast.LiteralKind.INT, value)


def _time(pos: int) -> ast.Expr:
    """`TIME()`"""
    return ast.Call(pos, _name(pos, "TIME"), [])


def _joined(op: ast.Operator, operands: list[ast.Expr]) -> ast.Expr:
    first, *rest = operands
    for operand in rest:
        first = ast.Binary(operand.pos, op, first, operand)
    return first


def _started(pos: int, step: ast.Step) -> ast.Stmt:
    return _assign(pos, _part(pos, step, "START"), _time(pos))


def _measured(pos: int, step: ast.Step) -> ast.Stmt:
    """The time the step has been active."""
    elapsed = ast.Binary(pos, ast.Operator.SUB, _time(pos), _part(pos, step, "START"))
    return _assign(pos, _part(pos, step, "T"), elapsed)


def _entered(pos: int, step: ast.Step) -> list[ast.Stmt]:
    zero = ast.Literal(pos, ast.LiteralKind.TIME, 0, "TIME")
    active = _assign(pos, _part(pos, step, "X"), _bool(pos, True))
    return [active, _started(pos, step), _assign(pos, _part(pos, step, "T"), zero)]


def _left(pos: int, step: ast.Step) -> ast.Stmt:
    return _assign(pos, _part(pos, step, "X"), _bool(pos, False))


class _Evolution:
    """From one situation of the chart to the next."""

    def __init__(self, decl: ast.PouDecl, chart: ast.Chart) -> None:
        self._decl = decl
        self._chart = chart
        self._steps = {step.name.casefold(): step for step in chart.steps}
        self._initial = [step for step in chart.steps if step.initial]
        self._numbers = {step.name.casefold(): n for n, step in enumerate(chart.steps, 1)}
        last = max((t.priority for t in chart.transitions if t.priority is not None), default=0) + 1
        self._transitions = sorted(chart.transitions, key=lambda t: last if t.priority is None else t.priority)

    def statements(self) -> list[ast.Stmt]:
        return self._one_at_a_time() if is_sequential(self._chart) else self._all_together()

    def _one_at_a_time(self) -> list[ast.Stmt]:
        (initial,) = self._initial
        pos = initial.pos
        start = [_started(pos, initial), self._state(pos, initial)]
        branches = [([_label(pos, 0)], start)]
        leaving = defaultdict[str, list[ast.Transition]](list)
        for transition in self._transitions:
            leaving[transition.sources[0][1].casefold()].append(transition)
        for step in self._chart.steps:
            key = step.name.casefold()
            firing = [(t.condition, self._move(t, step)) for t in leaving[key]]
            body = [_measured(step.pos, step)]
            if firing:
                body.append(ast.If(step.pos, firing, []))
            branches.append(([_label(step.pos, self._numbers[key])], body))
        note = _assign(pos, self._hidden(pos, BEFORE), self._hidden(pos, STATE))
        return [note, ast.Case(pos, self._hidden(pos, STATE), branches, [])]

    def _hidden(self, pos: int, what: str) -> ast.Expr:
        return _name(pos, hidden_name(self._decl, what))

    def _move(self, transition: ast.Transition, source: ast.Step) -> list[ast.Stmt]:
        pos, target = transition.pos, self._steps[transition.targets[0][1].casefold()]
        return [_left(pos, source), *_entered(pos, target), self._state(pos, target)]

    def _state(self, pos: int, step: ast.Step) -> ast.Stmt:
        return _assign(pos, self._hidden(pos, STATE), _integer(pos, self._numbers[step.name.casefold()]))

    def _all_together(self) -> list[ast.Stmt]:
        pos = self._initial[0].pos
        first = [_assign(pos, self._hidden(pos, RUNNING), _bool(pos, True))]
        first += [_started(step.pos, step) for step in self._initial]
        body: list[ast.Stmt] = [
            ast.If(step.pos, [(_part(step.pos, step, "X"), [_measured(step.pos, step)])], [])
            for step in self._chart.steps
        ]
        fires = {t: hidden_name(self._decl, f"{FIRES}{i}") for i, t in enumerate(self._chart.transitions)}
        before = defaultdict[str, list[ast.Transition]](list)  # those that leave a step
        for transition in self._transitions:
            sources = keys(transition.sources)
            body.append(self._test(transition, [t for key in sorted(sources) for t in before[key]], fires))
            for key in sources:
                before[key].append(transition)
        for transition in self._transitions:
            left = [_left(transition.pos, step) for step in self._ends(transition.sources)]
            body.append(ast.If(transition.pos, [(_name(transition.pos, fires[transition]), left)], []))
        for transition in self._transitions:
            entered = [s for step in self._ends(transition.targets) for s in _entered(transition.pos, step)]
            body.append(ast.If(transition.pos, [(_name(transition.pos, fires[transition]), entered)], []))
        return [ast.If(pos, [(self._hidden(pos, RUNNING), body)], first)]

    def _ends(self, names: list[tuple[int, str]]) -> list[ast.Step]:
        return [self._steps[name.casefold()] for _, name in names]

    def _test(
        self, transition: ast.Transition, rivals: list[ast.Transition], fires: dict[ast.Transition, str]
    ) -> ast.Stmt:
        """Notes whether a transition fires: its steps are active and none of those before takes one of them away."""
        pos = transition.pos
        enabled = [_part(pos, step, "X") for step in self._ends(transition.sources)]
        enabled += [ast.Unary(pos, ast.Operator.NOT, _name(pos, fires[other])) for other in dict.fromkeys(rivals)]
        note = _assign(pos, _name(pos, fires[transition]), _bool(pos, True))
        return ast.If(
            pos, [(_joined(ast.Operator.AND, enabled), [ast.If(pos, [(transition.condition, [note])], [])])], []
        )


def _label(pos: int, value: int) -> ast.CaseLabel:
    return ast.CaseLabel(pos, _integer(pos, value), None)


class _Execution:
    """What the active steps do."""

    def __init__(self, world: World, decl: ast.PouDecl, chart: ast.Chart, scope: Scope) -> None:
        self._chart = chart
        self._scope = scope
        self._decl = decl
        self._actions = actions_of(decl, chart)
        self._checker = Checker(world, scope)
        owner = decl if scope.cls is None else scope.cls.symbol.decl
        self._order = {member.name.casefold(): i for i, member in enumerate(owner.members)}

    def statements(self) -> list[ast.Stmt]:
        """BOOL variables come first, then the ACTIONs in the order they are declared in."""
        found: list[ast.Stmt] = []
        calls: list[Action] = []
        for action in self._actions:
            for indicator in (i for _, use in action.uses for i in use.indicators):
                named_place(self._checker, indicator, "an indicator")
            symbol = self._scope.lookup(action.name) if isinstance(action.target, ast.Name) else None
            if isinstance(symbol, MemberSymbol) or self._is_of_instance(action):
                calls.append(action)
            elif isinstance(action.target, ast.Name) and symbol is None:
                self._unknown(action)
            else:
                found += self._variable(action)
        calls.sort(key=lambda a: self._order.get(a.name.casefold(), -1))
        every = [statement for action in calls for statement in self._call(action)]
        if calls and is_sequential(self._chart) and all(action.plain for action in calls):
            return [*found, self._same_step(calls, every)]
        return found + every

    def _is_of_instance(self, action: Action) -> bool:
        """True for an action of an instance, such as `motor.Stop`."""
        bound = bound_member(self._checker, action.target) if isinstance(action.target, ast.Member) else None
        return bound is not None and bound.callable is not None

    def _same_step(self, calls: list[Action], otherwise: list[ast.Stmt]) -> ast.Stmt:
        """While the active step stays the same, its actions are all there is to call."""
        branches: list[tuple[list[ast.CaseLabel], list[ast.Stmt]]] = []
        for number, step in enumerate(self._chart.steps, 1):
            own = [_run(action) for action in calls if any(s is step for s, _ in action.uses)]
            branches.append(([_label(step.pos, number)], own))
        pos = calls[0].target.pos
        state = _name(pos, hidden_name(self._decl, STATE))
        same = ast.Binary(pos, ast.Operator.EQ, state, _name(pos, hidden_name(self._decl, BEFORE)))
        return ast.If(pos, [(same, [ast.Case(pos, state, branches, [])])], otherwise)

    def _unknown(self, action: Action) -> None:
        known = (*self._scope.outer.values(), *self._scope.names.values())
        names = [s.name for s in known if isinstance(s, MemberSymbol | VarSymbol) and s.name[0] != "%"]
        hint = did_you_mean(action.name, names)
        message = f"there is no ACTION and no BOOL variable {action.name}{hint}"
        self._scope.error(action.target.pos, "unknown", message)

    def _variable(self, action: Action) -> list[ast.Stmt]:
        pos = action.target.pos
        if action.plain:
            return [_assign(pos, action.target, _active(action, "N"))]
        return [*_controlled(action), _assign(pos, action.target, _output(action, "V"))]

    def _call(self, action: Action) -> list[ast.Stmt]:
        pos = action.target.pos
        if not action.plain:
            return [*_controlled(action), ast.If(pos, [(_output(action, "A"), [_run(action)])], [])]
        condition = ast.Binary(pos, ast.Operator.OR, _active(action, "N"), _name(pos, action.hidden))
        note = _assign(pos, _name(pos, action.hidden), _active(action, "N"))
        return [ast.If(pos, [(condition, [note, _run(action)])], [])]


def _active(action: Action, qualifier: str) -> ast.Expr:
    """Whether a step is active that has the action with this qualifier."""
    return _joined(ast.Operator.OR, [_part(u.pos, step, "X") for step, u in action.uses if u.qualifier == qualifier])


def _run(action: Action) -> ast.Stmt:
    pos = action.target.pos
    return ast.ExprStmt(pos, ast.Call(pos, action.target, []))


def _output(action: Action, member: str) -> ast.Expr:
    pos = action.target.pos
    return ast.Member(pos, _name(pos, action.hidden), member, pos)


def _controlled(action: Action) -> list[ast.Stmt]:
    """Runs the ACTION_CONTROL of an action."""
    pos = action.target.pos
    found: list[ast.Stmt] = []
    for step, use in action.uses:
        if use.time is not None:
            chosen = _assign(use.pos, _output(action, "T"), use.time)
            found.append(ast.If(use.pos, [(_part(use.pos, step, "X"), [chosen])], []))
    qualifiers = dict.fromkeys(use.qualifier for _, use in action.uses)
    args = [ast.Argument(pos, qualifier, _active(action, qualifier)) for qualifier in qualifiers]
    found.append(ast.ExprStmt(pos, ast.Call(pos, _name(pos, action.hidden), args)))
    return found
