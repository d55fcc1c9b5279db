"""Block transport over CAN: packets in ISO-TP, many devices and tools on one bus (docs/can.md).

The bus is any interface of python-can, ISO-TP is the package can-isotp. A tool takes a random address and makes sure
that no other tool has it: the device knows a tool by it.
"""

from __future__ import annotations

import errno
import logging
import math
import queue
import random
import re
import time
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from types import MappingProxyType
from typing import Protocol

import can
import isotp
from can.interfaces.slcan import slcanBus

from plctool.core import lib
from plctool.errors import LinkError, UsageError
from plctool.link import router
from plctool.link.channel import ChannelLost
from plctool.link.wire import Layout

for _name in ("can", "isotp"):
    logging.getLogger(_name).addHandler(logging.NullHandler())  # what matters is in our errors

_LONGEST_PACKET = 4095  # of ISO-TP [bytes]
_SCAN = Layout("CAN_SCAN")
_CLAIM = Layout("CAN_CLAIM")
_REQUEST = Layout("NS_REQUEST")

_FIRST_TOOL, _LAST_TOOL, _ALL = int(lib.CAN_TOOL_MIN), int(lib.CAN_TOOL_MAX), int(lib.CAN_TO_ALL)
_MASK, _SHIFT = int(lib.CAN_ADDRESS_MASK), int(lib.CAN_TARGET_SHIFT)
_LINE_END = re.compile(rb"[\r\a]")
_BASE_MASK = 0x1FFFFFFF & ~(_MASK << _SHIFT | _MASK)

_CLAIM_TIME = 0.08  # for others to say that they have an address [s]
_CLAIMS = 20  # addresses that are tried
_SCAN_WINDOW = 0.2  # in which nodes reply to a request to all [s]
_MAX_WAITS = 10  # flow control frames in a row that say wait
_QUEUE = 2  # packets to a node that wait to be sent
_TICK = 0.02  # longest wait while a packet is on its way [s]
_SEND_PATIENCE = 5.0  # for room on the bus [s]
_UNHEARD = 1.0  # a device that has sent no frame for so long is not waited for before the next packet [s]
_FULL_WAIT = 0.001  # before a full queue of the system is tried again [s]


class Bus(Protocol):
    """Frames to and from a bus; errors are those of python-can."""

    def send(self, message: can.Message) -> None: ...
    def receive(self, timeout: float) -> can.Message | None: ...
    def now(self) -> float: ...
    def fileno(self) -> int | None: ...
    def close(self) -> None: ...


class PythonCanBus:
    """A bus of python-can, for one transport."""

    def __init__(self, bus: can.BusABC) -> None:
        self._bus = bus

    def send(self, message: can.Message) -> None:
        end = time.monotonic() + _SEND_PATIENCE
        while True:
            try:
                return self._bus.send(message, timeout=_SEND_PATIENCE)
            except can.CanOperationError as error:
                if error.error_code != errno.ENOBUFS or time.monotonic() > end:
                    raise
                time.sleep(_FULL_WAIT)

    def receive(self, timeout: float) -> can.Message | None:
        return self._bus.recv(max(0.0, timeout))

    def now(self) -> float:
        return time.monotonic()

    def fileno(self) -> int | None:
        with suppress(NotImplementedError, OSError, can.CanError):
            return self._bus.fileno()
        return None

    def close(self) -> None:
        with suppress(can.CanError, OSError):
            self._bus.shutdown()


class SharedBus:
    """A bus of python-can for several transports of this process, each in a thread of its own."""

    def __init__(self, bus: can.BusABC) -> None:
        self._bus = PythonCanBus(bus)
        self._notifier = can.Notifier(bus, [], timeout=_TICK)

    def part(self) -> Bus:
        """The bus as one of the transports sees it."""
        return _Part(self._bus, self._notifier)

    def close(self) -> None:
        self._notifier.stop()
        self._bus.close()


class _Part:
    def __init__(self, bus: PythonCanBus, notifier: can.Notifier) -> None:
        self._bus, self._notifier = bus, notifier
        self._queue: queue.SimpleQueue[can.Message] = queue.SimpleQueue()
        notifier.add_listener(self._queue.put)

    def send(self, message: can.Message) -> None:
        self._bus.send(message)

    def receive(self, timeout: float) -> can.Message | None:
        if self._notifier.exception:
            raise self._notifier.exception
        try:
            return self._queue.get(timeout=timeout) if timeout > 0 else self._queue.get_nowait()
        except queue.Empty:
            return None

    def now(self) -> float:
        return self._bus.now()

    def fileno(self) -> int | None:
        return None

    def close(self) -> None:
        self._notifier.remove_listener(self._queue.put)


