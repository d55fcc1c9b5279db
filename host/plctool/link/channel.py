"""The client end of a channel (codesys-v3-protocol 3): whole messages over a line that loses and damages packets.

No I/O and no clock in here. The caller hands in received packages and the time, sends what `next_package`
gives, and calls again when a package arrives or `deadline` is reached. Times are seconds, rates bytes per second.

The device takes blocks in order only and asks once for the first one it misses; the reply acknowledges the request.
So the client sends all it has and goes back when asked. When nothing is heard, and now and then on a bad line, it
polls: an empty block with a number that the device has already makes it say what it has, and send a lost reply again.
Blocks are given out at the rate of the line, so that little is thrown away after a loss, and their size follows the
error rate, because on a bad line most long blocks arrive damaged. Up to two requests may be under way, so that the line
does not idle while the device works, or more if the device replies to several with one reply; a reply that is left out
counts in the numbers of the device's blocks.
"""

from __future__ import annotations

import math
import zlib
from collections import deque
from dataclasses import dataclass
from enum import Enum, auto

from plctool.core import error_name, lib
from plctool.errors import LinkError
from plctool.link.wire import Layout

_META = Layout("CHANNEL_META_HEADER")
_OPEN_REQUEST = Layout("CHANNEL_OPEN_REQUEST")
_OPEN_RESPONSE = Layout("CHANNEL_OPEN_RESPONSE")
_OLD_RESPONSE = Layout("CHANNEL_OPEN_RESPONSE", before="byte_order")  # version 1.0 has no more
_CLOSE = Layout("CHANNEL_CLOSE")
_CHANNEL = Layout("CHANNEL_HEADER")  # how every channel package starts
_DATA = Layout("CHANNEL_DATA")
_MESSAGE = Layout("CHANNEL_MESSAGE")
_ACK = Layout("CHANNEL_ACK")

WANTED_BUFFER = 0x4000  # longest message we would like to send or get, bytes
MAX_REQUESTS = 2  # requests under way at the same time
MAX_SHARING = 6  # the same, if several of them share a reply
_OPEN_RETRY = 0.3  # first repetition of a lost request to open [s]
_LONGEST_RETRY = 1.0
_NO_PROGRESS = 2  # times the patience: how long a device may be heard without anything getting on
_SHORTEST_TIMEOUT = 0.1
_FIRST_TIMEOUT = 0.4  # until a round trip has been measured
_AHEAD, _AHEAD_BAD = 0.05, 0.005  # how far ahead of the line blocks are given to it, on a good and a bad line [s]
_POLL_EVERY = 4  # blocks, on a bad line
_WINDOW = 2 * _POLL_EVERY  # most blocks under way on a bad line
_MAX_LOSSES = 40  # of one block
_MIN_PAYLOAD = 64
_REQUEST_COST = 44  # bytes of a request that are not its content, about
_LOSS_COST = 3  # blocks that have to be sent again for each that is lost
_RATE_MEMORY = 8192  # bytes over which the error rate of the line is averaged


class ChannelLost(LinkError):
    """The channel is gone but the line may be well: a new one can be opened."""


class State(Enum):
    CLOSED = auto()
    OPENING = auto()
    OPEN = auto()


@dataclass
class Line:
    """What a channel has to know of the line below it."""

    max_package: int  # longest layer 4 package, bytes
    overhead: int  # bytes the line carries for each package besides it
    byte_rate: float  # math.inf when unknown
    long_packet: int = 0  # longest packet to a device that says it takes so much, bytes; 0: as all others
    header: int = 0  # bytes of a packet before the package


@dataclass
class _Block:
    """A piece of `message` from `offset` on, in its package."""

    number: int
    message: bytes = b""
    offset: int = 0
    package: bytes = b""
    is_last: bool = False  # of the message
    sends: int = 0
    gone_at: float = 0.0  # when its last byte leaves the line


