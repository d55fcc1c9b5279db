"""The tree-sitter grammar reads what the compiler reads, and its queries know each word of the language."""

from __future__ import annotations

import dataclasses
import hashlib
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import tree_sitter_iecst
from tree_sitter import Language, Node, Query, QueryCursor
from tree_sitter_iecst import GRAMMAR, mistakes, parsed, walk

from plctool.compiler.base.source import Source
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.lexer import KEYWORDS
from plctool.compiler.syntax.parser import parse_all
from plctool.iec.types import ELEMENTARY

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("tests/st", "tests/st_unit", "tests/corpus", "examples", "bench/programs", "host/plctool")
SOURCES = sorted(
    path for name in FOLDERS for path in (ROOT / name).rglob("*") if path.suffix.lower() in (".st", ".iec")
)
ONE_BRANCH_ONLY = "conditional_pragmas_choose_what_is_compiled.st"
"""The tree has all branches of conditional pragmas; in this program they make sense one at a time only."""

WORDS = {word for word, kind in KEYWORDS.items() if kind not in ("MISSPELT", "REFUSED")}
MISSING = {"VAR_GENERIC"}  # editors/tree-sitter-iecst/README.md says so
MEANT_BY_PLACE = {"RETURNS", "REF="}  # a name to the lexer of the compiler, a word in the grammar


@pytest.fixture(scope="session")
def iecst(tmp_path_factory: pytest.TempPathFactory) -> Language:
    return tree_sitter_iecst.language(tree_sitter_iecst.compiled(tmp_path_factory.mktemp("parser")))


@dataclasses.dataclass
class Read:
    """A source, what the compiler said of its syntax, and its declarations."""

    path: Path
    text: str
    reports: list[tuple[int, str, str]]
    declarations: list[ast.Declaration]


@pytest.fixture(scope="session")
def read() -> list[Read]:
    found = []
    for path in SOURCES:
        text = path.read_bytes().decode("utf-8-sig", errors="replace")
        reports: list[tuple[int, str, str]] = []
        declarations = parse_all(Source(str(path), text), lambda *said, to=reports: to.append(said)).declarations
        found.append(Read(path, text, reports, declarations))
    return found


def test_every_source_that_the_compiler_reads_has_no_error_node(iecst: Language, read: list[Read]) -> None:
    right = [source for source in read if not source.reports and source.path.name != ONE_BRANCH_ONLY]
    assert len(right) > 900, "the sources were not found"
    wrong = {
        str(source.path.relative_to(ROOT)): list(mistakes(parsed(iecst, source.text).root_node)) for source in right
    }
    assert {path: said for path, said in wrong.items() if said} == {}


def test_operators_bind_as_in_the_compiler(iecst: Language, read: list[Read]) -> None:
    compared = 0
    for source in read:
        if source.reports or not source.text.isascii() or source.path.name == ONE_BRANCH_ONLY:
            continue
        theirs = dict(_operands_of_nodes(parsed(iecst, source.text).root_node))
        ours = dict(_operands_of_the_compiler(source.declarations))
        assert {at: theirs.get(at) for at in ours} == ours, source.path
        compared += len(ours)
    assert compared > 2000


def _operands_of_nodes(root: Node) -> Iterator[tuple[int, tuple[int, ...]]]:
    for node in walk(root):
        if node.type == "binary_expression":
            operands = [node.child_by_field_name(side) for side in ("left", "right")]
            yield _operator_of(node), tuple(_operator_of(_inside(operand)) for operand in operands if operand)


def _inside(node: Node) -> Node:
    while node.type == "parenthesized_expression":
        node = node.named_children[0]
    return node


def _operator_of(node: Node) -> int:
    operator = node.child_by_field_name("operator") if node.type == "binary_expression" else None
    return operator.start_byte if operator else -1


def _operands_of_the_compiler(tree: Any) -> Iterator[tuple[int, tuple[int, ...]]]:
    waiting = [tree]
    while waiting:
        node = waiting.pop()
        if isinstance(node, list | tuple):
            waiting += node
        elif dataclasses.is_dataclass(node):
            waiting += [getattr(node, f.name) for f in dataclasses.fields(node) if hasattr(node, f.name)]
            if isinstance(node, ast.Binary):
                yield node.pos, tuple(x.pos if isinstance(x, ast.Binary) else -1 for x in (node.left, node.right))


def test_the_grammar_has_the_words_of_the_compiler(iecst: Language) -> None:
    assert _words(iecst) == (WORDS | MEANT_BY_PLACE) - MISSING


