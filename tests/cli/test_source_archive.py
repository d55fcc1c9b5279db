"""Source.zip of a device: any tool that may log in put it there."""

from __future__ import annotations

import io
import json
import struct
import tracemalloc
import zipfile
import zlib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from plctool.archives import MAX_FILES, ArchiveError, inflate, inflate_all
from plctool.cli.source_archive import Archive, unpacked
from plctool.errors import DeviceError

FILES = {"a.st": b"PROGRAM Main\n" * 50, "lib/b.st": b"x"}
FACTS = {"format": 1, "image_crc": 1, "build": ["a.st"]}


def packed(
    files: dict[str, bytes] = FILES, facts: Any = FACTS, method: int = zipfile.ZIP_DEFLATED, **changed: Any
) -> bytes:
    """An archive, with other facts."""
    out = io.BytesIO()
    text = json.dumps({**facts, **changed} if isinstance(facts, dict) else facts)
    with zipfile.ZipFile(out, "w", method) as archive:
        for name, data in {"plctool-source.json": text.encode(), **files}.items():
            archive.writestr(name, data)
    return out.getvalue()


def refusal(data: bytes) -> str:
    with pytest.raises(DeviceError) as refused:
        unpacked(data)
    assert "'plctool source put'" in refused.value.message
    return refused.value.message


def test_what_is_packed_is_unpacked(tmp_path: Path) -> None:
    archive = Archive(0x1234, ["plc.toml", "--checks", "all"], FILES)
    assert unpacked(archive.pack()) == archive
    assert len(archive.unpack(tmp_path / "new")) == 2


@pytest.mark.parametrize("crc", [float("inf"), float("nan"), -1, 1 << 32, True, "1", None, 1.5, [1]])
def test_a_crc_that_is_none_is_refused(crc: Any) -> None:
    assert "has no CRC of an image" in refusal(packed(image_crc=crc))


@pytest.mark.parametrize("build", ["a.st", [1], None, {"a": 1}])
def test_words_that_are_none_are_refused(build: Any) -> None:
    assert "has no words after 'plctool build'" in refusal(packed(build=build))


@pytest.mark.parametrize("facts", [[], "x", 5, None, {}, {"format": 2}])
def test_facts_that_are_none_are_refused(facts: Any) -> None:
    assert "has no plctool-source.json of format 1" in refusal(packed(facts=facts))


def test_facts_that_are_nested_or_no_json_are_refused() -> None:
    for text, words in (
        (b"[" * 100_000, "nested too deeply"),
        (b"{", "cannot be read"),
        (b"\xff\xfe\xfd", "cannot be"),
    ):
        out = io.BytesIO()
        with zipfile.ZipFile(out, "w") as archive:
            archive.writestr("plctool-source.json", text)
        assert words in refusal(out.getvalue())


@pytest.mark.parametrize(
    "name",
    ["../x.st", "/x.st", "C:/x.st", "a\\..\\x.st", "a/../../x", ".git/config", "a/.GIT/hooks/x", "a:b", "\x1b[31m"],
)
def test_a_file_outside_and_settings_of_git_are_refused(name: str) -> None:
    found = refusal(packed({name: b"x"}))
    assert "leads out of it" in found or "control characters" in found


def test_a_symbolic_link_is_refused() -> None:
    out = io.BytesIO(packed())
    with zipfile.ZipFile(out, "a") as archive:
        link = zipfile.ZipInfo("x.st")
        link.external_attr = 0o120777 << 16
        archive.writestr(link, "/etc/passwd")
    assert "leads out of it" in refusal(out.getvalue())


@pytest.mark.parametrize("second", ["A.st", "./a.st"])
def test_two_files_of_one_name_are_refused(second: str) -> None:
    assert "twice" in refusal(packed({**FILES, second: b"x"}))


def test_a_name_that_is_a_file_and_a_folder_is_refused(tmp_path: Path) -> None:
    assert "as a file and as a folder" in refusal(packed({"a": b"x", "A/b.st": b"y"}))


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_another_compression_is_refused_before_it_is_unpacked(method: int) -> None:
    assert "in the compression" in refusal(packed(method=method))


@pytest.mark.parametrize("method", [zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2])
def test_a_bomb_that_states_a_small_size_takes_no_memory(method: int) -> None:
    out = io.BytesIO(packed())
    with zipfile.ZipFile(out, "a", method) as archive, archive.open("bomb.st", "w") as file:
        for _ in range(100):
            file.write(bytes(1 << 20))
    bomb = bytearray(out.getvalue())
    struct.pack_into("<I", bomb, bomb.rindex(b"PK\1\2") + 24, 1000)
    tracemalloc.start()
    try:
        refusal(bytes(bomb))
        assert tracemalloc.get_traced_memory()[1] < 16 << 20
    finally:
        tracemalloc.stop()


def test_a_list_of_too_many_files_is_refused_before_it_is_read() -> None:
    data = b"PK\1\2" * (MAX_FILES + 1)
    assert f"has {MAX_FILES + 1} files, of at most {MAX_FILES}" in refusal(data)


@given(st.lists(st.tuples(st.integers(0, 10_000), st.integers(0, 255)), min_size=1, max_size=4))
def test_a_damaged_archive_is_read_or_refused(changes: list[tuple[int, int]]) -> None:
    data = bytearray(packed())
    for at, value in changes:
        data[at % len(data)] = value
    try:
        unpacked(bytes(data))
    except DeviceError as error:
        assert error.code == "bad-source"


def test_a_stream_has_no_more_bytes_than_it_may() -> None:
    data = zlib.compress(bytes(1000))
    assert inflate(data, 1000) == bytes(1000)
    assert inflate_all([data, data], 2000) == [bytes(1000)] * 2
    for wrong in (
        lambda: inflate(data, 999),
        lambda: inflate_all([data, data], 1999),
        lambda: inflate(data[:-1], 1000),
    ):
        with pytest.raises(ArchiveError):
            wrong()
    with pytest.raises(ArchiveError, match="cannot be unpacked"):
        inflate(b"xxxx", 10)
