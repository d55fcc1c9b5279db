"""Packing an image for a slow line: the bytes that Unpack.c of the firmware takes (docs/protocol.md, "Packed data").

Each block is unpacked alone, but may copy from all of the image before it, which the device has by then.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

_AT_A_TIME = 4096  # bytes for which the best way is looked for together
_CHAIN = 32  # earlier places with the same three bytes that are looked at
_SEARCHED = 3  # bytes that are looked for
_ALL_CUTS = 16  # up to so many bytes, shorter copies are tried too
_LONGEST = 4096  # copy, bytes
_PAIR_BITS = 10  # of the copy of two bytes from nearby
_LOW = 128  # distances are sent in a number and seven bits
_FARTHEST = 0xFFFF * _LOW - _LOW  # a number is no larger than 0xFFFF
_TOKEN = 16  # the longest copy is shorter [bytes]


def _bits_of_number(number: int) -> int:
    return 2 * number.bit_length() - 1


_BITS = [0, *map(_bits_of_number, range(1, _LONGEST + 2))]


@dataclass(frozen=True)
class Packed:
    """A block: `data` unpack to `size` bytes of the image."""

    data: bytes
    size: int


@dataclass
class _Step:
    """`size` bytes copied from `distance` before; distance 0: as they are."""

    size: int
    distance: int


class Packer:
    """Packs an image. About 300 kB/s."""

    def __init__(self, image: bytes) -> None:
        self._image = image
        self._same = _Chain(image, _SEARCHED)
        self._pairs = _Chain(image, 2)

    def blocks(self, start: int, room: int, longest: int, first_room: int = 0) -> Iterator[Packed]:
        """The image from `start` on, in blocks of `room` bytes at most (more than 32) that unpack to no more than
        `longest`; the first one of `first_room`, if that is less and not 0, so that it is there sooner."""
        steps: deque[_Step] = deque()
        searched = position = start
        while position < len(self._image):
            first = position == start and 0 < first_room < room
            writer = _Writer(self._image, position, first_room if first else room, longest)
            while not writer.is_full:
                if not steps:
                    if searched == len(self._image):
                        break
                    end = min(searched + (first_room if first else _AT_A_TIME), len(self._image))
                    steps.extend(self._search(searched, end))
                    searched = end
                left = writer.add(steps.popleft())
                if left:
                    steps.appendleft(left)
            position = writer.position
            yield writer.block()

    def _search(self, start: int, end: int) -> list[_Step]:
        """The way from `start` to `end` that takes the fewest bits, as far as it looks."""
        self._same.extend(end)
        self._pairs.extend(end)
        count = end - start
        cost = [0] + [1 << 60] * count
        steps: list[tuple[int, int]] = [(0, 0)] * (count + 1)  # by which the place is reached
        run = [0] * (count + 1)  # of literals up to there
        last = [1] * (count + 1)  # distance that was used last
        for at in range(count):
            for size, distance, bits in self._choices(start + at, end, run[at], last[at]):
                if cost[at] + bits < cost[at + size]:
                    cost[at + size] = cost[at] + bits
                    steps[at + size] = size, distance
                    run[at + size] = 0 if distance else run[at] + 1
                    last[at + size] = distance or last[at]
        return _joined(steps, count)

    def _choices(self, at: int, end: int, run: int, last: int) -> Iterator[tuple[int, int, int]]:
        """Steps from `at` on: size, distance, bits. A literal costs less after another one."""
        yield 1, 0, 8 + (_BITS[run + 1] - _BITS[run] if run else 2)
        if run and last <= at:
            size = self._common(at, last, 0, end)
            for part in _parts(1, size):
                yield part, last, 1 + _BITS[part]
        if at - self._pairs.previous[at] <= _LOW and self._pairs.previous[at] >= 0 and at + 2 <= end:
            yield 2, at - self._pairs.previous[at], _PAIR_BITS
        found, place = _SEARCHED - 1, self._same.previous[at]
        for _ in range(_CHAIN):
            if place < 0 or at - place > _FARTHEST:
                return
            size = self._common(at, at - place, found, end)
            if size > found:
                bits = 8 + _bits_of_number(1 + (at - place - 1) // _LOW)
                for part in _parts(found + 1, size):
                    yield part, at - place, bits + _BITS[part - 1]
                found = size
            place = self._same.previous[place]

    def _common(self, at: int, distance: int, found: int, end: int) -> int:
        """How many bytes from `at` on are those `distance` before; 0 if no more than `found`."""
        image = self._image
        end = min(end, at + _LONGEST)
        if at + found >= end or image[at + found] != image[at + found - distance]:
            return 0
        to = at
        while to < end and image[to] == image[to - distance]:
            to += 1
        return to - at


class _Chain:
    """For each place, up to which it was extended, the `previous` one with the same `count` bytes; -1: none."""

    def __init__(self, image: bytes, count: int) -> None:
        self.previous: list[int] = []
        self._image, self._count = image, count
        self._newest: dict[bytes, int] = {}

    def extend(self, end: int) -> None:
        """To all places before `end`."""
        image, count, newest = self._image, self._count, self._newest
        for at in range(len(self.previous), end):
            key = image[at : at + count]
            self.previous.append(newest.get(key, -1))
            newest[key] = at


def _parts(first: int, size: int) -> range:
    """The lengths of a copy of up to `size` bytes that are tried."""
    return range(size if size > _ALL_CUTS else first, size + 1)


def _joined(steps: list[tuple[int, int]], at: int) -> list[_Step]:
    """The steps that lead to `at`; neighbouring literals are one step."""
    way: list[_Step] = []
    while at > 0:
        size, distance = steps[at]
        at -= size
        if way and not distance and not way[-1].distance:
            way[-1].size += size
        else:
            way.append(_Step(size, distance))
    way.reverse()
    return way


class _Writer:
    """One block. It starts as if a copy of distance 1 were before it."""

    def __init__(self, image: bytes, start: int, room: int, longest: int) -> None:
        self.position = start
        self._image, self._start = image, start
        self._room, self._end = room - _TOKEN, min(len(image), start + longest)
        self._data = bytearray()
        self._bit = 0  # of the byte at _bits_at that was used last
        self._bits_at = 0
        self._literals = 0  # before `position`, not written yet
        self._distance = 1

    @property
    def is_full(self) -> bool:
        return self._left <= 0 or self.position >= self._end

    @property
    def _left(self) -> int:
        return self._room - len(self._data) - self._literals

    def add(self, step: _Step) -> _Step | None:
        """What of the step the block has no room for."""
        size = min(step.size, self._end - self.position)
        if step.distance and (size > 1 or self._repeats(step.distance)):
            self._copy(size, step.distance)
        else:
            size = min(size, self._left)
            self._literals += size
        self.position += size
        return _Step(step.size - size, step.distance) if size < step.size else None

    def block(self) -> Packed:
        self._write_literals()
        return Packed(bytes(self._data), self.position - self._start)

    def _repeats(self, distance: int) -> bool:
        """Whether a copy would need no distance."""
        return self._literals > 0 and distance == self._distance

    def _copy(self, size: int, distance: int) -> None:
        repeats = self._repeats(distance)
        self._write_literals()
        self._put_bit(not repeats)
        if repeats:
            self._put_number(size)
            return
        self._distance = distance
        self._put_number(1 + (distance - 1) // _LOW)
        bits = _bits_of(size - 1)
        self._data.append((-distance % _LOW) << 1 | bits[0])
        self._put_bits(bits[1:])

    def _write_literals(self) -> None:
        if self._literals:
            self._put_bit(False)
            self._put_number(self._literals)
            self._data += self._image[self.position - self._literals : self.position]
            self._literals = 0

    def _put_number(self, number: int) -> None:
        self._put_bits(_bits_of(number))

    def _put_bits(self, bits: list[int]) -> None:
        for bit in bits:
            self._put_bit(bool(bit))

    def _put_bit(self, bit: bool) -> None:
        self._bit >>= 1
        if not self._bit:
            self._bit = 0x80
            self._bits_at = len(self._data)
            self._data.append(0)
        if bit:
            self._data[self._bits_at] |= self._bit


def _bits_of(number: int) -> list[int]:
    """A number from 1 on: a 0 before each bit after the highest one, then a 1."""
    bits = [bit for digit in f"{number:b}"[1:] for bit in (0, int(digit))]
    return [*bits, 1]
