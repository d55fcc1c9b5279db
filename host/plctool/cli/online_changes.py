"""What an online change does with a program, for people and tools: of `build --base` and `flash --online-change`.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plctool.cli.documents import Document
from plctool.errors import UsageError, counted
from plctool.project import SYMBOL_SUFFIX

if TYPE_CHECKING:
    from plctool.cli.projects import Settings
    from plctool.compiler.image.build import BuildResult
    from plctool.compiler.typed.online_change import OnlineChange
    from plctool.debug.symbols import SymbolTable

_SHOWN = 20  # names of each kind
_KINDS = {
    "moved": "moved",
    "retyped": "gets its initial value",
    "new": "new",
    "removed": "removed",
    "extended": "extended",
    "tasks": "task",
}


def with_base(settings: Settings, args: argparse.Namespace) -> Settings:
    """The settings with the program that `--base` names."""
    if args.base is None:
        if args.dry_run:
            raise UsageError("--dry-run needs --base OLD.cdl: the image that runs.", "usage")
        return settings
    return replace(settings, base=base_of(args.base))


def base_of(image: Path) -> SymbolTable:
    """The symbols of an image that runs, from beside it or from the cache, or a symbol file. Raises UsageError."""
    from plctool.debug.symbols import find_symbols, load_symbols
    from plctool.files import read_image
    from plctool.image.file import check_image, image_crc

    if image.suffix == SYMBOL_SUFFIX:
        return load_symbols(image)
    data = read_image(image)
    check_image(image, data)
    return find_symbols(image_crc(data), image)


def change_document(result: BuildResult) -> Document:
    """What a change does, ready for JSON. Names that are no identifiers are the compiler's own."""
    from plctool.image.file import parse_image

    change = result.change
    assert change is not None
    image, had = parse_image(result.image).change, change.previous.variables
    return {
        "base": f"{change.previous.crc:08X}",
        "kept": change.kept,
        "moved": change.moved,
        "retyped": change.retyped,
        "new": [v.name for v in change.new if _is_of_user(v.name) and v.name.casefold() not in had],
        "removed": [name for name in change.removed if _is_of_user(name)],
        "extended": list(dict.fromkeys(v.name for v, fresh in change.fresh if not fresh.was_in_register)),
        "written": 0 if image is None else sum(step.size for step in image.steps if step.writes),
        "tasks": change.tasks,
        "problems": change.problems,
    }


def _is_of_user(name: str) -> bool:
    return "%" not in name and " " not in name


def check_possible(change: OnlineChange) -> None:
    """Raises UsageError that says what is in the way of a change."""
    if change.problems:
        raise UsageError(_impossible(change.problems), "no-online-change")


def _impossible(problems: list[str]) -> str:
    return f"No online change: {'; '.join(problems)}. Undo that, or download the program with 'plctool flash'."


def change_text(document: dict[str, Any]) -> str:
    """What a change does, in lines. On the way back, values of what only the newer program has are lost."""
    kinds = _KINDS | ({"removed": "lost, since only the newer program has it"} if "back" in document else {})
    lines = [
        f"online change of {document['base']}: {counted(document['kept'], 'variable')} kept, "
        f"{len(document['new'])} new, {len(document['removed'])} removed; {document['written']} bytes are written"
    ]
    for kind, title in kinds.items():
        lines += [f"  {title}: {name}" for name in document[kind][:_SHOWN]]
        if len(document[kind]) > _SHOWN:
            lines.append(f"  {title}: and {len(document[kind]) - _SHOWN} more")
    if document["problems"]:
        lines.append(_impossible(document["problems"]))
    return "\n".join(lines)
