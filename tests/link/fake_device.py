"""A device in Python on a line with a virtual clock: fast, repeatable, and as bad as a test wants it.

The channel server follows the rules written down in docs/protocol.md, independently of the client's code. Nothing
sleeps: `FakeLine.receive` moves the clock to the next event.
"""

from __future__ import annotations

import hashlib
import heapq
import hmac
import itertools
import math
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from plctool.core import lib
from plctool.errors import LinkError
from plctool.link import bintag, router, simplecom
from plctool.link.transport import NO_PLACES
from plctool.testing.line import BITS_PER_BYTE, Damage

_FORCED = struct.Struct("<4B16s8s")  # MON2_FORCED: what says its place, and the value

DEVICE_ADDRESS = b"\x00\x01"
CLIENT_ADDRESS = b"\x00\x02"
NODE_NAME, DEVICE_NAME, VENDOR_NAME, SERIAL = "press-3", "Fake controller", "No vendor", "S-0815"

OUTPUT_BUFFER = 4096  # bytes that an operating system takes before a writer has to wait


def damage(seed: int, rate: float) -> Damage:
    """Bytes lost, doubled and flipped, each at a third of `rate`."""
    return Damage(rate / 3, rate / 3, rate / 3, seed)


class FakeLine:
    """A block transport whose other end is a `FakeDevice`. Every byte takes its time; latency is added to frames."""

    def __init__(
        self,
        device: FakeDevice,
        baud: float = 115200,
        latency: float = 0.001,
        to_device: Damage | None = None,
        to_client: Damage | None = None,
        known_rate: bool = True,
    ) -> None:
        self.name = "fake line"
        self.local_address = CLIENT_ADDRESS
        self.max_packet = simplecom.MAX_PACKET
        self.long_packet = simplecom.LONG_PACKET
        self.packet_overhead = simplecom.FRAME_OVERHEAD
        self.point_to_point = False
        self.heard_at = -math.inf
        self.peer_words = 1
        self.places = NO_PLACES
        self.rate = baud / BITS_PER_BYTE
        self.byte_rate = self.rate if known_rate else math.inf
        self.is_slow = True
        self.is_bus = False
        self.cut = False  # a cut line carries nothing
        self.gone = False  # an unplugged adapter raises
        self.sent_bytes = 0
        self._time = 0.0
        self._events: list[tuple[float, int, Callable[[], None]]] = []
        self._order = itertools.count()
        self._inbox: list[bytes] = []
        self._decoder = simplecom.Decoder()
        self._latency = latency
        self._damage = {True: to_device or Damage(), False: to_client or Damage()}
        self._free = {True: 0.0, False: 0.0}
        self.device = device
        device.attach(self)

    # ---- what the client sees ----

    def fileno(self) -> int | None:
        return None

    def now(self) -> float:
        return self._time

    def send(self, *packets: bytes) -> None:
        for packet in packets:
            self._send(packet)

    def _send(self, packet: bytes) -> None:
        if self.gone:
            raise LinkError("The serial line fake line was lost.", "link-lost")
        frame = simplecom.encode(packet)
        self.sent_bytes += len(frame)
        self._carry(True, frame, self.device.take_bytes)
        while (drained := self._free[True] - OUTPUT_BUFFER / self.rate) > self._time:
            self._advance(drained)

    def receive(self, timeout: float) -> bytes | None:
        end = self._time + timeout
        while not self._inbox and self._advance(end):
            pass
        return self._inbox.pop(0) if self._inbox else None

    def _advance(self, end: float) -> bool:
        """Goes to the next event, or to `end` when that is earlier; whether there was an event."""
        if not self._events or self._events[0][0] > end:
            self._time = max(self._time, end)
            return False
        self._time, _, action = heapq.heappop(self._events)
        action()
        return True

    def close(self) -> None:
        pass

    # ---- what the device sees ----

    def answer(self, packet: bytes) -> None:
        self._carry(False, simplecom.encode(packet), self._take_bytes)

    def after(self, seconds: float, action: Callable[[], None]) -> None:
        heapq.heappush(self._events, (self._time + seconds, next(self._order), action))

    def _take_bytes(self, data: bytes) -> None:
        self._inbox += self._decoder.feed(data)

    def _carry(self, to_device: bool, frame: bytes, sink: Callable[[bytes], None]) -> None:
        self._free[to_device] = max(self._free[to_device], self._time) + len(frame) / self.rate
        data = b"" if self.cut else self._damage[to_device].apply(frame)
        self.after(self._free[to_device] + self._latency - self._time, lambda: sink(data))


