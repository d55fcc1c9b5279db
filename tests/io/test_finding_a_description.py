"""Which description a program has does not depend on how its sources are written in the command."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from plctool.errors import UsageError
from plctool.io.description import find_description


@pytest.fixture(autouse=True)
def folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """a/ and b/ have a source and a description each; a/more/ a source."""
    for name in ("a/more", "b"):
        (tmp_path / name).mkdir(parents=True)
    for name in ("a/pump.st", "a/more/valve.st", "b/tank.st"):
        (tmp_path / name).write_text("")
    for name in ("a/pump.io.toml", "b/tank.io.toml"):
        (tmp_path / name).write_text("")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def find(*sources: str) -> Path | None:
    return find_description([Path(source) for source in sources])


@pytest.mark.parametrize("other", ["a/pump.st", "./a/../a", "a/more/..", "ABSOLUTE", "link"])
def test_one_folder_by_two_names_has_one_description(folders: Path, other: str) -> None:
    os.symlink("a", "link")
    found = find("a", str(folders / "a") if other == "ABSOLUTE" else other)
    assert found is not None
    assert found.samefile("a/pump.io.toml")


def test_folder_that_is_the_current_one_is_searched(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir("a")
    assert find("pump.st") == find(".") == Path("pump.io.toml")


def test_description_with_the_name_of_a_source_is_that_beside_it() -> None:
    Path("a/tank.io.toml").write_text("")
    assert find("a/pump.st", "a/more") == Path("a/pump.io.toml")
    Path("b/tank.io.toml").unlink()
    assert find("a/pump.st", "b/tank.st") == Path("a/pump.io.toml")  # a/tank.io.toml belongs to no b/tank.st


def test_descriptions_of_several_sources_are_not_clear() -> None:
    with pytest.raises(UsageError, match="choose one with --io"):
        find("a/pump.st", "b/tank.st")


def test_folder_with_the_name_of_a_description_is_none() -> None:
    Path("a/x.io.toml").mkdir()
    assert find("a") == Path("a/pump.io.toml")