def _words(iecst: Language) -> set[str]:
    kinds = {iecst.node_kind_for_id(number) for number in range(iecst.node_kind_count)}
    return {kind for kind in kinds if kind and re.fullmatch(r"[A-Z_]+=?", kind) and kind != "ERROR"}


def test_every_word_and_sign_is_highlighted(iecst: Language) -> None:
    query = (GRAMMAR / "queries" / "highlights.scm").read_text()
    shown_by_their_node = {"TRUE", "FALSE", "NULL", *_listed("qualifier"), *_listed("modifier")}
    quoted = set(re.findall(r'"([^"]+)"', query))
    signs = {
        kind
        for number in range(iecst.node_kind_count)
        if (kind := iecst.node_kind_for_id(number)) and re.fullmatch(r"\W+", kind)
    }
    assert (_words(iecst) | signs) - shown_by_their_node - quoted == set()
    assert {name for name in ELEMENTARY if f'"{name}"' not in query} == set()


def _listed(kind: str) -> set[str]:
    wanted = kind.upper()
    return {word for word, terminal in KEYWORDS.items() if terminal == wanted}


@pytest.mark.parametrize("name", sorted(path.name for path in (GRAMMAR / "queries").glob("*.scm")))
def test_a_query_finds_something_for_each_of_its_captures(iecst: Language, read: list[Read], name: str) -> None:
    query = Query(iecst, (GRAMMAR / "queries" / name).read_text())
    missing = {query.capture_name(number) for number in range(query.capture_count)}
    for source in read:
        missing -= set(QueryCursor(query).captures(parsed(iecst, source.text).root_node))
        if not missing:
            break
    assert missing == set()


def test_highlights_tell_types_calls_and_members_apart(iecst: Language) -> None:
    text = "FUNCTION_BLOCK Pump VAR_INPUT speed : int; END_VAR Start(limit := THIS^.speed); END_FUNCTION_BLOCK"
    query = Query(iecst, (GRAMMAR / "queries" / "highlights.scm").read_text())
    found: dict[str, str] = {}
    matches = QueryCursor(query).matches(parsed(iecst, text).root_node)
    for _, captures in sorted(matches, key=lambda match: match[0]):
        for kind, nodes in captures.items():
            found.update({(node.text or b"").decode(): kind for node in nodes})
    assert found["Pump"] == "type.definition"
    assert found["int"] == "type.builtin"
    assert found["Start"] == "function.call"
    assert found["limit"] == "variable.parameter"
    assert found["THIS"] == "variable.builtin"
    assert found["speed"] == "variable.member"


def _cases() -> Iterator[tuple[str, str, str]]:
    for path in sorted((GRAMMAR / "test" / "corpus").glob("*.txt")):
        parts = re.split(r"^=+\n(.+)\n=+\n", path.read_text(), flags=re.MULTILINE)[1:]
        for title, body in zip(parts[::2], parts[1::2], strict=True):
            text, _, tree = body.partition("\n---\n")
            yield title, text, tree


@pytest.mark.parametrize(("text", "tree"), [pytest.param(text, tree, id=title) for title, text, tree in _cases()])
def test_the_corpus_has_the_trees_it_names(iecst: Language, text: str, tree: str) -> None:
    # The cases of `tree-sitter test`, without that program.
    shown = re.sub(r"\w+: ", "", str(parsed(iecst, text).root_node))
    assert shown == re.sub(r"\s+(?=\))", "", " ".join(tree.split()))


def test_the_parser_was_generated_from_this_grammar() -> None:
    # The generator cannot be installed everywhere: its npm package downloads a program.
    recorded, name = (GRAMMAR / "src" / "grammar.js.sha256").read_text().split()
    made = hashlib.sha256((GRAMMAR / name).read_bytes()).hexdigest()
    assert made == recorded, "run `make tree-sitter`"


def test_a_case_of_thousands_of_branches_is_parsed(iecst: Language) -> None:
    # Statements in a CASE begin as labels may: two versions are tried, which must not multiply.
    branch = "    {0}, {0}0: a.b[{0}].c(x := {0}); IF a THEN b := c(d, e(f)); END_IF y := NOT (z);\n"
    text = "FUNCTION f : INT\nCASE x OF\n" + "".join(branch.format(n) for n in range(1, 3000)) + "END_CASE END_FUNCTION"
    tree = parsed(iecst, text)
    assert not tree.root_node.has_error
    assert sum(node.type == "case_branch" for node in walk(tree.root_node)) == 2999
