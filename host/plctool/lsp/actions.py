"""Code actions: what a message of the compiler says to write is written."""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from difflib import SequenceMatcher
from itertools import takewhile

from lsprotocol import types as lsp

from plctool.compiler.syntax.lexer import Token
from plctool.lsp.items import Item, Kind
from plctool.lsp.names import written
from plctool.lsp.outline import SECTIONS, UNITS, Block
from plctool.lsp.session import Place, Session
from plctool.lsp.tree import Tree
from plctool.lsp.uses import uses_of

_WORD = re.compile(r"\w+")
_MEMBER = re.compile(r"\s*\.\s*([^\W\d]\w*)")
_SIGNS = ";|\\)|\\]|THEN|DO|OF|TO|:=|:|,"


@dataclass(frozen=True)
class Change:
    """The text between two offsets becomes `text`."""

    title: str
    start: int
    end: int
    text: str


@dataclass(frozen=True)
class _Found:
    """A diagnostic with the text that it is about. `offset`: where it is; `token`: what begins there."""

    place: Place
    message: str
    offset: int

    @property
    def text(self) -> str:
        return self.place.tree.source.text

    @property
    def token(self) -> Token | None:
        tree = self.place.tree
        at = bisect_left(tree.starts, self.offset)
        return tree.tokens[at] if at < len(tree.tokens) and tree.tokens[at].pos == self.offset else None

    @property
    def line_end(self) -> int:
        end = self.text.find("\n", self.offset)
        return len(self.text) if end < 0 else end


Fix = Callable[[_Found, "re.Match[str]"], Iterator[Change]]

_FIXES: list[tuple[re.Pattern[str], Fix]] = []


def _fix(pattern: str) -> Callable[[Fix], Fix]:
    """Registers what corrects the mistakes whose messages contain a pattern."""

    def register(fix: Fix) -> Fix:
        _FIXES.append((re.compile(pattern), fix))
        return fix

    return register


def code_actions(session: Session, place: Place, diagnostic: lsp.Diagnostic) -> list[lsp.CodeAction]:
    """Returns what may be done about a diagnostic at a place."""
    tree = place.tree
    if tree.source.original is not None:
        return []
    found = _Found(place, diagnostic.message, place.offset)
    actions: list[lsp.CodeAction] = []
    for change in changes(found):
        where = session.span(tree.source, change.start, change.end)
        if change.start == change.end:
            where = session.range(tree.source, change.start, 0)
        uri = session.location(tree.source, place.offset, 0).uri
        edit = lsp.WorkspaceEdit(changes={uri: [lsp.TextEdit(where, change.text)]})
        actions.append(
            lsp.CodeAction(change.title, lsp.CodeActionKind.QuickFix, [diagnostic], is_preferred=not actions, edit=edit)
        )
    return actions


def changes(found: _Found) -> Iterator[Change]:
    """Returns the changes that a message says, the best one first."""
    seen: set[tuple[int, int, str]] = set()
    for pattern, fix in _FIXES:
        match = pattern.search(found.message)
        for change in fix(found, match) if match else ():
            if (change.start, change.end, change.text) not in seen:
                seen.add((change.start, change.end, change.text))
                yield change


def changes_at(place: Place, message: str) -> list[Change]:
    """Returns what may be done about a message."""
    return list(changes(_Found(place, message, place.offset)))


# ---- names ----


def _word_like(found: _Found, meant: str) -> tuple[int, int] | None:
    """The word in the line that the message quotes and that is most like another one."""
    quoted = {word.casefold() for word in _WORD.findall(found.message)} - {meant.casefold()}
    begin = found.text.rfind("\n", 0, found.offset) + 1
    words = [
        (
            SequenceMatcher(None, match.group().casefold(), meant.casefold()).ratio(),
            -abs(match.start() - found.offset),
            match,
        )
        for match in _WORD.finditer(found.text, begin, found.line_end)
        if match.group().casefold() in quoted
    ]
    best = max(words, key=lambda w: w[:2], default=None)
    return None if best is None else best[2].span()


@_fix(r"did you mean (?P<meant>[^\s?]+)\?")
def _did_you_mean(found: _Found, match: re.Match[str]) -> Iterator[Change]:
    meant = match["meant"]
    span = _word_like(found, meant)
    if span is None or found.text[slice(*span)] == meant:
        return
    change = Change(f"Write {meant}", *span, meant)
    if _has_member(found, change):
        yield change


