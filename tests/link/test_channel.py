"""Channels over lines of every quality: what was sent arrives, or a LinkError says that it did not."""

from __future__ import annotations

import random
import struct
import zlib
from contextlib import suppress

import pytest
from fake_device import FakeDevice, FakeLine, damage
from hypothesis import given, reject
from hypothesis import strategies as st
from shares import examples

from plctool.core import lib
from plctool.errors import LinkError
from plctool.link import router
from plctool.link.channel import Channel, ChannelLost, ErrorRate, Line, RoundTrip, State
from plctool.link.connection import Connection


def reverse(message: bytes) -> bytes:
    """A reply that shows the whole request arrived."""
    return message[::-1]


def connect(line: FakeLine) -> Connection:
    connection = Connection(line)
    connection.open()
    return connection


def pattern(size: int) -> bytes:
    return bytes(i * 7 & 0xFF for i in range(size))


# ---- clean line ----


def test_the_open_request_is_that_of_the_specification() -> None:
    channel = Channel(Line(500, 0, 1e9), 5, 0x8321D481)
    channel.open(0.0)
    package = channel.next_package(0.0)
    assert package is not None
    sample = bytes.fromhex("C30001010892 77AC81D4214083001F0005000000".replace(" ", ""))
    assert len(package) == 20
    assert package[:4] == sample[:4]
    assert package[8:12] == (0x8321D481).to_bytes(4, "little")
    assert package[16:] == bytes([5, 0, 0, 0])
    assert zlib.crc32(package[:4] + bytes(4) + package[8:]) == struct.unpack_from("<I", package, 4)[0]


def test_the_open_response_of_the_specification_opens_the_channel() -> None:
    channel = Channel(Line(500, 0, 1e9), 5, 0x8321D481)
    channel.open(0.0)
    channel.receive(bytes.fromhex("830001011130182481D421830000D8DB0008000000050000"), 0.1)
    assert channel.state is State.OPEN
    assert channel.buffer_size == 2048


def test_a_damaged_open_response_is_ignored() -> None:
    channel = Channel(Line(500, 0, 1e9), 5, 0x8321D481)
    channel.open(0.0)
    channel.receive(bytes.fromhex("830001011130182481D421830000D8DB0009000000050000"), 0.1)
    assert channel.state is State.OPENING


def opened(line: Line, limit: int, packet: int = 0) -> Channel:
    """A channel to a device that takes messages of `limit` bytes, and packets of `packet` bytes."""
    channel = Channel(line, 2, 7)
    channel.open(0.0)
    channel.next_package(0.0)
    body = struct.pack("<IHHIBBH", 7, 0, 1, limit, 0, 2, packet)
    head = struct.pack("<BBH", 0x83, 0, 0x0101)
    channel.receive(head + struct.pack("<I", zlib.crc32(head + bytes(4) + body)) + body, 0.1)
    assert channel.state is State.OPEN
    return channel


def test_the_open_request_says_how_long_packets_may_be_if_the_line_takes_longer_ones() -> None:
    channel = Channel(Line(500, 18, 1e9, 4096, 12), 5, 7)
    channel.open(0.0)
    package = channel.next_package(0.0)
    assert package is not None and package[16:] == bytes([5, 0, 0x00, 0x10])


@pytest.mark.parametrize(
    ("packet", "longest"), [(0, 500), (100, 500), (512, 500), (708, 696), (4096, 4084), (9999, 4084)]
)
def test_blocks_are_as_long_as_the_device_says_and_no_longer_than_was_asked(packet: int, longest: int) -> None:
    channel = opened(Line(500, 18, 1e9, 4096, 12), 16384, packet)
    channel.send(bytes(16384), 1.0)
    package = channel.next_package(1.0)
    assert package is not None and len(package) == longest


def test_no_block_is_longer_than_those_of_a_line_that_has_no_long_ones() -> None:
    channel = opened(Line(500, 18, 1e9), 16384, 4096)
    channel.send(bytes(16384), 1.0)
    package = channel.next_package(1.0)
    assert package is not None and len(package) == 500