class SlcanBus(slcanBus):
    """The one of python-can, which reads byte by byte: 27 calls for a frame."""

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        try:
            return super()._recv_internal(timeout)
        except (ValueError, IndexError):
            return None, False  # a damaged line

    def _read(self, timeout: float | None) -> str | None:
        end = math.inf if timeout is None else time.monotonic() + timeout
        while (line := self._next_line()) is None:
            try:
                self._buffer += self.serialPortOrig.read(self.serialPortOrig.in_waiting or 1)
            except OSError as error:
                raise can.CanOperationError(f"Could not read from the serial line: {error}") from error
            if time.monotonic() >= end:
                return self._next_line()
        return line

    def _next_line(self) -> str | None:
        """The oldest line in the buffer, with its end; None if there is none."""
        found = _LINE_END.search(self._buffer)
        if found is None:
            return None
        line = self._buffer[: found.end()].decode("ascii", "replace")
        del self._buffer[: found.end()]
        return line


# ---- opening ---------------------------------------------------------------------------------------------------------


def split_place(place: str) -> tuple[str, str]:
    """Interface and channel of INTERFACE:CHANNEL. Raises UsageError."""
    interface, colon, channel = place.partition(":")
    if not colon or not channel or interface not in can.VALID_INTERFACES:
        raise UsageError(
            f"'{place}' is not a CAN interface; write INTERFACE:CHANNEL with an interface of python-can, for example "
            "socketcan:can0 or slcan:/dev/ttyACM0.",
            "no-such-link",
        )
    return interface, channel


def open_bus(place: str, bit_rate: int, data_bit_rate: int) -> can.BusABC:
    """Opens INTERFACE:CHANNEL. Raises LinkError when it cannot be opened, UsageError for what is no interface."""
    interface, channel = split_place(place)
    options: dict[str, object] = {"bitrate": bit_rate}
    if data_bit_rate:
        options |= {"fd": True, "data_bitrate": data_bit_rate}
    try:
        if interface == "slcan":
            return _open_slcan(channel, bit_rate, data_bit_rate)
        return can.Bus(interface=interface, channel=channel, **options)  # type: ignore[arg-type]
    except (can.CanError, OSError, ValueError, TypeError, ImportError) as error:
        raise LinkError(f"Cannot open CAN {place}: {_advice(error)}", "open") from error


def _open_slcan(channel: str, bit_rate: int, data_bit_rate: int) -> SlcanBus:
    bus = SlcanBus(channel, sleep_after_open=0)
    try:
        bus.serialPortOrig.exclusive = True  # two tools would take each other's frames
    except OSError:
        bus.serialPortOrig.close()  # first: the end of a bus closes the adapter of the tool that has it
        with suppress(can.CanError, OSError):
            bus.shutdown()
        raise can.CanInitializationError("another program uses it; close that one first") from None
    bus.set_bitrate(bit_rate, data_bit_rate or None)
    return bus


def _advice(error: Exception) -> str:
    text = str(error).rstrip(".") or type(error).__name__
    if getattr(error, "errno", None) in (errno.ENODEV, errno.ENXIO) or "No such device" in text:
        return "there is no such interface; check its name, and that it is set up ('ip link')."
    return f"{text}."


# ---- the transport ---------------------------------------------------------------------------------------------------


