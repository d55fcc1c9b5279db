"""Syntax errors: what to say, and how to go on so that the next error is found as well.

First a repair is tried that loses nothing: put in the one token that is missing, or the END_... of what is still open.
Only when none fits, text is skipped to the end of the statement or to the next keyword that makes sense where the
parser stands.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from typing import Any

from lark.parsers.lalr_analysis import Shift
from lark.parsers.lalr_parser_state import ParserState

from plctool.compiler.lexer import KEYWORDS, Report, Token
from plctool.compiler.source import Source

_CLOSERS = {
    "IF": "END_IF", "CASE": "END_CASE", "FOR": "END_FOR", "WHILE": "END_WHILE", "REPEAT": "END_REPEAT",
    "VAR": "END_VAR",
    "GLOBAL": "END_VAR", "STRUCT": "END_STRUCT", "UNION": "END_UNION", "TYPE": "END_TYPE", "FUNCTION": "END_FUNCTION",
    "FUNCTION_BLOCK": "END_FUNCTION_BLOCK", "PROGRAM": "END_PROGRAM", "RESOURCE": "END_RESOURCE",
    "CONFIGURATION": "END_CONFIGURATION",
}  # fmt: skip
_ENDS = {"_" + end for end in _CLOSERS.values()}
_UNITS = {"FUNCTION", "FUNCTION_BLOCK", "PROGRAM", "TYPE", "GLOBAL", "CONFIGURATION"}
_STATEMENTS = {"IF", "CASE", "FOR", "WHILE", "REPEAT", "EXIT", "CONTINUE", "RETURN"}
_SYNC = {*_ENDS, *_UNITS, *_STATEMENTS, "VAR", "STRUCT", "RESOURCE", "TASK", "_ELSE", "_ELSIF", "_UNTIL", "$END"}
_ITEMS = ("stmt", "var_decl", "type_decl", "config_item", "unit")  # what can be left out as a whole

_INSERTIONS = {
    "_SEMI": (";", "expected ; after the {item}"),
    "_THEN": ("THEN", "expected THEN after the condition"),
    "_DO": ("DO", "expected DO before the body of the loop"),
    "_OF": ("OF", "expected OF"),
    "_TO": ("TO", "expected TO"),
    "_RPAR": (")", "expected )"),
    "_RSQB": ("]", "expected ]"),
    "_COLON": (":", "expected :"),
    "_ASSIGN": (":=", "expected :="),
    "_COMMA": (",", "expected ,"),
}
_WORDS = {
    "_SEMI": ";", "_COLON": ":", "_COMMA": ",", "_ASSIGN": ":=", "_LPAR": "(", "_RPAR": ")", "_LSQB": "[", "_RSQB": "]",
    "_DOTDOT": "..", "_THEN": "THEN", "_DO": "DO", "_OF": "OF", "_TO": "TO", "_UNTIL": "UNTIL", "_ON": "ON",
}  # fmt: skip

_PARTS = {"_ELSE": ("IF", "CASE"), "_ELSIF": ("IF",), "_UNTIL": ("REPEAT",)}
_BLOCKS = {"IF", "CASE", "FOR", "WHILE", "REPEAT"}
_APART = 3  # an error closer than so many tokens to the one before is a consequence of it

Stack = list[int]


class Recovery:
    """Repairs the state of one parser. `skipping` is set while text is thrown away."""

    def __init__(self, state: ParserState[int], source: Source, report: Report) -> None:
        self._state = state
        self._states: dict[int, dict[str, tuple[Any, Any]]] = state.parse_conf.states
        self._source = source
        self._report = report
        self.skipping = False
        self.previous: Token | None = None
        self._accepted = _APART  # tokens since the last error
        self._quiet = False

    def handle(self, token: Token) -> Any:
        """Reports that `token` does not fit, and repairs; returns what feeding the repaired input gives."""
        self._quiet = self._accepted < _APART
        self._accepted = 0
        self._reduce()
        if not self._stray_end(token):
            while self._insert(token) or self._close(token):
                if self._shift(self._state.state_stack, token.type) is not None:
                    return self._feed(token)
            if self._shift(self._state.state_stack, token.type) is None:
                self._say(token.pos, self._unexpected(token))
        return self._skip(token)

    def accept(self, token: Token) -> None:
        """Notes a token that was fine."""
        self.previous = token
        self._accepted += 1

    def resume(self, token: Token) -> bool:
        """While skipping: whether to go on with `token`. A semicolon ends what is skipped and belongs to it."""
        if token.type == "_SEMI":
            self._drop(None)
        elif token.type in _SYNC and self._drop(token.type):
            return True
        return False

    # ---- repairs ----

    def _insert(self, token: Token) -> bool:
        """Puts in one missing token before `token`, or before the name in front of it."""
        stack, values = self._state.state_stack, self._state.value_stack
        if token.type == "EQ" and self._shift(stack, "_ASSIGN") and self._item(stack) == "stmt":
            self._say(token.pos, "an assignment is written :=, not =")
            token.type = "_ASSIGN"
            return True
        if self._keyword_as_name(token):
            return True
        for kind, (text, message) in _INSERTIONS.items():
            if self._shift(stack, kind, token.type) is not None:
                self._say(self._gap(token), message.format(item=self._item_words(stack)))
                self._feed(Token(kind, text, self._gap(token)))
                return True
        if self._shift(stack, "_UNTIL", "IDENT", token.type) is not None:
            self._say(token.pos, f"UNTIL and a condition missing before {token.text}")
            self._feed(Token("_UNTIL", "UNTIL", token.pos))
            self._feed(Token("IDENT", "", token.pos))
            return True
        last = values[-1] if values else None
        if isinstance(last, Token) and last.type == "IDENT" and self._insert_before_name(last, token):
            return True
        if self._shift(stack, "IDENT", token.type) is not None and token.type not in _ENDS | _UNITS | {"$END"}:
            self._say(token.pos, f"expected {self._operand(stack)} before {_shown(token)}")
            self._feed(Token("IDENT", "", token.pos))
            return True
        return False

    def _insert_before_name(self, name: Token, token: Token) -> bool:
        """`f(x) y := 1`: the name was taken for the S of S=; `VAR a : INT; a := 1`: for a declaration."""
        state = self._state
        stack = state.state_stack[:-1]
        for kind, text in (("_SEMI", ";"), ("_END_VAR", "END_VAR")):
            if self._shift(stack, kind, "IDENT", token.type) is None:
                continue
            state.state_stack.pop()
            state.value_stack.pop()
            if kind == "_SEMI":
                before = self._source.text[: name.pos].rstrip()
                self._say(len(before), f"expected ; after the {self._item_words(stack)}")
            else:
                self._report_open(name, self._open())
            self._feed(Token(kind, text, name.pos))
            self._feed(name)
            return True
        return False

    def _keyword_as_name(self, token: Token) -> bool:
        if token.text.upper() not in KEYWORDS or self._shift(self._state.state_stack, "IDENT") is None:
            return False
        if self._item(self._state.state_stack) == "stmt" or self._source.text[token.end :].lstrip()[:1] not in (
            ":",
            ",",
        ):
            return False
        self._say(token.pos, f"{token.text} is a keyword and cannot be a name")
        token.type = "IDENT"
        return True

    def _close(self, token: Token) -> bool:
        """Closes the innermost open IF, FOR, VAR ... when `token` can only stand further out."""
        opener = self._open()
        if opener is None or token.type not in _SYNC:
            return False
        end = _CLOSERS[opener.type]
        stack = self._shift(self._state.state_stack, "_" + end)
        if stack is None:
            return False
        if token.type in _STATEMENTS and self._shift(stack, token.type) is None:
            return False
        self._report_open(token, opener)
        self._feed(Token("_" + end, end, token.pos))
        return True

    def _stray_end(self, token: Token) -> bool:
        """An END_... that closes nothing that is open: it stands for the right one, or for nothing."""
        needed = _PARTS.get(token.type)
        if needed is not None and not any(t.type in needed for t in self._openers()):
            self._say(token.pos, f"{token.text} without {_a(needed[0])}")
            return True
        if token.type not in _ENDS:
            return False
        if any("_" + _CLOSERS[t.type] == token.type for t in self._openers()):
            return False
        opener = self._open()
        name = token.text.upper().removeprefix("END_")
        if opener is None or (opener.type in _BLOCKS) is not (name in _BLOCKS):
            self._say(token.pos, f"{token.text} without {_a(name)}")
            return True
        line = self._source.pos(opener.pos).line
        end = _CLOSERS[opener.type]
        self._say(token.pos, f"expected {end} for the {opener.text.upper()} in line {line}, not {token.text}")
        if self._shift(self._state.state_stack, "_" + end) is not None:
            token.type = "_" + end
        return True

    def _report_open(self, token: Token, opener: Token | None) -> None:
        assert opener is not None
        line = self._source.pos(opener.pos).line
        self._report(
            token.pos, "syntax", f"{_CLOSERS[opener.type]} missing for the {opener.text.upper()} in line {line}"
        )

    def _skip(self, token: Token) -> Any:
        if self._shift(self._state.state_stack, token.type) is not None:
            return self._feed(token)
        self.skipping = True
        if self.resume(token):
            return self._feed(token)
        return None

    def _drop(self, before: str | None) -> bool:
        """Leaves out the unfinished statement or declaration, and as many around it as need be for `before` to fit."""
        state = self._state
        for depth in range(len(state.state_stack), 0, -1):
            stack = state.state_stack[:depth]
            item = self._item_at(stack[-1])
            if item is None:
                continue
            after = [*stack, self._states[stack[-1]][item][1]]
            if before is None or self._shift(after, before) is not None:
                state.state_stack[:] = after
                state.value_stack[depth - 1 :] = [None]
                self.skipping = False
                return True
        return False

    def _say(self, offset: int, message: str) -> None:
        if not self._quiet:
            self._report(offset, "syntax", message)

    # ---- looking at the parser ----

    def _reduce(self) -> None:
        """Does the reductions that are due whatever comes next, so that what is complete is no longer open."""
        states, values, callbacks = self._state.state_stack, self._state.value_stack, self._state.parse_conf.callbacks
        while True:
            actions = [entry for kind, entry in self._states[states[-1]].items() if kind.isupper()]
            rules = {id(rule) for action, rule in actions if action is not Shift}
            if len(rules) != 1 or any(action is Shift for action, _ in actions):
                return
            rule = actions[0][1]
            size = len(rule.expansion)
            children = values[len(values) - size :]
            del states[len(states) - size :], values[len(values) - size :]
            values.append(callbacks[rule](children))
            states.append(self._states[states[-1]][rule.origin.name][1])

    def _feed(self, token: Token) -> Any:
        feed: Any = self._state.feed_token
        return feed(token, token.type == "$END")

    def _shift(self, stack: Stack, *kinds: str) -> Stack | None:
        """The states after tokens of these kinds, None when one does not fit."""
        stack = list(stack)
        for kind in kinds:
            while True:
                action, arg = self._states[stack[-1]].get(kind, (None, None))
                if action is None:
                    return None
                if action is Shift:
                    stack.append(arg)
                    break
                if arg.expansion:
                    del stack[-len(arg.expansion) :]
                stack.append(self._states[stack[-1]][arg.origin.name][1])
                if kind == "$END" and stack[-1] == self._state.parse_conf.end_state:
                    return stack
        return stack

    def _item_at(self, state: int) -> str | None:
        return next((item for item in _ITEMS if item in self._states[state]), None)

    def _item(self, stack: Stack) -> str | None:
        return next((item for s in reversed(stack) if (item := self._item_at(s))), None)

    def _item_words(self, stack: Stack) -> str:
        return "statement" if self._item(stack) == "stmt" else "declaration"

    def _operand(self, stack: Stack) -> str:
        return "a value" if self._shift(stack, "NUMBER") is not None else "a name"

    def _openers(self) -> list[Token]:
        return [v for v in self._state.value_stack if isinstance(v, Token) and v.type in _CLOSERS]

    def _open(self) -> Token | None:
        return next(reversed(self._openers()), None)

    def _gap(self, token: Token) -> int:
        return self.previous.end if self.previous else token.pos

    def _unexpected(self, token: Token) -> str:
        stack = self._state.state_stack
        if self._shift(stack, "NUMBER") is not None:
            return f"expected a value, found {_shown(token)}"
        if self._item_at(stack[-1]) == "unit":
            return f"expected PROGRAM, FUNCTION, FUNCTION_BLOCK, TYPE, VAR_GLOBAL or CONFIGURATION, found {_shown(token)}"
        if self._shift(stack, "_ASSIGN") is not None and self._shift(stack, "_SEMI") is not None:
            return f"expected := or ;, found {_shown(token)}"
        words = [word for kind, word in _WORDS.items() if self._shift(stack, kind) is not None]
        if self._shift(stack, "IDENT") is not None:
            words.insert(0, "a name")
        if self._shift(stack, "OP") is not None:
            words.insert(0, "an operator")
        if not words or len(words) > 5:
            return f"{_shown(token)} has no place here"
        listed = words[0] if len(words) == 1 else f"{', '.join(words[:-1])} or {words[-1]}"
        return f"expected {listed}, found {_shown(token)}"


def _a(word: str) -> str:
    return f"an {word}" if word == "IF" else f"a {word}"


def _shown(token: Token) -> str:
    if token.type == "$END":
        return "the end of the file"
    return token.text if len(token.text) <= 40 else token.text[:37] + "..."
