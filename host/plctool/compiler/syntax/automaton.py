"""The automaton of an LALR(1) parser: states and values on two stacks.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from plctool.compiler.syntax.lexer import Token
from plctool.compiler.syntax.tables import END, Tables

Reducer = Callable[[list[Any]], Any]


class Parser:
    """The state of one parse. `states` and `values` are the stacks; they are repaired by `Recovery`."""

    def __init__(self, tables: Tables, reducers: list[Reducer | None]) -> None:
        self.tables = tables
        self.states = [tables.start]
        self.values: list[Any] = []
        self._reducers = reducers

    def feed(self, token: Token) -> bool:
        """Takes a token; False when it does not fit. The stacks then are as if it had not been there, but for
        reductions that were due."""
        states, values, actions = self.states, self.values, self.tables.actions
        kind = token.type
        while True:
            action = actions[states[-1]].get(kind)
            if action is None:
                return False
            if action >= 0:
                states.append(action)
                values.append(token)
                return True
            self.reduce(-1 - action)
            if kind == END and states[-1] == self.tables.end:
                return True

    def reduce(self, number: int) -> None:
        """Replaces the symbols of a rule by what it stands for."""
        states, values = self.states, self.values
        rule, reducer = self.tables.rules[number], self._reducers[number]
        size = rule.size
        if reducer is None:
            del states[-1]
        elif size:
            children = values[-size:]
            del states[-size:], values[-size:]
            values.append(reducer(children))
        else:
            values.append(reducer([]))
        states.append(self.tables.gotos[states[-1]][rule.origin])
