"""The parser of a command: it reports mistakes as UsageErrors and names the options of links once in the usage."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Iterable
from typing import Any, NoReturn

from plctool.errors import UsageError, did_you_mean

LINK_GROUP = "link options"
"""The title of the options that every command on a device has."""
ONE_DOCUMENT = "print one JSON document and nothing else"


class _Formatter(argparse.HelpFormatter):
    """Names the options of links once in the usage: they are the same for every command."""

    def add_usage(
        self,
        usage: str | None,
        actions: Iterable[argparse.Action],
        groups: Iterable[argparse._MutuallyExclusiveGroup],
        prefix: str | None = None,
    ) -> None:
        own = [action for action in actions if not _is_of_link(action)]
        if len(own) < len(list(actions)):
            own.append(argparse.Action([LINK_GROUP], "link", nargs=0))
        super().add_usage(usage, own, groups, prefix)


def _is_of_link(action: argparse.Action) -> bool:
    return getattr(getattr(action, "container", None), "title", None) == LINK_GROUP


class Parser(argparse.ArgumentParser):
    """Reports wrong arguments as UsageError, like all other wrong use. Options are written whole, so that they mean the
    same when there are more of them."""

    def __init__(self, **words: Any) -> None:
        super().__init__(allow_abbrev=False, formatter_class=_Formatter, **words)
        self._json: argparse.Action | None = None

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Of what a command does not know, it says so itself."""
        found, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}")
        return found, unknown

    def error(self, message: str) -> NoReturn:
        message = self._without_value(message) or message + self._meant(message)
        raise UsageError(f"{message[:1].upper()}{message[1:]}; see '{self.prog} --help'.", "usage")

    def _without_value(self, message: str) -> str:
        """What to say of an option without its value, "" for other mistakes."""
        found = re.match(r"argument (\S+): expected (?:at least )?one argument", message)
        option = "" if found is None else found[1].rpartition("/")[2]
        action = self._option_string_actions.get(option)
        if action is None:
            return ""
        value = action.metavar or "|".join(map(str, action.choices or ())) or action.dest.upper()
        return f"{option} is followed by {value}"

    def _meant(self, message: str) -> str:
        """`(did you mean --version?)` for an option that is not known, if there is one like it."""
        found = re.match(r"unrecognized arguments: (-\S+)", message)
        hint = "" if found is None else did_you_mean(found[1], self._option_string_actions)
        return f" ({hint.removeprefix('; ')})" if hint else ""

    def add_json(self, **words: Any) -> None:
        """Adds the option that every command has."""
        self._json = self.add_argument("--json", action="store_true", help=ONE_DOCUMENT, **words)

    def json_line_for_each(self, what: str) -> None:
        """Says in the help that --json prints several documents, such as one for each reading."""
        assert self._json is not None
        self._json.help = f"print a JSON document a line for each {what}"

    def adder_of_actions(self) -> Callable[..., Parser]:
        """Returns a function that adds the actions of a command, such as `get` of `plctool files`: their name, their
        help, and the function that runs them."""
        actions = self.add_subparsers(title="what", metavar="WHAT", dest="what", required=True, parser_class=Parser)

        def add(name: str, text: str, action: Callable[[argparse.Namespace], int]) -> Parser:
            sub: Parser = actions.add_parser(name, help=text, description=sentence(text))
            sub.add_json(default=argparse.SUPPRESS)  # where it stands before the action, that counts
            sub.set_defaults(action=action)
            return sub

        return add


def sentence(text: str) -> str:
    """Returns a help text as a sentence."""
    return f"{text[:1].upper()}{text[1:]}."