@dataclass
class _Reply:
    packages: list[bytes]
    last: int  # block number
    repeats: list[float] = field(default_factory=lambda: [1.0, 2.0, 4.0, 8.0])


class FakeDevice:
    """Router, name service and a channel server; `handler` makes a reply of each complete request."""

    def __init__(self, handler: Callable[[bytes], bytes] = lambda message: message, buffer_size: int = 16384) -> None:
        self.handler = handler
        self.buffer_size = buffer_size
        self.packet_size = 0  # longest packet that it takes, if a client asks
        self.longest_packet = 0  # that has arrived
        self.work_time = 0.002  # between a request and its reply [s]
        self.free_channels = True
        self.messages: list[bytes] = []
        self.requests_repeated = 0
        self._decoder = simplecom.Decoder(simplecom.LONG_PACKET)
        self.leaves_out: Callable[[bytes], bool] = lambda message: False  # the reply to this, unless it is asked for
        self._peer = b""
        self._ids = itertools.count(0x5A01)
        self._reset_channel(0, 0)

    def attach(self, line: FakeLine) -> None:
        self.line = line

    def restart(self) -> None:
        """As after a power cycle: the channel is forgotten."""
        self._reset_channel(0, 0)

    def _reset_channel(self, channel_id: int, request_id: int) -> None:
        self._id, self._request_id = channel_id, request_id
        self._received = self._highest = self._sent = 0
        self._incoming = bytearray()
        self._expected: tuple[int, int] | None = None
        self._asked: int | None = None
        self._reply: _Reply | None = None

    def take_bytes(self, data: bytes) -> None:
        for whole in self._decoder.feed(data):
            packet = router.decode(whole)
            if packet is None:
                continue
            self.longest_packet = max(self.longest_packet, len(whole))
            self._peer = packet.sender
            if packet.service == lib.ROUTER_SVC_NAME_REQUEST:
                self._send(lib.ROUTER_SVC_NAME_RESPONSE, name_reply(struct.unpack_from("<I", packet.payload, 4)[0]))
            elif packet.service == lib.ROUTER_SVC_CHANNEL:
                self._take_package(packet.payload)

    def _send(self, service: int, payload: bytes) -> None:
        self.line.answer(router.encode(router.Packet(service, self._peer, DEVICE_ADDRESS, payload)))

    def _send_package(self, package: bytes) -> None:
        self._send(lib.ROUTER_SVC_CHANNEL, package)

    # ---- channel ----

    def _take_package(self, package: bytes) -> None:
        kind = package[0]
        if kind == lib.CHANNEL_PKG_OPEN_REQ:
            self._open(*struct.unpack_from("<IIBBH", package, 8))
            return
        channel_id = struct.unpack_from("<H", package, 8 if kind & lib.CHANNEL_META else 2)[0]
        if not self._id or channel_id != self._id:
            self._send_package(meta(lib.CHANNEL_PKG_CLOSE, struct.pack("<HH", channel_id, lib.ERR_CHS_CHINVALID)))
        elif kind == lib.CHANNEL_PKG_CLOSE_REQ:
            self._reset_channel(0, 0)
        elif kind == lib.CHANNEL_PKG_DATA:
            self._take_data(package)
        elif kind == lib.CHANNEL_PKG_ACK:
            self._take_ack(package)

    def _open(self, request_id: int, wanted: int, words: int, _: int, packet: int) -> None:
        if not self.free_channels:
            self._send_package(
                meta(lib.CHANNEL_PKG_OPEN_RESP, struct.pack("<IHHIBBH", request_id, 1, 0xFFFF, 0, 0, 0, 0))
            )
            return
        if request_id != self._request_id:
            self._reset_channel(next(self._ids), request_id)
        granted = min(wanted, self.buffer_size)
        self._send_package(
            meta(
                lib.CHANNEL_PKG_OPEN_RESP,
                struct.pack("<IHHIBBH", request_id, 0, self._id, granted, 0, words, min(packet, self.packet_size)),
            )
        )

    def _take_data(self, package: bytes) -> None:
        flags, number = package[1], struct.unpack_from("<I", package, 4)[0]
        again, self._highest = number <= self._highest, max(self._highest, number)
        if number <= self._received:
            self.requests_repeated += 1
            self._acknowledge(0)
            if self._reply:
                self._send_reply(self._reply)
        elif number > self._received + 1:
            if again or self._asked != self._received:
                self._asked = self._received
                self._acknowledge(lib.CHANNEL_FLAG_MISSING)
            self._highest = number
        else:
            self._received = number
            self._append(package[12:], bool(flags & lib.CHANNEL_FLAG_FIRST))

    def _append(self, content: bytes, first: bool) -> None:
        if first:
            self._expected = struct.unpack_from("<II", content)
            self._incoming.clear()
            content = content[8:]
        if not self._expected:
            return
        self._incoming += content
        length, crc = self._expected
        if len(self._incoming) < length:
            return
        message, self._expected = bytes(self._incoming), None
        if len(message) != length or zlib.crc32(message) != crc:
            self._send_package(meta(lib.CHANNEL_PKG_CLOSE, struct.pack("<HH", self._id, lib.ERR_CHS_CHECKSUM)))
            self._reset_channel(0, 0)
            return
        self._reply = None  # a new request acknowledges it
        self.messages.append(message)
        channel = self._id
        self.line.after(self.work_time, lambda: self._answer(channel, self.handler(message)))

    def _answer(self, channel: int, message: bytes) -> None:
        if channel != self._id:
            return
        packages, at = [], 0
        while at < len(message) or not packages:
            self._sent += 1
            first = at == 0
            head = struct.pack("<BBHII", lib.CHANNEL_PKG_DATA, int(first), self._id, self._sent, self._received)
            if first:
                head += struct.pack("<II", len(message), zlib.crc32(message))
            packages.append(head + message[at : at + 500 - len(head)])
            at += 500 - len(head)
        self._reply = _Reply(packages, self._sent)
        if self.leaves_out(self.messages[-1]):
            return
        self._send_reply(self._reply)
        self._repeat_later(self._reply)

    def _send_reply(self, reply: _Reply, after: int = 0) -> None:
        for package in reply.packages:
            if struct.unpack_from("<I", package, 4)[0] > after:
                self._send_package(package)

    def _repeat_later(self, reply: _Reply) -> None:
        def repeat() -> None:
            if self._reply is reply:
                self._send_reply(reply)
                self._repeat_later(reply)

        if reply.repeats:
            self.line.after(reply.repeats.pop(0), repeat)

    def _take_ack(self, package: bytes) -> None:
        flags, number = package[1], struct.unpack_from("<I", package, 4)[0]
        if self._reply and flags & lib.CHANNEL_FLAG_MISSING:
            self._send_reply(self._reply, after=number)
        elif self._reply and number >= self._reply.last:
            self._reply = None

    def _acknowledge(self, flags: int) -> None:
        self._send_package(struct.pack("<BBHI", lib.CHANNEL_PKG_ACK, flags, self._id, self._received))


