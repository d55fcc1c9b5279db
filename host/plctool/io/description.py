"""Finding and reading a description: `NAME.io.toml` beside the sources."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from plctool.errors import UsageError
from plctool.files import Pos, check_inside, is_inside, read_utf8
from plctool.io.board_header import check_names
from plctool.io.device_file import DeviceFile, read_device_file
from plctool.io.kinds import KINDS
from plctool.io.mistakes import Mistakes
from plctool.io.model import Connector, Context, Description
from plctool.io.positions import BadToml, TomlText
from plctool.io.tables import Table

SUFFIX = ".io.toml"


def find_description(sources: Sequence[Path], project: Path | None = None) -> Path | None:
    """The description beside the sources, or in a folder of them; None if there is none. Of several, that beside a
    source of its name. Raises UsageError if it is not clear which one is meant, or it is a link that leads out of its
    folder, or of that of the `project`."""
    folders = {(path if path.is_dir() else path.parent).resolve(): path for path in reversed(sources)}
    named = [path if path.is_dir() else path.parent for path in folders.values()]
    found = sorted(file for folder in named for file in folder.glob(f"*{SUFFIX}") if file.is_file())
    if len(found) > 1:
        own = {source.with_name(f"{source.stem}{SUFFIX}").resolve() for source in sources if source.is_file()}
        found = [file for file in found if file.resolve() in own] or found
    if len(found) > 1:
        names = ", ".join(str(file) for file in found)
        raise UsageError(f"There are several descriptions of inputs and outputs; choose one with --io: {names}.", "io")
    if not found:
        return None
    check_inside(found[0], project or found[0].parent)
    return found[0]


def load_description(path: Path, device: Path | None = None, project: Path | None = None) -> Description:
    """Reads a description and the device file: `device`, else the one it names, which is in the folder of the
    description, or in that of the `project` if the description is there. What is wrong with them is in
    `mistakes`. Raises UsageError for a file that cannot be read."""
    return read_description(str(path), read_utf8(path, "io"), device, project)


def read_description(path: str, text: str, device: Path | None = None, project: Path | None = None) -> Description:
    """The same for a text."""
    mistakes = Mistakes()
    made = Description(path, [], mistakes, {path: text})
    try:
        toml = TomlText(path, text)
    except BadToml as error:
        mistakes.error(error.pos, error.message)
        made.readable = False
        return made
    root = Table(toml, (), toml.values, mistakes)
    named = root.text("device")
    folder = root_of(Path(path), project)
    if device is None and named is not None:
        device = Path(path).parent / named
        if not os.path.isfile(device):  # False as well for a name that no file can have
            root.error(f"there is no file {device}", "device")
            device = None
        elif not is_inside(device, folder):
            root.error(f"{device} is outside {folder.resolve()}; copy it there, or name it with --device", "device")
            device = None
    if device is not None:
        made.device = _device_file(device, made)
        if not made.readable:
            return made
    context = Context(mistakes, made.device)
    for name, read in KINDS.items():
        for table in root.tables(name):
            made.connectors += read(table, context)
            table.close()
    for connector in made.connectors:
        made.contents.update(connector.contents)
    root.close()
    _check_names(made.connectors, _check_taken(made.connectors, mistakes), mistakes)
    return made


def root_of(description: Path, project: Path | None) -> Path:
    """The folder that contains the device file which a description names: that of the project, if the description is
    there, else that of the description."""
    return project if project is not None and is_inside(description, project) else description.parent


def _device_file(path: Path, made: Description) -> DeviceFile | None:
    device, mistakes, text = load_device(path)
    made.contents[str(path)] = text
    made.mistakes.found += mistakes.found
    made.readable = device is not None
    return device


def load_device(path: Path) -> tuple[DeviceFile | None, Mistakes, str]:
    """A device file with what is wrong with it, and its text. Raises UsageError if it cannot be read."""
    text = read_utf8(path, "io")
    return *device_in(str(path), text), text


def device_in(path: str, text: str) -> tuple[DeviceFile | None, Mistakes]:
    """Returns what a text says of a device, and what is wrong with it."""
    mistakes = Mistakes()
    try:
        device = read_device_file(TomlText(path, text), mistakes)
    except BadToml as error:
        mistakes.error(error.pos, error.message)
        return None, mistakes
    check_names(device, mistakes)
    return device, mistakes


def _check_taken(connectors: Sequence[Connector], mistakes: Mistakes) -> set[str]:
    """Two devices cannot have the same line, or listen at the same port; one that is optional goes without. Returns the
    names of those that do."""
    reported = set[str]()
    seen: dict[str, Connector] = {}
    for connector in (c for c in connectors if c.takes and c.enabled and not c.optional):
        first = seen.setdefault(connector.takes, connector)
        if first is not connector:
            message = f"{connector.name} cannot have {connector.takes}, which {first.name} in line {first.pos.line} has"
            same = type(connector) is type(first) and connector.faults
            hint = ": write its devices there" if same else ""
            mistakes.error(connector.pos, message + hint)
            reported.add(connector.name)
    return reported


def _check_names(connectors: Sequence[Connector], reported: set[str], mistakes: Mistakes) -> None:
    """Names are unique: of devices all but those of which something worse is `reported`, of channels those of one
    device."""
    seen: dict[str, Pos] = {}
    for connector in connectors:
        first = seen.setdefault(connector.name.casefold(), connector.pos)
        if first is not connector.pos and connector.name not in reported:
            hint = "give it another name" if connector.variable else 'give it a name: name = "..."'
            message = f"there is a device {connector.name} in line {first.line} already; {hint}"
            mistakes.error(connector.pos, message)
        channels: dict[str, Pos] = {}
        for channel in connector.channels:
            earlier = channels.setdefault(channel.name.casefold(), channel.pos)
            if earlier is not channel.pos:
                message = f"{connector.name} has a channel {channel.name} in line {earlier.line} already"
                mistakes.error(channel.pos, message)
