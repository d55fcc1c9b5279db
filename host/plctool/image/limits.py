"""Whether a program fits a device: what it needs, and what of it is the largest."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from plctool.errors import UsageError
from plctool.iec.areas import Area
from plctool.image.file import Image

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

_OF_AREA = {Area.INPUT: "inputs", Area.OUTPUT: "outputs"}

_LARGEST = 3


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
    }


def check_fit(needs: Mapping[str, Need], limits: Mapping[str, int], device: str, advice: str) -> None:
    """Raises UsageError that says of each limit that is passed how far, and by what. `advice` is its last sentence."""
    passed = [
        _sentence(name, needs[name], limits[name])
        for name in LIMITS
        if name in needs and name in limits and needs[name].amount > limits[name]
    ]
    if passed:
        raise UsageError(f"The program does not fit {device}. {' '.join(passed)} {advice}", "does-not-fit")


def _sentence(name: str, need: Need, limit: int) -> str:
    text = f"It needs {'at least ' if need.at_least else ''}{need.amount} {LIMITS[name]}, the device has {limit}"
    if not need.parts:
        return f"{text}."
    parts = need.parts[:_LARGEST]
    if all(amount == 1 for _, amount in need.parts):
        shown, kind = ", ".join(part for part, _ in parts), ""
    else:
        shown = ", ".join(f"{part} {amount}" for part, amount in parts)
        kind = "the deepest calls, largest frames first: " if need.deepest else "the largest: "
    more = len(need.parts) - len(parts)
    return f"{text} ({kind}{shown}{f' and {more} more' if more > 0 else ''})."
