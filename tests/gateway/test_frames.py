"""Frames between tools and gateway: what is sent arrives however it is cut, and garbage is not taken for frames."""

from __future__ import annotations

import json
import socket
import threading
from collections.abc import Callable
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from plctool.gateway.frames import (
    MAX_PAYLOAD,
    Closed,
    Decoder,
    Frame,
    FrameError,
    Kind,
    Pipe,
    Reply,
    Request,
    document_frame,
    encode,
)
from plctool.link.channel import WANTED_BUFFER

NUMBERS = st.integers(0, 2**32 - 1)
FRAMES = st.builds(Frame, st.sampled_from(Kind), NUMBERS, st.binary(max_size=300))
CUTS = st.lists(st.integers(1, 40), min_size=1)


def pieces(data: bytes, cuts: list[int]) -> list[bytes]:
    """The data in pieces of these sizes, again and again."""
    found = []
    while data:
        for size in cuts:
            found.append(data[:size])
            data = data[size:]
    return found


@given(st.lists(FRAMES, max_size=5), CUTS)
def test_frames_arrive_as_they_were_sent_however_they_are_cut(frames: list[Frame], cuts: list[int]) -> None:
    decoder = Decoder()
    sent = b"".join(map(encode, frames))
    assert [frame for piece in pieces(sent, cuts) for frame in decoder.feed(piece)] == frames


@given(st.lists(FRAMES, max_size=3), st.binary(min_size=1, max_size=600), CUTS)
def test_garbage_after_frames_is_frames_or_an_error(frames: list[Frame], garbage: bytes, cuts: list[int]) -> None:
    decoder = Decoder()
    found: list[Frame] = []
    with suppress(FrameError):
        for piece in pieces(b"".join(map(encode, frames)) + garbage, cuts):
            found += decoder.feed(piece)
    common = min(len(frames), len(found))
    assert found[:common] == frames[:common]
    assert all(len(frame.payload) <= MAX_PAYLOAD for frame in found)


@given(st.integers(MAX_PAYLOAD + 1, 2**32 - 1), NUMBERS)
def test_a_frame_that_is_too_long_is_refused_at_its_head(size: int, number: int) -> None:
    head = size.to_bytes(4, "little") + bytes([Kind.EXCHANGE]) + number.to_bytes(4, "little")
    with pytest.raises(FrameError):
        Decoder().feed(head)


def test_a_frame_that_is_too_long_is_not_sent() -> None:
    with pytest.raises(FrameError):
        encode(Frame(Kind.EXCHANGE, 1, bytes(MAX_PAYLOAD + 1)))


def test_the_longest_message_of_the_link_fits() -> None:
    message = bytes(WANTED_BUFFER)
    encode(Frame(Kind.STREAM, 1, Request(1, 8.0, message).encode()))
    encode(Frame(Kind.REPLY, 1, Reply(1, message).encode()))


@given(NUMBERS, st.integers(0, 10_000_000), st.binary(max_size=100), st.booleans())
def test_requests_come_out_as_they_went_in(generation: int, patience_ms: int, message: bytes, more: bool) -> None:
    request = Request(generation, patience_ms / 1000, message, more)
    assert Request.decode(request.encode()) == request


@given(NUMBERS, st.binary(max_size=100))
def test_replies_come_out_as_they_went_in(taken: int, message: bytes) -> None:
    assert Reply.decode(Reply(taken, message).encode()) == Reply(taken, message)


@pytest.mark.parametrize("decode", [Request.decode, Reply.decode])
@given(payload=st.binary(max_size=20))
def test_any_payload_is_a_message_or_an_error(decode: Callable[[bytes], Request | Reply], payload: bytes) -> None:
    with suppress(FrameError):
        assert payload.endswith(decode(payload).message)


@pytest.mark.parametrize("payload", [b"", b"{", b"\xff\xfe", b"[]", b"7", b"null", b"[" * MAX_PAYLOAD])
def test_what_is_no_json_object_is_an_error(payload: bytes) -> None:
    with pytest.raises(FrameError):
        _ = Frame(Kind.CALL, 1, payload).document


@given(st.dictionaries(st.text(max_size=9), st.integers() | st.text(max_size=9), max_size=4))
def test_documents_come_out_as_they_went_in(document: dict[str, object]) -> None:
    assert document_frame(Kind.DONE, 3, document).document == json.loads(json.dumps(document))


# ---- the pipe --------------------------------------------------------------------------------------------------------


def pipes() -> tuple[Pipe, socket.socket]:
    ours, theirs = socket.socketpair()
    return Pipe(ours), theirs


def test_a_frame_that_is_not_complete_in_time_is_a_timeout() -> None:
    pipe, other = pipes()
    other.send(encode(Frame(Kind.CALL, 1, b"hello"))[:-1])
    with pytest.raises(TimeoutError):
        pipe.receive(0.01)
    other.send(b"o")
    assert pipe.receive(30).payload == b"hello"


def test_half_a_frame_and_a_closed_socket_is_closed() -> None:
    pipe, other = pipes()
    other.send(encode(Frame(Kind.CALL, 1, b"hello"))[:-1])
    other.close()
    with pytest.raises(Closed):
        pipe.receive(30)


def test_one_that_does_not_read_is_a_timeout_and_not_a_thread_that_hangs() -> None:
    pipe, _other = pipes()
    with pytest.raises(TimeoutError):
        for _ in range(10_000):
            pipe.send(Frame(Kind.REPLY, 1, bytes(MAX_PAYLOAD)), 0.01)


def test_sending_to_one_that_is_gone_is_closed() -> None:
    pipe, other = pipes()
    other.close()
    with pytest.raises(Closed):
        pipe.send(Frame(Kind.REPLY, 1), 30)
    assert pipe.is_gone()


def test_one_that_has_closed_is_gone_though_there_is_something_to_read() -> None:
    pipe, other = pipes()
    other.send(encode(Frame(Kind.CALL, 1)))
    assert not pipe.is_gone()
    other.close()
    assert pipe.is_gone()
    assert pipe.receive(30) == Frame(Kind.CALL, 1)
    with pytest.raises(Closed):
        pipe.receive(30)


def test_a_look_at_what_has_come_leaves_it_there_and_takes_no_more_than_asked_for() -> None:
    pipe, other = pipes()
    frames = [Frame(Kind.STREAM, number, bytes(20_000)) for number in range(6)]
    sending = threading.Thread(target=other.sendall, args=(b"".join(map(encode, frames)),))
    sending.start()
    assert pipe.receive(30) == frames[0]
    seen = pipe.look(2)
    assert seen == frames[1 : 1 + len(seen)] and len(seen) <= 5
    assert [pipe.receive(30) for _ in range(5)] == frames[1:]
    sending.join(30)