@pytest.mark.parametrize(
    ("limit", "best"), [(232, 232), (480, 480), (500, 480), (576, 480), (944, 944), (968, 968), (2048, 1944)]
)
def test_the_best_message_fills_its_blocks_or_is_the_longest(limit: int, best: int) -> None:
    assert opened(Line(500, 18, 1e9), limit).best_size == best


@pytest.mark.parametrize("size", [1, 467, 468, 469, 944, 945, 5000, 16384])
def test_messages_of_any_size_arrive_and_are_answered(size: int) -> None:
    device = FakeDevice(reverse)
    assert connect(FakeLine(device)).exchange(pattern(size)) == pattern(size)[::-1]
    assert device.messages == [pattern(size)]


def test_nothing_is_sent_twice_on_a_clean_line() -> None:
    device = FakeDevice(reverse)
    connection = connect(FakeLine(device))
    for _ in range(5):
        connection.exchange(pattern(3000))
    assert device.requests_repeated == 0


def test_a_slow_device_is_waited_for() -> None:
    device = FakeDevice(reverse)
    device.work_time = 6.0
    assert connect(FakeLine(device)).exchange(b"erase", patience=10.0) == b"esare"
    assert device.messages == [b"erase"]


def test_a_message_longer_than_the_device_takes_is_refused_at_once() -> None:
    connection = connect(FakeLine(FakeDevice(reverse, buffer_size=2048)))
    assert connection.buffer_size == 2048
    with pytest.raises(LinkError, match="too long"):
        connection.exchange(bytes(2049))
    assert connection.exchange(bytes(2048)) == bytes(2048)


@pytest.mark.parametrize("baud", [1200, 9600, 115200, 3_000_000])
def test_all_line_rates_work(baud: int) -> None:
    device = FakeDevice(reverse)
    assert connect(FakeLine(device, baud=baud)).exchange(pattern(4000)) == pattern(4000)[::-1]
    assert device.requests_repeated <= 2


def test_long_latency_costs_time_but_no_repetition_in_the_long_run() -> None:
    device = FakeDevice(reverse)
    connection = connect(FakeLine(device, baud=1e6, latency=0.25))
    for _ in range(20):
        connection.exchange(pattern(2000))
    repeated = device.requests_repeated
    for _ in range(10):
        connection.exchange(pattern(2000))
    assert device.requests_repeated == repeated


# ---- throughput ----


def throughput(line: FakeLine, device: FakeDevice, messages: int) -> float:
    """Share of the line's byte rate that carries message content."""
    connection = connect(line)
    begin = line.now()
    size = connection.buffer_size
    for _ in connection.stream(pattern(size) for _ in range(messages)):
        pass
    return messages * size / (line.now() - begin) / line.rate


def acknowledge(message: bytes) -> bytes:
    """A short reply, as to a block of a download."""
    return message[:40]


def test_large_messages_use_92_percent_of_the_line() -> None:
    device = FakeDevice(acknowledge)
    assert throughput(FakeLine(device), device, 8) > 0.92


def test_the_line_does_not_idle_while_the_device_works() -> None:
    device = FakeDevice(acknowledge, buffer_size=4096)
    device.work_time = 0.1
    assert throughput(FakeLine(device, latency=0.02), device, 30) > 0.91


def test_unknown_line_rates_are_used_as_well() -> None:
    device = FakeDevice(acknowledge)
    assert throughput(FakeLine(device, known_rate=False), device, 8) > 0.92


def test_long_packets_use_97_percent_of_the_line() -> None:
    device = FakeDevice(acknowledge)
    device.packet_size = 2048
    assert throughput(FakeLine(device), device, 8) > 0.97
    assert device.longest_packet == 2048


def test_a_device_that_does_not_say_so_gets_no_long_packets() -> None:
    device = FakeDevice(acknowledge)
    throughput(FakeLine(device), device, 2)
    assert device.longest_packet == 512


@pytest.mark.parametrize("packet_size", [0, 2048])
def test_a_bad_line_still_carries_two_fifths(packet_size: int) -> None:
    device = FakeDevice(acknowledge)
    device.packet_size = packet_size
    line = FakeLine(device, to_device=damage(3, 0.001), to_client=damage(4, 0.001))
    assert throughput(line, device, 30) > 0.4


