"""Hostile images whose CRC is right."""

from __future__ import annotations

import platform
import random
from collections.abc import Callable
from contextlib import suppress
from functools import partial

from campaign import BEFORE, ITSELF, REFUSED, STOPPED, Campaign, Case, Fallen
from faults import with_crc
from look import Seen, expect_running
from simulated import Device, Ended, Flash, Geometry, violation
from verdict import check_can_be_flashed, look_again, look_at
from workshop import PROVING_MS, Workshop

from plctool.core import ffi, lib
from plctool.errors import DeviceError
from plctool.link.services import AppState

COUNT = 10_000
CYCLE_LIMIT_MS = 500  # in which an endless loop is aborted, time of the processor

# Something of everything an image can hold.
RICH = """
FUNCTION_BLOCK Counter
VAR_INPUT step : DINT; END_VAR
VAR n : DINT := 5; END_VAR
METHOD FB_Init : BOOL
VAR_INPUT bInitRetains : BOOL; bInCopyCode : BOOL; END_VAR
n := n + 1;
END_METHOD
n := n + step;
END_FUNCTION_BLOCK
PROGRAM Main
VAR
    count : Counter;
    x : REAL := 1.5;
    text : STRING := 'counts';
    go AT %IX0.0 : BOOL;
    lamp AT %QX0.1 : BOOL;
    ton : TON;
    i : DINT;
    a : ARRAY[0..9] OF DINT;
END_VAR
VAR RETAIN
    total : DINT;
END_VAR
count(step := 3);
ton(IN := NOT ton.Q, PT := T#50ms);
FOR i := 0 TO 9 DO a[i] := a[9 - i] + count.n; END_FOR
x := SIN(x) + 1.0;
text := CONCAT(LEFT(text, 5), '!');
lamp := go XOR ton.Q;
total := total + a[3];
END_PROGRAM
PROGRAM Event
VAR n : DINT; END_VAR
n := n + 1;
END_PROGRAM
VAR_GLOBAL rise : BOOL; END_VAR
PROGRAM Free
VAR n : DINT; END_VAR
n := n + 1;
rise := NOT rise;
END_PROGRAM
CONFIGURATION Config
    RESOURCE Res ON PLC
        TASK Fast(INTERVAL := T#10ms, PRIORITY := 1, WATCHDOG := T#100ms);
        TASK OnRise(SINGLE := rise, PRIORITY := 5);
        TASK Slow(INTERVAL := T#50ms, PRIORITY := 9);
        PROGRAM Main WITH Fast : Main;
        PROGRAM Event WITH OnRise : Event;
        PROGRAM Free WITH Slow : Free;
    END_RESOURCE
END_CONFIGURATION
"""
BASES = ("good2", "rich")
WORDS = (0, 1, 2, 3, 4, 15, 16, 103, 104, 105, 0x7F, 0xFF, 0x100, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFC,
         0xFFFFFFF0, 0xFFFFFFFF)  # fmt: skip
SEGMENTS = ("application_info", "area_table", "function_table", "external_function_table", "iec_function_table",
            "blob", "code")  # fmt: skip

Image = bytearray
Mutation = Callable[[random.Random, Image], None]


def _header(image: Image) -> object:
    return ffi.from_buffer("CDL_HEADER *", image)


def _word(rng: random.Random, near: int) -> int:
    """A value that a check may have forgotten."""
    choice = rng.random()
    if choice < 0.4:
        return rng.choice(WORDS)
    if choice < 0.8:
        return (near + rng.choice((-64, -16, -8, -4, -2, -1, 1, 2, 4, 8, 16, 64))) & 0xFFFFFFFF
    return rng.getrandbits(32)


def _change_word(rng: random.Random, image: Image, at: int) -> None:
    if at + 4 <= len(image):
        near = rng.choice((int.from_bytes(image[at : at + 4], "little"), len(image)))
        image[at : at + 4] = _word(rng, near).to_bytes(4, "little")


