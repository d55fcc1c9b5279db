"""`plctool ui`: a page in a browser, of a device or a simulator."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from contextlib import ExitStack, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from plctool.cli import output
from plctool.cli.arguments import add_link, port_number
from plctool.cli.builds import Built, program_to_run, simulator
from plctool.cli.connections import connect
from plctool.cli.links import link_of
from plctool.cli.output import EXIT_OK
from plctool.cli.parser import Parser
from plctool.errors import UsageError
from plctool.files import usable_path
from plctool.project import find_project

if TYPE_CHECKING:
    from plctool.controller import Controller
    from plctool.device import Plc
    from plctool.ui.layout import Layout
    from plctool.ui.live import Target
    from plctool.ui.operating import OperatorPage


def ui_arguments(command: Parser) -> None:
    command.add_argument(
        "--sim", dest="image", type=usable_path, nargs="?", const=Path(), metavar="IMAGE|PROJECT",
        help="of a program that runs in this process instead; without a name, of the project of the current folder",
    )  # fmt: skip
    command.add_argument(
        "--plant", type=usable_path, metavar="FILE", help="of --sim: what the inputs and outputs are connected to"
    )
    command.add_argument(
        "--page", type=usable_path, metavar="FILE",
        help="show operators the elements that a page.toml lays out, instead of all variables",
    )  # fmt: skip
    command.add_argument(
        "--port-number",
        type=port_number,
        default=0,
        metavar="N",
        help="of the page on this machine; default: a free one",
    )
    command.add_argument("--open", action="store_true", help="open the page in the browser of this machine")
    add_link(command, symbols=True)
    command.set_defaults(action=_ui)


def _ui(args: argparse.Namespace) -> int:
    check_installed()
    if args.plant is not None and args.image is None:
        raise UsageError("--plant is for --sim; a device has a plant of its own.", "usage")
    from plctool.ui.layout import read_layout
    from plctool.ui.server import serve

    layout = None if args.page is None else read_layout(args.page)
    if args.image is not None:
        target = simulated_page(program_to_run(args), args.plant)
    else:
        target = device_page(str(link_of(args)), lambda: connect(args))

    def announce(address: str) -> None:
        output.show(args, {"url": address}, lambda d: f"{d['url']}\nCtrl-C ends it.")
        if args.open:
            import webbrowser

            webbrowser.open(address)

    with suppress(KeyboardInterrupt):
        plc = target.open()
        serve(target, plc, args.port_number, announce, None if layout is None else _page_of(plc, layout))
    return EXIT_OK


def _page_of(plc: Controller, layout: Layout) -> OperatorPage:
    """Returns a page for the program of a controller, which is closed if the page does not fit it."""
    from plctool.ui.operating import operator_page

    try:
        return operator_page(layout, plc.symbols())
    except BaseException:
        plc.close()
        raise


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