# ---- bad lines ----


def exchange_surely(connection: Connection, message: bytes) -> bytes:
    """As sessions do it: a new channel when the old one was lost. CRC-16 lets one damaged frame in 65536 through."""
    for _ in range(2):
        try:
            return connection.exchange(message)
        except ChannelLost:
            connection.open()
    return connection.exchange(message)


@examples(60)
@given(
    st.integers(0, 2**32),
    st.sampled_from([0.0003, 0.001]),
    st.integers(1, 6000),
    st.booleans(),
    st.sampled_from([0, 708, 2048]),
)
def test_messages_arrive_intact_over_bad_lines(
    seed: int, rate: float, size: int, known_rate: bool, packet_size: int
) -> None:
    device = FakeDevice(reverse)
    device.packet_size = packet_size
    line = FakeLine(device, to_device=damage(seed, rate), to_client=damage(seed + 1, rate), known_rate=known_rate)
    connection = connect(line)
    for n in range(3):
        message = bytes([n]) + pattern(size)
        assert exchange_surely(connection, message) == message[::-1]
    assert {m[0] for m in device.messages} == {0, 1, 2}


@examples(40)
@given(st.integers(0, 2**32), st.sampled_from([0.003, 0.01, 0.1]), st.integers(1, 3000))
def test_over_hopeless_lines_a_message_arrives_intact_or_fails(seed: int, rate: float, size: int) -> None:
    line = FakeLine(FakeDevice(reverse), to_device=damage(seed, rate), to_client=damage(seed + 1, rate))
    message = pattern(size)
    try:
        assert connect(line).exchange(message) == message[::-1]
    except LinkError as error:
        assert error.exit_code == 3


@examples(40)
@given(st.integers(0, 2**32), st.integers(1, 12))
def test_streams_lose_no_request_and_invent_no_reply(seed: int, count: int) -> None:
    device = FakeDevice(acknowledge, buffer_size=2048)
    connection = connect(FakeLine(device, to_device=damage(seed, 0.001), to_client=damage(seed + 1, 0.002)))
    messages = [bytes([n]) * 2000 for n in range(count)]
    try:
        replies = list(connection.stream(messages))
    except ChannelLost:
        reject()  # one damaged frame in 65536 passes its CRC; sessions recover from that
    assert device.messages == messages
    assert set(replies) <= {acknowledge(m) for m in messages}
    assert replies[-1] == acknowledge(messages[-1])


def leaves_out(message: bytes) -> bool:
    """A reply is left out for all but each fourth and the last one of ten."""
    return message[0] % 4 != 3 and message[0] != 9


def test_requests_may_share_replies() -> None:
    device = FakeDevice(acknowledge, buffer_size=2048)
    device.leaves_out = leaves_out
    connection = connect(FakeLine(device))
    messages = [bytes([n]) * 2000 for n in range(10)]
    begin = connection.now()
    assert [reply[0] for reply in connection.stream(messages, sharing=True)] == [3, 7, 9]
    assert device.messages == messages and device.requests_repeated == 0
    assert connection.now() - begin < 1.1 * 10 * 2000 / connection.transport.byte_rate
    assert connection.exchange(b"after") == acknowledge(b"after")


@examples(40)
@given(st.integers(0, 2**32), st.sampled_from([0.0002, 0.001]))
def test_shared_replies_arrive_over_bad_lines(seed: int, rate: float) -> None:
    device = FakeDevice(acknowledge, buffer_size=2048)
    device.leaves_out = leaves_out
    connection = connect(FakeLine(device, to_device=damage(seed, rate), to_client=damage(seed + 1, rate)))
    messages = [bytes([n]) * 2000 for n in range(10)]
    try:
        replies = list(connection.stream(messages, sharing=True))
        last = connection.exchange(b"after")
    except ChannelLost:
        reject()
    assert device.messages == [*messages, b"after"]
    assert set(replies) <= {acknowledge(m) for m in messages}
    assert (replies[-1], last) == (acknowledge(messages[-1]), acknowledge(b"after"))


