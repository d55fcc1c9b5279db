"""Sequential Function Charts: a chart becomes variables and statements of the unit whose body it is.

- A step is a variable of the type SFC_STEP__, so that `step.X` and `step.T` are read like any members.
- In a chart without simultaneous branches one step is active at a time: its transitions are a branch of a CASE over a
  hidden number, and while it stays, so are the calls of its actions. Else the transitions are evaluated first, into
  temporaries, and then fire together.
- An action that has only the qualifier N is called while one of its steps is active, and once more behind that. With
  any other qualifier an instance of the library's ACTION_CONTROL decides.

What is hidden has a name that starts with %, which no identifier does, and holds that of the unit, because a unit that
it extends may have a chart as well. In the first cycle no transition is looked at:
the standard wants the effects of an activation to be over before what follows it is tested.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from plctool.compiler import ast
from plctool.compiler.diagnostics import Diagnostics, did_you_mean
from plctool.compiler.symbols import MemberSymbol, VarSymbol

if TYPE_CHECKING:
    from plctool.compiler.scope import Scope

STEP_TYPE = "SFC_STEP__"
_CONTROL = "ACTION_CONTROL"
_UNTIMED_CONTROL = "UNTIMED_ACTION_CONTROL"
_STATE = "%state"  # of a chart that has one active step: its number from 1; 0 before the first cycle
_BEFORE = "%before"  # the same number at the beginning of the cycle
_RUNNING = "%running"  # of any other chart: FALSE before the first cycle
_FIRES = "%fires"  # whether a transition does, in this cycle


@dataclass
class _Action:
    """An ACTION or a BOOL variable, and the steps that have it. `plain`: with no qualifier but N."""

    name: str
    hidden: str  # the variable that belongs to it: an ACTION_CONTROL, or whether the action is active
    target: ast.Expr
    uses: list[tuple[ast.Step, ast.StepAction]] = field(default_factory=list)

    @property
    def plain(self) -> bool:
        return all(use.qualifier == "N" for _, use in self.uses)


def hidden_name(decl: ast.PouDecl, what: str) -> str:
    """A hidden variable of a unit: that of an action, for example."""
    return f"%{decl.name}%{what}"


def _actions(decl: ast.PouDecl, chart: ast.Chart) -> list[_Action]:
    found: dict[str, _Action] = {}
    for step in chart.steps:
        for use in step.actions:
            action = _Action(use.name, hidden_name(decl, use.name), use.target)
            found.setdefault(use.name.casefold(), action).uses.append((step, use))
    return list(found.values())


def _is_sequential(chart: ast.Chart) -> bool:
    """Whether one step is active at a time."""
    return all(len(t.sources) == len(t.targets) == 1 for t in chart.transitions)


# ---- declaring -----------------------------------------------------------------------------------------------------


def declare(decl: ast.PouDecl, diagnostics: Diagnostics) -> None:
    """Checks the chart of a unit, if its body is one, and adds the variables that belong to it."""
    if decl.chart is None:
        return
    _Structure(decl, decl.chart, diagnostics).check()
    steps = ast.VarBlock(decl.pos, "STEP", set(), [_step_variable(step) for step in decl.chart.steps])
    steps.decls += _hidden(decl, decl.chart)
    temporary = [_variable(decl.pos, hidden_name(decl, _BEFORE), "UINT")]
    if not _is_sequential(decl.chart):
        fires = [hidden_name(decl, f"{_FIRES}{i}") for i in range(len(decl.chart.transitions))]
        temporary = [_variable(t.pos, name, "BOOL") for t, name in zip(decl.chart.transitions, fires, strict=True)]
    decl.blocks = [*decl.blocks, steps]
    if decl.chart.valid:
        decl.blocks.append(ast.VarBlock(decl.pos, "VAR_TEMP", set(), temporary))


def _variable(pos: int, name: str, type_name: str, init: ast.Init | None = None) -> ast.VarDecl:
    return ast.VarDecl(pos, [(pos, name)], None, ast.NamedType(pos, type_name), init)


def _step_variable(step: ast.Step) -> ast.VarDecl:
    active = ast.Literal(step.pos, ast.LiteralKind.BOOL, 1)
    init = ast.StructInit(step.pos, [(step.pos, "X", active)]) if step.initial else None
    return _variable(step.pos, step.name, STEP_TYPE, init)


def _hidden(decl: ast.PouDecl, chart: ast.Chart) -> list[ast.VarDecl]:
    own = {name.casefold() for block in decl.blocks for line in block.decls for _, name in line.names}
    state = (_STATE, "UINT") if _is_sequential(chart) else (_RUNNING, "BOOL")
    found = [_variable(decl.pos, hidden_name(decl, state[0]), state[1])]
    for action in _actions(decl, chart):
        if not action.plain:
            timed = any(use.time is not None for _, use in action.uses)
            found.append(_variable(action.target.pos, action.hidden, _CONTROL if timed else _UNTIMED_CONTROL))
        elif isinstance(action.target, ast.Name) and action.name.casefold() not in own:
            found.append(_variable(action.target.pos, action.hidden, "BOOL"))
    return found


class _Structure:
    """Finds what is wrong with a chart by itself."""

    def __init__(self, decl: ast.PouDecl, chart: ast.Chart, diagnostics: Diagnostics) -> None:
        self._decl = decl
        self._chart = chart
        self._diagnostics = diagnostics
        self._steps: dict[str, ast.Step] = {}

    def _error(self, pos: int, code: str, message: str) -> None:
        self._diagnostics.error(self._decl.source.pos(pos), code, message)

    def check(self) -> None:
        before = self._diagnostics.errors
        self._check_names()
        self._check_initial()
        for transition in self._chart.transitions:
            self._check_ends(transition)
        if self._diagnostics.errors == before:
            self._warn_of_unreachable()
        else:
            self._chart.valid = False

    def _check_names(self) -> None:
        members = {m.name.casefold(): m for m in self._decl.members}
        for step in self._chart.steps:
            other = self._steps.setdefault(step.name.casefold(), step)
            if other is not step:
                line = self._decl.source.pos(other.pos).line
                self._error(step.pos, "duplicate", f"there is a step {other.name} already in line {line}")
            elif step.name.casefold() in members:
                keyword = members[step.name.casefold()].keyword
                self._error(step.pos, "duplicate", f"{step.name} is the name of a step and of an {keyword}")
        self._chart.steps = list(self._steps.values())

    def _check_initial(self) -> None:
        initial = [step for step in self._chart.steps if step.initial]
        if not initial:
            pos = self._chart.steps[0].pos if self._chart.steps else self._decl.pos
            self._error(pos, "sfc", f"the chart of {self._decl.name} has no INITIAL_STEP to start with")
        for step in initial[1:]:
            message = f"{step.name} cannot be an INITIAL_STEP as well: {initial[0].name} is the one"
            self._error(step.pos, "sfc", message)

    def _check_ends(self, transition: ast.Transition) -> None:
        for side in (transition.sources, transition.targets):
            seen = set[str]()
            for pos, name in side:
                if name.casefold() not in self._steps:
                    hint = did_you_mean(name, [s.name for s in self._steps.values()])
                    self._error(pos, "unknown", f"there is no step {name}{hint}")
                elif name.casefold() in seen:
                    self._error(pos, "duplicate", f"{name} is in this list already")
                seen.add(name.casefold())

    def _warn_of_unreachable(self) -> None:
        reached = {key for key, step in self._steps.items() if step.initial}
        grown = True
        while grown:
            grown = False
            for transition in self._chart.transitions:
                targets = _keys(transition.targets)
                if _keys(transition.sources) <= reached and not targets <= reached:
                    reached |= targets
                    grown = True
        for key, step in self._steps.items():
            if key not in reached:
                pos = self._decl.source.pos(step.pos)
                message = f"the step {step.name} is never reached: no transitions lead there from the initial step"
                self._diagnostics.warning(pos, "unreachable", message)


def _keys(names: Iterable[tuple[int, str]]) -> set[str]:
    return {name.casefold() for _, name in names}


# ---- statements ----------------------------------------------------------------------------------------------------


def statements(decl: ast.PouDecl, scope: Scope) -> list[ast.Stmt]:
    """The body of a unit; of a chart what it does in a cycle."""
    if decl.chart is None:
        return decl.body
    if not decl.chart.valid:
        return []
    return [*_Evolution(decl, decl.chart).statements(), *_Execution(decl, decl.chart, scope).statements()]


def _name(pos: int, name: str) -> ast.Expr:
    return ast.Name(pos, name)


def _part(pos: int, step: ast.Step, member: str) -> ast.Expr:
    """`step.member`"""
    return ast.Member(pos, _name(pos, step.name), member, pos)


def _assign(pos: int, target: ast.Expr, value: ast.Expr) -> ast.Stmt:
    return ast.Assign(pos, [target], ":=", value)


def _bool(pos: int, value: bool) -> ast.Expr:
    return ast.Literal(pos, ast.LiteralKind.BOOL, int(value))


def _integer(pos: int, value: int) -> ast.Expr:
    return ast.Literal(pos, ast.LiteralKind.INT, value)


def _time(pos: int) -> ast.Expr:
    """`TIME()`"""
    return ast.Call(pos, _name(pos, "TIME"), [])


def _joined(op: str, operands: list[ast.Expr]) -> ast.Expr:
    first, *rest = operands
    for operand in rest:
        first = ast.Binary(operand.pos, op, first, operand)
    return first


def _started(pos: int, step: ast.Step) -> ast.Stmt:
    return _assign(pos, _part(pos, step, "START"), _time(pos))


def _measured(pos: int, step: ast.Step) -> ast.Stmt:
    """The time the step has been active."""
    elapsed = ast.Binary(pos, "-", _time(pos), _part(pos, step, "START"))
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
        self._initial = next(step for step in chart.steps if step.initial)
        self._numbers = {step.name.casefold(): n for n, step in enumerate(chart.steps, 1)}
        last = max((t.priority for t in chart.transitions if t.priority is not None), default=0) + 1
        self._transitions = sorted(chart.transitions, key=lambda t: last if t.priority is None else t.priority)

    def statements(self) -> list[ast.Stmt]:
        return self._one_at_a_time() if _is_sequential(self._chart) else self._all_together()

    def _one_at_a_time(self) -> list[ast.Stmt]:
        pos = self._initial.pos
        start = [_started(pos, self._initial), self._state(pos, self._initial)]
        branches = [([_label(pos, 0)], start)]
        for step in self._chart.steps:
            key = step.name.casefold()
            firing = [
                (t.condition, self._move(t, step)) for t in self._transitions if t.sources[0][1].casefold() == key
            ]
            body = [_measured(step.pos, step)]
            if firing:
                body.append(ast.If(step.pos, firing, []))
            branches.append(([_label(step.pos, self._numbers[key])], body))
        note = _assign(pos, self._hidden(pos, _BEFORE), self._hidden(pos, _STATE))
        return [note, ast.Case(pos, self._hidden(pos, _STATE), branches, [])]

    def _hidden(self, pos: int, what: str) -> ast.Expr:
        return _name(pos, hidden_name(self._decl, what))

    def _move(self, transition: ast.Transition, source: ast.Step) -> list[ast.Stmt]:
        pos, target = transition.pos, self._steps[transition.targets[0][1].casefold()]
        return [_left(pos, source), *_entered(pos, target), self._state(pos, target)]

    def _state(self, pos: int, step: ast.Step) -> ast.Stmt:
        return _assign(pos, self._hidden(pos, _STATE), _integer(pos, self._numbers[step.name.casefold()]))

    def _all_together(self) -> list[ast.Stmt]:
        pos = self._initial.pos
        first = [_assign(pos, self._hidden(pos, _RUNNING), _bool(pos, True)), _started(pos, self._initial)]
        body: list[ast.Stmt] = [
            ast.If(step.pos, [(_part(step.pos, step, "X"), [_measured(step.pos, step)])], [])
            for step in self._chart.steps
        ]
        fires = {t: hidden_name(self._decl, f"{_FIRES}{i}") for i, t in enumerate(self._chart.transitions)}
        for i, transition in enumerate(self._transitions):
            body.append(self._test(transition, self._transitions[:i], fires))
        for transition in self._transitions:
            left = [_left(transition.pos, step) for step in self._ends(transition.sources)]
            body.append(ast.If(transition.pos, [(_name(transition.pos, fires[transition]), left)], []))
        for transition in self._transitions:
            entered = [s for step in self._ends(transition.targets) for s in _entered(transition.pos, step)]
            body.append(ast.If(transition.pos, [(_name(transition.pos, fires[transition]), entered)], []))
        return [ast.If(pos, [(self._hidden(pos, _RUNNING), body)], first)]

    def _ends(self, names: list[tuple[int, str]]) -> list[ast.Step]:
        return [self._steps[name.casefold()] for _, name in names]

    def _test(
        self, transition: ast.Transition, before: list[ast.Transition], fires: dict[ast.Transition, str]
    ) -> ast.Stmt:
        """Notes whether a transition fires: its steps are active and none of those before takes one of them away."""
        pos, sources = transition.pos, _keys(transition.sources)
        enabled = [_part(pos, step, "X") for step in self._ends(transition.sources)]
        rivals = [other for other in before if sources & _keys(other.sources)]
        enabled += [ast.Unary(pos, "NOT", _name(pos, fires[other])) for other in rivals]
        note = _assign(pos, _name(pos, fires[transition]), _bool(pos, True))
        return ast.If(pos, [(_joined("AND", enabled), [ast.If(pos, [(transition.condition, [note])], [])])], [])


def _label(pos: int, value: int) -> ast.CaseLabel:
    return ast.CaseLabel(pos, _integer(pos, value), None)


class _Execution:
    """What the active steps do."""

    def __init__(self, decl: ast.PouDecl, chart: ast.Chart, scope: Scope) -> None:
        self._chart = chart
        self._scope = scope
        self._decl = decl
        self._actions = _actions(decl, chart)
        self._checker = scope.world.expressions(scope)
        self._order = {member.name.casefold(): i for i, member in enumerate(decl.members)}

    def statements(self) -> list[ast.Stmt]:
        """BOOL variables come first, then the ACTIONs in the order they are declared in."""
        found: list[ast.Stmt] = []
        calls: list[_Action] = []
        for action in self._actions:
            for indicator in (i for _, use in action.uses for i in use.indicators):
                self._checker.place(indicator, "an indicator")
            symbol = self._scope.lookup(action.name) if isinstance(action.target, ast.Name) else None
            if isinstance(symbol, MemberSymbol):
                calls.append(action)
            elif isinstance(action.target, ast.Name) and symbol is None:
                self._unknown(action)
            else:
                found += self._variable(action)
        calls.sort(key=lambda a: self._order.get(a.name.casefold(), -1))
        every = [statement for action in calls for statement in self._call(action)]
        if calls and _is_sequential(self._chart) and all(action.plain for action in calls):
            return [*found, self._same_step(calls, every)]
        return found + every

    def _same_step(self, calls: list[_Action], otherwise: list[ast.Stmt]) -> ast.Stmt:
        """While the active step stays the same, its actions are all there is to call."""
        branches: list[tuple[list[ast.CaseLabel], list[ast.Stmt]]] = []
        for number, step in enumerate(self._chart.steps, 1):
            own = [_run(action) for action in calls if any(s is step for s, _ in action.uses)]
            branches.append(([_label(step.pos, number)], own))
        pos = calls[0].target.pos
        state = _name(pos, hidden_name(self._decl, _STATE))
        same = ast.Binary(pos, "=", state, _name(pos, hidden_name(self._decl, _BEFORE)))
        return ast.If(pos, [(same, [ast.Case(pos, state, branches, [])])], otherwise)

    def _unknown(self, action: _Action) -> None:
        known = (*self._scope.outer.values(), *self._scope.names.values())
        names = [s.name for s in known if isinstance(s, MemberSymbol | VarSymbol) and s.name[0] != "%"]
        hint = did_you_mean(action.name, names)
        message = f"there is no ACTION and no BOOL variable {action.name}{hint}"
        self._scope.error(action.target.pos, "unknown", message)

    def _variable(self, action: _Action) -> list[ast.Stmt]:
        pos = action.target.pos
        if action.plain:
            return [_assign(pos, action.target, _active(action, "N"))]
        return [*_controlled(action), _assign(pos, action.target, _output(action, "V"))]

    def _call(self, action: _Action) -> list[ast.Stmt]:
        pos = action.target.pos
        if not action.plain:
            return [*_controlled(action), ast.If(pos, [(_output(action, "A"), [_run(action)])], [])]
        condition = ast.Binary(pos, "OR", _active(action, "N"), _name(pos, action.hidden))
        note = _assign(pos, _name(pos, action.hidden), _active(action, "N"))
        return [ast.If(pos, [(condition, [note, _run(action)])], [])]


def _active(action: _Action, qualifier: str) -> ast.Expr:
    """Whether a step is active that has the action with this qualifier."""
    return _joined("OR", [_part(u.pos, step, "X") for step, u in action.uses if u.qualifier == qualifier])


def _run(action: _Action) -> ast.Stmt:
    pos = action.target.pos
    return ast.ExprStmt(pos, ast.Call(pos, action.target, []))


def _output(action: _Action, member: str) -> ast.Expr:
    pos = action.target.pos
    return ast.Member(pos, _name(pos, action.hidden), member, pos)


def _controlled(action: _Action) -> list[ast.Stmt]:
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
