"""A download beside other tools: it has the device to itself, others get an error, and go on after it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import pytest
from fake_device import image_crc
from served import PATIENCE, Gate, Served, answer_on
from small_app import make_application

from plctool.core import lib
from plctool.errors import DeviceError, LinkError
from plctool.gateway import shared
from plctool.gateway.frames import BUSY, Frame, Kind, Request
from plctool.link import bintag, l7
from plctool.link.services import download


class Flashing:
    """A download that stays at its first block until it may go on."""

    def __init__(self, served: Served, gate: Gate, image: bytes) -> None:
        self.plc = served.connect("plctool flash big.cdl")
        self._gate = gate
        self._thread = threading.Thread(target=self.plc.flash, args=(image,), kwargs={"force": True})

    def begin(self) -> None:
        self._thread.start()
        assert self._gate.closed.wait(PATIENCE)

    def finish(self) -> None:
        self._gate.open()
        self._thread.join(PATIENCE)
        assert not self._thread.is_alive()


@pytest.fixture
def flashing(served: Served, gate: Callable[[], Gate]) -> Flashing:
    return Flashing(served, gate(), make_application("2", 20_000)[0])


def block(image: bytes, offset: int, session: int) -> bytes:
    """A message of a download."""
    flags = lib.DLF_CONTINUEDOWNLOAD if offset else 0
    content = [
        bintag.u32(lib.TAG_CDL_POSITION, flags, offset, len(image), image_crc(image)),
        bintag.raw(lib.TAG_CDL_DATA, image[offset : offset + 1000]),
    ]
    message = l7.Message(lib.SG_APPLICATION, lib.SRV_APP_DOWNLOAD_COMPACT, session, bintag.encode(content))
    return l7.encode(message)


def test_another_tool_learns_who_downloads(served: Served, flashing: Flashing) -> None:
    other = served.connect()
    flashing.begin()
    with pytest.raises(LinkError, match=r"plctool flash big.cdl \(pid \d+\) is downloading a program; try again") as e:
        other.status()
    assert e.value.code == BUSY
    flashing.finish()
    assert other.status().state == "run"


def test_a_second_download_is_refused_in_words(served: Served, flashing: Flashing) -> None:
    second = served.connect()
    flashing.begin()
    with pytest.raises(LinkError, match="plctool flash"):
        second.flash(served.image)
    flashing.finish()
    assert second.flash(served.image).state == "run"


def test_watch_goes_on_after_the_same_program_was_downloaded_again(served: Served, gate: Callable[[], Gate]) -> None:
    reasons: list[str] = []
    values: list[Any] = []
    watching = served.connect().watch(["Main.count"], 0.001, 3, reasons.append)
    values.append(next(watching)[1].values)
    flashing = Flashing(served, gate(), served.plc.image)
    flashing.begin()
    watched = threading.Thread(target=lambda: values.extend(reading.values for _, reading in watching))
    watched.start()
    while not reasons:
        watched.join(0.001)
    flashing.finish()
    watched.join(PATIENCE)
    assert values == [{"Main.count": 0}] * 3
    assert len(reasons) == 1 and "plctool flash big.cdl" in reasons[0]


def test_watch_ends_with_a_sentence_when_the_program_was_replaced(served: Served) -> None:
    watching = served.connect().watch(["Main.count"], 0)
    next(watching)
    served.connect().flash(make_application("2")[0])
    with pytest.raises(DeviceError, match="Another application was loaded") as caught:
        next(watching)
    assert caught.value.code == "app-changed"


def test_watch_ends_with_a_sentence_when_the_program_was_deleted(served: Served) -> None:
    watching = served.connect().watch(["Main.count"], 0)
    next(watching)
    served.connect().reset("origin")
    with pytest.raises(DeviceError):
        next(watching)


def test_a_refused_image_leaves_the_device_to_the_others(served: Served) -> None:
    served.plc.refuse = "it is not for this device"
    watching = served.connect()
    before = watching.read("Main.count")
    with pytest.raises(DeviceError, match="not for this device"):
        served.connect().flash(make_application("2", 20_000)[0])
    assert watching.read("Main.count") == before
    assert served.gateway.device.claim is None


def test_a_tool_that_leaves_in_mid_download_leaves_the_old_program_and_the_device(
    served: Served, eventually: Callable[[Callable[[], Any]], Any]
) -> None:
    """As when it is killed: the socket closes between two blocks."""
    old = served.plc.image
    guest, other = served.guest(), served.connect()
    other.read("Main.count")
    opened = served.call(guest, "open").document
    assert served.call(guest, "claim", purpose="downloading").kind is Kind.DONE
    image = make_application("2", 20_000)[0]
    for offset in (0, 1000):
        message = block(image, offset, opened["session"])
        guest.send(Frame(Kind.STREAM, 8, Request(opened["generation"], 8.0, message, more=True).encode()), PATIENCE)
    assert answer_on(guest).kind is Kind.REPLY
    with pytest.raises(LinkError, match="is downloading"):
        other.read("Main.count")
    guest.close()
    eventually(lambda: served.gateway.device.claim is None)
    assert other.read("Main.count") == 0
    assert served.plc.image == old


def test_a_download_that_its_tool_gives_up_ends_at_once_and_the_others_go_on(served: Served) -> None:
    """Ctrl-C. The channel is closed, so that the device does not get what is on its way already."""

    def give_up(done: int, total: int) -> None:
        raise KeyboardInterrupt

    old, image = served.plc.image, make_application("2", 100_000)[0]
    other, giving_up = served.connect(), served.connect()
    other.read("Main.count")
    with pytest.raises(KeyboardInterrupt):
        giving_up.flash(image, progress=give_up)
    assert other.read("Main.count") == 0
    assert giving_up.read("Main.count") == 0
    assert served.plc.image == old and len(served.plc.received) < len(image)


def test_a_tool_that_is_killed_when_all_of_its_program_is_on_its_way_leaves_the_old_program(
    served: Served, gate: Callable[[], Gate], eventually: Callable[[Callable[[], Any]], Any]
) -> None:
    """The gateway has the rest already, and must not send it."""
    old, image = served.plc.image, make_application("2", 2_500)[0]
    guest, other = served.guest(), served.connect()
    opened = served.call(guest, "open").document
    barred = gate()
    for offset in (0, 1000, 2000):
        message = block(image, offset, opened["session"])
        request = Request(opened["generation"], 8.0, message, more=offset < 2000)
        guest.send(Frame(Kind.STREAM, 8, request.encode()), PATIENCE)
    assert barred.closed.wait(PATIENCE)
    guest.close()
    barred.open()
    eventually(lambda: served.gateway.device.claim is None)
    assert other.read("Main.count") == 0
    assert served.plc.image == old


def test_a_stream_is_answered_message_by_message(served: Served) -> None:
    served.answer(lambda message: message[::-1])
    tool = served.tool()
    tool.open()
    for count in (0, 1, 2, 3, 4, 50):
        sent = [f"message {n}".encode() * 300 for n in range(count)]
        assert list(tool.stream(iter(sent))) == [message[::-1] for message in sent]


def test_a_stream_that_fails_is_an_error_and_the_rest_of_it_is_ignored(served: Served) -> None:
    served.answer(lambda message: message)
    tool = served.tool()
    tool.open()
    with pytest.raises(LinkError, match="too long for the device"):
        list(tool.stream([b"fits", bytes(served.device.buffer_size + 1), b"more", b"and more", b"and more"]))
    tool.open()
    assert tool.exchange(b"next") == b"next"


def test_a_tool_that_falls_silent_in_a_download_loses_the_device(
    served: Served, monkeypatch: pytest.MonkeyPatch, eventually: Callable[[Callable[[], Any]], Any]
) -> None:
    guest, other = served.guest(), served.connect()
    assert served.call(guest, "claim", purpose="downloading").kind is Kind.DONE
    with pytest.raises(LinkError):
        other.status()
    monkeypatch.setattr(shared, "CLAIM_SILENCE", -1.0)
    assert other.status().state == "none"
    eventually(guest.is_gone)


def test_the_image_arrives_whole_in_a_download_through_the_gateway(served: Served) -> None:
    image = make_application("3", 60_000)[0]
    arrived: list[int] = []
    served.connect().flash(image, progress=lambda done, total: arrived.append(done))
    assert served.plc.image == image
    assert arrived[-1] == len(image) and arrived == sorted(arrived)


def test_a_download_below_the_command_keeps_others_away_too(served: Served) -> None:
    """A program that uses the services directly claims nothing."""
    image = make_application("4", 200_000)[0]
    plc, other = served.connect(), served.connect()
    refused: list[LinkError] = []

    def look(done: int) -> None:
        if 0 < done < len(image) and not refused:
            with pytest.raises(LinkError) as caught:
                other.status()
            refused.append(caught.value)

    download(plc._session, image, progress=look)
    assert served.plc.image == image and refused[0].code == BUSY


def test_a_download_logs_in_again_when_the_device_has_ended_the_login(served: Served) -> None:
    plc, (image, _) = served.connect("plctool flash"), make_application("3", 3_000)
    plc.status()
    served.plc.LOGIN += 1
    plc.flash(image)
    assert served.plc.image == image
