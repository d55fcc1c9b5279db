"""Several tools on one device: each gets its own answers, in turn, and all share one channel and one login."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from served import PATIENCE, Gate, Served

from plctool.core import lib
from plctool.errors import DeviceError, LinkError
from plctool.gateway.shared import Turns
from plctool.link import l7
from plctool.link.channel import ChannelLost


def logins(served: Served) -> int:
    return served.plc.requests.count((lib.SG_DEVICE, lib.SRV_DEV_LOGIN))


def application_logins(served: Served) -> int:
    return served.plc.requests.count((lib.SG_APPLICATION, lib.SRV_APP_LOGIN))


def test_a_tool_reads_what_another_one_has_written(served: Served) -> None:
    first, second = served.connect(), served.connect()
    assert first.read("Main.count") == 0
    second.write({"Main.count": 42})
    assert first.read("Main.count") == 42


def test_tools_share_one_channel_and_one_login(served: Served) -> None:
    tools = [served.connect() for _ in range(5)]
    for tool in tools:
        tool.read("Main.count")
    assert (logins(served), application_logins(served)) == (1, 1)


def test_eight_tools_at_once_get_their_own_answers(served: Served) -> None:
    def work(number: int) -> None:
        echo = served.tool(f"tool {number}")
        echo.open()
        for turn in range(50):
            message = f"{number}/{turn}".encode() * (number + 1)
            assert echo.exchange(message) == message

    served.answer(lambda message: message)
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(work, range(8)))


def test_turns_are_taken_in_the_order_they_were_asked_for(eventually: Callable[[Callable[[], Any]], Any]) -> None:
    turns, order = Turns(), []

    def work(number: int) -> None:
        with turns.turn():
            order.append(number)

    threads = [threading.Thread(target=work, args=(number,)) for number in range(8)]
    with turns.turn():
        for waiting, thread in enumerate(threads, 1):
            thread.start()
            eventually(lambda waiting=waiting: len(turns) == 1 + waiting)
    for thread in threads:
        thread.join(PATIENCE)
    assert order == list(range(8))


def test_one_that_leaves_while_it_waits_gives_its_turn_to_the_next(
    monkeypatch: pytest.MonkeyPatch, eventually: Callable[[Callable[[], Any]], Any]
) -> None:
    class Left(Exception):
        pass

    def leave() -> None:
        raise Left

    monkeypatch.setattr("plctool.gateway.shared._BEAT", 0.001)
    turns = Turns()
    with turns.turn():
        with pytest.raises(Left), turns.turn(leave):
            raise AssertionError("it was not its turn")
        assert len(turns) == 1
    with turns.turn():
        pass


def test_the_channel_is_opened_again_when_it_was_lost_for_all(served: Served) -> None:
    first, second = served.connect(), served.connect()
    first.read("Main.count"), second.read("Main.count")
    served.device.restart()
    assert first.read("Main.count") == 0
    assert second.read("Main.count") == 0
    assert logins(served) == 2


def test_a_write_that_came_after_the_channel_was_lost_is_done_once(served: Served) -> None:
    first, second = served.connect(), served.connect()
    second.read("Main.count")
    served.device.restart()
    first.read("Main.count")
    second.write({"Main.count": 5})
    assert served.plc.writes == 1


def test_no_application_is_the_devices_own_error(served: Served) -> None:
    served.plc.image = b""
    with pytest.raises(DeviceError, match="no application") as caught:
        served.connect().read("Main.count")
    assert (caught.value.code, caught.value.result) == ("app-not-exist", lib.ERR_APP_NOT_EXIST)


def test_the_login_to_the_application_of_one_tool_is_taken_over_by_the_others(served: Served) -> None:
    """After a reset there is a new login to the application, which ends the login that the others have."""
    first, second = served.connect(), served.connect()
    first.read("Main.count"), second.read("Main.count")
    first.reset()
    first.start()  # a new login
    assert application_logins(served) == 2
    second.write({"Main.count": 3})
    second.stop()
    assert (first.read("Main.count"), served.plc.state) == (3, lib.AS_STOP)
    assert application_logins(served) == 2


def test_a_start_lets_others_wait_for_their_turn(
    served: Served, gate: Callable[[], Gate], eventually: Callable[[Callable[[], Any]], Any]
) -> None:
    """It is sent as two messages at once, as a program is; only a program keeps others out."""
    starting, reading = served.connect(), served.connect()
    assert reading.read("Main.count") == 0
    starting.stop()
    barred = gate()
    served.device.handler = lambda m: barred(m) if l7.decode(m).service == lib.SRV_APP_START else served.plc.handle(m)
    with ThreadPoolExecutor(2) as pool:
        start = pool.submit(starting.start)
        assert barred.closed.wait(PATIENCE)
        read = pool.submit(reading.read, "Main.count")
        eventually(lambda: read.done() or served.gateway.device.requests == 2)
        barred.open()
        start.result(PATIENCE)
        assert read.result(PATIENCE) == 0


def test_the_login_is_renewed_though_the_tool_that_made_it_old_is_gone(served: Served) -> None:
    watching, flashing = served.connect(), served.connect()
    watching.read("Main.count")
    flashing._session.forget_application = lambda: None  # type: ignore[method-assign]  # as when it is killed
    flashing.flash(served.image, force=True)
    flashing.close()
    assert served.connect().read("Main.count") == 0
    assert application_logins(served) == 2


def test_a_message_on_a_channel_that_is_gone_is_not_carried_out(served: Served) -> None:
    old, new = served.tool(), served.tool()
    old.open()
    served.device.restart()
    with pytest.raises(ChannelLost):
        new.open(), new.exchange(b"lost")
    new.open()
    seen = len(served.device.messages)
    with pytest.raises(ChannelLost) as caught:
        old.exchange(b"too late")
    assert caught.value.code == "closed" and len(served.device.messages) == seen
    old.open()
    assert old.is_open


def test_a_request_of_a_tool_that_left_while_it_waited_is_not_carried_out(
    served: Served, gate: Callable[[], Gate], eventually: Callable[[Callable[[], Any]], Any]
) -> None:
    """It would not know of it."""

    def write() -> None:
        with pytest.raises(LinkError):
            second.write({"Main.count": 1})

    first, second = served.connect(), served.connect()
    first.read("Main.count"), second.read("Main.count")
    before = served.plc.writes
    barred = gate()
    reading = threading.Thread(target=first.read, args=("Main.count",))
    reading.start()
    assert barred.closed.wait(PATIENCE)
    writing = threading.Thread(target=write)
    writing.start()
    eventually(lambda: served.gateway.device.requests == 2)
    second._connection._pipe.shut()  # type: ignore[attr-defined]  # as when it is killed
    barred.open()
    reading.join(PATIENCE), writing.join(PATIENCE)
    eventually(lambda: served.gateway.device.requests == 0)
    assert served.plc.writes == before


def test_scan_beside_other_tools_finds_the_device_and_keeps_the_channel(served: Served) -> None:
    tool = served.connect()
    tool.read("Main.count")
    nodes = served.tool().scan(PATIENCE, enough=1)
    assert [node.node_name for node in nodes] == ["press-3"]
    tool.read("Main.count")
    assert logins(served) == 1


def test_tools_learn_of_each_other(served: Served) -> None:
    watching, flashing = served.connect("plctool watch Main.x"), served.connect("plctool flash")
    assert [other.tool for other in flashing.others()] == ["plctool watch Main.x"]
    assert str(watching.others()[0]).startswith("plctool flash (pid ")
    flashing.close()
    assert watching.others() == []


def test_what_a_tool_calls_itself_is_fit_for_another_ones_terminal(served: Served) -> None:
    served.connect("evil \x1b[2J\n" + "x" * 1000)
    (other,) = served.connect().others()
    assert other.tool.startswith("evil \\x1b[2J\\nxxx") and len(other.tool) <= 100
