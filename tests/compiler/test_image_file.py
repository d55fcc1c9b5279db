"""The image file: what is built can be taken apart again, and nothing that is damaged is taken for an image."""

from __future__ import annotations

import zlib
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from shares import examples

from plctool.compiler import compile_sources
from plctool.core import ffi, lib
from plctool.errors import UsageError
from plctool.image.file import (
    ApplicationInfo,
    ExternalFunction,
    Image,
    ImageTask,
    KeptVariable,
    _parse_functions,
    build_image,
    describe_image,
    parse_image,
)

SAMPLE = Image(
    device_id=int(lib.TARGET_ID_X86_64_LINUX),
    code=bytes(range(100)),
    areas={0: 48, 1: 12, 3: 4},
    functions={1: 16},
    externals=[ExternalFunction("iecraise", 0x703B892E, 0x10000, 0), ExternalFunction("sin", 1, 0x20003, 8)],
    tasks=[
        ImageTask("fast", 0, 1, 1000, 0, 5000, 2),
        ImageTask("on_event", 1, 5, 0, 32, event=(0, 12)),
    ],
    info=ApplicationInfo("Pump", "Ada", "1.2", "two pumps", "plctool", 1_700_000_000),
    kept=[
        KeptVariable(b"\0\1\2\3\4\5\6\7", 4, 2, True, 2, 1, 0, is_run=False),
        KeptVariable(b"\1\1\2\3\4\5\6\7", 6, 2, False, 3, 2, -5, is_run=True),
    ],
)


def with_crc(data: bytearray) -> bytes:
    data[100:104] = bytes(4)
    data[100:104] = zlib.crc32(data).to_bytes(4, "little")
    return bytes(data)


def test_what_is_built_is_read_again() -> None:
    data = build_image(SAMPLE)
    assert replace(parse_image(data), crc=0) == SAMPLE


names = st.text(st.characters(min_codepoint=33, max_codepoint=126), min_size=1, max_size=31)
offsets = st.integers(0, 99)
hashes, places, halves = st.binary(min_size=8, max_size=8), st.integers(0, 2**28 - 1), st.integers(0, 2**16 - 1)
single = st.sampled_from((1, 2, 4, 8)).flatmap(
    lambda size: st.builds(
        KeptVariable, hashes, places, st.just(size), st.booleans(), st.just(size), st.just(1), st.just(0),
        st.just(False),
    )
)  # fmt: skip
run = st.builds(
    KeptVariable, hashes, places, halves, st.booleans(), halves, st.integers(0, 2**32 - 1),
    st.integers(-(2**31), 2**31 - 1), st.just(True),
)  # fmt: skip


@examples(60)
@given(
    st.builds(
        Image,
        device_id=st.integers(0, 2**32 - 1),
        code=st.binary(min_size=100, max_size=300),
        areas=st.dictionaries(st.integers(0, 4), st.integers(1, 2**32 - 1)),
        functions=st.dictionaries(st.integers(0, 5), offsets),
        externals=st.lists(
            st.builds(ExternalFunction, names, st.integers(0, 2**32 - 1), st.integers(0, 2**32 - 1), st.integers(0,
            999))
        ),
        tasks=st.lists(
            st.builds(
                ImageTask, names, st.integers(0, 3), st.integers(0, 31), st.integers(0, 2**32 - 1), offsets,
                st.integers(0, 2**32 - 1), st.integers(0, 2**16 - 1), st.none() | st.tuples(st.integers(0, 4), offsets),
            )
        ),
        info=st.builds(ApplicationInfo, names, names, names, names, names, st.integers(0, 2**32 - 1)),
        kept=st.lists(single | run),
    )
)  # fmt: skip
def test_any_image_is_read_as_it_was_built(image: Image) -> None:
    data = build_image(image)
    assert replace(parse_image(data), crc=0) == image
    header = ffi.new("CDL_HEADER *")
    ffi.buffer(header)[:] = data[:104]
    assert header.code.offset % lib.APP_CODE_ALIGN == 0
    segments = ("application_info", "area_table", "function_table", "external_function_table", "blob")
    assert all(getattr(header, name).offset % 4 == 0 for name in segments)


