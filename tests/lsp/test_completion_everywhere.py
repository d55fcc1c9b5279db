"""Completion in place of words of the programs in tests/st: what is offered parses, and what stood there is offered."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from plctool.compiler.base.source import Source
from plctool.compiler.formats.il_files import has_lists
from plctool.compiler.syntax.parser import parse
from plctool.lsp.completion import completion
from plctool.lsp.project import Project
from plctool.lsp.session import Place, Session
from plctool.lsp.tree import Tree

ROOT = Path(__file__).parents[2]
FILES, WORDS = 20, 4
KEYWORD, SNIPPET = 14, 15  # CompletionItemKind
LAST_WORD_OF_BASIC = "next"  # at the end of a text


def errors(text: str) -> list[tuple[int, str]]:
    """Returns the syntax errors of a text with their offsets."""
    found: list[tuple[int, str]] = []
    parse(Source("main.st", text), lambda offset, code, message: found.append((offset, message)))
    return found


def programs(rng: random.Random) -> list[tuple[str, str]]:
    """Returns some programs without syntax errors, each with its name."""
    files = sorted((ROOT / "tests" / "st").rglob("*.st"))
    texts = [(file.name, file.read_bytes().decode("utf-8", "replace")) for file in rng.sample(files, 2 * FILES)]
    return [(name, text) for name, text in texts if not has_lists(text) and not errors(text)][:FILES]


@pytest.mark.parametrize("seed", [1])
def test_what_is_offered_parses_and_what_stood_there_is_offered(seed: int, tmp_path: Path) -> None:
    rng = random.Random(seed)
    inserted = 0
    for name, text in programs(rng):
        path = tmp_path / name
        words = [t for t in Tree(Source(name, text)).tokens if t.text.isidentifier() and text.startswith(t.text, t.pos)]
        for token in rng.sample(words, min(WORDS, len(words))):
            project = Project([path], {str(path): text[: token.pos] + text[token.end :]})
            (tree,) = project.trees_of(str(path))
            offered = completion(Session(), Place(project, tree, token.pos))
            texts = {item.text_edit.new_text: item.kind for item in offered.items}  # type: ignore[union-attr]
            where = f"{name}: {text[max(0, token.pos - 40) : token.pos]}|{token.text}"
            if token.type != "IDENT" and not offered.is_incomplete:
                assert any(new.upper().startswith(token.text.upper()) for new in texts), where
            tried = set()
            for new, kind in texts.items():
                form = new if kind in (KEYWORD, SNIPPET) else new[-4:] if new.endswith(" ") else ""
                if form in tried or new.casefold() == LAST_WORD_OF_BASIC:
                    continue
                tried.add(form)
                inserted += 1
                end = token.pos + len(new)
                found = [m for offset, m in errors(f"{text[: token.pos]}{new} ") if token.pos <= offset < end]
                assert not found, f"{where}: {new} gives {found}"
    assert inserted > 500