def meta(kind: int, body: bytes) -> bytes:
    """A meta package with its CRC."""
    crc = zlib.crc32(struct.pack("<BBHI", kind, 0, lib.CHANNEL_VERSION, 0) + body)
    return struct.pack("<BBHI", kind, 0, lib.CHANNEL_VERSION, crc) + body


def name_reply(request_id: int) -> bytes:
    """A name service reply, version 4.00."""
    names = (NODE_NAME, DEVICE_NAME, VENDOR_NAME)
    head = struct.pack(
        "<HHIHBBHHHHIIIIBBBBII",
        lib.NS_IDENTIFICATION, lib.NS_VERSION_0400, request_id, 1, 1, 0, 0, *map(len, names),
        lib.TARGET_TYPE_PROGRAMMABLE, lib.TARGET_ID_CORTEX_M3, 0x01020304, 0, len(SERIAL), 0, lib.BLK_DRV_TYPE_COM,
        0, 0, 0,
    )  # fmt: skip
    return head + b"".join(name.encode("utf-16-le") + b"\0\0" for name in names) + SERIAL.encode() + b"\0"


# ---- services ----


class FakePlc:
    """The services on top: an application in memory. Pass `handle` to a FakeDevice."""

    LOGIN = 0x80001234
    FORCE_ROOM = 3

    def __init__(self) -> None:
        self.state, self.operating = lib.AS_NONE, 0
        self.application_session = 0x80004321
        self.image = b""
        self.denial = ""  # words of a component that denies start, stop and reset
        self.exception = (lib.RTSEXCPT_NOEXCEPTION, 0xFFFFFFFF, -1)
        self.memory = {area: bytearray(70000) for area in range(5)}
        self.disturbed = 0  # how many readings from now on a task runs in
        self.transfer: tuple[int, int] | None = None
        self.received = bytearray()
        self.starts_downloads = True  # by DLF_START; False: as older firmware
        self.refuse = ""  # reason to refuse the next complete image for
        self.log: list[tuple[int, int, int, str, str]] = []  # handle, time, class, component, text
        self.shell_refusals: dict[str, tuple[str, int]] = {}  # words and error, by command
        self.tasks: list[tuple[list[int], str]] = []
        self.lateness: list[list[list[tuple[int, int]]]] = [[]]  # one reply after the other, the last one again
        self.requests: list[tuple[int, int]] = []
        self.writes = 0
        self.forced: dict[tuple[Any, ...], bytes] = {}  # what by place
        self.password = b""  # its verifier
        self.wrong = 0  # proofs of another one
        self.pauses = 0  # proofs from now on that come too early after a wrong one

    @property
    def crc(self) -> int:
        return image_crc(self.image) if self.image else 0

    def handle(self, message: bytes) -> bytes:
        _, length, group, service, session, size = struct.unpack_from("<HHHHII", message)
        tags = bintag.decode(message[4 + length : 4 + length + size])
        self.requests.append((group, service))
        handler = self._handlers().get((group, service))
        if handler is None:
            reply = [bintag.u16(lib.TAG_ERROR, lib.ERR_L7_UNKNOWNCMD)]
        elif service not in (lib.SRV_DEV_LOGIN,) and session != self.LOGIN:
            reply = [bintag.u16(lib.TAG_ERROR, lib.ERR_INVALID_SESSION_ID)]
        else:
            reply = handler(tags)
        content = bintag.encode(reply)
        head = struct.pack("<HHHHIIHH", lib.L7_PROTOCOL, 16, group | lib.L7_REPLY, service, session, len(content), 0, 0)
        return head + content

    def _handlers(self) -> dict[tuple[int, int], Callable[[bintag.Tags], list[bintag.Tag]]]:
        app = lib.SG_APPLICATION
        return {
            (lib.SG_DEVICE, lib.SRV_DEV_LOGIN): self._login,
            (lib.SG_DEVICE, lib.SRV_DEV_ECHO): self._echo,
            (lib.SG_DEVICE, lib.SRV_DEV_GET_TARGET_IDENT): self._identity,
            (app, lib.SRV_APP_LOGIN): self._login_application,
            (app, lib.SRV_APP_READ_STATUS): self._status,
            (app, lib.SRV_APP_START): lambda tags: self._control(tags, lib.AS_RUN),
            (app, lib.SRV_APP_STOP): lambda tags: self._control(tags, lib.AS_STOP),
            (app, lib.SRV_APP_RESET): self._reset,
            (app, lib.SRV_APP_DOWNLOAD_COMPACT): self._download,
            (app, lib.SRV_APP_READ_TASK_INFO): self._task_info,
            (app, lib.SRV_APP_READ_TASK_LATENESS): self._task_lateness,
            (app, lib.SRV_APP_READ_APPLICATION_INFO): self._info,
            (lib.SG_MONITORING2, lib.SRV_MON2_READ): self._read,
            (lib.SG_MONITORING2, lib.SRV_MON2_WRITE): self._write,
            (lib.SG_MONITORING2, lib.SRV_MON2_FORCE): self._force,
            (lib.SG_MONITORING2, lib.SRV_MON2_UNFORCE): self._unforce,
            (lib.SG_MONITORING2, lib.SRV_MON2_FORCE_LIST): self._force_list,
            (app, lib.SRV_APP_RELEASE_FORCE_LIST): self._release_forces,
            (lib.SG_LOG, lib.SRV_LOG_GET_ENTRIES): self._log,
            (lib.SG_PLCSHELL, lib.SRV_SHELL_EXECUTE): self._shell,
            (lib.SG_USERMGR, lib.SRV_USER_SET_CREDENTIALS): self._set_credentials,
        }

    def _login(self, tags: bintag.Tags) -> list[bintag.Tag]:
        crypt, proof = tags.u32(lib.TAG_DEV_CRYPT_TYPE), tags.find(lib.TAG_DEV_PROOF)
        session = bintag.u32(lib.TAG_DEV_SESSION_ID, self.LOGIN)
        if not any(self.password):
            return self._login_reply(lib.ERR_OK, session)
        if crypt != lib.DEV_CRYPT_PROOF:
            return self._login_reply(lib.ERR_NO_ACCESS_RIGHTS)
        key, salt_and_iterations = self.password[:32], self.password[32:]
        if proof is None:
            self._challenge = len(self.requests).to_bytes(16, "little") + salt_and_iterations
            return self._login_reply(lib.ERR_PENDING, bintag.raw(lib.TAG_DEV_CHALLENGE, self._challenge))
        if self.pauses:
            self.pauses -= 1
            return self._login_reply(lib.ERR_NOT_READY_YET)
        signature = hmac.digest(key, self._challenge + proof[:16], "sha256")
        client_key = bytes(a ^ b for a, b in zip(signature, proof[16:], strict=True))
        if hashlib.sha256(client_key).digest() == key:
            return self._login_reply(lib.ERR_OK, session)
        self.wrong += 1
        return self._login_reply(lib.ERR_NO_ACCESS_RIGHTS)

    def _login_reply(self, result: int, *more: bintag.Tag) -> list[bintag.Tag]:
        return [bintag.container(lib.TAG_DEV_LOGIN_REPLY, bintag.u16(lib.TAG_DEV_LOGIN_RESULT, result), *more)]

    def _set_credentials(self, tags: bintag.Tags) -> list[bintag.Tag]:
        self.password = tags.bytes(lib.TAG_USER_VERIFIER, 52)
        return [bintag.u16(lib.TAG_SERVICE_RESULT, 0)]

    def _echo(self, tags: bintag.Tags) -> list[bintag.Tag]:
        data = tags.bytes(lib.TAG_DEV_ECHO_DATA)
        return [bintag.u16(lib.TAG_SERVICE_RESULT, 0), bintag.raw(lib.TAG_DEV_ECHO_DATA, data)]

    def _identity(self, tags: bintag.Tags) -> list[bintag.Tag]:
        def wide(tag: int, text: str) -> bintag.Tag:
            data = text.encode("utf-16-le") + b"\0\0"
            return bintag.data(tag, struct.pack("<I", len(data)) + data)

        return [
            bintag.u16(lib.TAG_DEV_RESULT, 0),
            bintag.u32(lib.TAG_DEV_IDENT, lib.TARGET_TYPE_PROGRAMMABLE, lib.TARGET_ID_CORTEX_M3, 0x01020304),
            bintag.u32(lib.TAG_DEV_RTS_VERSION, 0x00010000),
            wide(lib.TAG_DEV_DEVICE_NAME, DEVICE_NAME),
            wide(lib.TAG_DEV_VENDOR_NAME, VENDOR_NAME),
            wide(lib.TAG_DEV_NODE_NAME, NODE_NAME),
            bintag.data(lib.TAG_DEV_SERIAL_NUMBER, struct.pack("<H", len(SERIAL)) + SERIAL.encode()),
        ]

    def _login_application(self, tags: bintag.Tags) -> list[bintag.Tag]:
        guid = struct.pack("<I", self.crc) + bytes(12)
        result = lib.ERR_OK if self.image else lib.ERR_APP_NOT_EXIST
        if self.image:
            self.application_session += 2  # the previous one is not valid any more
        content = struct.pack("<HI", result, self.application_session if self.image else 0) + guid + guid
        return [bintag.container(lib.TAG_APP_DESCRIPTOR, bintag.Tag(lib.TAG_APP_OPTION, content, shift=2))]

    def _status(self, tags: bintag.Tags) -> list[bintag.Tag]:
        boots = lib.OS_BOOTPROJECT_VALID if self.image else 0
        state = struct.pack("<HII", 0, self.state, self.operating | boots)
        return [
            bintag.container(
                lib.TAG_APP_STATUS,
                bintag.Tag(lib.TAG_APP_STATE, state, shift=2),
                bintag.raw(lib.TAG_APP_LAST_EXCEPTION, struct.pack("<IIi", *self.exception)),
                bintag.u32(lib.TAG_APP_IMAGE, self.crc, len(self.image)),
            )
        ]

    def _control(self, tags: bintag.Tags, state: int) -> list[bintag.Tag]:
        if tags.container(lib.TAG_APP_DESCRIPTOR).u32(lib.TAG_APP_SESSION) != self.application_session:
            return [bintag.u16(lib.TAG_SERVICE_RESULT, lib.ERR_APP_INVALID_SESSIONID)]
        if self.operating & lib.OS_EXCEPTION and state == lib.AS_RUN:
            return [bintag.u16(lib.TAG_SERVICE_RESULT, lib.ERR_INVALID_STATE)]
        if self.denial:
            return self._deny()
        self.state = state
        return [bintag.u16(lib.TAG_SERVICE_RESULT, 0)]

    def _deny(self) -> list[bintag.Tag]:
        return [
            bintag.u16(lib.TAG_SERVICE_RESULT, lib.ERR_OPERATION_DENIED),
            bintag.text(lib.TAG_APP_REASON, self.denial),
        ]

    def _reset(self, tags: bintag.Tags) -> list[bintag.Tag]:
        if self.denial:
            return self._deny()
        option = tags.container(lib.TAG_APP_DESCRIPTOR).u32(lib.TAG_APP_OPTION)
        self.operating, self.state = 0, lib.AS_STOP
        self.exception = (lib.RTSEXCPT_NOEXCEPTION, 0xFFFFFFFF, -1)
        if option == lib.RESET_OPTION_ORIGIN:
            self.image, self.state = b"", lib.AS_NONE
        return [bintag.u16(lib.TAG_SERVICE_RESULT, 0)]

    def _download(self, tags: bintag.Tags) -> list[bintag.Tag]:
        flags, offset, total, crc = struct.unpack("<4I", tags.bytes(lib.TAG_CDL_POSITION, 16))
        data, result, reason = tags.find(lib.TAG_CDL_DATA), 0, ""
        if data is None:
            installed = bool(self.image) and (len(self.image), self.crc) == (total, crc)
            known = len(self.received) if self.transfer == (total, crc) else total if installed else 0
            return [bintag.u16(lib.TAG_SERVICE_RESULT, 0), bintag.u32(lib.TAG_CDL_NEXT, known)]
        if not offset and not flags & lib.DLF_CONTINUEDOWNLOAD:
            self.transfer, self.received = (total, crc), bytearray()
        if self.transfer != (total, crc) or offset > len(self.received):
            result = lib.ERR_INVALID_SEQUENCE
        else:
            self.received += data[len(self.received) - offset :]
        done = len(self.received)
        if not result and done == total:
            result, reason = self._finish_download(bool(flags & lib.DLF_START))
        reply = [bintag.u16(lib.TAG_SERVICE_RESULT, result), bintag.u32(lib.TAG_CDL_NEXT, done)]
        return [*reply, bintag.text(lib.TAG_CDL_REASON, reason)] if reason else reply

    def _finish_download(self, start: bool) -> tuple[int, str]:
        self.transfer = None
        if self.refuse:
            return lib.ERR_APP_UNRESOLVED_REFERENCE, self.refuse
        self.image, self.operating = bytes(self.received), 0
        self.state = lib.AS_RUN if start and self.starts_downloads else lib.AS_STOP
        self.exception = (lib.RTSEXCPT_NOEXCEPTION, 0xFFFFFFFF, -1)
        return lib.ERR_OK, ""

    def _task_info(self, tags: bintag.Tags) -> list[bintag.Tag]:
        return [
            bintag.data(lib.TAG_TASK_INFO, struct.pack("<10I", *numbers) + name.encode() + b"\0")
            for numbers, name in self.tasks
        ]

    def _task_lateness(self, tags: bintag.Tags) -> list[bintag.Tag]:
        reply = self.lateness.pop(0) if len(self.lateness) > 1 else self.lateness[0]
        return [
            bintag.data(lib.TAG_TASK_LATENESS, b"".join(struct.pack("<2I", *pair) for pair in pairs)) for pairs in reply
        ]

    def _info(self, tags: bintag.Tags) -> list[bintag.Tag]:
        if not self.image:
            return [bintag.u16(lib.TAG_ERROR, lib.ERR_APP_NOT_LOADED)]
        return [bintag.text(lib.TAG_APP_INFO_PROJECT, "demo"), bintag.text(lib.TAG_APP_INFO_VERSION, "1.2")]

    def _check_monitoring(self, tags: bintag.Tags) -> list[bintag.Tag]:
        session, crc = struct.unpack_from("<II", tags.bytes(lib.TAG_MON2_APPLICATION, 20))
        if session != self.application_session:
            return [bintag.u32(lib.TAG_MON2_ERROR, lib.ERR_APP_INVALID_SESSIONID)]
        return [] if crc == self.crc else [bintag.u32(lib.TAG_MON2_ERROR, lib.ERR_APP_INVALID_DATAID)]

    def _read(self, tags: bintag.Tags) -> list[bintag.Tag]:
        if error := self._check_monitoring(tags):
            return error
        values = bytearray()
        self.disturbed -= 1
        for index, variable in enumerate(tags.container(lib.TAG_MON2_READ_LIST).containers(lib.TAG_MON2_READ_VAR)):
            size = int.from_bytes(variable.bytes(lib.TAG_MON2_VAR_SIZE), "little")
            area, offset, followed = self._address(variable.bytes(lib.TAG_MON2_VAR_CODE))
            if area not in self.memory or offset + size > len(self.memory[area]):
                error = lib.MONITORING_ERR_INVALID_POINTER if followed else lib.MONITORING_ERR_INVALID_INDEX
                values += struct.pack("<HI", index | lib.MON2_ID_FAILED, error)
            else:
                values += struct.pack("<HI", index, size) + self.memory[area][offset : offset + size]
        consistent = [bintag.u16(lib.TAG_MON2_CONSISTENT, 1)] if self.disturbed < 0 else []
        return [bintag.data(lib.TAG_MON2_VALUES, bytes(values)), *consistent]

    def _write(self, tags: bintag.Tags) -> list[bintag.Tag]:
        if error := self._check_monitoring(tags):
            return error
        data, at = tags.bytes(lib.TAG_MON2_WRITE_LIST), 0
        while at < len(data):
            _, size = struct.unpack_from("<HI", data, at)
            value = data[at + 6 : at + 6 + size]
            code_size = struct.unpack_from("<H", data, at + 6 + size)[0]
            area, offset, _ = self._address(data[at + 8 + size : at + 8 + size + code_size])
            self.memory[area][offset : offset + size] = value
            at += 8 + size + code_size
            self.writes += 1
        return []

    def _force(self, tags: bintag.Tags) -> list[bintag.Tag]:
        if error := self._check_monitoring(tags):
            return error
        for index, (*place, value) in enumerate(_FORCED.iter_unpack(tags.bytes(lib.TAG_MON2_FORCED))):
            if len(self.forced) == self.FORCE_ROOM and tuple(place) not in self.forced:
                full = bintag.u32(lib.TAG_MON2_ERROR, lib.MONITORING_ERR_FORCE_FAILED)
                return [full, bintag.u32(lib.TAG_MON2_ERROR_INDEX, index)]
            self.forced[tuple(place)] = value
        return []

    def _unforce(self, tags: bintag.Tags) -> list[bintag.Tag]:
        if error := self._check_monitoring(tags):
            return error
        for *place, _ in _FORCED.iter_unpack(tags.bytes(lib.TAG_MON2_FORCED)):
            self.forced.pop(tuple(place), None)
        return []

    def _force_list(self, tags: bintag.Tags) -> list[bintag.Tag]:
        """Two at a time."""
        start = tags.u32(lib.TAG_MON2_FORCE_START)
        entries = [_FORCED.pack(*place, value) for place, value in list(self.forced.items())[start : start + 2]]
        listed = [bintag.raw(lib.TAG_MON2_FORCED, b"".join(entries))] if entries else []
        room = bintag.u32(lib.TAG_MON2_FORCE_MAX, self.FORCE_ROOM)
        return [bintag.u32(lib.TAG_MON2_FORCE_SERIAL, 1), room, *listed]

    def _release_forces(self, tags: bintag.Tags) -> list[bintag.Tag]:
        self.forced = {}
        return [bintag.u16(lib.TAG_SERVICE_RESULT, lib.ERR_OK)]

    def _address(self, code: bytes) -> tuple[int, int, bool]:
        """Area and offset, and whether a pointer led there. A pointer holds the number of an area + 1 and an offset."""
        offset, code = self._load(code)
        area, code, followed = code[1], code[2:], False
        while code[:2] == bytes([lib.MON2_OP_DER, lib.MON2_POINTER_SIZE]):
            held = int.from_bytes(self.memory.get(area, b"")[offset : offset + 8], "little")
            hop, code = self._load(code[2:])
            area, offset, code, followed = (held >> 32) - 1, (held & 0xFFFFFFFF) + hop, code[1:], True
        assert not code
        return area, offset, followed

    @staticmethod
    def _load(code: bytes) -> tuple[int, bytes]:
        size = 2 if code[0] == lib.MON2_OP_LD16 else 4
        return int.from_bytes(code[1 : 1 + size], "little"), code[1 + size :]

    def _shell(self, tags: bintag.Tags) -> list[bintag.Tag]:
        if refusal := self.shell_refusals.get(tags.text(lib.TAG_SHELL_COMMAND)):
            words, result = refusal
            text = bintag.text(lib.TAG_SHELL_TEXT, f"{words}\r\n")
            error = bintag.raw(lib.TAG_SHELL_RESULT, result.to_bytes(2, "little"))
            return [bintag.container(lib.TAG_SHELL_LAST, text, error)]
        lines = [f"You said {tags.text(lib.TAG_SHELL_COMMAND)}\r\n", "and now\r\n", "all is said.\r\n"]
        block = tags.u32(lib.TAG_SHELL_BLOCK)
        head = lib.TAG_SHELL_PART if block + 1 < len(lines) else lib.TAG_SHELL_LAST
        return [bintag.container(head, bintag.text(lib.TAG_SHELL_TEXT, lines[block]))]

    def _log(self, tags: bintag.Tags) -> list[bintag.Tag]:
        start = tags.u32(lib.TAG_LOG_START_HANDLE)
        return [
            bintag.container(
                lib.TAG_LOG_RECORD,
                bintag.u32(lib.TAG_LOG_HANDLE, handle),
                bintag.data(lib.TAG_LOG_TIME_NS, struct.pack("<Q", time_ns)),
                bintag.u32(lib.TAG_LOG_ENTRY, 2, log_class, 0, 0),
                bintag.text(lib.TAG_LOG_TEXT, text),
                bintag.text(lib.TAG_LOG_COMPONENT_NAME, component),
            )
            for handle, time_ns, log_class, component, text in [entry for entry in self.log if entry[0] >= start][:3]
        ]


def image_crc(image: bytes) -> int:
    """The CRC an image carries in its header."""
    return int.from_bytes(image[lib.CDL_CRC_OFFSET : lib.CDL_CRC_OFFSET + 4], "little")


def make_image(size: int, seed: int = 1) -> bytes:
    """Bytes that look like an image as far as the link is concerned: some content with a CRC in its place."""
    words = zlib.crc32(bytes([seed & 0xFF]))
    body = bytearray()
    while len(body) < size:
        words = zlib.crc32(words.to_bytes(4, "little"))
        body += words.to_bytes(4, "little")
    del body[size:]
    body[lib.CDL_CRC_OFFSET : lib.CDL_CRC_OFFSET + 4] = bytes(4)
    body[lib.CDL_CRC_OFFSET : lib.CDL_CRC_OFFSET + 4] = zlib.crc32(body).to_bytes(4, "little")
    return bytes(body)
