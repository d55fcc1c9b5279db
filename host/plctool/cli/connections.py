"""How a command reaches its device: the connection, the password, the progress of a transfer."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TextIO

from plctool.cli import output
from plctool.cli.documents import Document
from plctool.cli.links import link_of
from plctool.link.transports import Link

if TYPE_CHECKING:
    from plctool.device import Plc
    from plctool.link.passwords import AskPassword

ShowProgress = Callable[[int, int], None]


def connect(args: argparse.Namespace) -> Plc:
    return connect_to(args, link_of(args))


def connect_to(args: argparse.Namespace, link: Link) -> Plc:
    from plctool.device import connect

    return connect(
        link,
        getattr(args, "symbols", None),
        gateway=gateway_wanted(args),
        tool=me(args),
        password=password_source(args),
    )


def password_source(args: argparse.Namespace) -> AskPassword:
    """One for all links of this command, so that users are asked once."""
    from plctool.cli.passwords import password_source

    if "password" not in args:
        args.password = password_source(args.password_file)
    source: AskPassword = args.password
    return source


def gateway_wanted(args: argparse.Namespace) -> bool | None:
    return False if args.no_gateway else None


def me(args: argparse.Namespace) -> str:
    """How this tool is shown to others on the line: the command and its arguments without options."""
    image = [args.image.name] if getattr(args, "image", None) else []
    option = [args.option] if "option" in args else []
    return " ".join(["plctool", args.command, *option, *image, *getattr(args, "names", getattr(args, "values", []))])


def on_device(args: argparse.Namespace, operation: Callable[[Plc], Document], text: Callable[[Document], str]) -> int:
    with connect(args) as plc:
        document = operation(plc)
    return output.show(args, document, text)


def with_progress(
    args: argparse.Namespace,
    operation: Callable[[Plc, ShowProgress], Document],
    text: Callable[[Document], str],
    stream: TextIO | None = None,
) -> int:
    with connect(args) as plc, Progress(not args.json) as progress:
        document = operation(plc, progress.show)
    return output.show(args, document, text, stream)


class Progress:
    """A progress bar for each download on a terminal, silence elsewhere. It begins with the first bytes."""

    def __init__(self, wanted: bool) -> None:
        self._bar: Any = None
        self._tasks: dict[str, Any] = {}
        if wanted and sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import (
                BarColumn,
                DownloadColumn,
                Progress,
                TextColumn,
                TimeRemainingColumn,
                TransferSpeedColumn,
            )

            label = TextColumn("{task.description}", markup=False)
            columns = (label, BarColumn(), DownloadColumn(), TransferSpeedColumn(), TimeRemainingColumn())
            self._bar = Progress(*columns, console=Console(stderr=True), transient=True)

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *exc: object) -> None:
        if self._bar:
            self._bar.stop()

    def show(self, done: int, total: int, device: str = "") -> None:
        if not self._bar:
            return
        self._bar.start()  # harmless when repeated
        if device not in self._tasks:
            self._tasks[device] = self._bar.add_task(device, total=total)
        self._bar.update(self._tasks[device], completed=done, total=total)
