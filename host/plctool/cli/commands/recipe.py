"""`plctool recipe`: values of a program as a file, to load all of them later."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from plctool.cli import output
from plctool.cli.arguments import add_link, pairs, utf8
from plctool.cli.connections import connect
from plctool.cli.documents import Document
from plctool.cli.output import EXIT_FAILED, EXIT_OK
from plctool.cli.parser import Parser
from plctool.errors import UsageError
from plctool.files import file_path, usable_path
from plctool.printable import one_line

if TYPE_CHECKING:
    from plctool.debug.recipes import Difference, Recipe


def recipe_arguments(command: Parser) -> None:
    action = command.adder_of_actions()
    save = action("save", "write values of the controller to a recipe", _save)
    save.add_argument("file", type=file_path, metavar="FILE", help="FILE.json or FILE.csv")
    _add_names(save, "variables, structures, arrays, patterns; default: what FILE has already")
    add_link(save, symbols=True)
    load = action("load", "check a recipe, write all of its values, and read them back", _load)
    _add_file(load)
    load.add_argument(
        "--then", action="append", default=[], type=utf8, metavar="NAME=VALUE",
        help="write this after the values have been read back: Main.take_over=TRUE",
    )  # fmt: skip
    add_link(load, symbols=True)
    diff = action("diff", "print the values that differ from a recipe; exit status 1 if there are some", _diff)
    _add_file(diff)
    add_link(diff, symbols=True)
    check = action("check", "check names, types and ranges of a recipe against the program", _check)
    _add_file(check)
    check.add_argument(
        "--image", type=usable_path, metavar="APP.cdl", help="against this image; default: what the device runs"
    )
    add_link(check, symbols=True)
    _add_file(action("list", "print the values of a recipe", _list))


def _add_file(command: Parser) -> None:
    command.add_argument("file", type=usable_path, metavar="FILE", help="FILE.json or FILE.csv")
    _add_names(command, "some of its names or patterns; default: all")


def _add_names(command: Parser, help: str) -> None:
    command.add_argument("names", nargs="*", type=utf8, metavar="NAME", help=help)


def _read(args: argparse.Namespace) -> Recipe:
    from plctool.debug.recipes import read_recipe

    return read_recipe(args.file).only(args.names)


def _save(args: argparse.Namespace) -> int:
    from plctool.debug.recipes import check_suffix

    check_suffix(args.file)
    if not args.names and not args.file.exists():
        raise UsageError(f"Name what {args.file} is to have, such as 'Main.recipe.*'.", "usage")
    with connect(args) as plc:
        recipe = plc.save_recipe(args.file, args.names)
    return output.show(
        args,
        {"file": str(args.file), "values": recipe.texts},
        lambda d: f"{d['file']}: {_values(len(d['values']))}",
    )


def _load(args: argparse.Namespace) -> int:
    recipe, then = _read(args), pairs(args.then)
    with connect(args) as plc:
        loaded = plc.load_recipe(recipe, then)
    document = {
        "values": loaded.values,
        "changed": [_entry(difference) for difference in loaded.changed],
        "together": loaded.together,
    }
    return output.show(args, document, _loaded_text)


def _loaded_text(document: Document) -> str:
    how = "" if document["together"] else "; too many for one request, so cycles ran in between"
    lines = _differences_text(document["changed"])
    return "\n".join([*lines, f"{_values(document['values'])} written, {len(document['changed'])} changed{how}"])


def _diff(args: argparse.Namespace) -> int:
    recipe = _read(args)
    with connect(args) as plc:
        found = plc.recipe_differences(recipe)
    document = {"values": len(recipe.values), "changed": [_entry(difference) for difference in found]}
    output.show(args, document, lambda d: "\n".join(_differences_text(d["changed"])) or "no differences")
    return EXIT_FAILED if found else EXIT_OK


def _check(args: argparse.Namespace) -> int:
    recipe = _read(args)
    if args.image is not None:
        from plctool.debug.recipes import fit_recipe
        from plctool.debug.symbols import find_symbols
        from plctool.image.file import image_crc, read_program

        found = fit_recipe(find_symbols(image_crc(read_program(args.image)), args.image), recipe)
    else:
        with connect(args) as plc:
            found = plc.check_recipe(recipe)
    document = {"file": str(args.file), "values": {fitting.name: fitting.text for fitting in found}}
    return output.show(args, document, lambda d: f"{d['file']}: {_values(len(d['values']))} fit the program")


def _list(args: argparse.Namespace) -> int:
    recipe = _read(args)
    rows: list[dict[str, Any]] = [
        {"name": name, "type": value.type, "value": value.text} for name, value in recipe.values.items()
    ]
    return output.show(args, {"values": rows}, lambda d: output.table(d["values"], ("name", "type", "value")))


def _entry(difference: Difference) -> dict[str, str]:
    return {"name": difference.name, "now": difference.now, "recipe": difference.recipe}


def _differences_text(changed: list[dict[str, str]]) -> list[str]:
    return [f"{one_line(d['name'])}: {one_line(d['now'])} -> {one_line(d['recipe'])}" for d in changed]


def _values(count: int) -> str:
    return f"{count} value{'' if count == 1 else 's'}"