def _change_header(rng: random.Random, image: Image) -> None:
    _change_word(rng, image, rng.randrange(int(lib.CDL_CRC_OFFSET) // 4) * 4)


def _segment(image: Image, name: str) -> range:
    segment = getattr(_header(image), name)
    return range(segment.offset, min(segment.offset + segment.size, len(image)))


def _change_table(rng: random.Random, image: Image) -> None:
    places = _segment(image, rng.choice(SEGMENTS[:-1]))
    if places:
        _change_word(rng, image, rng.choice(places) & ~3)


def _change_byte(rng: random.Random, image: Image) -> None:
    places = _segment(image, rng.choice(SEGMENTS))
    if places:
        image[rng.choice(places)] = rng.choice((0, 1, 0x7F, 0x80, 0xFF, rng.getrandbits(8)))


def _change_entry(rng: random.Random, image: Image) -> None:
    """A function or task begins anywhere in the code, or past its end."""
    code = len(_segment(image, "code"))
    entry = rng.choice((rng.randrange(code), rng.randrange(code), code, code - 1, code + 1)) if code else 0
    functions, tasks = _segment(image, "function_table"), _segment(image, "blob")
    if rng.random() < 0.5 and functions:
        size = ffi.sizeof("POU_REF")
        at = functions.start + size * rng.randrange(len(functions) // size) + ffi.offsetof("POU_REF", "offset")
        image[at - 2 : at] = int(lib.APP_AREA_CODE).to_bytes(2, "little")
    elif tasks:
        size, head = ffi.sizeof("CDL_TASK"), ffi.sizeof("CDL_BLOB")
        number = rng.randrange(max(1, (len(tasks) - head) // size))
        at = tasks.start + head + size * number + ffi.offsetof("CDL_TASK", "entry_offset")
    else:
        return
    if at + 4 <= len(image):
        image[at : at + 4] = entry.to_bytes(4, "little")


def _change_code(rng: random.Random, image: Image) -> None:
    code = _segment(image, "code")
    for _ in range(rng.choice((1, 1, 2, 8))):
        if code:
            image[rng.choice(code)] = rng.getrandbits(8)


def _cut_or_extend(rng: random.Random, image: Image) -> None:
    """The length changes, and the header says so."""
    if rng.random() < 0.5 and len(image) > lib.CDL_HEADER_SIZE:
        del image[rng.randrange(int(lib.CDL_HEADER_SIZE), len(image)) :]
    else:
        image += rng.randbytes(rng.choice((1, 4, 16, 100, 4000)))
    image[12:16] = len(image).to_bytes(4, "little")


def _copy_inside(rng: random.Random, image: Image) -> None:
    size = rng.choice((4, 8, 20, 56))
    source, target = rng.randrange(len(image) - size), rng.randrange(int(lib.CDL_HEADER_SIZE), len(image) - size)
    image[target : target + size] = image[source : source + size]


MUTATIONS: dict[str, Mutation] = {
    "header": _change_header,
    "tables": _change_table,
    "byte": _change_byte,
    "entries": _change_entry,
    "code": _change_code,
    "length": _cut_or_extend,
    "copy": _copy_inside,
}


# What asks the kernel for something: SYSCALL, SYSENTER and INT 80 of x86-64, SVC 0 of AArch64. Such an image is not
# tried: it could stop or delete anything of the user who started the campaign.
KERNEL_CALLS = {"x86_64": (b"\x0f\x05", b"\x0f\x34", b"\xcd\x80"), "aarch64": (b"\x01\x00\x00\xd4",)}[
    platform.machine()
]


def hostile(shop: Workshop, base: str, kind: str, number: int) -> bytes:
    """An image that went wrong in one way, or in some, with its CRC."""
    rng = random.Random(f"{shop.seed} {number}")
    while True:
        image = Image(shop[base].image)
        for _ in range(rng.choice((1, 1, 1, 2, 4))):
            if len(image) >= lib.CDL_HEADER_SIZE + 64:
                MUTATIONS[kind](rng, image)
        if not any(image.count(call) > shop[base].image.count(call) for call in KERNEL_CALLS):
            return with_crc(image)


class Images(Campaign):
    name = "image"
    promise = "an image may hold anything: it is refused, or runs, or dies and is rolled back"
    short = 60

    def cases(self) -> list[Case]:
        kinds = list(MUTATIONS)
        return [
            Case(f"{base} with another {kind}, number {number}", (base, kind, number))
            for number in range(COUNT)
            for base, kind in [(BASES[number % len(BASES)], kinds[number // len(BASES) % len(kinds)])]
        ]

    def prepare(self, cases: list[Case]) -> None:
        self.shop.add({"rich": RICH})

    def run(self, case: Case) -> str:
        image = hostile(self.shop, *case.data)
        geometry = Geometry()
        flash = Flash(geometry)
        flash.load(self.shop.history(geometry, "good1"))
        ended = flash.power(partial(_take, self.shop, image))
        if ended.how == "hung":
            raise Fallen("the runtime hung")
        if ended.how == "used" and ended.value is None:
            expect_running(look_again(self.shop, flash), self.shop, ("good1",))
            return REFUSED
        crc = int.from_bytes(image[lib.CDL_CRC_OFFSET :][:4], "little")
        if ended.how == "died" and case.data[2] % 2:
            self._check_stays_stopped(flash, ended, crc)
            ended = Ended("used")
        outcome = self._judge(flash, ended, crc)
        check_can_be_flashed(self.shop, flash)
        return outcome

    def _check_stays_stopped(self, flash: Flash, ended: Ended, crc: int) -> None:
        """After a death plcrt is there, with the program that died, stopped, and with the reason."""
        seen = look_again(self.shop, flash, after=ended, stay_stopped=True)
        if seen.state in (AppState.RUN, AppState.NONE) or seen.crc != crc or not seen.causes:
            raise Fallen(f"after its death the image is not there, stopped, with the reason: {seen}")

    def _judge(self, flash: Flash, ended: Ended, crc: int) -> str:
        """The image was taken. It may run if it did, or be given up for the program before; what did not kill it in its
        first run may do so in the next."""
        seen = look_again(self.shop, flash, after=ended)
        if seen.crc == crc and seen.state is AppState.RUN:
            return ITSELF
        if seen.crc == crc and seen.state is not AppState.NONE and (seen.causes or seen.exception):
            return STOPPED
        expect_running(seen, self.shop, ("good1",))
        return BEFORE


def _take(shop: Workshop, image: bytes, device: Device) -> Seen | None:
    """Downloads and starts an image and lets it run; what there is then, None when it was refused."""
    lib.SimSetCycleLimit(CYCLE_LIMIT_MS)
    try:
        device.plc.flash(image, unchecked=True, start=False)
    except DeviceError:
        expect_running(look_at(shop, device), shop, ("good1",))
        _check_rules()
        return None
    with suppress(DeviceError):  # it had an exception in its initialisation
        device.plc.start()
    device.run(PROVING_MS)
    seen = look_at(shop, device)
    _check_rules()
    return seen


def _check_rules() -> None:
    if violation():
        raise Fallen(f"the flash was used against its rules: {violation()}")
