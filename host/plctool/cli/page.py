"""`plctool ui`: the controller of a page, on a link or simulated."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from plctool.errors import UsageError
from plctool.project import find_project

if TYPE_CHECKING:
    from plctool.cli.documents import Built
    from plctool.controller import Controller
    from plctool.device import Plc
    from plctool.ui.live import Target


def check_installed() -> None:
    """Raises UsageError if what the page needs is not installed."""
    missing = [name for name in ("starlette", "uvicorn", "websockets") if find_spec(name) is None]
    if missing:
        raise UsageError(
            f"The page needs {', '.join(missing)}; install it with: pip install 'plctool[ui]'", "not-installed"
        )


def device_page(name: str, connect: Callable[[], Plc]) -> Target:
    """The page of a device. `connect` opens its link."""
    from plctool.ui.live import Target

    def opened() -> Controller:
        plc = connect()
        try:
            plc.raw_status()  # asks for its password here, in the terminal
        except BaseException:
            plc.close()
            raise
        return plc

    return Target(name, opened, folders=_folders())


def simulated_page(program: Path | Built, plant: Path | None) -> Target:
    """The page of a simulator whose time follows the clock. `plant`: what its inputs and outputs are connected to."""
    from plctool.cli.documents import simulator
    from plctool.cli.plants import attached
    from plctool.ui.live import Target
    from plctool.ui.real_time import RealTime

    plants = ExitStack()  # as long as the page

    def opened() -> Controller:
        plc = simulator(program)
        if plant is not None:
            plants.enter_context(attached(plc, plant, aside=True))
        return plc

    beside = [program.parent] if isinstance(program, Path) else []
    return Target("simulator", opened, RealTime(), [*_folders(), *beside])


def _folders() -> list[Path]:
    """Where the sources of a program may be."""
    project = find_project()
    return [Path.cwd(), *([project.parent] if project is not None else [])]
