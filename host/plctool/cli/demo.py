"""`plctool demo`: the whole story on this machine, with the real runtime and the real tool, in less than a minute."""

from __future__ import annotations

import signal
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

import plctool
from plctool.compiler import IoFiles, compile_sources
from plctool.device import Plc
from plctool.errors import DeviceError, PlcError
from plctool.image.targets import host_target
from plctool.testing.plcrt import Plcrt
from plctool.testing.tanks import PlantServer, describe_tanks, examples

SHOWN = (
    "Control.setpoint", "Control.level2", "Control.pump", "Control.speed", "Control.inlet", "Control.alarm_plant",
    "Plant.ok",
)  # fmt: skip
SETTLED_PERCENT = 1.5
LIMIT_S = 40.0
POLL_S = 0.5
SHOW_EVERY_S = 1.0
BAR_WIDTH = 22

Values = dict[str, Any]


class Story:
    """Shows what happens, a headline for each step."""

    def __init__(self, console: Console) -> None:
        self.console = console
        self.step = 0

    def tell(self, headline: str) -> None:
        self.step += 1
        self.console.print(f"\n[bold cyan]{self.step}. {headline}[/]")

    def say(self, text: str) -> None:
        self.console.print(f"   {text}", highlight=False)


def bar(value: float, mark: float) -> str:
    """A level of 0..100 % as a bar, with the set point marked."""
    filled = round(value / 100 * BAR_WIDTH)
    at = min(round(mark / 100 * BAR_WIDTH), BAR_WIDTH - 1)
    cells = ["█" if i < filled else "·" for i in range(BAR_WIDTH)]
    cells[at] = "|"
    return "".join(cells)


def flash(story: Story, plc: Plc, image: Path) -> None:
    columns = (
        TextColumn("   {task.description}"),
        BarColumn(BAR_WIDTH),
        TextColumn("{task.completed} bytes"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=story.console, disable=story.console.record) as progress:
        task = progress.add_task("flash", total=image.stat().st_size)
        result = plc.flash(image, progress=lambda done, total: progress.update(task, completed=done, total=total))
    story.say(f"{result.bytes} bytes in {result.seconds:.2f} s; state: {plc.status().state}")


def line_of(values: Values, seconds: float) -> str:
    """What the program sees and does, in a line."""
    level, setpoint = values["Control.level2"], values["Control.setpoint"]
    seen = f"{level:4.1f} % [green]{bar(level, setpoint)}[/]"
    if not values["Plant.ok"]:
        seen = f"[yellow]{'Plant.ok = FALSE':{len('50.0 % ') + BAR_WIDTH}}[/]"
    inlet = "open" if values["Control.inlet"] else "shut"
    return f"{seconds:4.1f} s  {seen} wanted {setpoint:.0f} %  pump {values['Control.speed']:3.0f} %  inlet {inlet}"


def show(story: Story, plc: Plc, until: Callable[[Values, float], bool]) -> None:
    """Prints a line each second until `until(values, seconds)` is true; an error when it never is."""
    begin = time.monotonic()
    shown = 0.0
    while True:
        values = plc.read(*SHOWN)
        seconds = time.monotonic() - begin
        done = until(values, seconds)
        if done or seconds >= shown:
            story.say(line_of(values, seconds))
            shown = seconds + SHOW_EVERY_S - POLL_S / 2
        if done:
            return
        if seconds > LIMIT_S:
            raise DeviceError(f"that did not happen within {LIMIT_S:.0f} s", "demo")
        time.sleep(POLL_S)


def settle(story: Story, plc: Plc) -> None:
    """Waits until the level has been at the set point three times in a row."""
    in_band = 0

    def settled(values: Values, seconds: float) -> bool:
        nonlocal in_band
        near = values["Plant.ok"] and abs(values["Control.level2"] - values["Control.setpoint"]) < SETTLED_PERCENT
        in_band = in_band + 1 if near else 0
        return in_band >= 3

    show(story, plc, settled)


def lose_plant(story: Story, plc: Plc, plant: PlantServer) -> None:
    story.say(f"the plant says: {plant.press_enter()}")
    show(story, plc, lambda v, seconds: seconds > 4 and v["Control.alarm_plant"] and not v["Control.pump"])
    story.say(f"the plant says: {plant.press_enter()}")
    settle(story, plc)


def refuse_damaged(story: Story, plc: Plc, image: Path, folder: Path) -> None:
    damaged = bytearray(image.read_bytes())
    damaged[len(damaged) // 2] ^= 0x10
    bad = folder / "damaged.cdl"
    bad.write_bytes(damaged)
    cycles = plc.tasks()[0].cycles
    try:
        plc.flash(bad, unchecked=True)
    except DeviceError as error:
        story.say(f"[yellow]refused:[/] {error}")
    else:
        raise DeviceError("the damaged image was accepted", "demo")
    show(story, plc, lambda values, seconds: seconds > 1)
    more = plc.tasks()[0].cycles - cycles
    if plc.status().state != "run" or more <= 0:
        raise DeviceError("the old program does not run any more", "demo")
    story.say(f"the old program ran {more} cycles meanwhile; state: {plc.status().state}")


def run(console: Console) -> None:
    """The demo. Raises PlcError when a step does not do what it should."""
    story = Story(console)
    with tempfile.TemporaryDirectory(prefix="plctool-demo-") as name:
        folder = Path(name)
        image = folder / "tanks.cdl"
        runtime = Plcrt(folder / "plc.flash")

        story.tell("Start the plant: two tanks, a Modbus device on TCP")
        with PlantServer() as plant, runtime:
            story.say(f"modbus: 127.0.0.1:{plant.port}")

            story.tell("Compile examples/tanks: Structured Text, and what it is connected to")
            begin = time.monotonic()
            io = IoFiles(describe_tanks(folder, plant.port))
            result = compile_sources([examples() / "tanks"], target=host_target(), io=io)
            result.write(image)
            story.say(f"tanks.cdl: {image.stat().st_size} bytes of image, {time.monotonic() - begin:.2f} s")

            with plctool.connect(f"serial:{runtime.port}") as plc:
                story.tell("Flash it over a serial line to the runtime, plcrt")
                flash(story, plc, image)
                story.tell("Watch the controller fill the second tank, over Modbus")
                settle(story, plc)
                story.tell("Change the set point to 65 %; the controller settles again")
                plc.write({"Control.setpoint": 65.0})
                settle(story, plc)
                story.tell("Pull the bus: the program sees it and stops; plug it in: it goes on")
                lose_plant(story, plc, plant)
                story.tell("Send a damaged image (one bit flipped)")
                refuse_damaged(story, plc, image, folder)

            story.tell("Kill the runtime and start it again: the boot project comes back")
            runtime.stop(signal.SIGKILL)
            runtime.start()
            with plctool.connect(f"serial:{runtime.port}") as plc:
                status = plc.status()
                story.say(f"state after restart: {status.state}, image {status.image_crc:08X}")
                if status.state != "run":
                    raise DeviceError("the boot project did not come back", "demo")
                show(story, plc, lambda values, seconds: seconds > 3 and values["Plant.ok"])
    console.print(
        "\n[bold green]That was the whole story.[/] Next: README.md, and examples/ for programs to start from."
    )


def main() -> int:
    """Entry of `plctool demo`."""
    console = Console(highlight=False)
    try:
        run(console)
    except PlcError as error:
        console.print(f"[bold red]demo failed:[/] {error}")
        return error.exit_code
    return 0