class Dropper:
    """Damages the frames with the given numbers (counted from 1 after `arm`) and no others."""

    def __init__(self, *numbers: int) -> None:
        self.numbers, self.count, self.armed = set(numbers), 0, False

    def apply(self, data: bytes) -> bytes:
        if not self.armed:
            return data
        self.count += 1
        return b"" if self.count in self.numbers else data


@pytest.mark.parametrize("lost", range(1, 6))
def test_any_single_lost_block_costs_little(lost: int) -> None:
    device, dropper = FakeDevice(reverse), Dropper(lost)
    line = FakeLine(device, to_device=dropper)  # type: ignore[arg-type]
    connection = connect(line)
    dropper.armed = True
    begin = line.now()
    assert connection.exchange(pattern(2000)) == pattern(2000)[::-1]
    assert line.now() - begin < 2 * 2000 / line.rate + 0.75


@pytest.mark.parametrize("lost", range(1, 6))
def test_any_single_lost_block_of_a_reply_costs_little(lost: int) -> None:
    device, dropper = FakeDevice(reverse), Dropper(lost)
    line = FakeLine(device, to_client=dropper)  # type: ignore[arg-type]
    connection = connect(line)
    dropper.armed = True
    begin = line.now()
    assert connection.exchange(pattern(2000)) == pattern(2000)[::-1]
    assert line.now() - begin < 3 * 2000 / line.rate + 0.75


def test_a_lost_request_for_the_missing_block_is_made_up_for() -> None:
    device, to_device, to_client = FakeDevice(reverse), Dropper(2), Dropper(1)
    line = FakeLine(device, to_device=to_device, to_client=to_client)  # type: ignore[arg-type]
    connection = connect(line)
    to_device.armed = to_client.armed = True
    begin = line.now()
    assert connection.exchange(pattern(2000)) == pattern(2000)[::-1]
    assert line.now() - begin < 2.0


def test_a_lost_reply_in_a_stream_does_not_stop_it() -> None:
    device, dropper = FakeDevice(acknowledge, buffer_size=2048), Dropper(2)
    line = FakeLine(device, to_client=dropper)  # type: ignore[arg-type]
    connection = connect(line)
    dropper.armed = True
    messages = [bytes([n]) * 2000 for n in range(5)]
    replies = list(connection.stream(messages))
    assert device.messages == messages
    assert [r[0] for r in replies] == [0, 2, 3, 4]


def test_lost_open_requests_are_repeated() -> None:
    dropper = Dropper(1, 2)
    line = FakeLine(FakeDevice(reverse), to_device=dropper)  # type: ignore[arg-type]
    dropper.armed = True
    connection = Connection(line)
    connection.open()
    assert connection.exchange(b"ab") == b"ba"


# ---- round trips ----


class Listened(FakeLine):
    """Keeps what is sent: service and first byte of each packet."""

    def __init__(self, device: FakeDevice) -> None:
        self.heard: list[tuple[int, int]] = []
        super().__init__(device)

    def send(self, *packets: bytes) -> None:
        for data in packets:
            packet = router.decode(data)
            assert packet
            self.heard.append((packet.service, packet.payload[0]))
        super().send(*packets)


OPEN, DATA, ACK = (
    (lib.ROUTER_SVC_CHANNEL, kind) for kind in (lib.CHANNEL_PKG_OPEN_REQ, lib.CHANNEL_PKG_DATA, lib.CHANNEL_PKG_ACK)
)


def test_the_one_device_of_a_line_is_not_asked_for_its_address() -> None:
    line = Listened(FakeDevice(reverse))
    assert connect(line).exchange(b"who?") == b"?ohw"
    assert line.heard == [OPEN, DATA, ACK]


def test_a_line_that_may_have_several_devices_is_asked_who_is_there() -> None:
    line = Listened(FakeDevice(reverse))
    line.peer_words = 0
    connect(line)
    assert [service for service, _ in line.heard] == [lib.ROUTER_SVC_NAME_REQUEST, lib.ROUTER_SVC_CHANNEL]


