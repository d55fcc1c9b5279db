"""From text to tokens. Keywords are case-insensitive; comments nest; pragmas are put aside as attributes.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

from plctool.compiler.syntax import slips
from plctool.compiler.syntax.conditions import Conditions
from plctool.compiler.syntax.plain_text import FLAT_COMMENT, NAME, comment_ends

_TOKEN = re.compile(
    r"""\s*(?:
    (?P<WORD>"""
    + NAME
    + r"""(?!\#))
  | (?P<PUNCT>:=|\?=|=>|<=|>=|<>|\*\*|\.\.|\((?!\*)|/(?![/*])|[-+*)\[\]:;,.<>^]|=(?!=)|&(?!&))
  | (?P<NUMBER>\d[\d_]*+(?:\#\w++|(?:\.\d[\d_]*+|\.(?=[eE][+-]?\d|[^\w.]))?(?:[eE][+-]?\d++)?)(?!\w))
  | (?P<SKIP>"""
    + FLAT_COMMENT
    + r""")
  | (?P<DATE>(?i:L?(?:DATE_AND_TIME|DATE|DT|D|TIME_OF_DAY|TOD))\#[\d:._-]+)
  | (?P<STRING>(?i:(?:W?STRING|W?CHAR)\#)?(?:'(?:[^'$\n]|\$[^\n])*'|"(?:[^"$\n]|\$[^\n])*"))
  | (?P<TYPED>[A-Za-z_]\w*\#(?:[+-]?\d[\d_]*(?:\.[\d_]+)?[eE][+-]?\d+|[+-]?\w+(?:\.\w+)*(?:\#\w+)?)?)
  | (?P<DIRECT>%(?:[IQMiqm](?:\*|[XBWDLxbwdl]?\d+(?:\.\d+)*|[XBWDLxbwdl]?(?!\w))|[XBWDLxbwdl]\d+))
  | (?P<PRAGMA>\{[^{}]*\})
  | (?P<FOREIGN>\{\{.*?\}\})
  | (?P<TEMP>@@?\w+)
  | (?P<NESTED>\(\*|/\*)
  | (?P<SLIP>==|&&|!=|\|\|?|!|~|%(?=[\s\d(])|\d\w+|["""
    + "".join(slips.TYPESET)
    + "]|"
    + slips.QUOTED
    + r""")
  | (?P<BAD>\S)
  | (?P<END>\Z)
  )""",
    re.VERBOSE | re.ASCII | re.DOTALL,
)

_PUNCTUATION = {
    ";": "_SEMI", ":": "_COLON", ",": "_COMMA", ".": "_DOT", "..": "_DOTDOT", ":=": "_ASSIGN", "=>": "_ARROW",
    "?=": "ATTEMPT",
    "(": "_LPAR", ")": "_RPAR", "[": "_LSQB", "]": "_RSQB", "^": "_CARET",
    "=": "EQ", "+": "SIGN", "-": "SIGN", "*": "OP", "/": "OP", "&": "OP", "**": "OP",
    "<": "OP", ">": "OP", "<=": "OP", ">=": "OP", "<>": "OP",
}  # fmt: skip

KEYWORDS = {
    **dict.fromkeys(("AND", "OR", "XOR", "MOD", "AND_THEN", "OR_ELSE"), "OP"),
    **dict.fromkeys(("CONSTANT", "RETAIN", "NON_RETAIN", "PERSISTENT"), "QUALIFIER"),
    **dict.fromkeys(("VAR", "VAR_INPUT", "VAR_OUTPUT", "VAR_IN_OUT", "VAR_TEMP", "VAR_STAT", "VAR_EXTERNAL"), "VAR"),
    "VAR_INST": "VAR",
    "VAR_GENERIC": "VAR",
    **dict.fromkeys(("PUBLIC", "PRIVATE", "PROTECTED", "INTERNAL", "FINAL", "ABSTRACT", "OVERRIDE"), "MODIFIER"),
    "VAR_GLOBAL": "GLOBAL",
    "__TRY": "TRY",
    "__CATCH": "_CATCH",
    "__FINALLY": "_FINALLY",
    "__ENDTRY": "_END_TRY",
    "VAR_CONFIG": "CONFIG",
    "VAR_ACCESS": "ACCESS",
    **dict.fromkeys(("R_EDGE", "F_EDGE"), "EDGE"),
    **dict.fromkeys(("READ_ONLY", "READ_WRITE"), "RIGHTS"),
    **dict.fromkeys(("STRING", "WSTRING"), "TEXT"),
    **{k: k for k in (
        "TYPE", "STRUCT", "UNION", "OVERLAP", "ARRAY", "POINTER", "REFERENCE", "REF_TO", "FUNCTION", "FUNCTION_BLOCK",
        "PROGRAM", "CONFIGURATION", "RESOURCE", "TASK", "IF", "CASE", "FOR", "WHILE", "REPEAT", "EXIT", "CONTINUE",
        "RETURN", "JMP", "TRUE", "FALSE", "NULL", "NOT", "TEST", "SETUP", "TEARDOWN", "MOCK", "MOCK_FUNCTION",
        "CLASS", "INTERFACE", "METHOD", "PROPERTY", "GET", "SET", "ACTION", "NAMESPACE", "USING",
        "PROPERTY_GET", "PROPERTY_SET", "INITIAL_STEP", "STEP", "TRANSITION",
    )},
    **{k: "_" + k for k in (
        "END_TYPE", "END_STRUCT", "END_UNION", "OF", "TO", "END_VAR", "AT", "END_FUNCTION",
        "END_FUNCTION_BLOCK",
        "END_PROGRAM", "END_CONFIGURATION", "ON", "END_RESOURCE", "WITH", "THEN", "ELSIF", "ELSE", "END_IF", "END_CASE",
        "BY", "DO", "END_FOR", "END_WHILE", "UNTIL", "END_REPEAT", "END_TEST", "END_SETUP", "END_TEARDOWN",
        "EXTENDS", "IMPLEMENTS", "END_CLASS", "END_INTERFACE", "END_METHOD", "END_PROPERTY", "END_GET", "END_SET",
        "END_ACTION", "END_NAMESPACE", "END_STEP", "FROM", "END_TRANSITION",
    )},
}  # fmt: skip

_LAST_IN_KINDS = _TOKEN.groupindex["PUNCT"]  # the groups up to this one are in `_Kinds`

KEYWORDS |= dict.fromkeys(slips.WORDS, "MISSPELT") | dict.fromkeys(slips.REFUSED, "REFUSED")

SOFT = frozenset((
    "MISSPELT", "REFUSED", "JMP",
    "QUALIFIER", "TEXT", "POINTER", "REFERENCE", "RESOURCE", "TASK", "_ON", "_WITH", "_AT", "_TO", "_BY", "OVERLAP",
    "UNION", "TEST", "SETUP", "TEARDOWN", "MOCK", "MOCK_FUNCTION", "CLASS", "INTERFACE", "METHOD", "PROPERTY", "GET",
    "SET", "ACTION", "NAMESPACE", "USING", "MODIFIER", "_EXTENDS", "_IMPLEMENTS", "INITIAL_STEP", "STEP", "TRANSITION",
    "_FROM", "EDGE", "RIGHTS", "PROPERTY_GET", "PROPERTY_SET",
))  # fmt: skip
"""Terminals that are names where the grammar has no use for them."""

_OPERATOR_FUNCTIONS = frozenset(("AND", "OR", "XOR", "MOD"))  # names before a parenthesis in place of an operand

OPENING = frozenset((
    "MOCK", "MOCK_FUNCTION", "METHOD", "PROPERTY", "ACTION", "MODIFIER", "NAMESPACE", "USING", "INITIAL_STEP", "STEP",
    "TRANSITION", "PROPERTY_GET", "PROPERTY_SET", "_AT", "JMP", "POINTER", "REFERENCE",
))  # fmt: skip
"""Terminals that are names where no name (after AT, no address) follows."""

_ATTRIBUTE = re.compile(r"\{\s*attribute\s+'([^']*)'\s*(?::=\s*'([^']*)'\s*)?\}", re.IGNORECASE)
_DURATION = re.compile(rf"\d+(?:{slips.UNITS})", re.IGNORECASE)
_WITH_COMMA = re.compile(r"\w#(?P<number>\d+),$")
_MODIFIED = re.compile(r"\s+(METHOD|PROPERTY|FUNCTION_BLOCK|FUNCTION|CLASS|PROGRAM|INTERFACE)\s+(\w+)", re.IGNORECASE)
_ONLY_C = re.compile(
    r"\{\{|\{[^{}]*(?:\b(?:extern|static|void|char|printf|GetFbVar|SetFbVar)\b|\(\w+ ?\*+\)|::|^\s*#)", re.MULTILINE
)
"""The beginning of code in C that is not a block of statements written as in C."""

_STATEMENT_IN_C = re.compile(r"\{[^']*;\s*\}")  # pragmas with a text have quotes
_ACCESSOR = re.compile(r"\b(GET|SET)\s*\Z", re.IGNORECASE)
_OPEN_PARENTHESIS = re.compile(r"\s*\(")
_NAMED_ARGUMENT = re.compile(r"\s*\(\s*[A-Za-z_]\w*\s*(?::=|=>)", re.ASCII)
_VALUE_FOLLOWS = re.compile(r"\s*(?::=|=>|[.^\[])")
_PART_FOLLOWS = re.compile(r"\s*[:.,^\[]")
_NAME = re.compile(r"\s+[^\W\d]")
_ADDRESS = re.compile(r"\s*%")
_PRIORITY = re.compile(r"\s*\(\s*PRIORITY\s*:=", re.IGNORECASE)
_DECLARED = re.compile(r"\s*(?:,|:(?!=))")
_LABEL = re.compile(r"\s+[A-Za-z_]\w*\s*:(?!=)")
_QUOTE = re.compile(r"\s*['\"]")


class _Kinds(dict[str, str]):
    """The type of a word or sign: signs are put in, words come when they are first met, as they are written."""

    def __missing__(self, word: str) -> str:
        kind = self[word] = KEYWORDS.get(word.upper(), "IDENT")
        return kind


Report = Callable[[int, str, str], None]  # offset, code, message


class Token:
    """A token; `pos` is the offset of its first character. Duck-typed to what lark's LALR driver reads of its own."""

    __slots__ = ("pos", "text", "type")

    def __init__(self, type_: str, text: str, pos: int) -> None:
        self.type = type_
        self.text = text
        self.pos = pos

    @property
    def end(self) -> int:
        """The offset past the last character."""
        return self.pos + len(self.text)


class Lexer:
    """Iterates over the tokens of a text; `attributes` collects the attributes by the offset of the token they precede,
    `repeated` all of them in their order with their own offsets, `pragmas` all other pragmas with their own."""

    def __init__(
        self,
        text: str,
        report: Report,
        start: int = 0,
        end: int | None = None,
        declared: frozenset[str] = frozenset(),
        *,
        made: bool = False,
    ) -> None:
        """`declared`: what {IF defined(pou: NAME)} finds. `made`: of a text that plctool wrote, in which @x is one of
        its own variables."""
        self._made = made
        self.text = text
        self.attributes: dict[int, dict[str, str]] = {}
        self.repeated: dict[int, list[tuple[int, str, str]]] = {}
        self.pragmas: list[tuple[int, str]] = []
        self._report = report
        self._start = start
        self._end = len(text) if end is None else end
        self._pending: list[tuple[int, str, str]] = []
        self._conditions = Conditions(report, declared)

    def __iter__(self) -> Iterator[Token]:
        """All tokens, last one of type $END."""
        at, kinds = self._start, _Kinds(_PUNCTUATION)
        while True:
            for match in _TOKEN.finditer(self.text, at, self._end):
                group = match.lastindex or 0
                word, pos = match[group], match.start(group)
                if group <= _LAST_IN_KINDS:
                    token = Token(kinds[word], word, pos)
                elif (kind := match.lastgroup) == "NUMBER":
                    token = Token(kind, word, pos)
                elif kind == "SKIP":
                    continue
                elif kind == "NESTED":
                    at = self._skip_comment(word, match.end())
                    break
                elif kind == "PRAGMA":
                    self._pragma(word, pos)
                    if self._conditions.active:
                        continue
                    at = self._skip_branch(match.end())
                    break
                elif kind == "FOREIGN":
                    self._foreign(pos)
                    continue
                elif kind == "TEMP" and not self._made:
                    self._bad("@", pos)
                    at = pos + 1
                    break
                elif kind == "SLIP":
                    token = self._slip(word, pos)
                elif kind == "BAD":
                    if self._bad(word, pos):
                        continue
                    at = self._end_of_line(pos)
                    yield Token("STRING", "''", pos)
                    break
                else:
                    assert kind is not None
                    if kind == "END":
                        self._conditions.finish()
                    token = Token({"END": "$END", "DATE": "TYPED"}.get(kind, kind), word, pos)
                if self._pending:
                    self.attributes[pos] = {name: said for _, name, said in self._pending}
                    self.repeated[pos], self._pending = self._pending, []
                yield token
                if token.type == "$END":
                    return

    def _skip_comment(self, mark: str, at: int) -> int:
        """The end of a comment that holds comments, or of the text. One that is not closed ends at the first mark:
        there are systems where comments do not nest."""
        whole, first = comment_ends(self.text, mark, at, self._end)
        if whole >= 0:
            return whole
        if first >= 0:
            opened = self.text.find(mark, at, first)
            message = f"a comment in a comment: this {mark} is not closed, so the outer comment ends where it would end"
            self.pragmas.append((opened, f"{{warning '{message}'}}"))
            return first
        self._report(at - 2, "comment", "this comment is not closed")
        return self._end

    def _skip_branch(self, at: int) -> int:
        """The end of what a conditional pragma leaves out, or of the text."""
        for match in _TOKEN.finditer(self.text, at, self._end):
            kind = match.lastgroup
            if kind == "PRAGMA":
                self._conditions.take(match[kind], match.start(kind))
                if self._conditions.active:
                    return match.end()
            elif kind == "NESTED":
                return self._skip_branch(self._skip_comment(match[kind], match.end()))
        return self._end

    def _pragma(self, text: str, pos: int) -> None:
        match = _ATTRIBUTE.fullmatch(text)
        if match:
            self._pending.append((pos, match.group(1).lower(), match.group(2) or ""))
        elif _STATEMENT_IN_C.fullmatch(text):
            self._foreign(pos)
        elif not self._conditions.take(text, pos):
            self.pragmas.append((pos, text))

    def _foreign(self, pos: int) -> None:
        message = "code in C cannot be compiled; put it into an EXTERNAL function"
        if not _ONLY_C.match(self.text, pos) and self.text[:pos].rstrip()[-4:].upper().endswith(
            (")", "THEN", "ELSE", "DO")
        ):
            message = "there are no { } around statements; write IF x THEN ... END_IF"
        elif accessor := _ACCESSOR.search(self.text[:pos]):
            word = accessor[1].upper()
            message = f"what a property does is written {word} ... END_{word}, without braces"
        self._report(pos, "pragma", message)

    def _slip(self, text: str, pos: int) -> Token:
        """What was meant by a sign or number of another language."""
        if text in slips.SIGNS:
            kind, meant, message = slips.SIGNS[text]
        elif not text[0].isalnum():
            kind, meant = "STRING", f"'{text[1:-1]}'"
            message = f"a string is written with straight quotes: {meant}"
        elif _DURATION.fullmatch(text):
            kind, meant = "NUMBER", ""
            pos, message = self._duration(text, pos)
        else:
            kind, meant = "NUMBER", text.lower().replace("0x", "16#", 1).replace("0b", "2#", 1)
            message = f"a number is written {meant}, not {text}" if "#" in meant else f"{text} is not a number"
            if _DECLARED.match(self.text, pos + len(text)):
                message += "; a name begins with a letter"
        self._report(pos, "syntax", message)
        return Token(kind, meant if "#" in meant or kind != "NUMBER" else "0", pos)

    def _duration(self, text: str, pos: int) -> tuple[int, str]:
        """Where a duration without T# begins, and what to say of it."""
        before = self.text[max(0, pos - 20) : pos]
        comma = _WITH_COMMA.search(before)
        if comma is not None:
            return pos - 1, slips.COMMA.format(number=comma["number"], part=text)
        whole = before[len(before.rstrip("0123456789.")) :]
        return pos - len(whole), f"a duration is written T#{whole}{text}, not {whole}{text}"

    def _bad(self, character: str, pos: int) -> bool:
        """Reports a character that starts no token; False when the rest of the line is to be skipped."""
        if character in "'\"":
            rest = self.text[pos + 1 : self._end_of_line(pos)]
            hint = "; a $ in a string is written $$" if f"${character}" in rest else ""
            self._report(pos, "string", f"this string is not closed before the end of the line{hint}")
            return False
        if character == "{":
            self._report(pos, "pragma", "this pragma is not closed")
            return True
        shown = character if character.isprintable() else f"character {ord(character)}"
        known = (said for pattern, said in slips.BEGINNINGS if pattern.match(self.text, pos))
        hint = next(known, slips.CHARACTERS.get(character, ""))
        self._report(pos, "character", f"{shown} has no place in a program{'; ' * bool(hint)}{hint}")
        return True

    def _end_of_line(self, pos: int) -> int:
        end = self.text.find("\n", pos, self._end)
        return self._end if end < 0 else end


# What follows a token is looked for in `text`, the plain text with strings (`plain_text`).


def is_followed_by_name(token: Token, text: str) -> bool:
    """Whether MOCK, METHOD ... start something, as in `MOCK pump.valve;`: another name follows, as it never does
    after a variable of that name."""
    if token.type == "TRANSITION" and _PRIORITY.match(text, token.end):
        return True
    return (_ADDRESS if token.type == "_AT" else _NAME).match(text, token.end) is not None


def begins_unit(token: Token, text: str) -> bool:
    """Whether TEST or STEP begins one, wherever it stands: then the text before it is not finished."""
    if token.type in ("STEP", "INITIAL_STEP"):
        return _LABEL.match(text, token.end) is not None
    return token.type == "TEST" and _QUOTE.match(text, token.end) is not None


def meant(token: Token, text: str) -> str:
    """The terminal of the keyword that a misspelt one stands for, "" when it seems to be a name."""
    return "" if _PART_FOLLOWS.match(text, token.end) else KEYWORDS[slips.WORDS[token.text.upper()].split()[0]]


def modified(token: Token, text: str) -> tuple[str, str] | None:
    """Keyword and name of a unit whose modifier stands before it, as in `PUBLIC METHOD m`."""
    match = _MODIFIED.match(text, token.end)
    return None if match is None else (match[1].upper(), match[2])


def has_parts(token: Token, text: str) -> bool:
    """Whether NULL is a name, as a value or a part of it follows."""
    return _VALUE_FOLLOWS.match(text, token.end) is not None


def is_operator_function(token: Token, text: str) -> bool:
    """Whether AND, OR, XOR or MOD at the place of an operand starts a call such as `AND(a, b)`; NOT does with a named
    argument."""
    if token.type == "NOT":
        return _NAMED_ARGUMENT.match(text, token.end) is not None
    return token.text.upper() in _OPERATOR_FUNCTIONS and _OPEN_PARENTHESIS.match(text, token.end) is not None
