"""`plctool cache`: the compiled code, the syntax trees and the reports that are kept between builds."""

from __future__ import annotations

import argparse
from typing import Any

from plctool.cli import output
from plctool.cli.documents import Document
from plctool.cli.parser import Parser
from plctool.errors import counted


def cache_arguments(command: Parser) -> None:
    command.add_argument(
        "what", choices=["show", "clear"], nargs="?", default="show", metavar="show|clear",
        help="show: where compiled code and syntax trees are, and how many; clear: delete them; default: show",
    )  # fmt: skip
    command.set_defaults(action=_cache)


def _cache(args: argparse.Namespace) -> int:
    return output.show(args, cache(clear=args.what == "clear"), cache_text)


def cache(*, clear: bool) -> Document:
    """Describes the cache, or empties it. "usable": false where builds do without one."""
    from plctool.cli.kept_reports import report_folder
    from plctool.compiler.codegen.object_cache import ObjectCache
    from plctool.compiler.kept.tree_cache import tree_folder

    objects, trees, reports = ObjectCache(), tree_folder(), report_folder()
    usable = objects.usable() and trees.usable() and reports.usable()
    document: Document = {"folder": str(objects.folder), "usable": usable, "cleared": clear}
    counts = [kept.clear() if clear else kept.size() for kept in (objects, trees, reports)]
    document["objects"], document["trees"], document["reports"] = (count for count, _ in counts)
    document["bytes"] = sum(size for _, size in counts)
    return document


def cache_text(document: dict[str, Any]) -> str:
    """Where the cache is and how large; or why it is not used."""
    folder = document["folder"]
    if not document["usable"]:
        return (
            f"{folder} is not used: others may write or read it, or it is another user's. Remove it, or name a folder "
            "of your own in XDG_CACHE_HOME."
        )
    objects, trees = counted(document["objects"], "object"), counted(document["trees"], "syntax tree")
    found = f"{objects}, {trees} and {counted(document['reports'], 'report')}"
    if document["cleared"]:
        return f"{folder}: {found} deleted, {document['bytes']} bytes"
    return f"{folder}: {found}, {document['bytes']} bytes"
