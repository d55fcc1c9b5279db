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
        self._rules = [(r.origin, r.size, reducer) for r, reducer in zip(tables.rules, reducers, strict=True)]

    def feed(self, token: Token) -> bool:
        """Takes a token; False when it does not fit. The stacks then are as if it had not been there, but for
        reductions that were due."""
        states, values = self.states, self.values
        actions, gotos, rules = self.tables.actions, self.tables.gotos, self._rules
        kind = token.type
        while True:
            action = actions[states[-1]].get(kind)
            if action is None:
                return False
            if action >= 0:
                states.append(action)
                values.append(token)
                return True
            # Here and not in `reduce`: half the time of a parse is spent with it.
            origin, size, reducer = rules[-1 - action]
            if reducer is None:
                states[-1] = gotos[states[-2]][origin]
            else:
                self._replace(origin, size, reducer)
            if kind == END and states[-1] == self.tables.end:
                return True

    def reduce(self, number: int) -> None:
        """Replaces the symbols of a rule by what it stands for."""
        origin, size, reducer = self._rules[number]
        if reducer is None:
            self.states[-1] = self.tables.gotos[self.states[-2]][origin]
        else:
            self._replace(origin, size, reducer)

    def _replace(self, origin: str, size: int, reducer: Reducer) -> None:
        states, values = self.states, self.values
        if size:
            children = values[-size:]
            del states[-size:], values[-size:]
            values.append(reducer(children))
        else:
            values.append(reducer([]))
        states.append(self.tables.gotos[states[-1]][origin])