def _has_member(found: _Found, change: Change) -> bool:
    """False if a change writes the name of something without the member that follows."""
    member = _MEMBER.match(found.text, change.end)
    if member is None:
        return True
    source = found.place.tree.source
    tree = Tree(replace(source, text=found.text[: change.start] + change.text + found.text[change.end :]))
    offset = change.start + len(change.text) + member.start(1) - member.start()
    return any(use.offset == offset for use in uses_of(tree, found.place.project.names).uses)


@_fix(r"(?P<name>[\w.]+)(?: is (?:in|a value of) several \w+)?; write (?P<all>[\w.]+\.\w+(?:(?:, | or )[\w.]+\.\w+)*)")
def _longer_name(found: _Found, match: re.Match[str]) -> Iterator[Change]:
    token = found.token
    for longer in re.split(r", | or ", match["all"]):
        if token is not None and longer.casefold().endswith(f".{token.text.casefold()}"):
            yield Change(f"Write {longer}", token.pos, token.end, longer)


@_fix(r"^(?:unknown (?:type|name|function)|there is no) (?P<wrong>\S+); write (?P<meant>[\w^]+|[^\w\s]{1,2})$")
def _other_word(found: _Found, match: re.Match[str]) -> Iterator[Change]:
    at = found.text.find(match["wrong"], found.offset, found.line_end)
    if at >= 0:
        yield Change(f"Write {match['meant']}", at, at + len(match["wrong"]), match["meant"])


@_fix(r"^this assigns, and the value is used as well; a comparison is written =$")
def _comparison(found: _Found, match: re.Match[str]) -> Iterator[Change]:
    """Of an assignment that is a whole condition: elsewhere a comparison has another type than what is assigned."""
    tree = found.place.tree
    at = bisect_left(tree.starts, found.offset)
    condition = takewhile(lambda t: t.text.upper() not in _AFTER_CONDITIONS, tree.tokens[at:])
    assigned = [t for t in condition if t.type == "_ASSIGN"]
    if at and tree.tokens[at - 1].type in _OF_CONDITIONS and len(assigned) == 1:
        yield Change("Write =", assigned[0].pos, assigned[0].end, "=")


@_fix(r"^(?!this assigns).*is written (?:with straight quotes: )?(?P<meant>'.*'|[^\s,]+)(?:, not (?P<wrong>\S+?))?$")
def _is_written(found: _Found, match: re.Match[str]) -> Iterator[Change]:
    wrong = match["wrong"] or f"{found.text[found.offset]}{match['meant'][1:-1]}"
    at = found.text.find(wrong, max(0, found.offset - 1), found.line_end)
    end = at + len(wrong) + (not match["wrong"])
    if at >= 0:
        yield Change(f"Write {match['meant']}", at, end, match["meant"])


@_fix(r"; write (?P<meant>%[IQM][A-Z]?\d[\w.]*)")
def _address(found: _Found, match: re.Match[str]) -> Iterator[Change]:
    for token in _tokens_of_line(found):
        if token.type == "DIRECT" and token.text in found.message:
            yield Change(f"Write {match['meant']}", token.pos, token.end, match["meant"])


def _tokens_of_line(found: _Found) -> list[Token]:
    tree = found.place.tree
    begin = found.text.rfind("\n", 0, found.offset) + 1
    return tree.tokens[bisect_left(tree.starts, begin) : bisect_left(tree.starts, found.line_end)]


@_fix(r"^(?P<name>\w+) is an interface; write IMPLEMENTS")
def _implements(found: _Found, match: re.Match[str]) -> Iterator[Change]:
    before = re.search(rf"\bEXTENDS(?=\s+{match['name']}\b)", found.text[: found.line_end], re.IGNORECASE)
    if before:
        yield Change("Write IMPLEMENTS", *before.span(), "IMPLEMENTS")


# ---- syntax ----


@_fix(rf"^expected (?P<sign>{_SIGNS})(?: after| before|$)")
def _missing_sign(found: _Found, match: re.Match[str]) -> Iterator[Change]:
    sign = match["sign"]
    if "Instruction List" in found.message:
        return
    at = (
        len(found.text[: found.offset].rstrip())
        if not found.text[found.offset - 1 : found.offset].strip()
        else found.offset
    )
    if sign in (";", ")", "]", ","):
        yield Change(f"Insert {sign}", at, at, sign)
    else:
        after = "" if found.text[at : at + 1].isspace() else " "
        yield Change(f"Insert {sign}", at, at, f" {sign}{after}")