class RoundTrip:
    """Smoothed time from a block to its acknowledgement, and its variation, as TCP does it (RFC 6298)."""

    def __init__(self, floor: float) -> None:
        self.shortest = 0.0
        self.floor = floor  # shortest time-out
        self._smoothed = _FIRST_TIMEOUT
        self._variation = 0.0
        self._measured = False
        self._backoff = 1

    def sample(self, seconds: float) -> None:
        """Takes a measured round trip; only of what was sent once."""
        seconds = max(seconds, 0.0)
        if self._measured:
            self._variation += (abs(seconds - self._smoothed) - self._variation) / 4
            self._smoothed += (seconds - self._smoothed) / 8
            self.shortest = min(self.shortest, seconds)
        else:
            self._smoothed, self._variation, self.shortest = seconds, seconds / 2, seconds
        self._measured = True

    def back_off(self) -> None:
        """Doubles the time-out until `progress`."""
        self._backoff *= 2

    def progress(self) -> None:
        self._backoff = 1

    @property
    def timeout(self) -> float:
        plain = max(self._smoothed + 4 * self._variation, self.floor)
        return min(plain * self._backoff, max(plain, _LONGEST_RETRY))


class ErrorRate:
    """Damage per byte of the line as the channel sees it, and the block size that suits it."""

    def __init__(self) -> None:
        self._bytes = float(_RATE_MEMORY)
        self._losses = 0.0

    def count(self, size: int, lost: bool) -> None:
        keep = 1 - size / _RATE_MEMORY
        self._bytes = self._bytes * keep + size
        self._losses = self._losses * keep + lost

    @property
    def is_bad(self) -> bool:
        """Whether there have been losses lately."""
        return self._losses > 0.5

    def best_payload(self, overhead: int, longest: int) -> int:
        """Payload with the least cost per byte, overhead/n + cost*n: smallest at n = sqrt(overhead/cost)."""
        cost = _LOSS_COST * self._losses / self._bytes
        if cost * longest * longest <= overhead:
            return longest
        return max(_MIN_PAYLOAD, int(math.sqrt(overhead / cost)))


