"""The end of a gateway: when it is idle, asked to, or the line is gone; its tools get the reason or start another."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from served import BAUD, PATIENCE, PORT, Gate, Served

from plctool.errors import LinkError
from plctool.gateway import server
from plctool.gateway.client import Ended, connect, greet
from plctool.gateway.frames import GOODBYE, Kind, document_frame

Eventually = Callable[[Callable[[], Any]], Any]


@pytest.fixture
def impatient(served: Served) -> Served:
    """A gateway that ends as soon as its last tool has left."""
    served.gateway._idle = 0.0
    return served


def test_it_ends_when_the_last_tool_has_left(impatient: Served, eventually: Eventually) -> None:
    first, second = impatient.connect(), impatient.connect()
    first.close()
    assert second.read("Main.count") == 0
    second.close()
    eventually(lambda: impatient.has_ended)
    assert not impatient.place.socket.exists()


def test_one_that_only_asks_does_not_keep_it_alive(impatient: Served, eventually: Eventually) -> None:
    asking, tool = impatient.guest(asks_only=True), impatient.connect()
    tool.close()
    asking.close()
    eventually(lambda: impatient.has_ended)


def test_a_line_that_is_lost_is_reported_to_every_tool(served: Served, eventually: Eventually) -> None:
    first, second = served.connect(), served.connect()
    first.read("Main.count"), second.read("Main.count")
    served.line.gone = True
    with pytest.raises(LinkError, match="lost") as caught:
        first.read("Main.count")
    assert caught.value.code == "link-lost"
    eventually(lambda: served.has_ended)
    with pytest.raises(LinkError, match="lost"):
        second.read("Main.count")


def test_a_tool_is_told_only_once_that_the_line_was_lost(served: Served, eventually: Eventually) -> None:
    tool = served.connect()
    tool.read("Main.count")
    served.line.gone = True
    with pytest.raises(LinkError, match="lost"):
        tool.read("Main.count")
    eventually(lambda: served.has_ended)
    served.line.gone = False
    served.start()
    assert tool.read("Main.count") == 0


def test_tools_learn_that_it_was_ended_by_command(served: Served, eventually: Eventually) -> None:
    tool, asking = served.connect(), served.guest(asks_only=True, tool="plctool gateway")
    tool.read("Main.count")
    asking.send(document_frame(Kind.CALL, 2, {"op": "stop"}), PATIENCE)
    eventually(lambda: served.has_ended)
    with pytest.raises(LinkError, match=r"was ended by plctool gateway \(pid \d+\)") as caught:
        tool.read("Main.count")
    assert caught.value.code == "gateway-stopped"


def test_it_is_not_ended_in_a_download(served: Served) -> None:
    flashing, asking = served.guest(), served.guest(asks_only=True)
    served.call(flashing, "claim", purpose="downloading x.cdl")
    refusal = served.call(asking, "stop")
    assert refusal.kind is Kind.FAILED and "downloading x.cdl" in refusal.document["message"]
    assert not served.has_ended


def test_one_that_wants_the_line_alone_gets_it_from_an_idle_gateway_only(
    served: Served, eventually: Eventually
) -> None:
    tool, asking = served.connect(), served.guest(asks_only=True)
    assert served.call(asking, "stop", only_idle=True).document == {"ends": False}
    tool.close()
    asking.send(document_frame(Kind.CALL, 8, {"op": "stop", "only_idle": True}), PATIENCE)
    eventually(lambda: served.has_ended)


def test_the_device_learns_that_the_channel_closes(
    served: Served, monkeypatch: pytest.MonkeyPatch, eventually: Eventually
) -> None:
    monkeypatch.setattr(server, "_CLOSE_PATIENCE", PATIENCE)
    served.connect().read("Main.count")
    assert served.device._id
    served.gateway.stop("over", "over")
    eventually(lambda: served.has_ended)
    served.line.receive(1.0)
    assert not served.device._id


def test_it_ends_though_a_request_is_under_way(
    served: Served, gate: Callable[[], Gate], eventually: Eventually
) -> None:
    barred, guest = gate(), served.guest()
    guest.send(document_frame(Kind.CALL, 2, {"op": "open"}), PATIENCE)
    assert barred.closed.wait(PATIENCE)
    served.gateway.stop("over", "over")
    goodbye = guest.receive(PATIENCE)
    assert (goodbye.kind, goodbye.number, goodbye.document["message"]) == (Kind.FAILED, GOODBYE, "over")
    eventually(lambda: served.has_ended)


# ---- tools that do not fit -------------------------------------------------------------------------------------------


def hello(served: Served, **said: Any) -> None:
    pipe = connect(served.place)
    assert pipe
    greet(pipe, served.place, {"scheme": "serial", "baud": BAUD, "tool": "x", **said}, PATIENCE)


def test_another_baud_rate_is_refused_in_words_while_there_are_tools(served: Served) -> None:
    watching = served.connect("plctool watch Main.x")
    with pytest.raises(LinkError, match=r"in use with 115200 baud by plctool watch Main.x \(pid .*--baud 115200") as e:
        hello(served, baud=9600)
    assert e.value.code == "other-baud"
    assert watching.read("Main.count") == 0


def test_another_kind_of_link_on_the_line_is_refused_in_words_while_there_are_tools(served: Served) -> None:
    watching = served.connect("plctool watch Main.x")
    with pytest.raises(LinkError, match=rf"in use as --port {PORT} by plctool watch Main.x \(pid") as e:
        hello(served, scheme="modbus", unit=3)
    assert e.value.code == "other-scheme"
    assert watching.read("Main.count") == 0


def test_another_version_is_refused_in_words_while_there_are_tools(served: Served) -> None:
    watching = served.connect("plctool watch Main.x")
    with pytest.raises(LinkError, match=r"is of another plctool.*serves plctool watch Main.x.*plctool gateway stop"):
        hello(served, protocol=99)
    assert watching.read("Main.count") == 0


@pytest.mark.parametrize("said", [{"protocol": 99}, {"scheme": "modbus"}, {"baud": 9600}, {"baud": None}])
def test_without_tools_it_makes_room_for_one_that_does_not_fit(
    served: Served, said: dict[str, Any], eventually: Eventually
) -> None:
    with pytest.raises(Ended):
        hello(served, **said)
    eventually(lambda: served.has_ended)