def test_the_crc_is_that_of_zlib_with_its_own_word_zero() -> None:
    data = bytearray(build_image(SAMPLE))
    crc = int.from_bytes(data[100:104], "little")
    data[100:104] = bytes(4)
    assert zlib.crc32(data) == crc == parse_image(build_image(SAMPLE)).crc


@examples(100)
@given(st.data())
def test_every_changed_bit_is_refused(data: st.DataObject) -> None:
    image = bytearray(build_image(SAMPLE))
    at = data.draw(st.integers(0, len(image) * 8 - 1))
    image[at // 8] ^= 1 << at % 8
    with pytest.raises(UsageError):
        parse_image(bytes(image))


def test_every_truncated_image_is_refused() -> None:
    image = build_image(SAMPLE)
    for length in range(len(image)):
        with pytest.raises(UsageError, match="not a valid application image"):
            parse_image(image[:length])


@examples(200)
@given(st.lists(st.tuples(st.integers(0, 103), st.integers(0, 255)), min_size=1, max_size=4))
def test_a_damaged_header_with_a_good_checksum_never_crashes(changes: list[tuple[int, int]]) -> None:
    image = bytearray(build_image(SAMPLE))
    for at, value in changes:
        image[at] = value
    try:
        parse_image(with_crc(image))
    except UsageError as error:
        assert error.message.endswith("build it again.")


@examples(200)
@given(st.data())
def test_damaged_tables_with_a_good_checksum_never_crash(data: st.DataObject) -> None:
    image = bytearray(build_image(SAMPLE))
    for _ in range(data.draw(st.integers(1, 4))):
        image[data.draw(st.integers(104, len(image) - 101))] = data.draw(st.integers(0, 255))
    try:
        parse_image(with_crc(image))
    except UsageError as error:
        assert error.message.endswith("build it again.")


def test_an_entry_outside_the_code_is_refused() -> None:
    for image in (replace(SAMPLE, functions={1: 100}), replace(SAMPLE, tasks=[ImageTask("t", 0, 0, 1, 100)])):
        with pytest.raises(UsageError, match="outside the code"):
            parse_image(build_image(image))


def test_entries_of_functions_that_no_device_knows_are_left_out() -> None:
    table = ffi.new("POU_REF[]", lib.CDL_FUNCTION_COUNT + 2)
    for entry in table:
        entry.area, entry.offset = lib.APP_AREA_CODE, 8
    found = _parse_functions(bytes(ffi.buffer(table)), code_size=100)
    assert list(found) == list(range(lib.CDL_FUNCTION_COUNT))


def test_description_is_ready_for_json() -> None:
    described = describe_image(build_image(SAMPLE))
    assert described["target"] == "x86_64-linux"
    assert described["info"]["date"] == "2023-11-14T22:13:20Z"
    assert described["tasks"][1]["kind"] == "event"
    assert described["externals"][1] == {"name": "sin", "signature": "00000001", "version": "2.3"}
    assert {a["name"]: a["size"] for a in described["areas"]} == {"data": 48, "retain": 12, "output": 4}


def test_properties_follow_the_strings_as_the_device_reads_them(tmp_path: Path) -> None:
    """The bytes are those of tests/c/test_app_properties.c."""
    (tmp_path / "main.st").write_text("PROGRAM Main END_PROGRAM")
    (tmp_path / "plc.toml").write_text(
        "sources = 'main.st'\n[information]\ntitle = 'Pump station'\n[information.properties]\n"
        "gain = 1.5\ntested = true\nhw = { version = '2.0.1' }\nlast = 'x'\n"
    )
    properties = (
        b"TTitle\0\0Pump station\0\0\0\0Ngain\0\0\0\0\0\0\0\0\0\xf8\x3fBtested\0\1\0\0\0Vhw\0"
        b"2.0.1.0\0Tlast\0\0\0x\0\0\0"
    )
    image = compile_sources([tmp_path]).image
    assert properties in image
    assert parse_image(image).info.description == ""
