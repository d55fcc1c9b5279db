"""A device reached over a block transport: name service, one channel, whole messages. The only I/O loop of the link."""

from __future__ import annotations

import math
import os
import re
import secrets
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice
from typing import Protocol

from plctool.core import lib
from plctool.errors import LinkError
from plctool.link import names, router
from plctool.link.channel import MAX_REQUESTS, MAX_SHARING, Channel, ChannelLost, Line, State
from plctool.link.transport import BlockTransport

PATIENCE = 3.5  # default time of silence after which a channel counts as lost; most devices erase flash in less [s]
ERASE_PATIENCE = 5.0  # for what may erase a sector of flash [s]
SLOW_PATIENCE = 30.0  # for what may erase much of it or run initialisation code [s]
_OPEN_PATIENCE = 5.0
_AGAIN_PATIENCE = 1.5  # the same for a device that has been silent for too long just before [s]
_BUSY_PATIENCE = 1.5  # in less a device notices that a tool has vanished which held a channel [s]
_PORT_OF_HOST = re.compile(r"[\w.-]+:\d+$")
_BUSY_PAUSE = 0.25  # between two requests for a channel [s]
_AT_ONCE = 16  # packages sent before the next look at the input
_ASK_EVERY = 0.4  # a lost name request is repeated after [s]
_LONG_REQUEST = 256  # bytes of those on a network: a device limits replies that are longer than the request
SCAN_SECONDS = 1.5
_ALL_REPLIED = 1.0  # time after which all devices on a bus have replied [s]


def patience_factor() -> float:
    """How many times as long as usual a device may be silent, by PLCTOOL_PATIENCE in the environment: for lines that
    are interrupted for seconds, and for devices that are processes of a busy machine. 1 if that is not a number."""
    with suppress(ValueError):
        return bounded_factor(float(os.environ.get("PLCTOOL_PATIENCE", "1")))
    return 1.0


def bounded_factor(factor: float) -> float:
    """Such a factor, 1 for one that makes no sense."""
    return factor if 0.1 <= factor <= 100 else 1.0


def no_answer(name: str) -> ChannelLost:
    """The error of a link on which no device answers."""
    what = "and that it is a controller" if _PORT_OF_HOST.search(name) else "the cable, and the baud rate or address"
    return ChannelLost(f"No device answers on {name}; check that it is on, {what}.", "no-answer")


def _node_texts(nodes: Iterable[names.Node]) -> str:
    """What users choose from: `1 (press), 2 (mixer)`."""
    found = sorted(nodes, key=lambda node: node.address)
    return ", ".join(f"{int.from_bytes(node.address, 'big')} ({node.node_name})" for node in found)


def _several(name: str, choice: Choice, nodes: Iterable[names.Node]) -> LinkError:
    return LinkError(
        f"Several devices answer on {name}: {_node_texts(nodes)}; say which one with {choice.option}.", "several"
    )


def _no_such_node(name: str, choice: Choice, nodes: Iterable[names.Node]) -> LinkError:
    return LinkError(
        f"No device on {name} has the name {choice.wanted}; these answer: {_node_texts(nodes)}.", "no-answer"
    )


@dataclass(frozen=True)
class Choice:
    """Which device is meant on a link where several may reply: its number or name, "" for the only one. `option`: how a
    user says it."""

    wanted: str
    option: str = "--node"

    @property
    def number(self) -> int | None:
        return int(self.wanted) if self.wanted.isdecimal() else None

    def fits(self, node: names.Node) -> bool:
        if self.number is not None:
            return node.address == self.number.to_bytes(2, "big")
        return self.wanted in ("", node.node_name)


class MessageLink(Protocol):
    """Whole messages to one device and back, over a line of this process (Connection) or through a gateway."""

    @property
    def name(self) -> str:
        """For messages: the port or address."""

    @property
    def is_open(self) -> bool: ...

    @property
    def buffer_size(self) -> int:
        """Longest message the device takes, in bytes; 0 while no channel is open."""

    @property
    def best_size(self) -> int:
        """Length of message that carries most for its cost, in bytes; 0 while no channel is open."""

    @property
    def is_slow(self) -> bool:
        """Whether it pays to pack what is sent; False while no channel is open."""

    @property
    def is_bus(self) -> bool:
        """Whether a reply takes the time of what is sent, so that one reply should do for several requests."""

    def open(self) -> None: ...
    def exchange(self, message: bytes, patience: float = PATIENCE, *, more: bool = False) -> bytes: ...
    def stream(
        self, messages: Iterable[bytes], patience: float = PATIENCE, *, sharing: bool = False, more: bool = False
    ) -> Iterator[bytes]: ...
    def scan(self, seconds: float = SCAN_SECONDS, enough: int = 0) -> list[names.Node]: ...
    def now(self) -> float:
        """Monotonic time in seconds; virtual for virtual lines."""

    def wait(self, seconds: float) -> None:
        """Lets time pass, less than a channel bears without a package."""

    def close(self) -> None: ...


