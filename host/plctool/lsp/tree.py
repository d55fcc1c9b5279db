"""One parsed text: tokens, blocks, what it declares, and the comments about that."""

from __future__ import annotations

import re
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from functools import cached_property

from plctool.compiler.base.source import Source
from plctool.compiler.syntax.lexer import SOFT, Lexer, Token
from plctool.compiler.syntax.parser import parse_all
from plctool.compiler.syntax.plain_text import FLAT_COMMENT
from plctool.lsp.items import ItemsOf
from plctool.lsp.outline import SECTIONS, UNITS, Block, outline

_FOLLOWED_BY_NAME = re.compile(r"\s+[^\W\d]|\s*'")
_COMMENT = re.compile(FLAT_COMMENT, re.DOTALL)
_OPEN_COMMENT = re.compile(r"//[^\n]*\Z|\(\*(?:(?!\*\)).)*\Z|/\*(?:(?!\*/).)*\Z|\{[^}]*\Z", re.DOTALL)
_OPEN_STRING = re.compile(r"'(?:[^'$\n]|\$[^\n])*\Z|\"(?:[^\"$\n]|\$[^\n])*\Z")


def _ignore(offset: int, code: str, message: str) -> None:
    """Takes what the check reports as well."""


class Tree:
    """A text with what an editor asks about it. `before`: the tree of the text before it was changed, whose items stand
    for units that cannot be read now."""

    def __init__(self, source: Source, before: Tree | None = None, library: str = "") -> None:
        self.source = source
        errors: list[tuple[int, str, str]] = []
        tokens: list[Token] = []
        parsed = parse_all(source, lambda *error: errors.append(error), tokens=tokens)
        self.errors = errors
        self.has_errors = bool(errors)
        self.parsed = parsed
        self.declarations = parsed.declarations
        self.tokens = tokens if not errors else self._all_tokens(tokens)
        self.items = ItemsOf(source, parsed.declarations, library)
        if errors and before is not None:
            self._keep_lost(before)

    def _all_tokens(self, taken: Sequence[Token]) -> list[Token]:
        """The tokens of a text with errors: also those that the parser left out, without those that it added."""
        kinds = {token.pos: token.type for token in taken if self.source.text.startswith(token.text, token.pos)}
        found = []
        for token in Lexer(self.source.text, _ignore):
            if token.pos in kinds:
                token.type = kinds[token.pos]
            elif token.type in SOFT and not self._begins_something(token):
                token.type = "IDENT"
            found.append(token)
        return found

    def _begins_something(self, token: Token) -> bool:
        return token.type in UNITS and _FOLLOWED_BY_NAME.match(self.source.text, token.end) is not None

    def _keep_lost(self, before: Tree) -> None:
        """Takes over the units whose declaration cannot be read at the moment, so that others still find them."""
        named = {item.key for item in self.items.units}
        words = {token.text.casefold() for token in self.tokens if token.type == "IDENT"}
        for item in before.items.units:
            if item.key not in named and item.name.casefold() in words:
                self.items.units.append(item)

    @cached_property
    def starts(self) -> list[int]:
        """The offsets of the tokens."""
        return [token.pos for token in self.tokens]

    @cached_property
    def blocks(self) -> list[Block]:
        """The outermost blocks."""
        return outline(self.tokens)

    @cached_property
    def interface(self) -> int:
        """A hash of all that other sources can see of this one: not of bodies, comments and blanks."""
        bodies = self.bodies
        parts: list[str] = []
        at = 0
        for first, last in bodies:
            parts += [token.text for token in self.tokens[at:first]]
            at = last
        parts += [token.text for token in self.tokens[at:]]
        return hash(tuple(parts))

    @cached_property
    def bodies(self) -> list[tuple[int, int]]:
        """The tokens of statements, from and to before."""
        found: list[tuple[int, int]] = []
        for block in (b for top in self.blocks for b in top.every() if b.kind in UNITS and b.kind != "TYPE"):
            own = [b for b in block.inner if b.kind in SECTIONS]
            first = own[-1].last + 1 if own else self._after_header(block)
            members = [b for b in block.inner if b.kind in UNITS]
            last = members[0].first if members and members[0].first >= first else block.last
            if first < last:
                found.append((first, last))
        found.sort()
        return [(a, b) for i, (a, b) in enumerate(found) if i == 0 or a >= found[i - 1][1]]

    def _after_header(self, block: Block) -> int:
        """Where the statements of a unit without variables begin: in its second line."""
        pos = self.tokens[block.first].pos
        end = self.source.text.find("\n", pos)
        return block.last if end < 0 else min(block.last, bisect_left(self.starts, end))

    # ---- looking for tokens ----

    def index_at(self, offset: int) -> int:
        """Returns the index of the token that begins at or before an offset; -1 if none does."""
        return bisect_right(self.starts, offset) - 1

    def word_at(self, offset: int) -> Token | None:
        """Returns the word that an offset is in or at the end of."""
        at = self.index_at(offset)
        for token in self.tokens[max(0, at - 1) : at + 1][::-1]:
            if (
                token.type != "$END"
                and token.pos <= offset <= token.end
                and (token.text[:1].isalpha() or "_" in token.text[:1])
            ):
                return token
        return None

    def is_in_comment(self, offset: int) -> bool:
        """True if nothing of the program is written at an offset: in a comment, a pragma or a string."""
        at = bisect_left(self.starts, offset) - 1
        if at < 0:
            return _OPEN_COMMENT.search(self.source.text, 0, offset) is not None
        token = self.tokens[at]
        if token.type in ("STRING", "TYPED") and token.text.endswith(("'", '"')) and token.pos < offset < token.end:
            return True
        gap = self.source.text[min(token.end, offset) : offset]
        for match in _COMMENT.finditer(gap):
            if match.end() == len(gap) and match.group().startswith("//"):
                return True
        gap = _COMMENT.sub(" ", gap)
        return _OPEN_COMMENT.search(gap) is not None or _OPEN_STRING.search(gap) is not None
