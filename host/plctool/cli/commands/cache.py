"""`plctool cache`: the compiled code that is kept between builds."""

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
        help="show: where the code is and how much; clear: delete it; default: show",
    )  # fmt: skip
    command.set_defaults(action=_cache)


def _cache(args: argparse.Namespace) -> int:
    return output.show(args, cache(clear=args.what == "clear"), cache_text)


def cache(*, clear: bool) -> Document:
    """Describes the cache, or empties it. "usable": false where builds do without one."""
    from plctool.compiler.codegen.object_cache import ObjectCache

    kept = ObjectCache()
    document: Document = {"folder": str(kept.folder), "usable": kept.usable(), "cleared": clear}
    document["objects"], document["bytes"] = kept.clear() if clear else kept.size()
    return document


def cache_text(document: dict[str, Any]) -> str:
    """Where the cache is and how large; or why it is not used."""
    folder, objects = document["folder"], counted(document["objects"], "object")
    if not document["usable"]:
        return (
            f"{folder} is not used: others may write or read it, or it is another user's. Remove it, or name a folder "
            "of your own in XDG_CACHE_HOME."
        )
    if document["cleared"]:
        return f"{folder}: {objects} deleted, {document['bytes']} bytes"
    return f"{folder}: {objects}, {document['bytes']} bytes"
