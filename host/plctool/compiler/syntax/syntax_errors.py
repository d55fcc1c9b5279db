"""Syntax errors: what to say, and how to go on so that the next error is found as well.

First a repair is tried that loses nothing: put in the one token that is missing, or the END_... of what is still open.
Only when none fits, text is skipped to the end of the statement or to the next keyword that makes sense where the
parser stands.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from difflib import get_close_matches

from plctool.compiler.base.source import Source
from plctool.compiler.syntax import slips
from plctool.compiler.syntax.automaton import Parser
from plctool.compiler.syntax.hints import hint
from plctool.compiler.syntax.lexer import KEYWORDS, Report, Token
from plctool.compiler.syntax.tables import END

_CLOSERS = {
    "IF": "END_IF", "CASE": "END_CASE", "FOR": "END_FOR", "WHILE": "END_WHILE", "REPEAT": "END_REPEAT",
    "VAR": "END_VAR", "GLOBAL": "END_VAR", "CONFIG": "END_VAR", "ACCESS": "END_VAR",
    "STRUCT": "END_STRUCT", "UNION": "END_UNION", "TYPE": "END_TYPE", "FUNCTION": "END_FUNCTION",
    "FUNCTION_BLOCK": "END_FUNCTION_BLOCK", "PROGRAM": "END_PROGRAM", "RESOURCE": "END_RESOURCE",
    "CONFIGURATION": "END_CONFIGURATION", "TEST": "END_TEST", "SETUP": "END_SETUP", "TEARDOWN": "END_TEARDOWN",
    "CLASS": "END_CLASS", "INTERFACE": "END_INTERFACE", "METHOD": "END_METHOD", "PROPERTY": "END_PROPERTY",
    "PROPERTY_GET": "END_PROPERTY", "PROPERTY_SET": "END_PROPERTY", "GET": "END_GET", "SET": "END_SET",
    "ACTION": "END_ACTION", "NAMESPACE": "END_NAMESPACE",
    "INITIAL_STEP": "END_STEP", "STEP": "END_STEP", "TRANSITION": "END_TRANSITION",
    "TRY": "__ENDTRY",
}  # fmt: skip
_ENDS = {KEYWORDS[end] for end in _CLOSERS.values()}
_UNITS = {
    "FUNCTION", "FUNCTION_BLOCK", "PROGRAM", "TYPE", "GLOBAL", "CONFIG", "ACCESS", "CONFIGURATION", "TEST", "SETUP",
    "TEARDOWN",
}  # fmt: skip
_INSTRUCTIONS = {"LD", "LDN", "ST", "STN", "CAL", "CALC", "CALCN", "JMPC", "JMPCN", "RETC", "RETCN"}
_STATEMENTS = {"IF", "CASE", "FOR", "WHILE", "REPEAT", "EXIT", "CONTINUE", "RETURN", "JMP", "TRY"}
_CHART = {"INITIAL_STEP", "STEP", "TRANSITION"}
_SYNC = {*_ENDS, *_UNITS, *_STATEMENTS, *_CHART, "VAR", "STRUCT", "RESOURCE", "TASK", "_ELSE", "_ELSIF", "_UNTIL",
         "_CATCH", "_FINALLY", END}  # fmt: skip
_ITEMS = ("stmt", "var_decl", "type_decl", "config_item", "unit", "expr_stmt", "step")  # can be left out as a whole

_INSERTIONS = {
    "_SEMI": (";", "expected ; after the {item}"),
    "_THEN": ("THEN", "expected THEN after the condition"),
    "_DO": ("DO", "expected DO before the body of the loop"),
    "_OF": ("OF", "expected OF"),
    "_TO": ("TO", "expected TO"),
    "_RPAR": (")", "expected )"),
    "_RSQB": ("]", "expected ]"),
    "_COLON": (":", "expected : before {next}"),
    "_ASSIGN": (":=", "expected := before {next}"),
    "_COMMA": (",", "expected ,"),
}
_VALUES = {"IDENT", "NUMBER", "TYPED", "STRING", "TRUE", "FALSE"}
_WORDS = {
    "_SEMI": ";", "_COLON": ":", "_COMMA": ",", "_ASSIGN": ":=", "_LPAR": "(", "_RPAR": ")", "_LSQB": "[", "_RSQB": "]",
    "_DOTDOT": "..", "_THEN": "THEN", "_DO": "DO", "_OF": "OF", "_TO": "TO", "_UNTIL": "UNTIL", "_ON": "ON",
}  # fmt: skip

_PARTS = {"_ELSE": ("IF", "CASE"), "_ELSIF": ("IF",), "_UNTIL": ("REPEAT",), "_CATCH": ("TRY",), "_FINALLY": ("TRY",)}
_RETURN = "RETURN takes no value; assign it to the name of the function, then RETURN"
_BLOCKS = {"IF", "CASE", "FOR", "WHILE", "REPEAT", "TRY"}
_AFTER_DECLARATIONS = re.compile(r"\b(?:END_\w+|VAR(?:_\w+)?|IF|FOR|WHILE|REPEAT|CASE)\b", re.IGNORECASE)
_WORDS_OF_ENDS = re.compile(r"\b(?:END(?=\s*;)|END\w+|FI|WEND|ESAC)\b", re.IGNORECASE)
_OTHER_ENDS = {"FI": "END_IF", "WEND": "END_WHILE", "ESAC": "END_CASE"}
_UNIT_WORDS = ("PROGRAM", "FUNCTION", "FUNCTION_BLOCK", "TYPE", "VAR_GLOBAL", "CONFIGURATION", "INTERFACE")
_STATEMENT_WORDS = (
    "IF", "THEN", "ELSIF", "ELSE", "FOR", "WHILE", "REPEAT", "UNTIL", "CASE", "RETURN", "NOT", "AND", "XOR", "MOD",
)  # fmt: skip
_POUS = ("PROGRAM", "FUNCTION", "FUNCTION_BLOCK")
_NEXT_UNIT = re.compile(r"\b(?:END_)?(?:PROGRAM|FUNCTION_BLOCK|FUNCTION|CONFIGURATION)\b", re.IGNORECASE)
_ELSE_IF = re.compile(r"\bELSE\s+IF\b", re.IGNORECASE)
_APART = 3  # an error closer than so many tokens to the previous one is a consequence of it

Stack = list[int]


class Recovery:
    """Repairs the state of one parser. `skipping` is set while text is thrown away."""

    def __init__(self, parser: Parser, taken: list[Token], source: Source, report: Report) -> None:
        """`taken`: the tokens that were fine up to now."""
        self._parser = parser
        self._tables = parser.tables
        self._source = source
        self._report = report
        self.skipping = False
        self._taken = taken
        self._quiet_up_to = 0  # an error before so many tokens were taken is a consequence of the last one
        self._quiet = False
        self._misspelt = ""  # what is added to what is said next
        self._skip_to = ""  # the word or sign that ends what is refused
        self._dropped: list[str] = []  # openings that were thrown away, whose ends are still to come

    def handle(self, token: Token) -> None:
        """Reports that `token` does not fit, and repairs what can be repaired."""
        self._quiet = len(self._taken) < self._quiet_up_to
        self._note_error()
        if self._parted_end(token):
            return
        self._reduce()
        self._misspelt = ""
        self._hint(token)
        if self.skipping:
            return
        self._misspelt = "" if self._quiet else self._misspelt_near(token)
        if self._late_variables(token) or self._misspelt_unit(token) or self._stray_end(token):
            return
        while self._insert(token) or self._close(token):
            if self._parser.feed(token):
                return
        self._say(token.pos, self._unexpected(token))
        self._skip(token)

    def report_token(self, offset: int, code: str, message: str) -> None:
        """Reports a fault of the text; what does not fit right after it is a consequence."""
        self._report(offset, code, message)
        self._note_error()

    def report_misspelt(self, token: Token, kind: str) -> None:
        """Reports a keyword that is spelled wrongly; `kind` is the terminal it stands for."""
        right = slips.WORDS[token.text.upper()]
        self.report_token(token.pos, "syntax", f"{token.text} is written {right}")
        token.type, token.text = kind, right.split()[0]

    def report_in_front(self, token: Token, keyword: str, name: str) -> None:
        """Reports a modifier that stands before the keyword of a unit, and leaves it out."""
        word = token.text.upper()
        refusal = slips.REFUSED.get(word)
        message = refusal.message if refusal else f"{word} comes after {keyword}: {keyword} {word} {name}"
        self._report(token.pos, "syntax", message)
        token.type = "LEFT_OUT"

    def refuse(self, token: Token) -> None:
        """Reports a word that begins what this compiler leaves out, and leaves it out."""
        refusal = slips.REFUSED[token.text.upper()]
        self._leave_out(token, refusal.message, refusal.end)

    def resume(self, token: Token) -> bool:
        """While skipping: whether to go on with `token`. A semicolon ends what is skipped and belongs to it."""
        if self._skip_to and token.type != END:
            if token.text.upper() == self._skip_to:
                self._skip_to, self.skipping, self._quiet_up_to = "", False, 0
            return False
        if token.type != "_SEMI" and token.type not in _SYNC:
            return False
        if self._shift(self._parser.states, token.type) is not None:
            self.skipping = False
            self._quiet_up_to = 0
            return True
        return self._drop(None if token.type == "_SEMI" else token.type) and token.type != "_SEMI"

    @property
    def _earlier(self) -> Token | None:
        """The first of the last two tokens that were fine, or the only one."""
        return next(iter(self._taken[-2:]), None)

    @property
    def _previous(self) -> Token | None:
        """The last token that was fine."""
        return self._taken[-1] if self._taken else None

    def _note_error(self) -> None:
        self._quiet_up_to = len(self._taken) + _APART

    # ---- repairs ----

    def _insert(self, token: Token) -> bool:
        """Puts in one missing token before `token`, or before the name before it."""
        stack, values = self._parser.states, self._parser.values
        if token.type == "EQ" and self._shift(stack, "_ASSIGN"):
            what = "an assignment" if self._item(stack) == "stmt" else "an initial value"
            self._say(token.pos, f"{what} is written :=, not =")
            token.type = "_ASSIGN"
            return True
        if token.type == "_COLON" and self._shift(stack, "_EXTENDS", "IDENT") is not None:
            self._say(token.pos, "what is derived from another one is written EXTENDS, not with a colon")
            token.type = "_EXTENDS"
            return True
        if self._keyword_as_name(token):
            return True
        for kind, (text, message) in _INSERTIONS.items():
            if kind == "_ASSIGN" and token.type not in _VALUES:
                continue
            if self._shift(stack, kind, token.type) is not None:
                if kind == "_SEMI" and self._previous is not None and self._previous.type == "RETURN":
                    message = _RETURN
                self._say(self._gap(token), message.format(item=self._item_words(stack), next=_shown(token)))
                self._parser.feed(Token(kind, text, self._gap(token)))
                return True
        if self._shift(stack, "_UNTIL", "IDENT", token.type) is not None:
            self._say(token.pos, f"UNTIL and a condition missing before {token.text}")
            self._parser.feed(Token("_UNTIL", "UNTIL", token.pos))
            self._parser.feed(Token("IDENT", "", token.pos))
            return True
        last = values[-1] if values else None
        if isinstance(last, Token) and last.type == "IDENT" and self._insert_before_name(last, token):
            return True
        if self._shift(stack, "IDENT", token.type) is not None and token.type not in _ENDS | _UNITS | {END, "_LSQB"}:
            self._say(token.pos, f"expected {self._operand(stack)} before {_shown(token)}")
            self._parser.feed(Token("IDENT", "", token.pos))
            return True
        return False

    def _insert_before_name(self, name: Token, token: Token) -> bool:
        """`f(x) y := 1`: the name was taken for the S of S=; `VAR a : INT; a := 1`: for a declaration."""
        stack = self._parser.states[:-1]
        for kind, text in (("_SEMI", ";"), ("_END_VAR", "END_VAR")):
            if token.type == "_SEMI" or self._shift(stack, kind, "IDENT", token.type) is None:
                continue
            if kind == "_END_VAR" and self._declarations_end_later(name):
                continue
            self._parser.states.pop()
            self._parser.values.pop()
            if kind == "_SEMI":
                before = self._source.text[: name.pos].rstrip()
                instruction = self._earlier is not None and self._earlier.text.upper() in _INSTRUCTIONS
                hint = "; a body is either all Structured Text or all Instruction List" if instruction else ""
                self._say(len(before), f"expected ; after the {self._item_words(stack)}{hint}")
            else:
                self._report_open(name, self._open())
            self._parser.feed(Token(kind, text, name.pos))
            self._parser.feed(name)
            return True
        return False

    def _declarations_end_later(self, token: Token) -> bool:
        """Whether their END_... follows before anything that cannot stand between declarations."""
        following = _AFTER_DECLARATIONS.search(self._source.text, token.pos)
        return following is not None and following[0].upper() in ("END_VAR", "END_STRUCT", "END_UNION")

    def _keyword_as_name(self, token: Token) -> bool:
        if token.text.upper() not in KEYWORDS or self._shift(self._parser.states, "IDENT") is None:
            return False
        if self._item(self._parser.states) == "stmt" or self._source.text[token.end :].lstrip()[:1] not in (
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
        if opener is None or not (token.type in _SYNC or self._ends_repeat(opener, token)):
            return False
        if token.type in _PARTS and not any(t.type in _PARTS[token.type] for t in self._openers()[:-1]):
            return False
        end = _CLOSERS[opener.type]
        stack = self._shift(self._parser.states, KEYWORDS[end])
        if stack is None:
            return False
        if token.type in _STATEMENTS and self._shift(stack, token.type) is None:
            return False
        self._report_open(token, opener)
        self._parser.feed(Token(KEYWORDS[end], end, token.pos))
        return True

    def _ends_repeat(self, opener: Token, token: Token) -> bool:
        """Whether a statement follows UNTIL and its condition."""
        ended = self._previous is not None and self._previous.type == "_SEMI" and opener.type == "REPEAT"
        return ended and self._shift(self._parser.states, "_END_REPEAT", token.type) is not None

    def _parted_end(self, token: Token) -> bool:
        """`END IF` for END_IF."""
        previous, name = self._previous, token.text.upper()
        if previous is None or previous.text.upper() != "END" or f"END_{name}" not in KEYWORDS:
            return False
        if not self._parser.values or self._parser.values[-1] is not previous:
            return False
        self._say(previous.pos, f"END {token.text} is written END_{name}")
        self._parser.states.pop()
        self._parser.values.pop()
        token.type = f"_END_{name}"
        return self._parser.feed(token)

    def _hint(self, token: Token) -> None:
        """Says what was meant when the text around the error gives it away; the rest is a consequence."""
        if self._quiet:
            return
        item = self._item(self._parser.states)
        where = {"stmt": "body", "var_decl": "declaration"}.get(item or "", "")
        if where == "declaration" and not self._declarations_end_later(token):
            where = ""
        begin = (self._earlier or token).pos
        found = hint(self._source.text, begin, token.pos, where)
        if found is not None:
            self._say(found.offset, found.message)
            self._quiet = True
            self.skipping = found.ends

    def _leave_out(self, token: Token, message: str, end: str) -> None:
        """Reports `token`, and goes on after the word or sign `end`."""
        self._say(token.pos, message)
        self.skipping, self._skip_to = True, end

    def _late_variables(self, token: Token) -> bool:
        """Variables declared between statements, global ones and POUs within a POU, others outside of one."""
        message, opener = "", self._open()
        if token.type == "VAR" and self._item(self._parser.states) == "stmt":
            message = f"{token.text} stands before the first statement"
        elif token.type == "VAR" and self._item_at(self._parser.states[-1]) == "unit":
            message = f"{token.text} stands in a PROGRAM, FUNCTION or FUNCTION_BLOCK; for all of them write VAR_GLOBAL"
        elif opener is not None and self._is_within(opener, token):
            self._leave_out(token, f"{token.text} stands outside of the {opener.text.upper()}", _CLOSERS[token.type])
            return True
        elif token.type == "GLOBAL" and opener is not None and self._ends_later(opener, token):
            message = f"{token.text} stands outside of the {opener.text.upper()}"
        if message:
            self._leave_out(token, message, "END_VAR")
        return bool(message)

    def _is_within(self, opener: Token, token: Token) -> bool:
        """Whether a POU stands as a whole in one that is open."""
        if token.type not in _POUS:
            return False
        end = re.compile(rf"\b{_CLOSERS[token.type]}\b", re.IGNORECASE).search(self._source.text, token.pos)
        following = None if end is None else _NEXT_UNIT.search(self._source.text, end.end())
        return opener.type in _POUS and following is not None and following[0].upper() == _CLOSERS[opener.type]

    def _ends_later(self, opener: Token, token: Token) -> bool:
        """Whether a POU that is open at `token` has its END_... before the next one begins."""
        following = _NEXT_UNIT.search(self._source.text, token.pos)
        return opener.type in _POUS and following is not None and following[0].upper() == _CLOSERS[opener.type]

    def _misspelt_unit(self, token: Token) -> bool:
        """Takes `FUNTION` for FUNCTION."""
        if token.type != "IDENT" or self._item_at(self._parser.states[-1]) != "unit":
            return False
        word = next(iter(get_close_matches(token.text.upper(), _UNIT_WORDS, 1, 0.8)), "")
        if word:
            self._say(token.pos, f"{token.text} is written {word}")
            token.type, token.text = KEYWORDS[word], word
        return bool(word) and self._parser.feed(token)

    def _stray_end(self, token: Token) -> bool:
        """An END_... that closes nothing that is open: it stands for the right one, or is left out."""
        needed = _PARTS.get(token.type)
        if needed is not None and not any(t.type in needed for t in self._openers()):
            self._say(token.pos, f"{token.text} without {_a(needed[0])}")
            return True
        if token.type not in _ENDS:
            return False
        if any(KEYWORDS[_CLOSERS[t.type]] == token.type for t in self._openers()):
            return False
        opener = self._open()
        name = token.type.removeprefix("_END_")
        if name in self._dropped:
            self._dropped.remove(name)
            return True
        if opener is None or (opener.type in _BLOCKS) is not (name in _BLOCKS):
            self._say(token.pos, f"{token.text} without {_a(name)}")
            return True
        line = self._source.pos(opener.pos).line
        end = _CLOSERS[opener.type]
        self._say(token.pos, f"expected {end} for the {opener.text.upper()} in line {line}, not {token.text}")
        token.type = KEYWORDS[end]
        return self._parser.feed(token)

    def _report_open(self, token: Token, opener: Token | None) -> None:
        assert opener is not None
        line = self._source.pos(opener.pos).line
        second = list(_ELSE_IF.finditer(self._source.text, opener.pos, token.pos)) if opener.type == "IF" else []
        if second:
            message = "ELSE IF begins a second IF, with an END_IF of its own; write ELSIF"
            self._say(second[-1].start(), message)
            return
        closer = _CLOSERS[opener.type]
        for end in _WORDS_OF_ENDS.finditer(self._source.text, opener.pos, token.pos):
            word = end[0].upper()
            if word in KEYWORDS or not (word == "END" or _OTHER_ENDS.get(word) == closer or _is_like(word, closer)):
                continue
            self._misspelt = ""
            self._say(end.start(), f"{end[0]} is written {closer}")
            return
        self._say(token.pos, f"{closer} missing for the {opener.text.upper()} in line {line}")

    def _skip(self, token: Token) -> None:
        if self._shift(self._parser.states, token.type) is None:
            if token.type in _CLOSERS:
                self._dropped.append(KEYWORDS[_CLOSERS[token.type]].removeprefix("_END_"))
            self.skipping = True
            if not self.resume(token):
                return
        self._parser.feed(token)

    def _drop(self, before: str | None) -> bool:
        """Leaves out the unfinished statement or declaration, and as many around it as need be for `before` to fit."""
        states, values = self._parser.states, self._parser.values
        for depth in range(len(states), 0, -1):
            item = self._item_at(states[depth - 1])
            if item is None:
                continue
            after = [*states[:depth], self._tables.gotos[states[depth - 1]][item]]
            if before is None or self._shift(after, before) is not None:
                self._dropped += [v.type for v in values[depth - 1 :] if isinstance(v, Token) and v.type in _CLOSERS]
                states[:] = after
                values[depth - 1 :] = [None]
                self.skipping = False
                self._quiet_up_to = 0
                return True
        return False

    def _say(self, offset: int, message: str) -> None:
        if not self._quiet:
            self._report(offset, "syntax", message + self._misspelt)
            self._misspelt = ""

    def _misspelt_near(self, token: Token) -> str:
        """`; did you mean ELSE for ESLE?` of one of the last names, unless it is declared here."""
        for name in (token, *reversed(self._taken[-2:])):
            word = _like(name.text.upper()) if name.type == "IDENT" else ""
            if word and not re.search(rf"\b{name.text}\s*[,:](?!=)", self._source.text):
                return f"; did you mean {word} for {name.text}?"
        return ""

    # ---- looking at the parser ----

    def _reduce(self) -> None:
        """Does the reductions that are due whatever comes next, so that what is complete is no longer open."""
        while True:
            actions = set(self._tables.actions[self._parser.states[-1]].values())
            if len(actions) != 1 or min(actions) >= 0:
                return
            self._parser.reduce(-1 - min(actions))

    def _shift(self, stack: Stack, *kinds: str) -> Stack | None:
        """The states after tokens of these kinds, None when one does not fit."""
        return self._tables.after(stack, *kinds)

    def _item_at(self, state: int) -> str | None:
        return next((item for item in _ITEMS if item in self._tables.gotos[state]), None)

    def _item(self, stack: Stack) -> str | None:
        return next((item for s in reversed(stack) if (item := self._item_at(s))), None)

    def _item_words(self, stack: Stack) -> str:
        return {"stmt": "statement", "expr_stmt": "action"}.get(self._item(stack) or "", "declaration")

    def _operand(self, stack: Stack) -> str:
        return "a value" if self._shift(stack, "NUMBER") is not None else "a name"

    def _openers(self) -> list[Token]:
        return [v for v in self._parser.values if isinstance(v, Token) and v.type in _CLOSERS]

    def _open(self) -> Token | None:
        return next(reversed(self._openers()), None)

    def _gap(self, token: Token) -> int:
        return self._previous.end if self._previous else token.pos

    def _known_slip(self, token: Token, stack: Stack) -> str:
        """What to say of a mistake that is made often; "" when it is another one."""
        if self._shift(stack, "NUMBER") is not None:
            listed = "a list of values is for declarations; assign the elements one by one, or copy a constant"
            return listed if token.type == "_LSQB" else ""
        if self._previous is not None and self._previous.type == "RETURN":
            return _RETURN
        if self._item(stack) != "stmt":
            return ""
        if token.type == "_COLON":
            return "a label is one name, such as again:, and not in front of the statements of a CASE"
        if token.type == "_COMMA" and self._assigns_in_parentheses():
            return "values by name are for declarations and calls; assign the members one by one"
        return ""

    def _assigns_in_parentheses(self) -> bool:
        """Whether the parenthesis that is open began with `a :=`."""
        kinds = [v.type if isinstance(v, Token) else "" for v in self._parser.values]
        inside = kinds[::-1].index("_LPAR") if "_LPAR" in kinds else 0
        return kinds[len(kinds) - inside :][1:2] == ["_ASSIGN"]

    def _unexpected(self, token: Token) -> str:
        stack = self._parser.states
        slip = self._known_slip(token, stack)
        if slip:
            return slip
        if self._shift(stack, "NUMBER") is not None:
            return f"expected a value, found {_shown(token)}"
        if self._shift(stack, "DIRECT") is not None and self._shift(stack, "IDENT") is None:
            return f"AT is for an address such as %IX0.3, not for {_shown(token)}"
        if self._item_at(stack[-1]) == "unit":
            return (
                f"expected PROGRAM, FUNCTION, FUNCTION_BLOCK, TYPE, VAR_GLOBAL or CONFIGURATION, found {_shown(token)}"
            )
        if self._shift(stack, "_ASSIGN") is not None and self._shift(stack, "_SEMI") is not None:
            return f"expected := or ;, found {_shown(token)}"
        words = [word for kind, word in _WORDS.items() if self._shift(stack, kind) is not None]
        if self._shift(stack, "IDENT") is not None:
            words = ["a name", *(word for word in words if word != "(")]
        if self._shift(stack, "OP") is not None:
            words.insert(0, "an operator")
        if not words or len(words) > 5:
            return f"{_shown(token)} has no place here"
        listed = words[0] if len(words) == 1 else f"{', '.join(words[:-1])} or {words[-1]}"
        return f"expected {listed}, found {_shown(token)}"


def _like(written: str) -> str:
    """The word of statements that a name seems to be, "" for none."""
    swapped = [word for word in _STATEMENT_WORDS if sorted(word) == sorted(written)]
    return next(iter(swapped or get_close_matches(written, _STATEMENT_WORDS, 1, 0.75)), "")


def _is_like(word: str, keyword: str) -> bool:
    return bool(get_close_matches(word, [keyword], 1, 0.8))


def _a(word: str) -> str:
    word = "__TRY" if word == "TRY" else word
    return f"an {word}" if word[0] in "AEIO" else f"a {word}"


def _shown(token: Token) -> str:
    if token.type == END:
        return "the end of the file"
    return token.text if len(token.text) <= 40 else token.text[:37] + "..."