def test_the_next_request_acknowledges_a_reply_where_one_follows() -> None:
    line = Listened(FakeDevice(reverse))
    connection = connect(line)
    assert connection.exchange(b"first", more=True) == b"tsrif"
    assert connection.exchange(b"second", more=True) == b"dnoces"
    assert connection.exchange(b"last") == b"tsal"
    assert line.heard == [OPEN, DATA, DATA, DATA, ACK]


def test_a_reply_that_comes_again_because_none_followed_changes_nothing() -> None:
    connection = connect(FakeLine(FakeDevice(reverse)))
    assert connection.exchange(b"first", more=True) == b"tsrif"
    connection.wait(3.0)
    assert connection.exchange(b"second") == b"dnoces"


# ---- failures ----


def test_no_device_is_a_link_error_after_some_seconds() -> None:
    line = FakeLine(FakeDevice(reverse))
    line.cut = True
    with pytest.raises(LinkError, match="No device answers on fake line") as caught:
        Connection(line).open()
    assert caught.value.code == "no-answer"
    assert 3 < line.now() < 10


def test_a_cut_line_is_noticed() -> None:
    line = FakeLine(FakeDevice(reverse))
    connection = connect(line)
    line.cut = True
    begin = line.now()
    with pytest.raises(ChannelLost) as caught:
        connection.exchange(b"anybody?", patience=4.0)
    assert caught.value.code == "timeout"
    assert 3.99 < line.now() - begin < 6


@pytest.mark.parametrize("words", [0, 1])
def test_a_device_that_is_gone_is_reported_within_about_five_seconds(words: int) -> None:
    """With the look whether it has been started again, or another one is there."""
    line = FakeLine(FakeDevice(reverse))
    line.peer_words = words
    connection = connect(line)
    line.cut = True
    begin = line.now()
    with pytest.raises(ChannelLost):
        connection.exchange(b"anybody?")
    with pytest.raises(ChannelLost) as caught:
        connection.open()
    assert caught.value.code == "no-answer"
    assert line.now() - begin < 5.5


