"""Syntax trees in the user's cache folder, so that a check or build parses only the files that have changed.

A tree is found by a hash of all that it depends on. The folder is as that of the objects: a file that another user may
write is not read. What is read makes nodes of the syntax tree and nothing else: a file that names any other class or
function is not used.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import pickle
import sys
from collections.abc import Callable
from dataclasses import is_dataclass
from enum import Enum
from functools import cache
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Any

from plctool.compiler.base.source import Source
from plctool.compiler.codegen.object_cache import ObjectCache
from plctool.compiler.front import KnownTree, Trees
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.parser import ParsedText
from plctool.files import cache_folder
from plctool.iec.literals import BitPattern, LiteralKind

LIMIT = 50 << 20  # bytes of all trees
_SHORTEST = 1000  # characters of a text for which a tree is kept
_FORMAT = 5  # of pickle


class KeptTrees(Trees):
    """Trees that outlive the process. `kept`: where."""

    def __init__(self, kept: ObjectCache) -> None:
        super().__init__()
        self._kept = kept

    def find(self, source: Source, declared: frozenset[str]) -> KnownTree | None:
        """Returns the tree of a text that is in the cache."""
        if len(source.text) < _SHORTEST:
            return None
        data = self._kept.get(tree_key(source, declared))
        return None if data is None else read_tree(data, source)

    def made(self, source: Source, declared: frozenset[str], tree: KnownTree) -> None:
        """Puts a tree into the cache."""
        data = None if len(source.text) < _SHORTEST else written_tree(tree, source)
        if data is not None:
            self._kept.put(tree_key(source, declared), data)


def trees_of_user() -> Trees:
    """Trees that are kept in the user's cache folder; those of this process alone where that is not possible."""
    folder = tree_folder()
    return KeptTrees(folder) if folder.usable() else Trees()


def tree_folder() -> ObjectCache:
    """Where the trees are."""
    return ObjectCache(cache_folder() / "trees", LIMIT)


def tree_key(source: Source, declared: frozenset[str]) -> str:
    """A hash of all that the tree of a text depends on."""
    facts = (sys.version_info[:2], _parser(), sorted(declared), source.path, source.name, source.shared, source.lists)
    whole = (*facts, source.pieces, source.original, source.findings, sorted(source.absent))
    return sha256(f"{whole!r}\n{source.text}".encode(errors="surrogatepass")).hexdigest()


@cache
def _parser() -> str:
    """A hash of the code that makes trees."""
    digest = sha256()
    root = Path(__file__).parents[1]
    for folder in (root / "syntax", root / "base", root.parent / "iec"):
        for file in sorted(folder.iterdir()):
            if file.suffix in (".py", ".lark"):
                digest.update(file.name.encode() + b"\n" + file.read_bytes())
    return digest.hexdigest()


# ---- files ----


def written_tree(tree: KnownTree, source: Source) -> bytes | None:
    """The content of the file of a tree; None if it depends on other sources."""

    def reduced(found: Source) -> tuple[Callable[[], Source], tuple[()]]:
        if found is not source:
            raise pickle.PicklingError(found.path)
        return _this_source, ()

    to = BytesIO()
    pickler = pickle.Pickler(to, _FORMAT)
    pickler.dispatch_table = {Source: reduced, **dict.fromkeys(_enumerations(), _by_value)}
    try:
        pickler.dump(tree)
    except (pickle.PicklingError, RecursionError, TypeError, AttributeError):
        return None
    return to.getvalue()


def _by_value(member: Enum) -> tuple[type[Enum], tuple[Any]]:
    """How a member is written. Some versions of Python 3.11 name `getattr` instead, which is not read."""
    return type(member), (member.value,)


def _this_source() -> Source:
    """Stands for the source of a tree in its file. It is never called: `_Reader` puts the reader's source there."""
    raise NotImplementedError


def read_tree(data: bytes, source: Source) -> KnownTree | None:
    """The tree in a file; None if the file is not one that `written_tree` has made."""
    try:
        tree = _Reader(data, source).load()
    except Exception:  # whatever a damaged file leads to
        return None
    if (
        isinstance(tree, tuple)
        and len(tree) == 2
        and isinstance(tree[0], ParsedText)
        and isinstance(tree[1], list)
        and all(isinstance(error, tuple) and [type(part) for part in error] == [int, str, str] for error in tree[1])
    ):
        return tree
    return None


class _Reader(pickle.Unpickler):
    """Makes objects of the syntax tree only."""

    def __init__(self, data: bytes, source: Source) -> None:
        super().__init__(BytesIO(data))
        self._source = source

    def find_class(self, module: str, name: str) -> Any:
        """Returns a class of the syntax tree. Raises UnpicklingError for all else."""
        if (module, name) == (_this_source.__module__, _this_source.__name__):
            return lambda: self._source
        found = _classes().get((module, name))
        if found is None:
            raise pickle.UnpicklingError(f"{module}.{name}")
        return found


@cache
def _enumerations() -> list[type[Enum]]:
    return [c for c in _classes().values() if issubclass(c, Enum)]


@cache
def _classes() -> dict[tuple[str, str], type]:
    """The classes of which a tree is made, by module and name. Their constructors only set fields."""
    nodes = [c for c in vars(ast).values() if isinstance(c, type) and c.__module__ == ast.__name__]
    made = [c for c in nodes if issubclass(c, Enum) or is_dataclass(c)]
    return {(c.__module__, c.__name__): c for c in (ParsedText, LiteralKind, BitPattern, *made)}
