"""The LALR(1) tables of grammar.lark. lark makes them once; after that they come from the user's cache folder.

Making them takes longer than checking a small program, hence the cache. It is only a file of numbers and names:
whatever is wrong with it, the tables are made again.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import hashlib
import json
import os
from functools import cache
from pathlib import Path
from typing import Any

from plctool.files import cache_folder
from plctool.records import dataclass

_GRAMMAR = Path(__file__).with_name("grammar.lark")
_VERSION = 1  # of the format of the cache

END = "$END"


@dataclass(frozen=True)
class Rule:
    """A production. `parts` are the children the tree builder gets: (index, spliced), index -1 for an optional part
    left out; spliced children are lists. `transparent`: a single child stands for the whole."""

    origin: str
    size: int
    callback: str
    parts: tuple[tuple[int, bool], ...]
    transparent: bool

    @property
    def is_list(self) -> bool:
        """Helper rules collect their children for the rule they occur in."""
        return self.origin.startswith("_")


@dataclass(frozen=True)
class Tables:
    """`actions`: per state, for a kind of token: the next state, or -1-n to reduce by rule n. `gotos`: per state, the
    next state after a reduction. The parse ends in state `end`."""

    actions: list[dict[str, int]]
    gotos: list[dict[str, int]]
    rules: list[Rule]
    start: int
    end: int

    def after(self, stack: list[int], *kinds: str) -> list[int] | None:
        """The states after tokens of these kinds, None when one does not fit. More than a look into `actions`: that
        may hold reductions for tokens that fit nowhere after them."""
        stack = list(stack)
        for kind in kinds:
            while True:
                action = self.actions[stack[-1]].get(kind)
                if action is None:
                    return None
                if action >= 0:
                    stack.append(action)
                    break
                rule = self.rules[-1 - action]
                if rule.size:
                    del stack[-rule.size :]
                stack.append(self.gotos[stack[-1]][rule.origin])
                if kind == END and stack[-1] == self.end:
                    return stack
        return stack


@cache
def load_tables() -> Tables:
    """The tables, from the cache when they are there."""
    grammar = _GRAMMAR.read_text("utf-8")
    digest = hashlib.sha256(f"{_VERSION}\n{grammar}".encode()).hexdigest()[:20]
    path = cache_folder() / f"grammar-{digest}.json"
    try:
        return _decode(json.loads(path.read_text("utf-8")))
    except (OSError, ValueError, KeyError, TypeError, IndexError):
        tables = make_tables(grammar)
        _store(path, tables)
        return tables


def _store(path: Path, tables: Tables) -> None:
    """Writes the cache; without one everything works as well."""
    temporary = path.with_suffix(f".{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.write_text(json.dumps(_encode(tables)), "utf-8")
        temporary.replace(path)
    except OSError:
        return


def _encode(tables: Tables) -> dict[str, Any]:
    rules = [[r.origin, r.size, r.callback, r.parts, r.transparent] for r in tables.rules]
    return {"actions": tables.actions, "gotos": tables.gotos, "rules": rules, "start": tables.start, "end": tables.end}


def _decode(data: dict[str, Any]) -> Tables:
    rules = [
        Rule(str(origin), int(size), str(callback), tuple((int(i), bool(s)) for i, s in parts), bool(transparent))
        for origin, size, callback, parts, transparent in data["rules"]
    ]
    return Tables(data["actions"], data["gotos"], rules, int(data["start"]), int(data["end"]))


def make_tables(grammar: str) -> Tables:
    """Has lark work out the tables."""
    from lark import Lark  # here, because it is slow to import and seldom needed
    from lark.lexer import Lexer
    from lark.parsers.lalr_analysis import Shift

    class NoLexer(Lexer):
        """Tokens are made elsewhere."""

        def __init__(self, conf: object) -> None:
            pass

        def lex(self, lexer_state: object, parser_state: object = None) -> Any:
            return iter(())

    lark = Lark(grammar, parser="lalr", lexer=NoLexer, maybe_placeholders=True)
    conf = lark.parse_interactive("").parser_state.parse_conf
    numbers = {state: number for number, state in enumerate(conf.states)}
    rules: list[Rule] = []
    known: dict[Any, int] = {}
    actions: list[dict[str, int]] = []
    gotos: list[dict[str, int]] = []
    for entries in conf.states.values():
        actions.append({})
        gotos.append({})
        for name, (action, target) in entries.items():
            if action is Shift:
                (actions if name.isupper() else gotos)[-1][name] = numbers[target]
                continue
            if target not in known:
                known[target] = len(rules)
                rules.append(_rule(target))
            actions[-1][name] = -1 - known[target]
    return Tables(actions, gotos, rules, numbers[conf.start_state], numbers[conf.end_state])


def _rule(rule: Any) -> Rule:
    """What lark's tree builder would do with a rule."""
    expansion, options = rule.expansion, rule.options
    gaps = [0] * (len(expansion) + 1)  # optional parts left out before each symbol
    if options.empty_indices:
        gaps = [len(ones) for ones in "".join(str(int(b)) for b in options.empty_indices).split("0")]
    parts: list[tuple[int, bool]] = []
    for index, symbol in enumerate(expansion):
        parts += [(-1, False)] * gaps[index]
        if not (symbol.is_term and symbol.filter_out):
            parts.append((index, not symbol.is_term and symbol.name.startswith("_")))
    parts += [(-1, False)] * gaps[len(expansion)]
    name = str(rule.origin.name)
    return Rule(name, len(expansion), str(rule.alias or name), tuple(parts), bool(options.expand1 and not rule.alias))
