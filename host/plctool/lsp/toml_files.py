"""Diagnostics and completion in plc.toml, library.toml, device.toml and NAME.io.toml.

What may be written is asked of those who read these files: a key or value that nothing knows is put in place of what
is being written, and the message about it lists what is known.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path

from lsprotocol import types as lsp

from plctool.compiler.sources.library_files import library_in
from plctool.compiler.sources.project import project_in
from plctool.compiler.syntax.diagnostics import CompileError, Diagnostic
from plctool.errors import PlcError
from plctool.io.description import SUFFIX, device_in, read_description
from plctool.io.mistakes import CODE, Mistakes
from plctool.lsp.items import Kind
from plctool.lsp.names import Names
from plctool.project import LIBRARY_FILE, PROJECT_FILE

DEVICE_FILE = "device.toml"
_UNKNOWN = "zzqqjx"
_LINE = re.compile(r"^(?P<indent>\s*)(?:(?P<table>\[+)(?P<name>[^\]]*)|(?P<key>[\w.-]*)(?P<is>\s*=\s*(?P<value>.*))?)$")
_KEYS = re.compile(rf"there is no '{_UNKNOWN}' here; .*? has (?P<all>.+)$")
_CHOICES = re.compile(rf"'{_UNKNOWN}'(?:; it can be|; the names are) (?P<all>.+)$")
_QUOTED = re.compile(r"\"(\w+)\"")
_PATHS = ("sources", "libraries", "device", "io", "eds")
_FLAGS = re.compile(r"has to be true or false")


def is_toml(path: str) -> bool:
    """True for a file that is answered here."""
    name = Path(path).name
    return name in (PROJECT_FILE, LIBRARY_FILE, DEVICE_FILE) or name.endswith(SUFFIX)


def diagnostics(path: str, text: str) -> list[Diagnostic]:
    """Returns what is wrong with a file."""
    file = Path(path)
    try:
        if file.name == PROJECT_FILE:
            project_in(file, text)
        elif file.name == LIBRARY_FILE:
            library_in(file.parent, text)
        elif file.name == DEVICE_FILE:
            return _of_mistakes(path, device_in(path, text)[1])
        else:
            return _of_mistakes(path, read_description(path, text).mistakes)
    except CompileError as error:
        return [d for d in error.diagnostics if d.file == path]
    except PlcError as error:
        return [Diagnostic(path, 1, 1, "error", "toml", error.message)]
    return []


def _of_mistakes(path: str, mistakes: Mistakes) -> list[Diagnostic]:
    found = (m for m in mistakes.found if m.pos.file == path)
    return [Diagnostic(m.pos.file, m.pos.line, m.pos.column, m.severity, CODE, m.message) for m in found]


# ---- completion ----


def completion(path: str, text: str, position: lsp.Position, names: Names | None) -> lsp.CompletionList:
    """Returns keys, tables or values that may stand at a position. `names`: of the program, for channels."""
    lines = text.split("\n")
    if position.line >= len(lines):
        return lsp.CompletionList(False, [])
    line = lines[position.line]
    before = line[: position.character]
    match = _LINE.match(before)
    if match is None or "#" in before:
        return lsp.CompletionList(False, [])

    def messages(instead: str) -> list[str]:
        changed = [*lines[: position.line], instead, *lines[position.line + 1 :]]
        return [d.message for d in diagnostics(path, "\n".join(changed))]

    if match["table"] is not None:
        found = [(word, lsp.CompletionItemKind.Module, word) for word in _tables(messages, match["name"])]
        typed = match["name"].rpartition(".")[2]
    elif match["is"] is None:
        found = [(word, lsp.CompletionItemKind.Property, f"{word} = ") for word in _keys(messages(f"{_UNKNOWN} = 0"))]
        typed = match["key"]
    else:
        typed = match["value"].lstrip().rpartition("[")[2].rpartition(",")[2].strip().removeprefix('"')
        values = _values(path, messages, match["key"], names, '"' in match["value"])
        found = [(word, lsp.CompletionItemKind.Value, new) for word, new in values]
    return _listed(found, typed, position)


def _listed(
    found: list[tuple[str, lsp.CompletionItemKind, str]], typed: str, position: lsp.Position
) -> lsp.CompletionList:
    start = lsp.Position(position.line, position.character - len(typed))
    wanted = typed.casefold()
    return lsp.CompletionList(
        False,
        [
            lsp.CompletionItem(word, kind=kind, text_edit=lsp.TextEdit(lsp.Range(start, position), new))
            for word, kind, new in found
            if wanted in word.casefold()
        ],
    )


def _words(text: str) -> list[str]:
    return [word for part in text.split(", ") for word in re.split(r" (?:or|and) ", part) if word]


def _keys(messages: list[str]) -> list[str]:
    """The keys that a table has, by the message about one that nothing knows."""
    return [word for message in messages if (match := _KEYS.search(message)) for word in _words(match["all"])]


def _tables(messages: Callable[[str], list[str]], name: str) -> list[str]:
    """The tables that may stand in the file, or in the table before the last point."""
    outer = name.rpartition(".")[0]
    head = f"[{outer}]\n{_UNKNOWN} = 0" if outer else f"[{_UNKNOWN}]"
    return _keys(messages(head))


def _values(
    path: str, messages: Callable[[str], list[str]], key: str, names: Names | None, quoted: bool
) -> Iterator[tuple[str, str]]:
    """The values that a key may have: each as it is shown, and as it is inserted."""

    def shown(word: str) -> tuple[str, str]:
        return word, word if quoted else f'"{word}"'

    if key in _PATHS:
        yield from (shown(word) for word in _files(Path(path).parent))
        return
    said = messages(f'{key} = "{_UNKNOWN}"') + messages(f'{key} = ["{_UNKNOWN}"]')
    choices = [word for m in said if (match := _CHOICES.search(m)) for word in _words(match["all"])]
    choices += [word for m in said if f"{key} can be" in m for word in _QUOTED.findall(m)]
    if choices:
        yield from (shown(word) for word in dict.fromkeys(choices))
    elif any(_FLAGS.search(m) for m in messages(f"{key} = 0")):
        yield from (("true", "true"), ("false", "false"))
    elif names is not None and path.endswith(SUFFIX):
        yield from (shown(word) for word in _variables(names))


def _files(folder: Path) -> list[str]:
    try:
        found = sorted(folder.iterdir())
    except OSError:
        return []
    return [f.name for f in found[:200] if not f.name.startswith(".") and f.name not in (PROJECT_FILE, LIBRARY_FILE)]


def _variables(names: Names) -> Iterator[str]:
    """The variables that a channel may be connected to."""
    for unit in names.units.values():
        if unit.kind is Kind.PROGRAM:
            yield from (f"{unit.name}.{v.name}" for v in unit.inner.values() if v.kind is Kind.VARIABLE)
    for variable in names.globals.values():
        yield variable.name
