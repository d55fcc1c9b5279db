"""The transport within Modbus: which bytes on a line are the reply, what is repeated, how it behaves beside others."""

from __future__ import annotations

import os
import select
import socket
import threading
import time
import tty
from collections.abc import Iterator
from itertools import groupby

import pytest

from plctool.core import lib
from plctool.errors import LinkError
from plctool.link import simplecom
from plctool.link.channel import ChannelLost
from plctool.link.modbus import GatewayBus, ModbusTransport, RtuBus, find_reply, modbus_crc

UNIT = 7
PATIENCE = 60.0  # for what is bound to come [s]
REQUEST = bytes([0x2B, 0x80, 5])


def framed(unit: int, pdu: bytes) -> bytes:
    return bytes([unit]) + pdu + modbus_crc(bytes([unit]) + pdu)


def reply_pdu(sequence: int, taken: int, data: bytes = b"") -> bytes:
    return bytes([0x2B, 0x80, sequence, taken, len(data)]) + data


def test_crc_is_that_of_the_standard() -> None:
    assert modbus_crc(b"123456789") == b"\x37\x4b"


def test_reply_is_found_among_frames_of_others_and_the_echo_of_the_request() -> None:
    reply = reply_pdu(5, 3, bytes(range(248)))
    others = framed(3, b"\x03\x00\x01\x00\x02") + framed(3, b"\x03\x04\x01\x02\x03\x04")
    heard = framed(UNIT, REQUEST + b"abc") + others + framed(UNIT, reply) + others
    assert find_reply(heard, UNIT, REQUEST + b"abc") == reply


