"""The parser of editors/tree-sitter-iecst, compiled for the tests that use it."""

from __future__ import annotations

import ctypes
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

from tree_sitter import Language, Node, Parser, Tree

GRAMMAR = Path(__file__).resolve().parents[2] / "editors" / "tree-sitter-iecst"


def compiled(folder: Path) -> Path:
    """Compiles the parser as editors do: no tool but a C compiler."""
    library = folder / "iecst.so"
    sources = [GRAMMAR / "src" / "parser.c", GRAMMAR / "src" / "scanner.c"]
    options = ["-shared", "-fPIC", "-O1", "-std=c11", "-Wall", "-Wextra", "-Werror", f"-I{GRAMMAR / 'src'}"]
    subprocess.run([os.environ.get("CC", "cc"), *options, *map(str, sources), "-o", str(library)], check=True)
    return library


def language(library: Path) -> Language:
    """Loads a compiled parser."""
    function = ctypes.CDLL(str(library)).tree_sitter_iecst
    function.restype = ctypes.c_void_p
    capsule = ctypes.pythonapi.PyCapsule_New
    capsule.restype = ctypes.py_object
    capsule.argtypes = (ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p)
    return Language(capsule(function(), b"tree_sitter.Language", None))


def parsed(language: Language, text: str) -> Tree:
    """The tree of a text; offsets in it are those of its UTF-8 form."""
    return Parser(language).parse(text.encode())


def mistakes(node: Node) -> Iterator[str]:
    """Yields what the parser could not read, with line and column."""
    if node.is_error or node.is_missing:
        line, column = node.start_point
        said = f"missing {node.type}" if node.is_missing else repr((node.text or b"").decode()[:60])
        yield f"{line + 1}:{column + 1}: {said}"
    elif node.has_error:
        for child in node.children:
            yield from mistakes(child)


def walk(node: Node) -> Iterator[Node]:
    """Yields a node and all in it."""
    waiting = [node]
    while waiting:
        yield (last := waiting.pop())
        waiting += last.children
