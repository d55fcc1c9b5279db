"""`plctool flash`: a program onto one or several devices."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Any

from plctool.cli import output
from plctool.cli.arguments import add_image, add_link
from plctool.cli.builds import fresh_image, project_of
from plctool.cli.connections import Progress, connect, connect_to, on_device, password_source
from plctool.cli.documents import Document
from plctool.cli.links import link_of
from plctool.cli.output import EXIT_OK, EXIT_USAGE
from plctool.cli.parser import Parser
from plctool.cli.previous_program import keep_sources
from plctool.errors import EXIT_INTERRUPTED, PlcError, UsageError
from plctool.files import usable_path
from plctool.link.transports import Link
from plctool.printable import one_line

if TYPE_CHECKING:
    from plctool.cli.source_archive import Archive
    from plctool.controller import Controller, OtherTool
    from plctool.device import Plc


def flash_arguments(command: Parser) -> None:
    add_image(command)
    command.add_argument("--no-start", action="store_true", help="do not start it; it starts at the next power-up")
    command.add_argument(
        "--boot", action=argparse.BooleanOptionalAction,
        help="whether it is what starts at power-up; --no-boot: when 'plctool boot' makes it so (default: a setting)",
    )  # fmt: skip
    command.add_argument("--force", action="store_true", help="send it even if the device has it already")
    command.add_argument(
        "--with-source", nargs="*", type=usable_path, metavar="FILE.st|DIR",
        help="also keep its sources and symbols on the device; without any, those of the project of the current folder",
    )  # fmt: skip
    command.add_argument(
        "--online-change", action="store_true",
        help="replace the program between two cycles, so that variables keep their values; of a project, or of an "
        "image that was built with --base",
    )  # fmt: skip
    command.add_argument("--dry-run", action="store_true", help="with --online-change: only say what it would do")
    command.add_argument(
        "--watch", action="store_true", help="with --online-change: again whenever a file of the project is saved"
    )
    command.add_argument(
        "--back", action="store_true",
        help="with --online-change: the program before the last change, with the values of today",
    )  # fmt: skip
    add_link(command)
    command.set_defaults(action=_flash)


def _flash(args: argparse.Namespace) -> int:
    link = link_of(args)
    if args.online_change:
        return _change(args, link)
    if args.dry_run or args.watch or args.back:
        raise UsageError("--dry-run, --watch and --back are for --online-change.", "usage")
    settings = project_of(args)
    args.image = fresh_image(args, settings)
    keep_sources(settings, args.image)
    if len(link.nodes or ()) > 1:
        if args.with_source is not None:
            raise UsageError("--with-source is for one device; name one with --node.", "usage")
        return _flash_several(args, link)

    prepared = _prepared_source(args)

    def announce(others: Sequence[OtherTool]) -> None:
        if others and not args.json:
            users = "1 other tool uses" if len(others) == 1 else f"{len(others)} other tools use"
            output.say(f"{users} this line: {', '.join(one_line(str(other)) for other in others)}")

    def operation(plc: Plc) -> Document:
        with Progress(not args.json) as progress:
            document = flash(
                plc, args.image, start=not args.no_start, force=args.force, boot=args.boot, progress=progress.show,
                announce=announce,
            )  # fmt: skip
        if prepared is not None:
            from plctool.cli.commands.source import store_source

            document["source"] = store_source(plc, prepared)
        return document

    try:
        return on_device(args, operation, flash_text)
    except KeyboardInterrupt:
        raise interrupted_flash({"": partial(connect, args)}, args.image) from None


def _change(args: argparse.Namespace, link: Link) -> int:
    from plctool.cli.live_changes import change, live_change_text, watch

    if len(link.nodes or ()) > 1:
        raise UsageError("--online-change is for one device; name one with --node.", "usage")
    if args.no_start or args.force or args.with_source is not None or args.boot is not None:
        raise UsageError("--online-change goes without --no-start, --force, --no-boot and --with-source.", "usage")
    if args.back and args.watch:
        raise UsageError("--back goes without --watch.", "usage")
    with connect(args) as plc:
        if not args.watch:
            document = change(plc, args)
            output.show(args, document, live_change_text)
            return EXIT_USAGE if document.get("problems") else EXIT_OK
        for document in watch(plc, args):
            output.show(args, document, live_change_text)
    return EXIT_OK


def _flash_several(args: argparse.Namespace, link: Link) -> int:
    from plctool.device import connect_several

    try:
        with connect_several(link, password=password_source(args)) as plcs, Progress(not args.json) as progress:
            document, errors = flash_several(
                plcs,
                args.image,
                start=not args.no_start,
                force=args.force,
                boot=args.boot,
                progress=lambda node, done, total: progress.show(done, total, node),
            )
    except KeyboardInterrupt:
        again = {node: partial(connect_to, args, link.of_node(node)) for node in link.nodes or ()}
        raise interrupted_flash(again, args.image) from None
    output.show(args, document, flash_several_text)
    return max((error.exit_code for error in errors), default=EXIT_OK)


def _prepared_source(args: argparse.Namespace) -> tuple[Archive, bytes] | None:
    """The sources that are to go with an image, if that is wanted: checked before anything is sent."""
    if args.with_source is None:
        return None
    from plctool.cli.commands.source import prepared_source
    from plctool.cli.projects import settings_of_sources
    from plctool.files import read_image
    from plctool.image.file import image_crc

    return prepared_source(settings_of_sources(args.with_source), image_crc(read_image(args.image)), args.image)


class Interrupted(PlcError):
    """The user ended an operation by Ctrl-C; the message says what it has left."""

    exit_code = EXIT_INTERRUPTED


def flash(
    plc: Plc,
    image: Path,
    *,
    start: bool = True,
    force: bool = False,
    boot: bool | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
    announce: Callable[[Sequence[OtherTool]], None] = lambda others: None,
) -> Document:
    """Brings an image onto a controller; see `Controller.flash`. `announce` gets the other tools on the line first."""
    others = plc.others()
    announce(others)
    result = plc.flash(image, start=start, force=force, boot=boot, progress=progress)
    return {
        "bytes": result.bytes,
        "seconds": round(result.seconds, 3),
        "skipped": result.skipped,
        "state": str(result.state),
        "boot_project": result.boots,
        "others": [vars(other) for other in others],
        "persistent": None if result.persistent is None else vars(result.persistent),
    }


def flash_several(
    plcs: Mapping[str, Plc],
    image: Path,
    *,
    start: bool = True,
    force: bool = False,
    boot: bool | None = None,
    progress: Callable[[str, int, int], None] = lambda node, done, total: None,
) -> tuple[Document, list[PlcError]]:
    """Brings an image onto several controllers at once. Returns also what went wrong; the document has it by node."""
    from concurrent.futures import ThreadPoolExecutor

    ended = Event()  # by Ctrl-C

    def one(node: str, plc: Plc) -> Document:
        def show(done: int, total: int) -> None:
            if ended.is_set():
                raise Interrupted("Interrupted.", "interrupted")
            progress(node, done, total)

        return {"node": node, **flash(plc, image, start=start, force=force, boot=boot, progress=show)}

    devices: list[Document] = []
    errors: list[PlcError] = []
    with ThreadPoolExecutor(len(plcs)) as threads:
        results = [(node, threads.submit(one, node, plc)) for node, plc in plcs.items()]
        for node, result in results:
            try:
                devices.append(result.result())
            except PlcError as error:
                errors.append(error)
                devices.append({"node": node, "error": {"code": error.code, "message": error.message}})
            except KeyboardInterrupt:
                ended.set()
                raise
    return {"devices": devices}, errors


def interrupted_flash(connections: Mapping[str, Callable[[], Controller]], image: Path) -> Interrupted:
    """After a download that was given up: what is on each controller now, asked on a link of its own. They have the
    names of their nodes, the only one perhaps none."""
    now = [_now_on(f"Node {node}" if node else "The device", connect, image) for node, connect in connections.items()]
    return Interrupted(" ".join(["Interrupted.", *now]), "interrupted")


def _now_on(device: str, connect: Callable[[], Controller], image: Path) -> str:
    from plctool.files import read_image
    from plctool.image.file import image_crc
    from plctool.link.services import AppState

    try:
        with connect() as plc:
            status = plc.raw_status()
    except PlcError as error:
        return f"{device} does not say what it has, see 'plctool status': {error.message}"
    if status.state is AppState.NONE:
        return f"{device} has no program."
    which = "the new" if status.image_crc == image_crc(read_image(image)) else "still the previous"
    return f"{device} has {which} program (CRC {status.image_crc:08X}), state: {status.state}."


def flash_text(document: dict[str, Any]) -> str:
    """What a download did, and what became of PERSISTENT values."""
    size, seconds = document["bytes"], document["seconds"]
    done = "already on the device" if document["skipped"] else f"{size} bytes in {seconds:.2f} s"
    lines = [f"{done}; state: {document['state']}"]
    if not document["boot_project"]:
        lines.append("It does not start at power-up; 'plctool boot' makes it the boot project.")
    if document["persistent"]:
        lines += [f"PERSISTENT value lost: {name} {why}" for name, why in document["persistent"]["lost"].items()]
        lines += [f"PERSISTENT value new: {name}" for name in document["persistent"]["new"]]
    return "\n".join(lines)


def flash_several_text(document: dict[str, Any]) -> str:
    """What a download did on each device."""
    return "\n".join(
        f"{device['node']}: {device['error']['message'] if 'error' in device else flash_text(device)}"
        for device in document["devices"]
    )