def test_what_is_no_reply_is_not_taken() -> None:
    good = framed(UNIT, reply_pdu(5, 3, b"data"))
    assert find_reply(good, UNIT, REQUEST) is not None
    assert find_reply(good[:-1], UNIT, REQUEST) is None
    assert find_reply(good, UNIT + 1, REQUEST) is None
    assert find_reply(framed(UNIT, reply_pdu(4, 3, b"data")), UNIT, REQUEST) is None
    assert find_reply(framed(UNIT, b"\x2b\x0e\x05\x00\x00"), UNIT, REQUEST) is None
    for bit in range(8 * len(good)):
        damaged = bytearray(good)
        damaged[bit // 8] ^= 1 << bit % 8
        assert find_reply(bytes(damaged), UNIT, REQUEST) is None


def test_exception_is_a_reply() -> None:
    assert find_reply(framed(UNIT, b"\xab\x01"), UNIT, REQUEST) == b"\xab\x01"


# ---- a device ------------------------------------------------------------------------------------------------------


class Device:
    """The other end of a pseudo terminal: a device whose block driver sends everything back, as `size` bytes at a time.
    `ignores`: so many requests get no reply from now on; `exception`: what all get, if not 0."""

    def __init__(self) -> None:
        self.end, near = os.openpty()
        self.near = near
        tty.setraw(near)
        self.path = os.ttyname(near)
        self.ignores = self.exception = 0
        self.room = 250
        self.requests: list[bytes] = []
        self.times: list[float] = []
        self._sequence = -1
        self._last = b""
        self._data = bytearray()
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        if not self._done.is_set():
            self._done.set()
            self._thread.join()
            os.close(self.end)
            os.close(self.near)

    def _run(self) -> None:
        frame = b""
        while not self._done.is_set():
            if select.select([self.end], [], [], 0.004)[0]:
                frame += os.read(self.end, 300)
            elif frame:
                if frame[-2:] == modbus_crc(frame[:-2]) and frame[0] == UNIT:
                    self._take(frame[1:-2])
                frame = b""

    def _take(self, pdu: bytes) -> None:
        self.requests.append(pdu)
        self.times.append(time.monotonic())
        reply = self._reply(pdu)
        if self.ignores:
            self.ignores -= 1
        else:
            os.write(self.end, framed(UNIT, reply))

    def _reply(self, pdu: bytes) -> bytes:
        if self.exception:
            return bytes([0xAB, self.exception])
        sequence, data = pdu[2], pdu[3:]
        if sequence == 0:
            self._data.clear()
        if sequence == 0 or sequence != self._sequence:
            given = bytes(self._data[:248])
            del self._data[:248]
            taken = min(len(data), self.room)
            self._data += data[:taken]
            self._last = reply_pdu(sequence, taken, given)
            self._sequence = sequence
        return self._last


@pytest.fixture
def device() -> Iterator[Device]:
    device = Device()
    yield device
    device.close()


@pytest.fixture
def transport(device: Device) -> Iterator[ModbusTransport]:
    transport = ModbusTransport(RtuBus(device.path, UNIT, 38400, "even"))
    yield transport
    transport.close()


def test_packets_go_and_come(device: Device, transport: ModbusTransport) -> None:
    packets = [bytes([i]) * 512 for i in range(5)]
    transport.send(*packets)
    assert [transport.receive(PATIENCE) for _ in packets] == packets
    assert device.requests[0] == b"\x2b\x80\x00"
    assert transport.receive(0.0) is None


@pytest.mark.parametrize("room", [1, 100, 249])
def test_what_the_device_does_not_take_is_sent_again(device: Device, transport: ModbusTransport, room: int) -> None:
    device.room = room
    transport.send(b"some bytes" * 4)
    assert transport.receive(PATIENCE) == b"some bytes" * 4


def test_request_without_reply_is_repeated_as_it_was(device: Device, transport: ModbusTransport) -> None:
    transport.send(b"first")
    assert transport.receive(PATIENCE) == b"first"
    device.ignores, asked = 2, len(device.requests)
    transport.send(b"second")
    assert transport.receive(PATIENCE) == b"second"
    same = [request for request in device.requests[asked:] if simplecom.encode(b"second") in request]
    assert len(same) >= 2  # 3, unless an earlier one came late
    assert len(set(same)) == 1


def test_numbers_go_round_and_leave_the_beginning_out(device: Device, transport: ModbusTransport) -> None:
    for i in range(300):
        transport.send(i.to_bytes(2))
        assert transport.receive(PATIENCE) == i.to_bytes(2)
    numbers = [number for number, _ in groupby(request[2] for request in device.requests)]  # one repeated keeps its own
    assert numbers[0] == 0
    assert numbers[1:] == [i % 255 + 1 for i in range(len(numbers) - 1)]


def test_silent_device_is_no_error_of_the_transport(device: Device, transport: ModbusTransport) -> None:
    device.ignores = 1000
    began = time.monotonic()
    transport.send(b"hello")
    assert transport.receive(0.2) is None
    assert time.monotonic() - began < PATIENCE
    device.ignores = 0
    transport.send(b"again")
    assert transport.receive(PATIENCE) == b"hello"
    assert transport.receive(PATIENCE) == b"again"


def test_device_that_takes_no_tools_says_what_to_do(device: Device, transport: ModbusTransport) -> None:
    device.exception = lib.MODBUS_ILLEGAL_FUNCTION
    with pytest.raises(LinkError, match="takes no tools within Modbus") as caught:
        transport.send(b"hello")
        transport.receive(PATIENCE)  # under load the reply may be late for `send`
    assert caught.value.code == "no-tunnel"
    assert "--tunnel" in caught.value.message


def test_device_that_has_forgotten_the_tool_ends_the_channel(device: Device, transport: ModbusTransport) -> None:
    transport.send(b"hello")
    assert transport.receive(PATIENCE) == b"hello"
    device.exception = lib.MODBUS_ILLEGAL_VALUE
    with pytest.raises(ChannelLost, match="another tool has begun"):
        transport.send(b"more")
        transport.receive(PATIENCE)
    device.exception = 0
    transport.send(b"new")
    assert transport.receive(PATIENCE) == b"new"


def test_busy_device_is_asked_again(device: Device, transport: ModbusTransport) -> None:
    device.exception = lib.MODBUS_DEVICE_BUSY
    threading.Timer(0.15, setattr, (device, "exception", 0)).start()
    transport.send(b"hello")
    assert transport.receive(PATIENCE) == b"hello"


def test_device_with_nothing_to_say_is_asked_now_and_then(device: Device, transport: ModbusTransport) -> None:
    transport.send(b"hello")
    assert transport.receive(PATIENCE) == b"hello"
    time.sleep(0.3)
    asked, end = 0, time.monotonic() + PATIENCE
    while asked < 3:  # on a machine under load in one of several seconds
        before = len(device.requests)
        assert transport.receive(1.0) is None
        asked = len(device.requests) - before
        assert asked <= 12
        assert time.monotonic() < end


def test_it_listens_before_it_speaks_and_leaves_others_time(device: Device, transport: ModbusTransport) -> None:
    transport.send(b"hello")
    assert transport.receive(PATIENCE) == b"hello"
    foreign = framed(3, b"\x03\x00\x01\x00\x02")
    for _ in range(5):
        os.write(device.end, foreign)
        assert select.select([device.near], [], [], PATIENCE)[0]  # the kernel hands bytes on when it has time
        heard = time.monotonic()
        asked = len(device.times)
        transport.send(b"more")
        assert transport.receive(PATIENCE) == b"more"
        assert device.times[asked] - heard >= 0.03


def test_line_that_is_never_quiet_is_used_all_the_same(device: Device, transport: ModbusTransport) -> None:
    done = threading.Event()

    def talk() -> None:
        while not done.wait(0.01):
            os.write(device.end, framed(3, b"\x03\x00\x01\x00\x02"))

    talker = threading.Thread(target=talk)
    talker.start()
    try:
        transport.send(b"hello")
        assert transport.receive(PATIENCE) == b"hello"
    finally:
        done.set()
        talker.join()


def test_line_that_goes_away_is_said(device: Device, transport: ModbusTransport) -> None:
    device.close()
    with pytest.raises(LinkError, match="was lost") as caught:
        for _ in range(10):
            transport.send(b"hello")
    assert caught.value.code == "link-lost"


# ---- through a gateway ---------------------------------------------------------------------------------------------


@pytest.fixture(autouse=True)
def patient_with_gateways(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("plctool.link.modbus._GATEWAY_PATIENCE", PATIENCE)


def serve(answers: list[bytes]) -> str:
    """A gateway that gives these bytes back, one for each request, and then closes; its place. "TT" in them is the
    number of the request."""
    listener = socket.create_server(("127.0.0.1", 0))

    def run() -> None:
        connected, _ = listener.accept()
        with connected, listener:
            for answer in answers:
                request = connected.recv(300)
                connected.sendall(answer.replace(b"TT", request[:2]))

    threading.Thread(target=run, daemon=True).start()
    return f"127.0.0.1:{listener.getsockname()[1]}"


def adu(pdu: bytes, unit: int = UNIT) -> bytes:
    return b"TT\0\0" + (1 + len(pdu)).to_bytes(2) + bytes([unit]) + pdu


def test_replies_of_a_gateway_are_taken_by_what_they_say() -> None:
    stale, other = adu(reply_pdu(9, 0)), adu(reply_pdu(0, 0), 3)
    bus = GatewayBus(serve([stale + other + adu(reply_pdu(0, 0))]), UNIT, 38400)
    assert bus.ask(b"\x2b\x80\x00") == reply_pdu(0, 0)
    bus.close()


def test_gateway_that_gets_no_reply_is_asked_again() -> None:
    packet = simplecom.encode(b"hello")
    answers = [adu(b"\xab\x0b"), adu(reply_pdu(0, 0)), adu(b"\xab\x0b"), adu(reply_pdu(1, len(packet), packet))]
    transport = ModbusTransport(GatewayBus(serve(answers), UNIT, 38400))
    transport.send(b"hello")
    assert transport.receive(PATIENCE) == b"hello"
    transport.close()


def test_gateway_that_closes_is_said() -> None:
    bus = GatewayBus(serve([adu(reply_pdu(0, 0))]), UNIT, 38400)
    bus.ask(b"\x2b\x80\x00")
    with pytest.raises(ChannelLost, match="closed the connection"):
        bus.ask(b"\x2b\x80\x01")


def test_what_is_no_modbus_is_said() -> None:
    bus = GatewayBus(serve([b"HTTP/1.1 400 Bad Request"]), UNIT, 38400)
    with pytest.raises(LinkError, match="is not Modbus TCP"):
        bus.ask(b"\x2b\x80\x00")


def test_no_gateway_is_said() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    with pytest.raises(LinkError, match="Cannot connect"):
        GatewayBus(f"127.0.0.1:{port}", UNIT, 38400)
