"""Compiled code is kept between builds: images are the same with and without it, and only what changed is compiled."""

from __future__ import annotations

import os
import random
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest

from plctool.compiler import build, program_files
from plctool.compiler.codegen import emit, objects
from plctool.compiler.codegen.lower_unit import Options
from plctool.compiler.codegen.object_cache import ObjectCache, cache_of_user
from plctool.compiler.codegen.objects import object_key
from plctool.compiler.codegen.partition import Part
from plctool.compiler.front import Trees
from plctool.compiler.kept.kept_build import KeptBuild
from plctool.compiler.sources.request import BuildRequest
from plctool.compiler.syntax.diagnostics import CompileError
from plctool.image.targets import find_target

pytestmark = pytest.mark.skipif(not hasattr(os, "getuid"), reason="files have no owner here")

KEY = "5" * 64
BLOCKS = 10
BLOCK = """FUNCTION_BLOCK Block{n}
VAR_INPUT limit : INT := {n}; END_VAR
VAR_OUTPUT sum : DINT; name : STRING; END_VAR
VAR i : INT; t : TON; END_VAR
FOR i := 0 TO limit DO
    sum := sum + i * {n};
END_FOR;
t(IN := sum > 100, PT := T#{n}s);
IF t.Q THEN
    name := CONCAT('block', INT_TO_STRING(limit));
END_IF;
END_FUNCTION_BLOCK
"""


def program() -> list[str]:
    """The lines of a program of some blocks that are alike."""
    declared = "".join(f"b{n} : Block{n};\n" for n in range(BLOCKS))
    calls = "".join(f"b{n}(limit := {n});\n" for n in range(BLOCKS))
    blocks = "".join(BLOCK.format(n=n) for n in range(BLOCKS))
    return f"{blocks}PROGRAM Main\nVAR\n{declared}END_VAR\n{calls}END_PROGRAM\n".splitlines(keepends=True)


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ObjectCache:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return ObjectCache()


