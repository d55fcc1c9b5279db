"""BinTag: samples of the specification, alignment, and a reader that believes nothing."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from plctool.errors import LinkError
from plctool.link import bintag

DATA_IDS = st.integers(0, 0x7F) | st.sampled_from([0x100, 0xFF7F])
CONTAINER_IDS = st.sampled_from([0x81, 0x82, 0xA0, 0xFF82])
TAGS = st.recursive(
    st.builds(bintag.Tag, DATA_IDS, st.binary(max_size=300), st.sampled_from([0, 2])),
    lambda inner: st.builds(bintag.Tag, CONTAINER_IDS, st.lists(inner, max_size=4).map(tuple)),
    max_leaves=12,
)


def as_tree(tags: Any) -> list[tuple[int, Any]]:
    """Ids and contents of tags to write or of tags that were read."""
    if isinstance(tags, bintag.Tags):
        return [(i, as_tree(c) if isinstance(c, bintag.Tags) else c) for i, c in tags]
    return [(t.id, t.content if isinstance(t.content, bytes) else as_tree(t.content)) for t in tags]


@given(st.lists(TAGS, max_size=5), st.booleans())
def test_trees_survive_encoding(tags: list[bintag.Tag], aligned: bool) -> None:
    assert as_tree(bintag.decode(bintag.encode(tags, aligned))) == as_tree(tags)


FLAT_TAGS = st.builds(bintag.Tag, DATA_IDS, st.binary(min_size=1, max_size=20), st.sampled_from([0, 2]))


@given(st.lists(FLAT_TAGS, max_size=8))
def test_contents_are_aligned(tags: list[bintag.Tag]) -> None:
    encoded, at = bintag.encode(tags), 0
    for tag in tags:
        _, at = bintag._read_varint(encoded, at)
        length, at = bintag._read_varint(encoded, at)
        assert at % 4 == tag.shift
        at += length


def test_the_header_of_the_capture_is_written_for_twelve_aligned_bytes() -> None:
    assert bintag.encode([bintag.u32(0x01, 1, 2, 3)])[:4] == bytes.fromhex("018C8000")


def test_a_two_byte_value_takes_four_bytes() -> None:
    assert bintag.encode([bintag.u16(0x22, 1)]) == bytes.fromhex("22020100")


@pytest.mark.parametrize(
    ("header", "tag", "length"),
    [("018C8000", 0x01, 12), ("0A9280808000", 0x0A, 18), ("81018802", 0x81, 264), ("82FF0304", 0xFF82, 4)],
)
def test_headers_of_the_specification_are_read(header: str, tag: int, length: int) -> None:
    encoded = bytes.fromhex(header)
    read_tag, at = bintag._read_varint(encoded, 0)
    read_length, at = bintag._read_varint(encoded, at)
    assert (read_tag, read_length, at) == (tag, length, len(encoded))


def test_text_ends_with_nul_and_padding() -> None:
    assert bintag.encode([bintag.text(0x10, "abc"), bintag.text(0x11, "abcd")])[-8:] == b"abcd\0\0\0\0"


@pytest.mark.parametrize(
    "message",
    [
        "01",  # length missing
        "0105AABB",  # longer than the message
        "01808080808080808000",  # length of nine groups
        "FFFFFFFFFFFFFFFFFF01",  # id of nine groups
        "0184",  # length cut
        "810103010500",  # element longer than its container
        "81018080",  # nothing where the length should go on
    ],
)
def test_broken_messages_are_refused(message: str) -> None:
    with pytest.raises(LinkError):
        bintag.decode(bytes.fromhex(message))


def test_nesting_is_bounded() -> None:
    message = b""
    for _ in range(9):
        message = bintag.encode([bintag.Tag(0x81, message)])
    bintag.decode(message)
    with pytest.raises(LinkError):
        bintag.decode(bintag.encode([bintag.Tag(0x81, bintag.encode([bintag.Tag(0x81, message)]))]))


@given(st.binary(max_size=200))
def test_random_bytes_give_tags_or_a_link_error(message: bytes) -> None:
    try:
        bintag.decode(message)
    except LinkError as error:
        assert error.code == "protocol"


def test_a_missing_or_short_value_is_a_link_error() -> None:
    tags = bintag.decode(bintag.encode([bintag.u16(1, 7)]))
    assert tags.u16(1) == 7
    for access in (lambda: tags.u32(1), lambda: tags.u16(2), lambda: tags.container(0x81)):
        with pytest.raises(LinkError, match="malformed"):
            access()


def test_zero_length_and_unknown_tags_are_skipped() -> None:
    tags = bintag.decode(bytes.fromhex("0500") + bintag.encode([bintag.u16(1, 7)]))
    assert tags.u16(1) == 7
