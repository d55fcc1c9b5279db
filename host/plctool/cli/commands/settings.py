"""`plctool settings`: what a user may change on a device without another firmware."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from plctool.cli import output
from plctool.cli.arguments import add_link
from plctool.cli.connections import on_device
from plctool.cli.documents import Document
from plctool.cli.parser import Parser
from plctool.errors import DeviceError, UsageError
from plctool.files import usable_path
from plctool.printable import one_line

if TYPE_CHECKING:
    from plctool.device import Plc
    from plctool.settings import Setting


def settings_arguments(command: Parser) -> None:
    action = command.adder_of_actions()
    add_link(action("list", "show the settings of a device", _list))
    check = action("check", "say what is wrong with a file of settings", _check)
    check.add_argument("file", type=usable_path, metavar="FILE")
    put = action("put", "check a file of settings and send it; it counts from the next start of the device on", _put)
    put.add_argument("file", type=usable_path, metavar="FILE")
    add_link(put)


def _list(args: argparse.Namespace) -> int:
    return on_device(args, list_settings, list_text)


def _check(args: argparse.Namespace) -> int:
    from plctool.settings import values

    text = _checked(args.file)
    if text is None:
        return 1
    document: Document = {"file": str(args.file), "settings": _named(values(text))}
    output.show(args, document, lambda d: f"{d['file']}: {len(d['settings'])} settings, all valid")
    return 0


def _put(args: argparse.Namespace) -> int:
    text = _checked(args.file)
    if text is None:
        return 1
    _check_for_device(args.file, text)
    return on_device(
        args,
        lambda plc: put_settings(plc, args.file, text),
        lambda d: f"{d['file']}: {d['size']} bytes are on the device; they count from its next start on.",
    )


def _checked(path: Path) -> bytes | None:
    """The content of a file; None if it has faults, which are printed."""
    from plctool.settings import faults

    try:
        text = path.read_bytes()
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}.", "no-file") from None
    found = faults(text)
    for fault in found:
        output.say(f"plctool: {one_line(f'{path}:{fault.line}: {fault.words}')}", sys.stderr)
    return None if found else text


def _check_for_device(path: Path, text: bytes) -> None:
    """Raises UsageError for what a device does not take from a file that is put."""
    from plctool.core import lib
    from plctool.settings import values

    if len(text) > lib.SETTINGS_FILE_SIZE:
        raise UsageError(
            f"{path} has {len(text)} bytes, a device takes {lib.SETTINGS_FILE_SIZE}: remove comments.", "too-large"
        )
    options = [setting.name for setting in values(text) if setting.option]
    if options:
        raise UsageError(
            f"{path}: {', '.join(options)} can only be in the file of plcrt --config, on its machine. Remove it.",
            "not-of-devices",
        )


def _on_device(plc: Plc) -> bytes:
    """The file of settings, b"" if none was put. Raises DeviceError for firmware without settings."""
    from plctool.core import lib
    from plctool.settings import FILE_NAME

    try:
        return plc.read_file(FILE_NAME)
    except DeviceError as error:
        if error.result != lib.ERR_NO_OBJECT:
            raise
        raise DeviceError(
            "The firmware of this device has no settings; build one with SETTINGS (docs/settings.md).", "no-settings"
        ) from None


def put_settings(plc: Plc, path: Path, text: bytes) -> Document:
    from plctool.core import lib
    from plctool.settings import FILE_NAME

    _on_device(plc)
    try:
        plc.write_file(FILE_NAME, text)
    except DeviceError as error:
        if error.result != lib.ERR_OPERATION_DENIED:
            raise
        raise DeviceError(
            "This plcrt was started with --config: change that file on its machine, and start it again.",
            "given-settings",
        ) from None
    return {"file": str(path), "size": len(text)}


def list_settings(plc: Plc) -> Document:
    from plctool.settings import all_settings, faults, values

    text = _on_device(plc)
    written = values(text)
    shown = [setting for setting in all_settings() if not setting.option or setting in written]
    rows = [
        {
            "component": s.component,
            "key": s.key,
            "value": written.get(s, s.standard),
            "standard": s not in written,
            "meaning": s.sentence,
        }
        for s in shown
    ]
    return {"settings": rows, "faults": [{"line": f.line, "text": f.words} for f in faults(text)]}


def _named(written: dict[Setting, str]) -> list[Document]:
    return [{"component": s.component, "key": s.key, "value": value} for s, value in written.items()]


def list_text(document: Document) -> str:
    lines = []
    for row in document["settings"]:
        setting = f"[{row['component']}] {row['key']}={row['value']}"
        lines.append(f"{setting}{' (standard)' if row['standard'] else ''}: {row['meaning']}")
    lines += [f"line {f['line']}: {f['text']}" for f in document["faults"]]
    return "\n".join(lines)