@pytest.fixture
def small_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Small programs are cut as large ones are, and compiled in this process."""
    monkeypatch.setattr("plctool.compiler.codegen.partition._WHOLE", 40)
    monkeypatch.setattr("plctool.compiler.codegen.partition._GROUP", 100)
    monkeypatch.setattr("plctool.compiler.codegen.partition._COPIED", 30)
    monkeypatch.setattr("os.cpu_count", lambda: 1)


@pytest.fixture
def compiled(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Part]]:
    """The parts that LLVM compiles."""
    found: list[Part] = []
    original = emit.emit_object

    def noted(part: Part, options: Options) -> bytes:
        found.append(part)
        return original(part, options)

    monkeypatch.setattr(emit, "emit_object", noted)
    monkeypatch.setattr("plctool.compiler.codegen.memory_functions._made", {})
    yield found


def image_of(folder: Path, lines: list[str], *, cache: bool, kept: KeptBuild | None = None) -> bytes:
    source = folder / "main.st"
    source.write_text("".join(lines))
    return build(BuildRequest(program_files([source]), cache=cache), kept=kept).image


def edited(lines: list[str], rng: random.Random) -> list[str]:
    """A line is doubled, left out or moved, or a number in it is another one."""
    at = rng.randrange(len(lines))
    kind = rng.randrange(4)
    if kind == 0:
        return [*lines[:at], lines[at], *lines[at:]]
    if kind == 1:
        return [*lines[:at], *lines[at + 1 :]]
    if kind == 2:
        return [*lines[:at], "\n", *lines[at:]]
    return [*lines[:at], lines[at].replace("100", str(rng.randrange(1000))).replace("0 TO", "1 TO"), *lines[at + 1 :]]


@pytest.mark.usefixtures("cache", "small_parts")
def test_image_is_the_same_with_and_without_the_cache_after_each_of_many_edits(tmp_path: Path) -> None:
    rng, lines, builds, kept = random.Random(1), program(), 0, KeptBuild(Trees())
    while builds < 4:
        changed = edited(lines, rng)
        try:
            image = image_of(tmp_path, changed, cache=True, kept=kept)
        except CompileError:
            continue
        builds += 1
        assert image == image_of(tmp_path, changed, cache=False)
        lines = changed


@pytest.mark.usefixtures("cache", "small_parts")
def test_changed_statement_has_its_own_group_compiled_only(tmp_path: Path, compiled: list[Part]) -> None:
    lines = program()
    image_of(tmp_path, lines, cache=True)
    parts = len(compiled)
    assert parts > 6
    compiled.clear()
    image_of(tmp_path, lines, cache=True)
    assert not compiled
    at = next(n for n, line in enumerate(lines) if "i * 7;" in line)
    image_of(tmp_path, [*lines[:at], lines[at].replace("7", "8"), *lines[at + 1 :]], cache=True)
    assert len(compiled) == 1
    assert "@st.Block7(" in compiled[0].text


@pytest.mark.usefixtures("cache")
def test_unchanged_program_is_built_without_llvm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    image = image_of(tmp_path, program(), cache=True)
    monkeypatch.setattr(objects, "_compiled", lambda parts, _: [] if not parts else pytest.fail("LLVM runs"))
    assert image_of(tmp_path, program(), cache=True) == image


def test_key_changes_with_all_that_code_depends_on(monkeypatch: pytest.MonkeyPatch) -> None:
    part, options = Part("text"), Options(find_target("cortex-m3"))
    keys = {
        object_key(part, options),
        *(object_key(p, options) for p in (Part("texts"), Part("text", True), Part("text", True, True))),
        *(
            object_key(part, replace(options, **changed))
            for changed in ({"target": find_target("cortex-m4f")}, {"opt_level": 3}, {"size": True})
        ),
    }
    monkeypatch.setattr("llvmlite.__version__", "0.0")
    assert len(keys | {object_key(part, options)}) == 8


def test_object_is_found_again(cache: ObjectCache) -> None:
    assert cache.get(KEY) is None
    cache.put(KEY, b"object")
    assert cache.get(KEY) == b"object"
    assert cache.get("6" * 64) is None
    assert cache.size() == (1, len(b"object") + 32)


def file_of(cache: ObjectCache) -> Path:
    return cache.folder / KEY[0] / KEY


def damage(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-1] + b"!")


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:20])


def lend(path: Path) -> None:
    path.chmod(0o620)


def link_to_another(path: Path) -> None:
    path.rename(path.with_name("other"))
    path.symlink_to("other")


def pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path, 0o600)


def of_another_key(path: Path) -> None:
    ObjectCache(path.parent.parent).put("57" + KEY[2:], b"another")
    path.with_name("57" + KEY[2:]).rename(path)


@pytest.mark.parametrize("change", [damage, cut, lend, link_to_another, pipe, of_another_key], ids=lambda c: c.__name__)
def test_file_that_is_damaged_or_not_the_users_alone_is_not_used(cache: ObjectCache, change) -> None:
    cache.put(KEY, b"object")
    change(file_of(cache))
    assert cache.get(KEY) is None
    cache.put(KEY, b"object")
    assert cache.get(KEY) == b"object"


@pytest.mark.parametrize("mode", [0o750, 0o707, 0o777], ids=oct)
def test_folder_that_others_may_use_is_not_used(cache: ObjectCache, mode: int) -> None:
    cache.put(KEY, b"object")
    for folder in (file_of(cache).parent, cache.folder):
        folder.chmod(mode)
        assert cache.get(KEY) is None
        cache.put("5" + "4" * 63, b"object")
        assert not (folder / ("5" + "4" * 63)).exists()
        folder.chmod(0o700)
    cache.folder.chmod(mode)
    assert cache_of_user() is None


def test_folder_of_another_user_is_not_used(cache: ObjectCache, monkeypatch: pytest.MonkeyPatch) -> None:
    cache.put(KEY, b"object")
    monkeypatch.setattr("os.geteuid", lambda: 12345)
    assert cache.get(KEY) is None
    assert cache_of_user() is None


def test_folder_that_cannot_be_made_costs_nothing_but_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    ObjectCache().put(KEY, b"object")
    assert ObjectCache().get(KEY) is None
    assert image_of(tmp_path, ["PROGRAM Main\n", "END_PROGRAM\n"], cache=True)


def test_oldest_objects_make_room(tmp_path: Path) -> None:
    cache = ObjectCache(tmp_path / "cache", limit=16 * 1000)
    keys = [f"5{n:063}" for n in range(4)]
    for age, key in enumerate(keys[:3]):
        cache.put(key, bytes(250))
        os.utime(cache.folder / "5" / key, (1000 + age, 1000 + age))
    assert cache.get(keys[0]) is not None  # so it is no longer the oldest
    cache.put(keys[3], bytes(250))
    assert [cache.get(key) is not None for key in keys] == [True, False, True, True]
    cache.put(keys[1], bytes(2000))
    assert cache.get(keys[1]) is None  # too large for its share


def test_builds_at_the_same_time_find_whole_objects_only(cache: ObjectCache) -> None:
    data = bytes(range(256)) * 100

    def work(_: int) -> bool:
        cache.put(KEY, data)
        return cache.get(KEY) in (data, None)

    with ThreadPoolExecutor(4) as pool:
        assert all(pool.map(work, range(60)))
    cache.put(KEY, data)
    assert cache.get(KEY) == data
    assert cache.clear()[0] == 1
    assert cache.get(KEY) is None
