"""`plctool new` makes a whole project that compiles, or nothing."""

from __future__ import annotations

import errno
import os
import re
from pathlib import Path
from typing import Any

import pytest

from plctool import templates
from plctool.compiler import check_sources
from plctool.templates import TEMPLATES


@pytest.mark.parametrize("name", ["2pumps", "a-b", "größer", "a" * 64])
def test_new_project_has_a_name(tool: Any, name: str) -> None:
    done = tool("new", name)
    assert done.status == 2 and "letters, digits and _" in done.err
    assert not Path(name).exists()


@pytest.mark.parametrize("name", ["INT", "Test", "end_if", "TIME"])
def test_a_library_is_not_called_like_a_word_of_the_language(tool: Any, name: str) -> None:
    done = tool("new", f"libraries/{name}", "--template", "library")
    assert done.status == 2
    assert f"'{name}' cannot be the name of a library: it is a word of the language; choose another" in done.err
    assert not Path("libraries").exists()


@pytest.mark.parametrize("name", ["TON", "Main", "Scale", "THIS", "Default", "library", "a" * 63])
def test_other_names_do_for_a_library(tool: Any, name: str) -> None:
    assert tool("new", name, "--template", "library").status == 0
    assert check_sources([name]).diagnostics == []


def test_every_word_of_its_template_does_for_a_library_or_is_refused(tool: Any) -> None:
    """A variable hides the library whose name it has."""
    sources = (Path(templates.__file__).parent / "library").rglob("*.st")
    words = {word for source in sources for word in re.findall(r"[A-Za-z]\w*", source.read_text("utf-8"))}
    made = [word for word in sorted(words) if tool("new", word, "--template", "library").status == 0]
    assert [word for word in ("raw", "low", "Cyclic") if word not in made] == []
    assert [word for word in made if check_sources([word]).diagnostics] == []


@pytest.mark.parametrize("template", sorted({*TEMPLATES} - {"library"}))
def test_a_program_may_be_called_like_a_word_of_the_language(tool: Any, template: str) -> None:
    assert tool("new", "INT", "--template", template).status == 0
    assert check_sources(["INT"]).diagnostics == []


def test_new_project_replaces_nothing(tool: Any, scratch: Path) -> None:
    (scratch / "pump").mkdir()
    assert tool("new", "pump").status == 0
    done = tool("new", "pump")
    assert done.status == 2 and "pump exists already" in done.err


def everything(folder: Path) -> list[Path]:
    return sorted(folder.rglob("*"))


@pytest.mark.parametrize("failure", [OSError(errno.ENOSPC, "No space left on device"), KeyboardInterrupt()])
@pytest.mark.parametrize("there", ["", "plant", "plant/pump"])
def test_what_fails_on_the_way_leaves_nothing(
    tool: Any, scratch: Path, monkeypatch: pytest.MonkeyPatch, there: str, failure: BaseException
) -> None:
    (scratch / there).mkdir(parents=True, exist_ok=True)
    before = everything(scratch)
    replace, written = os.replace, 0

    def replace_until(*names: Any) -> None:
        nonlocal written
        if written == good:
            raise failure
        written += 1
        replace(*names)

    monkeypatch.setattr(os, "replace", replace_until)
    for good in range(4):
        written = 0
        done = tool("new", "plant/pump", "--template", "library")
        assert (done.status, written) == (130 if isinstance(failure, KeyboardInterrupt) else 2, good)
        assert everything(scratch) == before


def test_a_folder_that_cannot_be_made_leaves_nothing(tool: Any, scratch: Path) -> None:
    (scratch / "file").write_text("")
    done = tool("new", "file/deep/pump")
    assert done.status == 2 and "cannot be made: Not a directory" in done.err
    assert everything(scratch) == [scratch / "file"]