@pytest.mark.parametrize(("factor", "longer"), [("4", 4), ("0.5", 0.5), ("none", 1), ("-1", 1), ("1e9", 1)])
def test_a_device_is_waited_for_as_long_as_the_user_wants(
    factor: str, longer: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PLCTOOL_PATIENCE", factor)
    line = FakeLine(FakeDevice(reverse))
    connection = connect(line)
    line.cut = True
    begin = line.now()
    with pytest.raises(ChannelLost):
        connection.exchange(b"anybody?", patience=4.0)
    assert 4 * longer <= line.now() - begin < 4.5 * longer
    begin = line.now()
    with pytest.raises(ChannelLost):
        connection.open()
    assert 1.5 * longer <= line.now() - begin < 2 * longer


def test_a_device_that_is_back_is_found_again_and_waited_for_as_before() -> None:
    line = FakeLine(FakeDevice(reverse))
    connection = connect(line)
    line.cut = True
    with pytest.raises(ChannelLost):
        connection.exchange(b"anybody?")
    line.cut = False
    connection.open()
    assert connection.exchange(b"ab") == b"ba"
    line.cut = True
    begin = line.now()
    with pytest.raises(ChannelLost):
        connection.open()
    assert line.now() - begin > 4.0  # it was heard before, so this may be a bad line


def test_on_a_slow_line_the_time_of_a_block_and_its_reply_is_no_silence() -> None:
    line = FakeLine(FakeDevice(reverse), baud=600)  # a block takes 8 s
    assert connect(line).exchange(pattern(3000)) == pattern(3000)[::-1]


class Stopped(FakeLine):
    """The process of the tool stands still for 10 s after each packet; the line does not."""

    def send(self, *packets: bytes) -> None:
        super().send(*packets)
        end = self.now() + 10.0
        while self._advance(end):
            pass


def test_a_tool_that_stood_still_looks_at_what_has_arrived_before_it_gives_up() -> None:
    assert connect(Stopped(FakeDevice(reverse))).exchange(b"ab") == b"ba"


class Hearing(FakeLine):
    """The line notices that the device is there, for 6 s."""

    @property
    def heard_at(self) -> float:
        return min(self.now(), 6.0)

    @heard_at.setter
    def heard_at(self, _: float) -> None:
        pass


def test_a_device_that_only_the_line_hears_is_not_given_up() -> None:
    line = Hearing(FakeDevice(reverse))
    connection = connect(line)
    line.cut = True
    with pytest.raises(ChannelLost):
        connection.exchange(b"anybody?", patience=4.0)
    assert 7.9 < line.now() < 11.0  # twice the patience at most: nothing gets on


def test_an_unplugged_adapter_is_noticed_at_once() -> None:
    line = FakeLine(FakeDevice(reverse))
    connection = connect(line)
    line.gone = True
    with pytest.raises(LinkError) as caught:
        connection.exchange(b"anybody?")
    assert not isinstance(caught.value, ChannelLost)


def test_a_restarted_device_says_that_the_channel_is_gone_and_takes_a_new_one() -> None:
    device = FakeDevice(reverse)
    connection = connect(FakeLine(device))
    device.restart()
    with pytest.raises(ChannelLost, match="CHINVALID"):
        connection.exchange(b"ab")
    assert not connection.is_open
    connection.open()
    assert connection.exchange(b"ab") == b"ba"


def test_a_busy_device_is_a_link_error() -> None:
    device = FakeDevice(reverse)
    device.free_channels = False
    with pytest.raises(LinkError, match="busy") as caught:
        Connection(FakeLine(device)).open()
    assert caught.value.exit_code == 3


def test_a_device_that_is_busy_for_less_than_a_second_is_asked_again() -> None:
    device = FakeDevice(reverse)
    device.free_channels = False
    line = FakeLine(device)

    def become_free() -> None:
        device.free_channels = True

    line.after(0.9, become_free)
    connection = connect(line)
    assert connection.exchange(b"ab") == b"ba"
    assert 0.9 < line.now() < 1.3


def test_packages_of_strangers_and_nonsense_are_ignored() -> None:
    device = FakeDevice(reverse)
    line = FakeLine(device)
    connection = connect(line)
    too_far = b"\x02\x02\x01\x5a\xff\xff\xff\xff"
    for package in (b"", b"\x01", too_far, b"\x01\x01\x99\x99" + bytes(8), b"\x84" + bytes(40)):
        device._send_package(package)
    assert connection.exchange(b"ab") == b"ba"


@examples(100)
@given(st.integers(0, 2**32), st.integers(1, 2000))
def test_a_device_that_talks_nonsense_gives_a_link_error_or_the_right_answer(seed: int, size: int) -> None:
    """Its packages are changed before they get their frame CRC, so all of the nonsense reaches the channel."""
    rng = random.Random(seed)
    device = FakeDevice(reverse)
    send = device._send

    def mutate(service: int, payload: bytes) -> None:
        changed = bytearray(payload)
        if rng.random() < 0.3 and changed:
            changed[rng.randrange(min(24, len(changed)))] = rng.randrange(256)
        send(service, bytes(changed[: rng.randrange(len(changed) + 1)] if rng.random() < 0.1 else changed))

    connection = connect(FakeLine(device))
    device._send = mutate  # type: ignore[method-assign]
    message = pattern(size)
    with suppress(LinkError):
        assert connection.exchange(message) == message[::-1]


def test_closing_tells_the_device() -> None:
    device = FakeDevice(reverse)
    line = FakeLine(device)
    connection = connect(line)
    connection.close()
    line.receive(1.0)
    assert device._id == 0


# ---- parts ----


def test_block_sizes_follow_the_error_rate() -> None:
    rate = ErrorRate()
    assert rate.best_payload(30, 488) == 488
    for n in range(100):
        rate.count(200, lost=n % 5 == 0)
    assert 100 < rate.best_payload(30, 488) < 256
    for _ in range(400):
        rate.count(200, lost=False)
    assert rate.best_payload(30, 488) == 488


def test_timeouts_follow_the_round_trip_and_back_off() -> None:
    trip = RoundTrip(0.1)
    for _ in range(50):
        trip.sample(0.5)
    assert 0.5 <= trip.timeout < 0.6
    trip.back_off()
    assert 1.0 <= trip.timeout < 1.2
    trip.progress()
    assert trip.timeout < 0.6
