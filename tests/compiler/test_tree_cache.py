"""Syntax trees are kept between builds: diagnostics and images are the same with and without them."""

from __future__ import annotations

import os
import pickle
import random
from collections.abc import Iterator
from pathlib import Path

import pytest

from plctool.compiler import build, front, program_files
from plctool.compiler.base.source import Source
from plctool.compiler.codegen.object_cache import ObjectCache
from plctool.compiler.front import Trees, check_sources
from plctool.compiler.kept.tree_cache import KeptTrees, read_tree, tree_folder, tree_key, trees_of_user, written_tree
from plctool.compiler.sources.request import BuildRequest
from plctool.compiler.sources.source_files import read_content
from plctool.compiler.syntax.diagnostics import CompileError, Diagnostics
from plctool.compiler.syntax.parser import parse_all

pytestmark = pytest.mark.skipif(not hasattr(os, "getuid"), reason="files have no owner here")

PROGRAMS = sorted((Path(__file__).parents[1] / "st").rglob("*.st"))
EDITED = 40  # programs, others for each seed
WORDS = ("END_IF", "VAR", ":=", ";", "x", "(", "(*", "'", "{IF", "NOT", "ARRAY", "0")
COMMENT = "(* " + "long " * 300 + "*)\n"  # short sources are not kept
NAMES = frozenset[str]()


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ObjectCache:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tree_folder()


