"""Whether a program fits a device: what it needs, and what of it is the largest."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from plctool.core import lib
from plctool.errors import UsageError
from plctool.iec.areas import Area
from plctool.image.file import Image, ImagePart

LIMITS = {
    "tasks": "tasks",
    "functions": "C functions",
    "data": "bytes of variables",
    "retain": "bytes of RETAIN variables",
    "inputs": "bytes of inputs (%I)",
    "outputs": "bytes of outputs (%Q)",
    "memory": "bytes of %M",
    "code": "bytes of code",
    "image": "bytes of flash for the image",
    "stack": "bytes of stack",
}
"""What a device may limit, and what messages call it."""

COPIES = {
    "copies": "bytes of copies of the inputs and outputs that tasks share",
    "all_copies": "bytes of copies of inputs and outputs",
}
"""The same: a firmware limits one of them, the second one if its tasks have copies also of what they use alone."""

ROOM = {
    "connectors": "devices and buses",
    "gpio_groups": "groups of lines",
    "events": "events of lines",
    "modbus_lines": "lines to Modbus devices",
    "modbus_devices": "Modbus devices",
    "modbus_jobs": "reads and writes of Modbus",
    "modbus_calls": "request of a program to Modbus devices at a time",
    "modbus_servers": "Modbus servers",
    "modbus_ranges": "ranges of Modbus servers",
    "modbus_data": "bytes of Modbus data",
    "modbus_tcp": "lines and servers of Modbus TCP",
}
"""The same of the manager of inputs and outputs and its drivers: fields of BOARD_FACTS."""

_OF_AREA = {Area.INPUT: "inputs", Area.OUTPUT: "outputs"}

MOST_SHOWN = 3  # names that a sentence has


@dataclass(frozen=True)
class Need:
    """How much a program needs of something, and what needs most of it: (name, amount), largest first. `deepest`: they
    are the frames of a chain of calls. `at_least`: it is not known how much more."""

    amount: int
    parts: tuple[tuple[str, int], ...] = ()
    deepest: bool = False
    at_least: bool = False

    @property
    def known(self) -> int | None:
        """The amount, if that is all."""
        return None if self.at_least else self.amount


def of_area(area: Area) -> str:
    """The limit of an area."""
    return _OF_AREA.get(area, area.name.lower())


def largest(parts: Iterable[tuple[str, int]]) -> tuple[tuple[str, int], ...]:
    """In the order of messages."""
    return tuple(sorted(parts, key=lambda part: (-part[1], part[0])))


def needs_of_image(image: Image, size: int) -> dict[str, Need]:
    """What an image of `size` bytes needs, as far as it says so itself."""
    return {
        "tasks": Need(len(image.tasks), tuple((task.name, 1) for task in image.tasks)),
        "functions": Need(len(image.externals), tuple((e.name, 1) for e in image.externals)),
        **{of_area(Area(index)): Need(amount) for index, amount in image.areas.items()},
        "code": Need(len(image.code)),
        "image": Need(size),
        "copies": Need(sum(_copies(part) for task in image.tasks for part in task.parts if part.shared)),
        "all_copies": Need(sum(_copies(part) for task in image.tasks for part in task.parts)),
    }


def _copies(part: ImagePart) -> int:
    """Bytes of a task's copies of its inputs or outputs, as AppImagePlace counts: also of what it began with."""
    return (1 + part.written) * part.count * int(lib.CDL_IMAGE_UNIT)


def check_fit(
    needs: Mapping[str, Need], limits: Mapping[str, int], device: str, advice: str, lacking: Iterable[str] = ()
) -> None:
    """Raises UsageError that says of each limit that is passed how far, and by what. `advice`: what to do then, a
    sentence; `lacking`: sentences about what else does not fit."""
    passed = [
        _sentence(title, needs[name], limits[name])
        for name, title in (LIMITS | COPIES | ROOM).items()
        if name in needs and name in limits and needs[name].amount > limits[name]
    ]
    sentences = [*passed, *([advice] if passed else []), *lacking]
    if sentences:
        raise UsageError(f"The program does not fit {device}. {' '.join(sentences)}", "does-not-fit")


def _sentence(title: str, need: Need, limit: int) -> str:
    text = f"It needs {'at least ' if need.at_least else ''}{need.amount} {title}, the device has {limit}"
    if not need.parts:
        return f"{text}."
    parts = need.parts[:MOST_SHOWN]
    if all(amount == 1 for _, amount in need.parts):
        shown, kind = ", ".join(part for part, _ in parts), ""
    else:
        shown = ", ".join(f"{part} {amount}" for part, amount in parts)
        kind = "the deepest calls, largest frames first: " if need.deepest else "the largest: "
    more = len(need.parts) - len(parts)
    return f"{text} ({kind}{shown}{f' and {more} more' if more > 0 else ''})."
