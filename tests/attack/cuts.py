"""A power cut, and a call that fails, at every single flash operation of everything that writes."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from campaign import BEFORE, NEWEST, NOTHING, Campaign, Case, Fallen
from look import expect_running
from simulated import Device, Flash, Geometry, violation
from verdict import check_can_be_flashed, look_again, look_at
from workshop import GOOD_NAMES, PROVING_MS, Workshop

from plctool.core import lib
from plctool.errors import DeviceError
from plctool.link.services import AppState

BLANK: tuple[str, ...] = ()
GEOMETRIES = (Geometry(), Geometry(erased=0x00, unit=1), Geometry(sector=512, unit=16, mapped=False))
FAILING = Geometry(mapped=False)  # reads can fail
MODES = {"before": lib.SIM_CUT_BEFORE, "after": lib.SIM_CUT_AFTER, "torn": lib.SIM_CUT_TORN}
CALLS = {
    "read": lib.SIM_READ,
    "program": lib.SIM_PROGRAM,
    "erase": lib.SIM_ERASE,
    "sync": lib.SIM_SYNC,
    "map": lib.SIM_MAP_CODE,
}
READS = 250  # failing reads tried in a story, of the thousands there are
BRIEFLY_MS = 500  # less than the proving time


@dataclass(frozen=True)
class Story:
    """What a device lives through. `history`: what its flash holds before. `live` leaves marks on its way. `survivors`:
    which programs may run afterwards, by the last mark; none: there need not be one."""

    history: tuple[str, ...]
    live: Callable[[Workshop, Device], None]
    survivors: dict[str, tuple[str, ...]]


def _flash(shop: Workshop, device: Device, name: str) -> None:
    device.plc.flash(shop[name].image, unchecked=True)
    device.mark("flashed")


def _download(shop: Workshop, device: Device) -> None:
    device.run(PROVING_MS)
    _flash(shop, device, "good2")
    device.run(2 * PROVING_MS)
    device.plc.stop()
    device.plc.start()
    device.run(2500)


def _boot(shop: Workshop, device: Device) -> None:
    device.run(PROVING_MS + 1000)


def _reset(shop: Workshop, device: Device) -> None:
    for option in ("warm", "cold"):
        device.plc.reset(option)
        device.plc.start()
        device.run(1500)


def _origin(shop: Workshop, device: Device) -> None:
    device.plc.reset("origin")
    device.mark("erased")


def _retain(shop: Workshop, device: Device) -> None:
    device.run(60_000)  # the log of retain variables changes halves


def _two_downloads(shop: Workshop, device: Device) -> None:
    """The second one comes before the first one has proven itself."""
    device.plc.flash(shop["good2"].image, unchecked=True)
    device.mark("first")
    device.run(BRIEFLY_MS)
    device.plc.flash(shop["good3"].image, unchecked=True)
    device.mark("flashed")
    device.run(PROVING_MS)


def _dead_and_replaced(shop: Workshop, device: Device) -> None:
    """The newest program died, and another one comes before power was off."""
    device.plc.flash(shop["dying"].image, unchecked=True)
    device.run(PROVING_MS)
    if device.plc.status().state is AppState.EXCEPTION:
        device.mark("died")
    _flash(shop, device, "good3")


STORIES = {
    "download": Story(
        ("good1",), _download, {"": ("good1", "good2"), "flashed": ("good2",)}
    ),
    "first download": Story(BLANK, partial(_flash, name="good2"), {"": (), "flashed": ("good2",)}),
    "two downloads": Story(
        ("good1",),
        _two_downloads,
        {"": ("good1", "good2"), "first": ("good2", "good3"), "flashed": ("good3",)},
    ),
    "download after a death": Story(
        ("good1",),
        _dead_and_replaced,
        {"": ("good1", "dying"), "died": ("good1", "good3"), "flashed": ("good3",)},
    ),
    "start": Story(("good1", "good2"), _boot, {"": ("good2",)}),
    "rollback": Story(("good1", "dying"), _boot, {"": ("good1",)}),
    "retain variables": Story(("good1", "good2"), _retain, {"": ("good2",)}),
    "resets": Story(("good1", "good2"), _reset, {"": ("good2",)}),
    "reset origin": Story(("good1", "good2"), _origin, {"": (), "erased": ()}),
}  # fmt: skip


class Cuts(Campaign):
    name = "cut"
    promise = "a power cut at any write leaves the old or the new program, whole"
    short = 30

    def cases(self) -> list[Case]:
        cases = []
        for name, story in STORIES.items():
            for geometry in GEOMETRIES:
                operations = measure(self.shop, story, geometry)[0]
                for operation in range(1, operations + 1):
                    for mode in MODES:
                        title = f"{name}: {mode} write {operation}, {_text(geometry)}"
                        cases.append(Case(title, (name, geometry, operation, mode)))
        return cases

    def run(self, case: Case) -> str:
        name, geometry, operation, mode = case.data
        story = STORIES[name]
        flash = load(self.shop, story, geometry)
        ended = flash.power(partial(_live, self.shop, story), plan=partial(lib.SimFlashCut, operation, MODES[mode]))
        if ended.how not in ("cut", "used"):
            raise Fallen(f"the runtime {ended.how} {ended.signal}".strip())
        marks = ended.value or [""]
        return settle(self.shop, flash, story, marks[-1])


class Calls(Campaign):
    name = "call"
    promise = "a flash operation that fails, once or from then on, loses no program"
    short = 30

    def cases(self) -> list[Case]:
        chooser = random.Random(self.shop.seed)
        cases = []
        for name, story in STORIES.items():
            counts = measure(self.shop, story, FAILING)[1]
            for kind, number in CALLS.items():
                calls = range(1, counts[number] + 1)
                tried = sorted(chooser.sample(calls, READS)) if len(calls) > READS and kind == "read" else calls
                cases += [
                    Case(f"{name}: {kind} {call}{' and all after it' if on else ''} fails", (name, kind, call, on))
                    for call in tried
                    for on in (False, True)
                ]
        return cases

    def run(self, case: Case) -> str:
        name, kind, call, on = case.data
        story = STORIES[name]
        flash = load(self.shop, story, FAILING)
        ended = flash.power(
            partial(_live_with_faults, self.shop, story),
            plan=partial(lib.SimFlashFailFrom if on else lib.SimFlashFail, CALLS[kind], call),
        )
        if ended.how != "used":
            raise Fallen(f"the runtime {ended.how} {ended.signal}".strip())
        mark, violation = ended.value
        if violation:
            raise Fallen(f"the flash was used against its rules: {violation}")
        return settle(self.shop, flash, story, mark)


def _text(geometry: Geometry) -> str:
    mapped = "" if geometry.mapped else ", not mapped"
    return f"units of {geometry.unit}, sectors of {geometry.sector}, erased {geometry.erased:02X}{mapped}"


def load(shop: Workshop, story: Story, geometry: Geometry) -> Flash:
    content = shop.history(geometry, *story.history)
    flash = Flash(geometry)
    flash.load(content)
    return flash


def _live(shop: Workshop, story: Story, device: Device) -> list[str]:
    story.live(shop, device)
    return device.marks


def _live_with_faults(shop: Workshop, story: Story, device: Device) -> tuple[str, str]:
    """The last mark, and what broke the rules of the flash. The device may refuse a request, but answers to the
    end. What a fault at the start left is attacked once more, by a download that is refused."""
    try:
        story.live(shop, device)
    except DeviceError:
        device.mark((device.marks or [""])[-1])
    seen = look_at(shop, device)
    last = device.marks[-1] if device.marks else ""
    if last == "died" and any("cannot be written" in cause for cause in seen.causes):
        last = ""  # nothing is left of the death
    if last == "flashed" and story.survivors[last] and seen.state is AppState.NONE:
        raise Fallen(f"flash said ok, but there is no program: {seen}")
    damaged = shop["good3"].image[:-1] + b"\x55"
    try:
        device.plc.flash(damaged, unchecked=True)
    except DeviceError:
        pass
    else:
        raise Fallen("a damaged image was taken")
    return last, violation()


def measure(shop: Workshop, story: Story, geometry: Geometry) -> tuple[int, list[int]]:
    """Writes and erases of a story without any fault, and its calls by kind."""

    def live(device: Device) -> tuple[int, list[int]]:
        story.live(shop, device)
        return lib.SimFlashOps(), [lib.SimFlashCalls(kind) for kind in range(lib.SIM_CALLS)]

    ended = load(shop, story, geometry).power(live)
    assert ended.how == "used", f"the story itself fails: {ended}"
    counts: tuple[int, list[int]] = ended.value
    return counts


def settle(shop: Workshop, flash: Flash, story: Story, mark: str) -> str:
    """Power comes back, goes three times for a moment, and comes back for good. Then another program is flashed."""
    survivors = story.survivors[mark]
    seen = look_again(shop, flash)
    if not survivors and seen.state is AppState.NONE:
        outcome = NOTHING
    else:
        runs = expect_running(seen, shop, survivors or GOOD_NAMES)
        for _ in range(3):
            flash.power(lambda device: device.run(BRIEFLY_MS))
        still = expect_running(look_again(shop, flash), shop, survivors or GOOD_NAMES)
        if still != runs:
            raise Fallen(f"{runs} ran, and after three power cuts it is {still}")
        outcome = NEWEST if not survivors or runs == survivors[-1] else BEFORE
    check_can_be_flashed(shop, flash)
    return outcome