@pytest.fixture
def not_parsed(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Takes the paths of the sources that are parsed."""
    paths: list[str] = []

    def noting(source: Source, *args: object, **options: object) -> object:
        paths.append(source.path)
        return parse_all(source, *args, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(front, "parse_all", noting)
    return paths


def edited(text: str, random_: random.Random) -> str:
    """The text with a few words replaced, added or left out."""
    for _ in range(random_.randrange(3)):
        at = random_.randrange(len(text) + 1)
        text = text[:at] + random_.choice(("", *WORDS)) + text[at + random_.randrange(4) :]
    return text


def programs() -> Iterator[Source]:
    """Programs of the tests with small mistakes, as an editor has them."""
    random_ = random.Random(38)
    for path in random_.sample(PROGRAMS, EDITED):
        yield from read_content(path, edited(path.read_text(), random_).encode())


def test_trees_of_edited_programs_are_the_same_when_they_are_read_again() -> None:
    kept = 0
    for source in programs():
        errors: list[tuple[int, str, str]] = []
        tree = parse_all(source, lambda *error, to=errors: to.append(error)), errors
        data = written_tree(tree, source)
        if data is not None:
            assert repr(read_tree(data, source)) == repr(tree), source.text
            kept += 1
    assert kept > EDITED * 0.9


def test_diagnostics_of_edited_programs_are_the_same_with_kept_trees(cache: ObjectCache) -> None:
    for source in programs():
        longer = [Source(source.path, source.text + COMMENT)]
        expected = check_sources(longer).diagnostics
        assert check_sources(longer, trees=KeptTrees(cache)).diagnostics == expected  # makes the tree
        assert check_sources(longer, trees=KeptTrees(cache)).diagnostics == expected, source.text
    assert cache.size()[0] > EDITED * 0.9


def test_images_after_random_edits_are_the_same_with_and_without_cache(tmp_path: Path, not_parsed: list[str]) -> None:
    random_, folder = random.Random(5), tmp_path / "project"
    folder.mkdir()
    for n in range(4):
        (folder / f"b{n}.st").write_text(
            f"{COMMENT}FUNCTION_BLOCK B{n}\n"
            "VAR_INPUT a : INT; END_VAR VAR_OUTPUT b : INT; END_VAR VAR t : TON; END_VAR\n"
            f"b := a + {n};\nt(IN := b > {n}, PT := T#1s);\nIF t.Q THEN b := 0; END_IF;\nEND_FUNCTION_BLOCK\n"
        )
    calls = "".join(f"b{n}(a := b{(n + 1) % 4}.b);\n" for n in range(4))
    declared = "".join(f"b{n} : B{n}; " for n in range(4))
    (folder / "main.st").write_text(f"{COMMENT}PROGRAM Main VAR {declared}END_VAR\n{calls}END_PROGRAM\n")

    def built(cache: bool) -> tuple[bytes, object, object]:
        try:
            found = build(BuildRequest(program_files([folder]), cache=cache))
        except CompileError as error:
            return b"", error.diagnostics, None
        return found.image, found.warnings, found.symbols.to_json()

    for _ in range(8):
        file = random_.choice(sorted(folder.iterdir()))
        lines = file.read_text().splitlines(keepends=True)
        at = random_.randrange(1, len(lines) - 1)
        lines[at : at + 1] = random_.choice(([], [lines[at], lines[at]], [lines[at].replace("a", "b", 1)]))
        file.write_text("".join(lines))
        expected = built(cache=False)
        assert built(cache=True) == expected
        not_parsed.clear()
        assert built(cache=True) == expected
        assert not [path for path in not_parsed if path.startswith(str(folder))]


def test_only_the_file_that_changed_is_parsed(cache: ObjectCache, not_parsed: list[str]) -> None:
    one, other = (Source(f"{name}.st", f"{COMMENT}FUNCTION {name} : INT {name} := 1; END_FUNCTION") for name in "FG")
    check_sources([one, other], library=False, trees=KeptTrees(cache))
    changed = Source("G.st", other.text.replace("1", "2"))
    not_parsed.clear()
    check_sources([one, changed], library=False, trees=KeptTrees(cache))
    assert not_parsed == ["G.st"]


def test_short_texts_are_parsed_again() -> None:
    check_sources([Source("a.st", "PROGRAM P END_PROGRAM")], trees=trees_of_user())
    assert tree_folder().size() == (0, 0)


def test_name_that_a_condition_asks_for_is_part_of_the_key() -> None:
    source = Source("a.st", COMMENT)
    assert tree_key(source, frozenset()) != tree_key(source, frozenset(["other"]))


class Evil:
    """Something that runs a command when pickle reads it."""

    def __init__(self, command: str) -> None:
        self._command = command

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return os.system, (self._command,)


@pytest.mark.parametrize("wrapped", [False, True])
def test_file_that_would_run_a_command_is_not_used(tmp_path: Path, cache: ObjectCache, wrapped: bool) -> None:
    mark, source = tmp_path / "mark", Source("a.st", COMMENT + "PROGRAM Main VAR x : INT; END_VAR x := 1; END_PROGRAM")
    evil = Evil(f"touch {mark}")
    data = pickle.dumps((evil, []) if wrapped else evil)
    assert read_tree(data, source) is None
    cache.put(tree_key(source, NAMES), data)
    assert check_sources([source], trees=KeptTrees(cache)).ok
    assert not mark.exists()


@pytest.mark.parametrize(
    ("module", "name"),
    [
        ("builtins", "eval"),
        ("builtins", "getattr"),
        ("plctool.compiler.syntax.ast", "dataclass"),
        ("plctool.compiler.syntax.ast", "Source"),
        ("plctool.compiler.syntax.ast", "Source.pos"),
        ("plctool.compiler.syntax.parser", "parse_all"),
        ("plctool.compiler.kept.tree_cache", "trees_of_user"),
    ],
)
def test_names_of_functions_are_refused(module: str, name: str) -> None:
    assert read_tree(f"c{module}\n{name}\n.".encode(), Source("a.st", "")) is None


def test_damaged_files_are_parsed_again(cache: ObjectCache) -> None:
    source, random_ = (
        Source("a.st", COMMENT + "PROGRAM Main VAR x : INT; END_VAR x := 1; END_PROGRAM"),
        random.Random(1),
    )
    diagnostics = Diagnostics()
    expected = repr(Trees().parse(source, NAMES, diagnostics))
    data = written_tree((parse_all(source, diagnostics.at(source).error), []), source)
    assert data is not None
    for _ in range(300):
        damaged = bytearray(data)
        for _ in range(random_.randrange(1, 4)):
            damaged[random_.randrange(len(damaged))] = random_.randrange(256)
        read_tree(bytes(damaged), source)  # raises nothing
        read_tree(data[: random_.randrange(len(data))], source)
    file = next(iter(_files(cache, source, data)))
    file.write_bytes(file.read_bytes()[:-1] + b"!")
    assert repr(KeptTrees(cache).parse(source, NAMES, diagnostics)) == expected


def _files(cache: ObjectCache, source: Source, data: bytes) -> Iterator[Path]:
    cache.put(tree_key(source, NAMES), data)
    return (path for path in cache.folder.rglob("*") if path.is_file())


def test_folder_that_others_may_write_is_not_used(cache: ObjectCache) -> None:
    cache.folder.mkdir(parents=True)
    cache.folder.chmod(0o777)
    assert type(trees_of_user()) is Trees
