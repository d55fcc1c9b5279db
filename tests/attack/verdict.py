"""A look at a simulated device after an attack."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from campaign import Fallen
from look import LOOK_MS, Seen, expect_running, look
from simulated import Device, Ended, Flash
from workshop import PROVING_MS, Workshop

from plctool.errors import DeviceError


def look_at(shop: Workshop, device: Device) -> Seen:
    """What the device says of itself."""
    return look(device.plc, lambda program: device.named(program.symbols), shop, lambda: device.run(LOOK_MS))


def look_again(shop: Workshop, flash: Flash, after: Ended | None = None, stay_stopped: bool = False) -> Seen:
    """What it says after power came back, or after its death. Raises Fallen when it does not come back."""
    ended = supervised(flash, partial(look_at, shop), after, stay_stopped)
    if ended.how != "used":
        raise Fallen(f"after the attack the runtime {ended.how} {ended.signal}".strip())
    seen: Seen = ended.value
    return seen


def supervised(
    flash: Flash, use: Callable[[Device], Any], after: Ended | None = None, stay_stopped: bool = False
) -> Ended:
    """A life. When the program there kills it, though it had proven itself, the program stays stopped in the next, as
    plcrt's supervisor has it."""
    ended = flash.power(use, after=after, stay_stopped=stay_stopped)
    if ended.how == "died" and not stay_stopped:
        ended = flash.power(use, after=ended, stay_stopped=True)
    return ended


def check_can_be_flashed(shop: Workshop, flash: Flash) -> None:
    """The device takes a program, which runs after the next power cut."""

    def use(device: Device) -> None:
        device.plc.flash(shop["good3"].image, unchecked=True)
        device.run(PROVING_MS)

    try:
        ended = supervised(flash, use)
    except DeviceError as error:
        raise Fallen(f"no program can be flashed any more: {error}") from None
    if ended != Ended("used"):
        raise Fallen(f"the runtime {ended.how} {ended.signal} when a program was flashed")
    expect_running(look_again(shop, flash), shop, ("good3",))