@_fix(r"^(?P<end>END_\w+) missing for the (?P<opener>\w+) in line (?P<line>\d+)")
def _missing_end(found: _Found, match: re.Match[str]) -> Iterator[Change]:
    opener = found.place.tree.source.line_text(int(match["line"]))
    indent = opener[: len(opener) - len(opener.lstrip())]
    begin = found.text.rfind("\n", 0, found.offset) + 1
    sign = ";" if match["opener"] in ("IF", "CASE", "FOR", "WHILE", "REPEAT") else ""
    if found.text[begin : found.offset].strip():
        yield Change(f"Insert {match['end']}", found.offset, found.offset, f" {match['end']}{sign}\n")
    else:
        before = "" if not begin or found.text[begin - 1] == "\n" else "\n"
        yield Change(f"Insert {match['end']}", begin, begin, f"{before}{indent}{match['end']}{sign}\n")


@_fix(r"^expected (?P<end>END_\w+) for the \w+ in line \d+, not (?P<wrong>\w+)")
def _other_end(found: _Found, match: re.Match[str]) -> Iterator[Change]:
    token = found.token
    if token is not None:
        yield Change(f"Write {match['end']}", token.pos, token.end, match["end"])


@_fix(r"ELSE IF begins a second IF.*write ELSIF")
def _elsif(found: _Found, match: re.Match[str]) -> Iterator[Change]:
    begin = found.text.rfind("\n", 0, found.offset) + 1
    both = re.search(r"\bELSE\s+IF\b", found.text[begin : found.line_end], re.IGNORECASE)
    if both:
        yield Change("Write ELSIF", begin + both.start(), begin + both.end(), "ELSIF")


@_fix(r"^there is no (?P<sign>\S+); write (?P<name>[\w.]+) := (?P<value>.+)$")
def _whole_assignment(found: _Found, match: re.Match[str]) -> Iterator[Change]:
    begin = found.text.rfind("\n", 0, found.offset) + 1
    start = found.text.rfind(match["name"], begin, found.line_end)
    start = found.text.find(match["name"], begin, found.line_end) if start < 0 or start > found.offset else start
    end = found.text.find(";", found.offset, found.line_end)
    if start >= 0 and end >= 0:
        statement = f"{match['name']} := {match['value']}"
        yield Change(f"Write {statement}", start, end, statement)


@_fix(r"the left side of \?= .*; write :=$")
def _plain_assignment(found: _Found, match: re.Match[str]) -> Iterator[Change]:
    at = found.text.find("?=", found.offset, found.line_end)
    if at >= 0:
        yield Change("Write :=", at, at + 2, ":=")


# ---- values ----


@_fix(r"; write (?P<function>\w+_TO_\w+)\((?:\.\.\.|[^)]*)\)")
def _conversion(found: _Found, match: re.Match[str]) -> Iterator[Change]:
    end = _end_of_value(found)
    if end is not None and not _is_in_step(found):
        value = found.text[found.offset : end]
        if "#" in value and "#" not in match[0] and value.rpartition("#")[2] in match[0]:
            value = value.rpartition("#")[2]  # REAL_TO_INT(5.5) for INT#5.5
        yield Change(f"Write {match['function']}(...)", found.offset, end, f"{match['function']}({value})")


def _is_in_step(found: _Found) -> bool:
    """True among the actions of a step, where no expression stands."""
    tree = found.place.tree
    steps = (b for top in tree.blocks for b in top.every() if b.kind in ("STEP", "INITIAL_STEP"))
    return any(tree.tokens[b.first].pos < found.offset < tree.tokens[b.last].pos for b in steps)