class CanTransport:
    """Packets to and from the devices on a bus. `node`: the number of the one that is meant; only this one is asked for
    its name. `fd`: frames of up to 64 bytes are sent."""

    def __init__(
        self,
        name: str,
        bus: Bus,
        node: int | None = None,
        *,
        base: int = int(lib.CAN_ID_BASE),
        fd: bool = False,
        random_source: random.Random | None = None,
    ) -> None:
        self.name = name
        self.max_packet = int(lib.BLK_MAX_SIZE)
        self.long_packet = _LONGEST_PACKET
        self.packet_overhead = 0
        self.byte_rate = math.inf  # `send` waits for the bus
        self.is_slow = True
        self.is_bus = True
        self.point_to_point = False
        self.heard_at = -math.inf
        self.peer_words = 0
        self.node = node
        self._places: dict[bytes, str] = {}
        self.places: Mapping[bytes, str] = MappingProxyType(self._places)
        self._bus, self._base, self._fd = bus, base, fd
        self._random = random_source or random.SystemRandom()
        self._number = self._random.getrandbits(32)
        self._packets: deque[bytes] = deque()
        self._nodes: dict[int, _Node] = {}
        self._collided = self._settled = False
        self._address = 0
        self.local_address = bytes(2)
        try:
            self._take_address()
        except LinkError:
            self.close()
            raise

    def now(self) -> float:
        return self._bus.now()

    def fileno(self) -> int | None:
        return self._bus.fileno()

    def send(self, *packets: bytes) -> None:
        for data in packets:
            packet = router.decode(data)
            if packet is None:
                raise ValueError("this is not a packet of the router")
            if packet.receiver == router.BROADCAST:
                self._ask(packet.payload)
            else:
                self._send_to(packet.receiver[-1], data)

    def receive(self, timeout: float) -> bytes | None:
        end = self.now() + timeout
        while not self._packets:
            left = end - self.now()
            self._pump(max(0.0, left))
            if left <= 0 and not self._packets:
                return None
        return self._packets.popleft()

    def close(self) -> None:
        with suppress(LinkError):
            self._flush()
        self._bus.close()

    # ---- sending ----

    def _send_to(self, number: int, data: bytes) -> None:
        node = self._node(number)
        if not node.waiting:
            node.sending_since = self.now()
        while node.waiting > _QUEUE and self.now() < max(node.sending_since, self.heard_at) + _UNHEARD:
            self._pump(_TICK)
        node.isotp.send(data)
        self._serve()

    def _flush(self) -> None:
        """Waits for a moment until no packet is on its way any more."""
        end = self.now() + _FLUSH_TIME
        while any(node.waiting for node in self._nodes.values()) and self.now() < end:
            self._pump(_TICK)

    def _ask(self, payload: bytes) -> None:
        """A name request, as the frame that stands for it."""
        request = _REQUEST.unpack(payload)
        window = 0 if self.node is not None else round(_SCAN_WINDOW * 1000 / lib.CAN_SCAN_UNIT_MS)
        frame = _SCAN.pack(
            type=lib.CAN_FRAME_SCAN, window=window, version=request.version, request_id=request.request_id
        )
        self._send_frame(_ALL if self.node is None else self.node, frame)

    def _send_frame(self, target: int, data: bytes) -> None:
        self._send_message(
            can.Message(
                arbitration_id=self._base | target << _SHIFT | self._address,
                is_extended_id=True,
                is_fd=self._fd,
                bitrate_switch=self._fd,
                data=data,
            )
        )

    def _send_message(self, message: can.Message) -> None:
        try:
            self._bus.send(message)
        except (can.CanError, OSError) as error:
            raise self._lost(error) from error

    # ---- receiving ----

    def _pump(self, timeout: float) -> None:
        """Takes what has arrived, waiting for it up to `timeout`, and lets packets go on."""
        busy = any(node.isotp.transmitting() or node.isotp.is_rx_active() for node in self._nodes.values())
        try:
            message = self._bus.receive(min(timeout, _TICK) if busy else timeout)
            end = self.now() + _TICK  # a bus may be full of frames of others
            while message is not None:
                self._take(message)
                message = self._bus.receive(0.0) if self.now() < end else None
        except (can.CanError, OSError) as error:
            raise self._lost(error) from error
        self._serve()
        if self._collided:
            self._move_away()

    def _serve(self) -> None:
        for node in self._nodes.values():
            self._packets.extend(node.serve())

    def _take(self, message: can.Message) -> None:
        identifier = message.arbitration_id
        target, source = identifier >> _SHIFT & _MASK, identifier & _MASK
        if not message.is_extended_id or message.is_remote_frame or message.is_error_frame or not message.data:
            return
        if identifier & _BASE_MASK != self._base:
            return
        if source == self._address:
            self._notice(message.data)
        elif target == self._address and source < _FIRST_TOOL:
            self.heard_at = self.now()
            node = self._node(source)
            node.inbox.append(message)
            self._packets.extend(node.serve())

    def _node(self, number: int) -> _Node:
        if number not in self._nodes:
            send = lambda message: self._send_isotp(message)  # noqa: E731
            self._nodes[number] = _Node(number, self._base, self._address, self._fd, send)
            self._places[bytes([0, number])] = f"node {number}"
        return self._nodes[number]

    def _send_isotp(self, message: isotp.CanMessage) -> None:
        self._send_frame(message.arbitration_id >> _SHIFT & _MASK, bytes(message.data))

    def _lost(self, error: Exception) -> LinkError:
        return LinkError(f"CAN {self.name} was lost ({error}); check the interface and try again.", "link-lost")

    # ---- the address of this tool ----

    def _take_address(self) -> None:
        """Takes an address that no other tool has. Raises LinkError when there is none."""
        for _ in range(_CLAIMS):
            self._address = self._another_address()
            self.local_address = bytes([0, self._address])
            self._collided = self._settled = False
            self._claim(lib.CAN_FRAME_CLAIM)
            end = self.now() + _CLAIM_TIME
            while not self._collided and (left := end - self.now()) > 0:
                message = self._receive_now(left)
                if message is not None:
                    self._take(message)
            if not self._collided:
                self._settled = True
                return
        raise LinkError(f"All addresses of tools on CAN {self.name} are in use; close some of them.", "open")

    def _another_address(self) -> int:
        while (address := self._random.randint(_FIRST_TOOL, _LAST_TOOL)) == self._address:
            pass  # another tool has that one
        return address

    def _receive_now(self, timeout: float) -> can.Message | None:
        try:
            return self._bus.receive(timeout)
        except (can.CanError, OSError) as error:
            raise self._lost(error) from error

    def _claim(self, kind: int) -> None:
        self._send_frame(_ALL, _CLAIM.pack(type=kind, number=self._number))

    def _notice(self, data: bytearray) -> None:
        """Takes a frame that another tool has sent from our address."""
        number = _CLAIM.unpack(bytes(data)).number if len(data) >= _CLAIM.size else None
        if data[0] in (lib.CAN_FRAME_CLAIM, lib.CAN_FRAME_TAKEN) and number == self._number:
            return  # our own, on an interface that returns it
        if data[0] == lib.CAN_FRAME_CLAIM and self._settled:
            self._claim(lib.CAN_FRAME_TAKEN)
        else:
            self._collided = True

    def _move_away(self) -> None:
        """Gives the address up; the connection is made again from another one."""
        self._nodes.clear()
        self._packets.clear()
        self._take_address()
        raise ChannelLost(f"Another tool on CAN {self.name} has the same address; try again.", "link-lost")


