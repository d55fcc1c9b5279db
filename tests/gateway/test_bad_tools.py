"""A tool that misbehaves at the gateway's socket ends its own connection, and nothing else."""

from __future__ import annotations

import socket
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from served import BAUD, PATIENCE, Gate, Served, answer_on
from shares import examples

from plctool.gateway import server
from plctool.gateway.frames import MAX_PAYLOAD, PROTOCOL, Frame, Kind, Pipe, Request, document_frame, encode

Eventually = Callable[[Callable[[], Any]], Any]

SAID = {"protocol": PROTOCOL, "scheme": "serial", "baud": BAUD, "tool": "bad", "pid": 1}
HELLO = encode(document_frame(Kind.HELLO, 1, SAID))
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=9),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=9), inner, max_size=3),
    max_leaves=6,
)
CALLS = st.fixed_dictionaries(
    {"op": st.sampled_from(["open", "application", "forget", "claim", "release", "others", "scan", "status", "?"])},
    optional=dict.fromkeys(("generation", "session", "purpose", "seconds", "enough"), JSON),
)
SENT = st.one_of(
    st.binary(max_size=60),
    st.builds(lambda call: encode(document_frame(Kind.CALL, 5, call)), CALLS),
    st.builds(
        lambda kind, number, payload: encode(Frame(kind, number, payload)),
        st.sampled_from(Kind),
        st.integers(0, 3),
        st.binary(max_size=40),
    ),
    st.builds(
        lambda kind, generation, more, message: encode(
            Frame(kind, 2, Request(generation, 1.0, message, more).encode())
        ),
        st.sampled_from([Kind.EXCHANGE, Kind.STREAM]),
        st.integers(0, 2),
        st.booleans(),
        st.binary(max_size=40),
    ),
)


def raw(served: Served, data: bytes) -> socket.socket:
    """A socket on which data was sent, as far as the gateway takes it."""
    connected = socket.socket(socket.AF_UNIX)
    connected.connect(str(served.place.socket))
    connected.setblocking(False)
    try:
        while data:
            data = data[connected.send(data) :]
    except OSError:
        pass  # it has closed, or its buffer is full
    return connected


@given(polite=st.booleans(), sent=st.lists(SENT, max_size=6))
@examples(150)
def test_whatever_a_tool_sends_another_one_is_served(served: Served, polite: bool, sent: list[bytes]) -> None:
    """It may even take the device for itself: when it goes, that ends."""
    served.answer(lambda message: message)
    bad = raw(served, (HELLO if polite else b"") + b"".join(sent))
    bad.close()
    with served.connect() as plc:
        assert [reading.values for _, reading in plc.watch(["Main.count"], 0, 2)] == [{"Main.count": 0}] * 2


@pytest.mark.parametrize(
    "sent",
    [
        b"\xff" * 100,
        HELLO + b"\xff" * 100,
        encode(Frame(Kind.EXCHANGE, 1, bytes(20))),
        HELLO + encode(Frame(Kind.REPLY, 2)),
        HELLO + encode(Frame(Kind.CALL, 2, b"not json")),
        HELLO + encode(document_frame(Kind.CALL, 2, {"op": "format the disk"})),
        HELLO + encode(document_frame(Kind.CALL, 2, {"op": "application", "generation": "1"})),
        HELLO + encode(document_frame(Kind.CALL, 2, {"op": "scan", "seconds": -1, "enough": 0})),
        HELLO + encode(Frame(Kind.EXCHANGE, 2, b"short")),
    ],
)
def test_what_is_no_request_ends_the_connection(served: Served, sent: bytes, eventually: Eventually) -> None:
    pipe = Pipe(raw(served, sent))
    with pytest.raises(server.Closed):
        while True:
            pipe.receive(PATIENCE)
    eventually(lambda: served.gateway.tools() == [])


def test_half_a_frame_keeps_no_other_tool_waiting(served: Served) -> None:
    half = raw(served, HELLO + encode(Frame(Kind.EXCHANGE, 2, bytes(50)))[:-1])
    assert served.connect().read("Main.count") == 0
    half.close()


def test_one_that_says_nothing_is_no_tool_and_is_sent_away(
    served: Served, monkeypatch: pytest.MonkeyPatch, eventually: Eventually
) -> None:
    monkeypatch.setattr(server, "_HELLO_PATIENCE", 0.01)
    silent = served.stranger()
    assert served.gateway.tools() == []
    eventually(silent.is_gone)


def test_one_that_only_asks_about_the_gateway_cannot_reach_the_device(served: Served) -> None:
    asking = served.guest(asks_only=True)
    assert served.call(asking, "status").document["line"] == served.gateway.line
    with pytest.raises(server.Closed):
        served.call(asking, "open")
    assert served.plc.requests == []


def test_a_flood_of_requests_is_answered_in_turn_with_the_others(served: Served) -> None:
    """What is not served yet stays in the socket; nothing piles up in the gateway."""
    served.answer(lambda message: message)
    flooding, other = served.guest(), served.connect()
    opened = served.call(flooding, "open").document
    request = Request(opened["generation"], 8.0, b"flood").encode()
    for number in range(2, 200):
        flooding.send(Frame(Kind.EXCHANGE, number, request), PATIENCE)
    assert other.read("Main.count") == 0
    assert served.gateway.device.requests <= 1
    assert [answer_on(flooding).number for _ in range(2, 200)] == list(range(2, 200))


def test_one_that_does_not_read_is_dropped_and_keeps_no_other_waiting(
    served: Served, monkeypatch: pytest.MonkeyPatch, eventually: Eventually
) -> None:
    monkeypatch.setattr(server, "_SEND_PATIENCE", 0.05)
    served.answer(lambda message: message)
    opened = served.call(served.guest(), "open").document
    request = encode(Frame(Kind.EXCHANGE, 2, Request(opened["generation"], 8.0, bytes(8000)).encode()))
    lazy = raw(served, HELLO + request * 100)
    other = served.connect()
    for _ in range(20):
        assert other.read("Main.count") == 0
    eventually(lambda: not any(tool.words == "bad" for tool in served.gateway.tools()))
    lazy.close()


def test_one_that_leaves_in_the_middle_of_its_request_leaves_the_device_to_the_others(
    served: Served, gate: Callable[[], Gate]
) -> None:
    leaving, other = served.guest(), served.connect()
    other.read("Main.count")
    opened = served.call(leaving, "open").document
    barred = gate()
    leaving.send(Frame(Kind.CALL, 3, b'{"op": "application", "generation": %d}' % opened["generation"]), PATIENCE)
    leaving.send(Frame(Kind.EXCHANGE, 4, Request(opened["generation"], 8.0, bytes(30)).encode()), PATIENCE)
    leaving.close()
    barred.open()
    assert other.read("Main.count") == 0


def test_no_more_tools_than_there_is_room_for(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "MAX_TOOLS", 3)
    tools = [served.tool() for _ in range(3)]
    with pytest.raises(server.LinkError, match="3 tools use") as caught:
        served.tool()
    assert caught.value.code == "too-many"
    tools[0].open()
    tools[0].close()
    served.tool().open()


def test_the_largest_frame_is_no_reason_to_close(served: Served) -> None:
    guest = served.guest()
    call = {"op": "others", "filling": "x" * (MAX_PAYLOAD - 40)}
    guest.send(document_frame(Kind.CALL, 3, call), PATIENCE)
    assert guest.receive(PATIENCE).kind is Kind.DONE
