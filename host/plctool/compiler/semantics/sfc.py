"""Sequential Function Charts: a chart becomes variables and statements of the unit, or ACTION, whose body it is.

- A step is a variable of the type SFC_STEP__, so that `step.X` and `step.T` are read like any members.
- In a chart of one network without simultaneous branches one step is active at a time: its transitions are a branch of
  a CASE over a hidden number, and while it stays, so are the calls of its actions. Else the transitions are evaluated
  first, into temporaries, and then fire together.
- An action that has only the qualifier N is called while one of its steps is active, and once more after that. With
  any other qualifier an instance of the library's ACTION_CONTROL decides.

What is hidden has a name that starts with %, which no identifier does, and holds that of the unit, because a unit that
it extends may have a chart as well. The variables of a chart in an ACTION are known in that action only. In the first
cycle no transition is looked at: the standard wants the effects of an activation to be over before what follows it is
tested. Here is what is declared; sfc_statements.py has the statements.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import Diagnostics, did_you_mean

STEP_TYPE = "SFC_STEP__"
_CONTROL = "ACTION_CONTROL"
_UNTIMED_CONTROL = "UNTIMED_ACTION_CONTROL"
STATE = "%state"  # of a chart that has one active step: its number from 1; 0 before the first cycle
BEFORE = "%before"  # the same number at the beginning of the cycle
RUNNING = "%running"  # of any other chart: FALSE before the first cycle
FIRES = "%fires"  # whether a transition does, in this cycle


@dataclass
class Action:
    """An ACTION or a BOOL variable, and the steps that have it. `asked`: its A is read."""

    name: str
    hidden: str  # the variable that belongs to it: an ACTION_CONTROL, or whether the action is active
    target: ast.Expr
    asked: bool
    uses: list[tuple[ast.Step, ast.StepAction]] = field(default_factory=list)

    @property
    def plain(self) -> bool:
        """Whether it needs no ACTION_CONTROL."""
        return not self.asked and all(use.qualifier == "N" for _, use in self.uses)


def hidden_name(decl: ast.PouDecl, what: str) -> str:
    """A hidden variable of a unit: that of an action, for example."""
    return f"%{decl.name}%{what}"


def actions_of(decl: ast.PouDecl, chart: ast.Chart) -> list[Action]:
    """The actions of a chart in the order of their first use."""
    found: dict[str, Action] = {}
    for step in chart.steps:
        for use in step.actions:
            asked = use.name.casefold() in chart.asked
            action = Action(use.name, hidden_name(decl, use.name), use.target, asked)
            found.setdefault(use.name.casefold(), action).uses.append((step, use))
    return list(found.values())


def is_sequential(chart: ast.Chart) -> bool:
    """Whether one step is active at a time."""
    alone = sum(step.initial for step in chart.steps) == 1
    return alone and all(len(t.sources) == len(t.targets) == 1 for t in chart.transitions)


# ---- declaring -----------------------------------------------------------------------------------------------------


def declare(decl: ast.PouDecl, diagnostics: Diagnostics) -> None:
    """Checks the charts of a unit and of its actions, and adds the variables that belong to them."""
    for part in [part for part in (decl, *decl.members) if part.chart is not None]:
        if part.keyword not in (ast.Unit.METHOD, ast.Unit.GET, ast.Unit.SET):
            _declare(part, decl, diagnostics)
            continue
        message = f"{part.name} keeps nothing between its calls, so it cannot be a chart; use an ACTION"
        diagnostics.error(part.source.pos(part.pos), "sfc", message)
        part.chart = None


def _declare(decl: ast.PouDecl, owner: ast.PouDecl, diagnostics: Diagnostics) -> None:
    assert decl.chart is not None
    decl.chart.asked = {
        node.base.name.casefold()
        for node in ast.every(ast.Member, [owner.body, [m.body for m in owner.members]])
        if node.name.upper() == "A" and isinstance(node.base, ast.Name)
    }
    _Structure(decl, owner, diagnostics).check()
    steps = ast.VarBlock(decl.pos, ast.Section.STEP, set(), [_step_variable(step) for step in decl.chart.steps])
    steps.decls += _hidden(decl, decl.chart)
    temporary = [_variable(decl.pos, hidden_name(decl, BEFORE), "UINT")]
    if not is_sequential(decl.chart):
        fires = [hidden_name(decl, f"{FIRES}{i}") for i in range(len(decl.chart.transitions))]
        temporary = [_variable(t.pos, name, "BOOL") for t, name in zip(decl.chart.transitions, fires, strict=True)]
    decl.blocks = [*decl.blocks, steps]
    if decl.chart.valid:
        decl.blocks.append(ast.VarBlock(decl.pos, ast.Section.VAR_TEMP, set(), temporary))


def _variable(pos: int, name: str, type_name: str, init: ast.Init | None = None) -> ast.VarDecl:
    return ast.VarDecl(pos, [(pos, name)], None, ast.NamedType(pos, type_name), init)


def _step_variable(step: ast.Step) -> ast.VarDecl:
    active = ast.Literal(step.pos, ast.LiteralKind.BOOL, 1)
    init = ast.StructInit(step.pos, [(step.pos, "X", active)]) if step.initial else None
    return _variable(step.pos, step.name, STEP_TYPE, init)


def _hidden(decl: ast.PouDecl, chart: ast.Chart) -> list[ast.VarDecl]:
    own = {name.casefold() for block in decl.blocks for line in block.decls for _, name in line.names}
    state = (STATE, "UINT") if is_sequential(chart) else (RUNNING, "BOOL")
    found = [_variable(decl.pos, hidden_name(decl, state[0]), state[1])]
    for action in actions_of(decl, chart):
        if not action.plain:
            timed = any(use.time is not None for _, use in action.uses)
            found.append(_variable(action.target.pos, action.hidden, _CONTROL if timed else _UNTIMED_CONTROL))
        elif action.name.casefold() not in own:  # `motor.Stop` may be an action as well
            found.append(_variable(action.target.pos, action.hidden, "BOOL"))
    return found


class _Structure:
    """Finds what is wrong with a chart by itself."""

    def __init__(self, decl: ast.PouDecl, owner: ast.PouDecl, diagnostics: Diagnostics) -> None:
        assert decl.chart is not None
        self._decl = decl
        self._owner = owner
        self._chart = decl.chart
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
        members = {m.name.casefold(): m for m in self._owner.members}
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
        touching = defaultdict[str, list[set[str]]](list)  # the ends of the transitions at a step
        for ends in (keys(t.sources) | keys(t.targets) for t in self._chart.transitions):
            for key in ends:
                touching[key].append(ends)
        first = dict[str, ast.Step]()  # of each network, by any of its steps
        for step in initial:
            other = first.get(step.name.casefold())
            if other is not None:
                message = f"{step.name} cannot be an INITIAL_STEP as well: {other.name} is the one of this network"
                self._error(step.pos, "sfc", message)
            else:
                first |= dict.fromkeys(_network_of(step.name.casefold(), touching), step)

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
        leaving = defaultdict[str, list[tuple[set[str], set[str]]]](list)
        for transition in self._chart.transitions:
            sources = keys(transition.sources)
            for key in sources:
                leaving[key].append((sources, keys(transition.targets)))
        reached = {key for key, step in self._steps.items() if step.initial}
        waiting = list(reached)
        while waiting:
            for sources, targets in leaving[waiting.pop()]:
                if sources <= reached:
                    waiting += targets - reached
                    reached |= targets
        for key, step in self._steps.items():
            if key not in reached:
                pos = self._decl.source.pos(step.pos)
                message = f"the step {step.name} is never reached: no transitions lead there from an initial step"
                self._diagnostics.warning(pos, "unreachable", message)


def _network_of(key: str, touching: Mapping[str, list[set[str]]]) -> set[str]:
    """The steps that transitions connect with one, in either direction, and that one."""
    found, waiting = {key}, [key]
    while waiting:
        for ends in touching[waiting.pop()]:
            waiting += ends - found
            found |= ends
    return found


def keys(names: Iterable[tuple[int, str]]) -> set[str]:
    return {name.casefold() for _, name in names}