_FLUSH_TIME = 0.2  # for the last packets when the bus is closed [s]


class _Node:
    """ISO-TP with one device."""

    def __init__(self, number: int, base: int, own: int, fd: bool, send: Callable[[isotp.CanMessage], None]) -> None:
        self.number = number
        self.sending_since = -math.inf
        self.inbox: deque[can.Message] = deque()
        address = isotp.Address(
            isotp.AddressingMode.Normal_29bits,
            txid=base | number << _SHIFT | own,
            rxid=base | own << _SHIFT | number,
        )
        params = {
            "stmin": 0,
            "blocksize": 0,
            "wftmax": _MAX_WAITS,
            "tx_data_length": 64 if fd else 8,
            "can_fd": fd,
            "bitrate_switch": fd,
        }
        self.isotp = isotp.TransportLayerLogic(
            self._next, send, address=address, error_handler=lambda error: None, params=params
        )

    @property
    def waiting(self) -> int:
        """Packets that are not sent yet."""
        return int(self.isotp.tx_queue.qsize()) + (self.isotp.tx_state != self.isotp.TxState.IDLE)

    def serve(self) -> list[bytes]:
        """Lets packets go on; returns those that are complete."""
        self.isotp.process()
        packets = []
        while (data := self.isotp.recv()) is not None:
            packet = router.decode(bytes(data))
            if packet is not None and packet.sender == bytes([0, self.number]):
                packets.append(bytes(data))
        return packets

    def _next(self, timeout: float) -> isotp.CanMessage | None:
        if not self.inbox:
            return None
        message = self.inbox.popleft()
        return isotp.CanMessage(
            arbitration_id=message.arbitration_id,
            data=bytes(message.data),
            extended_id=True,
            is_fd=message.is_fd,
            bitrate_switch=message.bitrate_switch,
        )