def _end_of_value(found: _Found) -> int | None:
    """The end of the name, call or literal that begins at the diagnostic; None if it is not a value without signs."""
    tree = found.place.tree
    at = bisect_left(tree.starts, found.offset)
    if at >= len(tree.tokens) or tree.tokens[at].type not in (
        "IDENT",
        "NUMBER",
        "STRING",
        "TYPED",
        "DIRECT",
        "TRUE",
        "FALSE",
    ):
        return None
    end, at = tree.tokens[at].end, at + 1
    depth = 0
    while at < len(tree.tokens):
        kind = tree.tokens[at].type
        if kind in ("_LPAR", "_LSQB"):
            depth += 1
        elif kind in ("_RPAR", "_RSQB"):
            if not depth:
                break
            depth -= 1
        elif not depth and kind not in ("_DOT", "_CARET") and tree.tokens[at - 1].type != "_DOT":
            break
        if kind in ("_SEMI", "$END"):
            return None
        end, at = tree.tokens[at].end, at + 1
    operators = ("OP", "SIGN", "EQ")
    follows = tree.tokens[at].type if at < len(tree.tokens) else ""
    return None if follows in operators and found.message.startswith("BOOL") else end


@_fix(r"(?:write (?P<first>'[^']*'|\"[^\"]*\")|write (?P<number>16#[0-9A-F]+) for '.')$")
def _other_literal(found: _Found, match: re.Match[str]) -> Iterator[Change]:
    token, meant = found.token, match["first"] or match["number"]
    if token is not None and token.type in ("NUMBER", "STRING", "TYPED"):
        yield Change(f"Write {meant}", token.pos, token.end, meant)


@_fix(r"write LTIME#\.\.\. for (?:less|more)")
def _long_time(found: _Found, match: re.Match[str]) -> Iterator[Change]:
    token = found.token
    if token is not None and token.type == "TYPED" and not _is_given_to_time(found, token):
        yield Change("Write LTIME#", token.pos, token.pos + token.text.index("#"), "LTIME")


def _is_given_to_time(found: _Found, token: Token) -> bool:
    """True for the value of a TIME, which an LTIME does not fit."""
    tree = found.place.tree
    at = bisect_left(tree.starts, token.pos)
    if at < 2 or tree.tokens[at - 1].type != "_ASSIGN":
        return False
    target = tree.tokens[at - 2]
    return "TIME" in (target.text.upper(), _type_of_token(found, target).upper())


@_fix(r"^\$\S is not an escape; write \$\$")
def _dollar(found: _Found, match: re.Match[str]) -> Iterator[Change]:
    at = found.text.find(match[0][:2], found.offset, found.line_end)
    if at >= 0:
        yield Change("Write $$", at, at + 1, "$$")


@_fix(r"this CASE misses (?P<values>.+) of (?P<type>\w+); add what is missing, or an ELSE")
def _else_of_case(found: _Found, match: re.Match[str]) -> Iterator[Change]:
    tree = found.place.tree
    for block in (b for top in tree.blocks for b in top.every() if b.kind == "CASE" and b.closed):
        if tree.tokens[block.first].pos == found.offset:
            end = tree.tokens[block.last].pos
            begin = found.text.rfind("\n", 0, end) + 1
            indent = found.text[begin:end]
            if indent.strip():
                yield Change("Add ELSE", end, end, "ELSE ; ")
            else:
                yield Change("Add ELSE", begin, begin, f"{indent}ELSE\n{indent}    ;\n")


# ---- declarations ----


@_fix(r"^(?P<name>\w+) is never (?:used|read|written)")
def _remove_unused(found: _Found, match: re.Match[str]) -> Iterator[Change]:
    item = found.place.tree.items.declared.get(found.offset)
    if item is None or item.line is None or item.kind is not Kind.VARIABLE or item.line.init is not None:
        return
    names = item.line.names
    tokens = found.place.tree.tokens
    at = bisect_left(found.place.tree.starts, found.offset)
    if len(names) > 1:  # with the comma after it, or before the last one
        first = at if tokens[at + 1].type == "_COMMA" else at - 1
        end = tokens[first + 2].pos if first == at else tokens[first + 1].end
        yield Change(f"Remove {item.name}", tokens[first].pos, end, "")
        return
    start = item.line.pos if item.line.pos < found.offset else found.offset
    semicolon = next((t for t in tokens[at:] if t.type == "_SEMI"), None)
    if semicolon is None:
        return
    end = semicolon.end
    begin = found.text.rfind("\n", 0, start) + 1
    line_end = found.text.find("\n", end)
    if not found.text[begin:start].strip() and line_end >= 0 and not found.text[end:line_end].strip(" \t;"):
        start, end = begin, line_end + 1
    yield Change(f"Remove {item.name}", start, end, "")