class Connection:
    """The way to one device. `open` finds it and opens a channel, `exchange` sends a request and returns the reply."""

    def __init__(self, transport: BlockTransport, choice: Choice | None = None) -> None:
        self.transport = transport
        self._choice = choice
        self._peer: bytes | None = None
        self._channel: Channel | None = None
        self._silent = False  # it was given up, and has not been heard since
        self.patience_factor = patience_factor()

    def __enter__(self) -> Connection:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    @property
    def name(self) -> str:
        return self.transport.name

    @property
    def is_open(self) -> bool:
        return self._channel is not None

    def now(self) -> float:
        return self.transport.now()

    @property
    def buffer_size(self) -> int:
        return self._channel.buffer_size if self._channel else 0

    @property
    def best_size(self) -> int:
        return self._channel.best_size if self._channel else 0

    @property
    def is_slow(self) -> bool:
        return self.transport.is_slow

    @property
    def is_bus(self) -> bool:
        return self.transport.is_bus

    def open(self) -> None:
        """Opens a new channel. The first time it asks for the device's address before, unless there is one device
        only, whose response has it. The same if the device was silent before: there may be another one by now. Raises
        LinkError if no device answers."""
        if self._silent:
            self._peer = None
        if self._peer is None and (self._choice is not None or not self.transport.peer_words):
            self._peer = self._find(self._choice).address
        peer = self._peer or bytes(2 * self.transport.peer_words)
        header = router.header_size(peer, self.transport.local_address)
        line = Line(
            self.transport.max_packet - header,
            header + self.transport.packet_overhead,
            self.transport.byte_rate,
            self.transport.long_packet,
            header,
        )
        words = (len(peer) + len(self.transport.local_address)) // 2
        end = self.transport.now() + _BUSY_PATIENCE
        while (channel := self._open_channel(line, words, last=self.transport.now() >= end)) is None:
            self.wait(_BUSY_PAUSE)
        self._channel, self._silent = channel, False

    @property
    def _open_patience(self) -> float:
        again = _AGAIN_PATIENCE + 2 * self.transport.max_packet / self.transport.byte_rate
        return min(again, _OPEN_PATIENCE) if self._silent else _OPEN_PATIENCE

    def _open_channel(self, line: Line, words: int, *, last: bool) -> Channel | None:
        """None if all channels of the device are in use and this is not the last time that it is asked."""
        channel = Channel(line, words, secrets.randbits(32))
        channel.open(self.transport.now())
        try:
            self._run(channel, lambda: channel.state is State.OPEN, self._open_patience)
        except ChannelLost:
            if self._peer is None:
                raise no_answer(self.name) from None
            raise
        except LinkError as error:
            if last or error.code != "busy":
                raise
            return None
        return channel

    def _find(self, choice: Choice | None) -> names.Node:
        """The device that is meant. Raises LinkError when it does not reply, or there are several."""
        if choice is None or choice.number is not None:
            found = self.scan(self.patience_factor * self._open_patience, enough=1)
            if not found:
                raise no_answer(self.name)
            return found[0]
        found = self._find_fitting(choice)
        fitting = [node for node in found if choice.fits(node)]
        if len(fitting) == 1:
            return fitting[0]
        if not found:
            raise no_answer(self.name)
        raise _several(self.name, choice, fitting) if fitting else _no_such_node(self.name, choice, found)

    def _find_fitting(self, choice: Choice) -> list[names.Node]:
        """The devices that reply within the time that all need, or longer until one of them is meant."""
        found: dict[bytes, names.Node] = {}
        end = self.now() + self.patience_factor * self._open_patience
        while self.now() < end and not any(map(choice.fits, found.values())):
            found |= {node.address: node for node in self.scan(_ALL_REPLIED)}
        return list(found.values())

    def exchange(self, message: bytes, patience: float = PATIENCE, *, more: bool = False) -> bytes:
        """Sends a request and returns the reply. `patience`: seconds of silence that are borne. `more`: as in `stream`.

        Raises ChannelLost when the channel is gone; `open` gives a new one.
        """
        (reply,) = self.stream([message], patience, more=more)
        return reply

    def stream(
        self,
        messages: Iterable[bytes],
        patience: float = PATIENCE,
        check: Callable[[], None] = lambda: None,
        *,
        sharing: bool = False,
        more: bool = False,
    ) -> Generator[bytes, None, None]:
        """Sends requests, the next one already while the device works on the previous one, and yields the replies.

        On a bad line there may be fewer replies than requests, but never none to the last one. `sharing`: in the
        requests the device was asked to leave replies out, so more may be under way. `more`: another request follows at
        once, and acknowledges the last reply. When the stream is left before its end the channel is closed, so that the
        device gets no more of it. `check` is called again and again meanwhile; what it raises ends the stream.
        """
        if self._channel is None:
            raise ChannelLost("There is no connection to the device.", "closed")
        channel, requests = self._channel, iter(messages)
        channel.more_follows = more
        most = MAX_SHARING if sharing else MAX_REQUESTS
        try:
            while True:
                while channel.outstanding < most and (message := next(requests, None)) is not None:
                    channel.send(message, self.transport.now())
                    self._send_some(channel)  # the next message may take time to make
                if not channel.outstanding:
                    return
                self._run(channel, lambda: bool(channel.replies), patience, check)
                while channel.replies:
                    yield channel.replies.popleft()
        finally:
            if channel.outstanding:  # the caller has stopped: further replies are of no use
                self._drop_channel()

    def scan(self, seconds: float = SCAN_SECONDS, enough: int = 0) -> list[names.Node]:
        """Devices that answer a broadcast name request within `seconds`; stops early when `enough` have answered.

        Replies that have arrived by then are taken: this process may have had to wait, too.
        """
        request_id = secrets.randbits(32)
        found: list[names.Node] = []  # two may have one address by mistake
        long_request = 0
        now = self.transport.now()
        end, ask_at = now + seconds, now
        while not (enough and len(found) >= enough):
            if ask_at <= now < end:
                request = names.encode_request(request_id, long_request)
                long_request = _LONG_REQUEST if self.transport.byte_rate == math.inf else 0
                self.transport.send(self._packet(lib.ROUTER_SVC_NAME_REQUEST, router.BROADCAST, request))
                ask_at = now + _ASK_EVERY
            node = self._named(self._receive(max(0.0, min(ask_at, end) - now)), request_id)
            if node and node not in found:
                found.append(node)
            elif now >= end:
                break
            now = self.transport.now()
        return found

    def _named(self, packet: router.Packet | None, request_id: int) -> names.Node | None:
        """The device that has sent this reply to a name request; None for other packets."""
        if not packet or packet.service != lib.ROUTER_SVC_NAME_RESPONSE:
            return None
        node = names.decode_reply(packet.payload, request_id, packet.sender)
        return node and replace(node, place=self.transport.places.get(node.address, ""))

    def wait(self, seconds: float) -> None:
        """See MessageLink."""
        end = self.now() + seconds
        while (left := end - self.now()) > 0:
            self._receive(left)

    def close(self) -> None:
        """Closes channel and transport; never raises."""
        self._drop_channel()
        self.transport.close()

    def _drop_channel(self) -> None:
        channel, self._channel = self._channel, None
        if channel:
            channel.close()
            with suppress(LinkError):  # the device notices by itself
                while self._send_some(channel):
                    pass

    def _run(
        self, channel: Channel, done: Callable[[], bool], patience: float, check: Callable[[], None] = lambda: None
    ) -> None:
        """Moves packages until `done`. Raises ChannelLost after `patience` seconds of silence."""
        try:
            while not done():
                check()
                self._move(channel, patience)
            while self._send_some(channel):
                pass  # the acknowledgement of the reply
        except LinkError as error:
            if error.code == "link-lost":
                self._channel = None  # a close package could not be sent
            raise

    def _move(self, channel: Channel, patience: float) -> None:
        """Sends some packages, and takes one or waits for it. What has arrived is taken before the device is given up:
        this process may have had to wait, too."""
        sent = self._send_some(channel)
        wake_at = min(channel.deadline(), self._give_up_at(channel, patience))
        packet = self._receive(0.0 if sent else max(0.0, wake_at - self.transport.now()))
        if packet and packet.service == lib.ROUTER_SVC_CHANNEL and self._is_from_peer(packet):
            channel.receive(packet.payload, self.transport.now())
            if self._peer is None and channel.state is State.OPEN:
                self._peer = packet.sender
        if self.transport.now() >= self._give_up_at(channel, patience):
            self._silent = True
            raise ChannelLost(f"The device on {self.name} does not answer any more; check the line.", "timeout")

    def _give_up_at(self, channel: Channel, patience: float) -> float:
        return channel.give_up_at(self.patience_factor * patience, self.transport.heard_at)

    def _send_some(self, channel: Channel) -> bool:
        """Sends the packages that are due, up to _AT_ONCE. False if there were none."""
        packages = iter(lambda: channel.next_package(self.transport.now()), None)
        peer = self._peer or router.BROADCAST
        packets = [self._packet(lib.ROUTER_SVC_CHANNEL, peer, package) for package in islice(packages, _AT_ONCE)]
        if packets:
            self.transport.send(*packets)
        return bool(packets)

    def _packet(self, service: int, receiver: bytes, payload: bytes) -> bytes:
        return router.encode(router.Packet(service, receiver, self.transport.local_address, payload))

    def _receive(self, timeout: float) -> router.Packet | None:
        """The next packet for us, None when none came in time."""
        data = self.transport.receive(timeout)
        packet = router.decode(data) if data is not None else None
        return packet if packet and self._is_for_us(packet) else None

    def _is_for_us(self, packet: router.Packet) -> bool:
        return self.transport.point_to_point or packet.receiver in (router.BROADCAST, self.transport.local_address)

    def _is_from_peer(self, packet: router.Packet) -> bool:
        if self._peer is None:
            return len(packet.sender) == 2 * self.transport.peer_words
        return self.transport.point_to_point or packet.sender == self._peer
