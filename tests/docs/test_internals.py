"""docs/internals.md names files and functions; each of them exists."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest
from prose import ROOT, outside_code, project_files

INTERNALS = ROOT / "docs" / "internals.md"
FILE = re.compile(r"[\w./-]+\.(?:c|h|S|py|st|sh|md|build|ini|lark)|(?:[\w.-]+/)+[\w.-]+/?")
FUNCTION = re.compile(r"((?:\w+\.)*)(\w+)\(\)")
# In C a definition stands at the start of a line; macros and inline functions count.
DEFINED = r"^(?:[A-Za-z_][\w *]*?\b{0}\(|#define {0}\b)"
# Paths of the system, and a file that the reader is to write.
ELSEWHERE = ("/", "link/NAME.py", "app.", "build", "$")


@cache
def files() -> dict[str, str]:
    """Each file of the repository and its text; "" for one that is not a source."""
    sources = (".c", ".h", ".py")
    return {name: (ROOT / name).read_text() if name.endswith(sources) else "" for name in project_files()}


def words() -> list[str]:
    """What stands between backticks, outside of blocks."""
    text = "\n".join(line for _, line in outside_code(INTERNALS.read_text()))
    return sorted(set(re.findall(r"`([^`\n]+)`", text)))


def file_exists(path: str) -> bool:
    """Of a path as internals.md shortens them: a file or folder that ends so."""
    end = path.strip("/")
    return any(f"/{name}".endswith(f"/{end}") or f"/{end}/" in f"/{name}" for name in files())


def function_exists(owner: str, name: str) -> bool:
    """Of `name()`, or of `module.name()` or `Class.name()`."""
    for path, text in files().items():
        if owner and path.endswith(".py") and (Path(path).stem == owner or re.search(rf"^class {owner}\b", text, re.M)):
            if re.search(rf"^ *def {name}\(", text, re.M):
                return True
        elif not owner and re.search(rf"^ *def {name}\(" if path.endswith(".py") else DEFINED.format(name), text, re.M):
            return True
    return False


@pytest.mark.parametrize("path", [w for w in words() if FILE.fullmatch(w) and not w.startswith(ELSEWHERE)])
def test_every_file_exists(path: str) -> None:
    assert file_exists(path), f"{path}: there is no such file"


@pytest.mark.parametrize("call", [w for w in words() if FUNCTION.fullmatch(w)])
def test_every_function_exists(call: str) -> None:
    owner, name = FUNCTION.fullmatch(call).groups()  # type: ignore[union-attr]
    assert function_exists(owner.removesuffix("."), name), f"{call}: there is no such function"


def test_what_does_not_exist_is_found() -> None:
    assert not file_exists("link/NAME.py")
    assert not function_exists("", "no_such_function")
    assert not function_exists("Plc", "resolve")
    assert file_exists("cli/main.py") and function_exists("Plc", "start") and function_exists("", "SysTimeGetNs")