@_fix(r"^unknown name (?P<name>\w+)$")
def _declare(found: _Found, match: re.Match[str]) -> Iterator[Change]:
    tree, token = found.place.tree, found.token
    if token is None or token.text != match["name"]:
        return
    unit = _unit_around(found)
    if unit is None or _follows(found, token) in _OF_OTHERS:
        return
    type_name = _type_of_use(found, token)
    line = f"    {token.text} : {type_name};\n"
    title = f"Declare {token.text} : {type_name}"
    own = [b for b in unit.inner if b.kind in SECTIONS and b.closed]
    plain = [
        b for b in own if tree.tokens[b.first].text.upper() == "VAR" and tree.tokens[b.first + 1].type != "QUALIFIER"
    ]
    if plain:
        end = tree.tokens[plain[-1].last].pos
        begin = found.text.rfind("\n", 0, end) + 1
        if found.text[begin:end].strip():
            yield Change(title, end, end, f"{line.strip()} ")
        else:
            yield Change(title, begin, begin, line)
        return
    after = tree.tokens[own[-1].last].end if own else _end_of_header(found, unit)
    yield Change(title, after, after, f"\nVAR\n{line}END_VAR")


_OF_OTHERS = frozenset(("_DOT", "_LPAR", "_LSQB", "_CARET", "_COLON", "_DOTDOT"))
"""What follows a name that is not a variable of a simple type: it has members, or is a constant."""


def _follows(found: _Found, token: Token) -> str:
    """The type of the token after another one."""
    tree = found.place.tree
    return tree.tokens[bisect_left(tree.starts, token.pos) + 1].type


def _unit_around(found: _Found) -> Block | None:
    tree = found.place.tree
    best = None
    for block in (
        b for top in tree.blocks for b in top.every() if b.kind in UNITS and b.kind not in ("TYPE", "GET", "SET")
    ):
        if tree.tokens[block.first].pos <= found.offset <= tree.tokens[block.last].end and block.kind != "ACTION":
            best = block
    return best


def _end_of_header(found: _Found, unit: Block) -> int:
    end = found.text.find("\n", found.place.tree.tokens[unit.first].pos)
    return len(found.text) if end < 0 else end


_LITERALS = {"TRUE": "BOOL", "FALSE": "BOOL", "STRING": "STRING", "NOT": "BOOL"}
_OF_CONDITIONS = frozenset(("IF", "_ELSIF", "WHILE", "_UNTIL", "NOT"))
_AFTER_CONDITIONS = frozenset(("THEN", "DO", "END_REPEAT", ";"))


def _type_of_use(found: _Found, token: Token) -> str:
    """A type that a name may have where it is used: that of what it is assigned to or gets."""
    tree = found.place.tree
    at = bisect_left(tree.starts, token.pos)
    before, after = tree.tokens[at - 1], tree.tokens[at + 1]
    if after.type == "_ASSIGN":
        return _type_of_token(found, tree.tokens[at + 2]) or "INT"
    if before.type == "_LPAR" and at > 1 and tree.tokens[at - 2].text.upper() == "__CATCH":
        return "__SYSTEM.ExceptionCode"
    if before.type in _OF_CONDITIONS or before.text.upper() in ("AND", "OR", "XOR"):
        return "BOOL"
    if before.type in ("_ASSIGN", "OP", "SIGN", "EQ", "_ARROW"):
        return _type_of_token(found, tree.tokens[at - 2]) or "INT"
    return "INT"


def _type_of_token(found: _Found, token: Token) -> str:
    if token.type in _LITERALS:
        return _LITERALS[token.type]
    if token.type == "NUMBER":
        return "REAL" if "." in token.text else "INT"
    if token.type == "TYPED":
        prefix = token.text.partition("#")[0].upper()
        return {"T": "TIME", "LT": "LTIME", "D": "DATE"}.get(prefix, prefix)
    use = Place(found.place.project, found.place.tree, token.pos).item()
    return "" if use is None else _type_name(use)


def _type_name(item: Item) -> str:
    if item.spec is not None and item.line is not None:
        return written(item.spec)
    if item.kind is Kind.VALUE and item.owner is not None:
        return item.owner.name
    return written(item.spec) if item.spec is not None and item.kind in (Kind.FUNCTION, Kind.METHOD) else ""
