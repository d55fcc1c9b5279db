"""`plctool demo`: the whole story on this machine, with the real runtime and the real tool, in about half a minute."""

from __future__ import annotations

import signal
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

import plctool
from plctool.compiler import compile_sources
from plctool.device import Plc
from plctool.errors import DeviceError, PlcError
from plctool.testing.plcrt import Plcrt

SHOWN = ("Control.setpoint", "Plant.level1", "Plant.level2", "Control.pump", "Control.alarm_low")
SETTLED_PERCENT = 1.5
SETTLE_LIMIT_S = 40.0
BAR_WIDTH = 30


def examples() -> Path:
    """The folder of examples: in the installed package, or at the root of the source tree."""
    package = Path(__file__).parents[1]
    inside = package / "examples"
    return inside if inside.is_dir() else package.parents[1] / "examples"


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


def show_levels(story: Story, plc: Plc, until: Callable[[dict[str, float], float], bool]) -> None:
    """Prints the controlled level about twice a second until `until(values, seconds)` is true."""
    begin = time.monotonic()
    while True:
        values = plc.read(*SHOWN)
        seconds = time.monotonic() - begin
        level, setpoint = values["Plant.level2"], values["Control.setpoint"]
        story.say(f"{seconds:5.1f} s  level {level:5.1f} %  [green]{bar(level, setpoint)}[/]  wanted {setpoint:.0f} %")
        if until(values, seconds):
            return
        time.sleep(0.5)


def settle(story: Story, plc: Plc) -> None:
    """Waits until the level has been at the set point three times in a row; an error when it never does."""
    in_band = 0

    def settled(values: dict[str, float], seconds: float) -> bool:
        nonlocal in_band
        near = abs(values["Plant.level2"] - values["Control.setpoint"]) < SETTLED_PERCENT
        in_band = in_band + 1 if near else 0
        if seconds > SETTLE_LIMIT_S:
            raise DeviceError(f"the level did not settle within {SETTLE_LIMIT_S:.0f} s", "demo")
        return in_band >= 3

    show_levels(story, plc, settled)


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
    show_levels(story, plc, lambda values, seconds: seconds > 1)
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

        story.tell("Compile examples/tanks (Structured Text) to native code")
        begin = time.monotonic()
        result = compile_sources([examples() / "tanks"])
        result.write(image)
        story.say(f"tanks.cdl: {image.stat().st_size} bytes of image, {time.monotonic() - begin:.2f} s")

        story.tell("Start the runtime, plcrt, on a pseudo terminal")
        with runtime:
            story.say(f"serial: {runtime.port}")
            with plctool.connect(f"serial:{runtime.port}") as plc:
                story.tell("Flash it over the serial line")
                flash(story, plc, image)
                story.tell("Watch the controller fill the second tank")
                settle(story, plc)
                story.tell("Change the set point to 65 %; the controller settles again")
                plc.write({"Control.setpoint": 65.0})
                settle(story, plc)
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
                show_levels(story, plc, lambda values, seconds: seconds > 2)
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
