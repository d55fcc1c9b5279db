"""The automaton of an LALR(1) parser: states and values on two stacks.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from operator import itemgetter
from typing import Any, NamedTuple

from plctool.compiler.syntax.lexer import Token
from plctool.compiler.syntax.tables import END, Rule, Tables

Pick = Callable[[Sequence[Any]], Sequence[Any]]


class Reducer(NamedTuple):
    """What makes the value of a rule: `make` from its children, or from those that `pick` takes of them."""

    make: Callable[..., Any]
    pick: Pick | None = None


def picking(indices: Sequence[int]) -> Pick:
    """Takes the children with these indices, without a call of Python code for each rule."""
    if len(indices) > 1:
        return itemgetter(*indices)
    return itemgetter(slice(indices[0], indices[0] + 1) if indices else slice(0, 0))


class Parser:
    """The state of one parse. `states` and `values` are the stacks; they are repaired by `Recovery`."""

    def __init__(self, tables: Tables, reducers: Sequence[Reducer | None], gotos: list[dict[str, int]]) -> None:
        """`gotos`: those of `shortened`."""
        self.tables = tables
        self.states = [tables.start]
        self.values: list[Any] = []
        self._gotos = gotos
        self._rules = [
            (rule.origin, rule.size, *(reducer or (None, None)))
            for rule, reducer in zip(reversed(tables.rules), reversed(reducers), strict=True)
        ]  # by what stands for it in the actions: -1 for the first rule

    def run(self, tokens: Iterable[Token], taken: list[Token], unsure: Collection[str] = ()) -> Token | None:
        """Takes tokens and adds them to `taken`, up to the first that does not fit, or whose type is in `unsure`: gives
        it. The stacks then are as if it had not been there, but for reductions that were due."""
        states, values, actions, gotos, rules = self.states, self.values, self.tables.actions, self._gotos, self._rules
        end = self.tables.end
        state = states[-1]
        for token in tokens:
            kind = token.type
            if kind in unsure:
                return token
            # All in one function: half the time of a parse is spent here.
            while True:
                action = actions[state].get(kind)
                if action is None:
                    return token
                if action >= 0:
                    state = action
                    states.append(state)
                    values.append(token)
                    break
                origin, size, make, pick = rules[action]
                if make is None:
                    state = states[-1] = gotos[states[-2]][origin]
                elif size == 1 and pick is None:
                    values[-1] = make(values[-1])
                    state = states[-1] = gotos[states[-2]][origin]
                else:
                    state = self._replace(origin, size, make, pick)
                if state == end and kind == END:
                    break
            taken.append(token)
        return None

    def feed(self, token: Token) -> bool:
        """Takes a token; False when it does not fit."""
        return self.run((token,), []) is None

    def reduce(self, number: int) -> None:
        """Replaces the symbols of a rule by what it stands for."""
        origin, size, make, pick = self._rules[-1 - number]
        if make is None:
            self.states[-1] = self._gotos[self.states[-2]][origin]
        else:
            self._replace(origin, size, make, pick)

    def _replace(self, origin: str, size: int, make: Callable[..., Any], pick: Pick | None) -> int:
        """Does what a rule says with the stacks; gives the state."""
        states, values = self.states, self.values
        children: Sequence[Any] = ()
        if size:
            children = values[-size:]
            del states[-size:], values[-size:]
        values.append(make(*children) if pick is None else make(*pick(children)))
        state = self._gotos[states[-1]][origin]
        states.append(state)
        return state


def shortened(tables: Tables, reducers: Sequence[Reducer | None]) -> list[dict[str, int]]:
    """The gotos of the tables without detours: past states in which the next step, whatever comes, is to replace a
    symbol by another one with the same value."""
    names = {state: rule.origin for state, rule in _detours(tables, reducers)}
    found = []
    for gotos in tables.gotos:
        direct = {}
        for origin, state in gotos.items():
            while state in names:
                state = gotos[names[state]]
            direct[origin] = state
        found.append(direct)
    return found


def _detours(tables: Tables, reducers: Sequence[Reducer | None]) -> Iterator[tuple[int, Rule]]:
    for state, actions in enumerate(tables.actions):
        chosen = set(actions.values())
        if len(chosen) == 1 and (action := chosen.pop()) < 0 and reducers[-1 - action] is None:
            yield state, tables.rules[-1 - action]