class Channel:
    """State machine of one channel: `open`, then `send` messages, MAX_REQUESTS or MAX_SHARING at a time, and take their
    `replies`."""

    def __init__(self, line: Line, address_words: int, request_id: int) -> None:
        self.state = State.CLOSED
        self.buffer_size = 0  # longest message the device takes, bytes
        self.outstanding = 0  # requests without reply
        self.replies: deque[bytes] = deque()
        self.more_follows = False  # a request, soon after the last reply, which it acknowledges
        self._line = line
        self._address_words = address_words
        self._request_id = request_id
        self._id = 0
        self._opens = 0
        self._max_package = line.max_package
        self._round_trip = RoundTrip(_floor(line.max_package, line.byte_rate))
        self._error_rate = ErrorRate()
        self._line_free = 0.0  # when the line will have carried all that was sent
        self._timer = math.inf
        self._heard = self._progress = 0.0  # when the device was last heard, and when something got on
        self._control: deque[bytes] = deque()
        # Sending.
        self._outbox: deque[bytes] = deque()  # messages that are not completely cut into blocks
        self._cut = 0  # bytes of the first of them that are
        self._flight: deque[_Block] = deque()  # blocks without acknowledgement
        self._next = 0  # index in _flight of the next block to send
        self._newest = _Block(0)
        self._losses = 0  # of the oldest block in flight
        self._unanswered = 0  # requests that are completely sent
        self._unpolled = 0  # blocks since the last poll
        self._polls: deque[int] = deque()  # newest block sent before each poll that has not been answered
        self._quiet = False  # no block was sent since the last poll
        # Receiving.
        self._received = 0  # highest block number received in order
        self._incoming = bytearray()
        self._expected: tuple[int, int] | None = None  # length and CRC of the message that is coming in
        self._asked_at = -math.inf  # when a missing block was last asked for

    @property
    def best_size(self) -> int:
        """Length of message with the largest share of content on the line: the longest one, or the longest one that
        fills its blocks, as a short last block costs as much as a full one."""
        room = self._max_package - _DATA.size
        filled = (self.buffer_size + _MESSAGE.size) // room * room - _MESSAGE.size
        return max((size for size in (filled, self.buffer_size) if size > 0), key=self._content_share, default=0)

    def _content_share(self, size: int) -> float:
        blocks = -(-(size + _MESSAGE.size) // (self._max_package - _DATA.size))
        return (size - _REQUEST_COST) / (size + _MESSAGE.size + blocks * (_DATA.size + self._line.overhead))

    # ---- commands ----

    def open(self, now: float) -> None:
        self.state = State.OPENING
        self._timer = self._heard = self._progress = now

    def send(self, message: bytes, now: float) -> None:
        """Takes a request to be sent."""
        assert self.state is State.OPEN and self.outstanding < MAX_SHARING
        if len(message) > self.buffer_size:
            raise LinkError(f"A request of {len(message)} bytes is too long for the device.", "too-long")
        self._outbox.append(message)
        self.outstanding += 1
        self._heard = self._progress = now

    def close(self) -> None:
        """Closes the channel; there is no reply."""
        if self.state is State.OPEN:
            self._control.append(_meta(_CLOSE, lib.CHANNEL_PKG_CLOSE_REQ, id=self._id, error=lib.ERR_OK))
        self._shut()

    def _shut(self) -> None:
        self.state, self._timer = State.CLOSED, math.inf

    # ---- output ----

    def deadline(self) -> float:
        """When `next_package` has to be asked again even if nothing arrives."""
        return min(self._timer, self._ready_at()) if self._has_block() else self._timer

    def give_up_at(self, patience: float, heard_at: float = -math.inf) -> float:
        """When to give up: after `patience` seconds of silence, or much longer without progress. On a slow line there
        is time for a package and its reply on top. `heard_at`: when the line has heard the device."""
        patience += self._round_trip.floor
        return min(max(self._heard, heard_at) + patience, self._progress + _NO_PROGRESS * patience)

    def next_package(self, now: float) -> bytes | None:
        """The next package to send now; None when there is none until something arrives or `deadline` is reached."""
        if now >= self._timer:
            self._on_timeout(now)
        if self._control:
            package = self._control.popleft()
            self._departure(package, now)
            return package
        if not self._has_block() or now < self._ready_at():
            return None
        if self._next == len(self._flight):
            self._flight.append(self._cut_block())
        block = self._flight[self._next]
        self._next += 1
        block.sends += 1
        block.gone_at = self._departure(block.package, now)
        self._heard = self._progress = now  # silence counts from now on
        self._timer = block.gone_at + self._round_trip.timeout
        self._quiet = False
        self._unpolled += 1
        if self._unpolled >= _POLL_EVERY and self._error_rate.is_bad:
            self._poll()
        return block.package

    def _departure(self, package: bytes, now: float) -> float:
        """When the line will have carried the package that is sent now."""
        self._line_free = max(self._line_free, now) + (len(package) + self._line.overhead) / self._line.byte_rate
        return self._line_free

    def _ready_at(self) -> float:
        """When the line will soon have carried all it was given: time to hand out the next block."""
        return self._line_free - (_AHEAD_BAD if self._error_rate.is_bad else _AHEAD)

    def _has_block(self) -> bool:
        """Whether there is a block that may be sent."""
        open_window = self._next < _WINDOW or not self._error_rate.is_bad
        return self.state is State.OPEN and open_window and bool(self._next < len(self._flight) or self._outbox)

    def _cut_block(self) -> _Block:
        """Cuts the next block off the oldest message, as long as suits the line."""
        message = self._outbox[0]
        number = self._newest.number + 1
        first = self._cut == 0
        flags = lib.CHANNEL_FLAG_TO_SERVER | (lib.CHANNEL_FLAG_FIRST if first else 0)
        head = self._data_head(flags, number)
        if first:
            head += _MESSAGE.pack(size=len(message), crc=zlib.crc32(message))
        size = self._error_rate.best_payload(self._line.overhead + len(head), self._max_package - len(head))
        end = min(self._cut + size, len(message))
        package = head + message[self._cut : end]
        self._newest = _Block(number, message, self._cut, package, is_last=end == len(message))
        self._cut = end
        if self._newest.is_last:
            self._outbox.popleft()
            self._unanswered += 1
            self._cut = 0
        return self._newest

    # ---- time-outs ----

    def _on_timeout(self, now: float) -> None:
        if self.state is State.OPENING:
            wanted = {"request_id": self._request_id, "limit": WANTED_BUFFER, "address_words": self._address_words}
            packet = self._line.long_packet
            self._control.append(_meta(_OPEN_REQUEST, lib.CHANNEL_PKG_OPEN_REQ, **wanted, packet=packet))
            self._opens += 1
            self._timer = now + min(_OPEN_RETRY * self._opens, _LONGEST_RETRY)
            return
        self._round_trip.back_off()
        self._timer = now + self._round_trip.timeout
        if self._expected:
            self._ask_missing(now)
        else:
            self._poll()
            self._quiet = True

    def _poll(self) -> None:
        """Makes the device say what it has, with a block it has already."""
        known = self._flight[0].number - 1 if self._flight else self._newest.number
        flags = lib.CHANNEL_FLAG_TO_SERVER
        self._control.append(self._data_head(flags, known))
        self._polls.append(known + self._next)
        self._unpolled = 0

    def _data_head(self, flags: int, number: int) -> bytes:
        return _DATA.pack(
            type=lib.CHANNEL_PKG_DATA, flags=flags, id=self._id, block=number, acknowledged=self._received
        )

    def _ask_missing(self, now: float) -> None:
        self._asked_at = now
        self._acknowledge(lib.CHANNEL_FLAG_MISSING)

    def _acknowledge(self, flags: int = 0) -> None:
        flags |= lib.CHANNEL_FLAG_TO_SERVER
        self._control.append(_ACK.pack(type=lib.CHANNEL_PKG_ACK, flags=flags, id=self._id, acknowledged=self._received))

    # ---- input ----

    def receive(self, package: bytes, now: float) -> None:
        """Takes a layer 4 package; ignores what is malformed or not ours. Raises LinkError when the device says no."""
        if len(package) < _CHANNEL.size:
            return
        self._heard = now
        head = _CHANNEL.unpack(package)
        if head.type in (lib.CHANNEL_PKG_OPEN_RESP, lib.CHANNEL_PKG_CLOSE):
            self._receive_meta(head.type, package, now)
        elif self.state is not State.OPEN or head.id != self._id:
            return
        elif head.type == lib.CHANNEL_PKG_DATA and len(package) >= _DATA.size:
            self._receive_data(package, now)
        elif head.type == lib.CHANNEL_PKG_ACK and len(package) >= _ACK.size:
            number = _ACK.unpack(package).acknowledged
            self._receive_ack(number, now)
            if head.flags & lib.CHANNEL_FLAG_MISSING:
                self._go_back(number, now, recut=True)
            else:
                self._receive_poll_answer(number, now)

    def _receive_meta(self, kind: int, package: bytes, now: float) -> None:
        size = len(package) if _is_whole(package) else 0
        if kind == lib.CHANNEL_PKG_OPEN_RESP and self.state is State.OPENING and size >= _OLD_RESPONSE.size:
            self._receive_opened(package, now)
        elif kind == lib.CHANNEL_PKG_CLOSE and self.state is State.OPEN and size >= _CLOSE.size:
            close = _CLOSE.unpack(package)
            if close.id == self._id:
                self._shut()
                reason = error_name(close.error)
                raise ChannelLost(f"The device closed the connection ({reason}); try again.", "closed")

    def _receive_opened(self, package: bytes, now: float) -> None:
        opened = _OLD_RESPONSE.unpack(package)
        if opened.request_id != self._request_id:
            return
        if opened.result != lib.CHANNEL_OPEN_OK:
            self._shut()
            raise LinkError("The device is busy with another tool; close that one or wait a few seconds.", "busy")
        if self._opens == 1:
            self._round_trip.sample(now - self._line_free)
        self._id, self.buffer_size = opened.id, min(opened.limit, WANTED_BUFFER)
        self.state, self._timer = State.OPEN, math.inf
        if len(package) >= _OPEN_RESPONSE.size:
            self._take_packet_size(min(_OPEN_RESPONSE.unpack(package).packet, self._line.long_packet))

    def _take_packet_size(self, longest: int) -> None:
        """What the device takes beyond what all take; 0: nothing."""
        self._max_package = max(self._max_package, longest - self._line.header)
        self._round_trip.floor = _floor(self._max_package, self._line.byte_rate)

    def _receive_ack(self, number: int, now: float) -> None:
        """Everything up to block `number` has arrived."""
        if not self._flight or not self._flight[0].number <= number <= self._flight[-1].number:
            return
        while self._flight and self._flight[0].number <= number:
            block = self._flight.popleft()
            self._next = max(0, self._next - 1)
            self._error_rate.count(len(block.package) + self._line.overhead, lost=False)
        if block.sends == 1:
            self._round_trip.sample(now - block.gone_at)
        self._losses = 0
        self._round_trip.progress()
        self._progress = now
        self._timer = max(self._line_free, now) + self._round_trip.timeout

    def _receive_poll_answer(self, number: int, now: float) -> None:
        """What was sent before the oldest poll without answer and is not in this one is lost."""
        if self._quiet and self._polls and number < self._polls[0]:
            self._go_back(number, now, recut=False)
        while self._polls and self._polls[0] <= number:
            self._polls.popleft()

    def _go_back(self, number: int, now: float, recut: bool) -> None:
        """The device has everything up to `number` and the next block was lost: starts again from there.

        `recut`: what is in flight may be cut again, because the device drops what of it is still to come. That
        holds when it has reported the block as missing and no second copy of it is under way.
        """
        if not self._flight or self._flight[0].number != number + 1:
            return
        lost = self._flight[0]
        if now - lost.gone_at < self._round_trip.shortest:
            return  # reported before this copy can have arrived
        self._losses += 1
        if self._losses > _MAX_LOSSES:
            raise ChannelLost("Too many retries: blocks keep getting lost; check the cable.", "bad-line")
        self._error_rate.count(len(lost.package) + self._line.overhead, lost=True)
        self._next = self._unpolled = 0
        self._polls.clear()
        if recut and lost.sends == 1:
            self._put_back()

    def _put_back(self) -> None:
        """Puts everything in flight back to the messages that are not cut yet."""
        for block in reversed(self._flight):
            if block.is_last:
                self._outbox.appendleft(block.message)
                self._unanswered -= 1
        self._cut = self._flight[0].offset
        self._newest = _Block(self._flight[0].number - 1)
        self._flight.clear()

    def _receive_data(self, package: bytes, now: float) -> None:
        head = _DATA.unpack(package)
        number = head.block
        first = bool(head.flags & lib.CHANNEL_FLAG_FIRST)
        self._receive_ack(head.acknowledged, now)
        if number <= self._received:
            self._acknowledge()  # our acknowledgement was lost
        elif number > self._received + 1 and not (first and self._unanswered > 1):
            if now - self._asked_at >= self._round_trip.timeout:
                self._ask_missing(now)
        elif self._unanswered and self._take(package[_DATA.size :], first):
            for _ in range(min(number - self._received - 1, self._unanswered - 1)):
                self._answered()  # a previous reply was left out, or lost for good
            self._received = number
            self._asked_at = -math.inf
            self._progress = now
            self._timer = max(self._line_free, now) + self._round_trip.timeout
            self._finish_reply()

    def _take(self, content: bytes, first: bool) -> bool:
        """Adds a block to the reply; False when it does not fit there."""
        if first:
            if len(content) < _MESSAGE.size:
                return False
            message = _MESSAGE.unpack(content)
            if message.size > WANTED_BUFFER:
                return False
            self._expected = message.size, message.crc
            self._incoming.clear()
            content = content[_MESSAGE.size :]
        elif not self._expected:
            return False
        self._incoming += content
        return True

    def _finish_reply(self) -> None:
        """Delivers the reply when it is complete. A request under way or to come acknowledges it, otherwise we do at
        once."""
        assert self._expected
        length, crc = self._expected
        if len(self._incoming) < length:
            return
        self._expected = None
        reply = bytes(self._incoming)
        if len(reply) != length or zlib.crc32(reply) != crc:
            raise ChannelLost("A reply arrived damaged; try again.", "checksum")
        self.replies.append(reply)
        self._answered()
        self._round_trip.progress()
        if not self.outstanding:
            self._timer = math.inf
            if not self.more_follows:
                self._acknowledge()

    def _answered(self) -> None:
        """The oldest request is done with."""
        self.outstanding -= 1
        self._unanswered -= 1


def _floor(package: int, byte_rate: float) -> float:
    """The shortest time-out on a line with packages of up to that many bytes."""
    return max(_SHORTEST_TIMEOUT, 2 * package / byte_rate)


def _meta(layout: Layout, kind: int, **body: int) -> bytes:
    """A meta package; its CRC covers all of it with the CRC field zero."""
    crc = zlib.crc32(layout.pack(type=kind, version=lib.CHANNEL_VERSION, **body))
    return layout.pack(type=kind, version=lib.CHANNEL_VERSION, crc=crc, **body)


def _is_whole(package: bytes) -> bool:
    """Whether the CRC of a meta package is right."""
    if len(package) < _META.size:
        return False
    head = _META.unpack(package)
    return zlib.crc32(_META.pack(**head._replace(crc=0)._asdict()) + package[_META.size :]) == int(head.crc)
