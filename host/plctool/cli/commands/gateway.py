"""`plctool gateway`: the processes that share serial lines."""

from __future__ import annotations

import argparse
from typing import Any

from plctool.cli import output
from plctool.cli.documents import Document
from plctool.cli.parser import Parser


def gateway_arguments(command: Parser) -> None:
    command.add_argument(
        "what", choices=["status", "stop"], metavar="status|stop",
        help="status: tools of each line; stop: end it, its tools get an error",
    )  # fmt: skip
    command.add_argument("--port", metavar="PORT", help="only the gateway of this port; default: all of this user")
    command.set_defaults(action=_gateway)


def _gateway(args: argparse.Namespace) -> int:
    if args.what == "status":
        return output.show(args, gateways(args.port), gateways_text)
    return output.show(args, stop_gateways(args.port), stopped_text)


def gateways(port: str | None) -> Document:
    """What each gateway of this user does, or the one of a port."""
    from plctool.gateway.control import gateways as found

    return {"gateways": found(port)}


def stop_gateways(port: str | None) -> Document:
    """Ends the gateways of this user, or the one of a port."""
    from plctool.gateway.control import stop_gateways as stopped

    return {"stopped": stopped(port)}


def gateways_text(document: dict[str, Any]) -> str:
    """A line for each gateway, and one for each tool it serves."""
    return "\n".join(map(_gateway_text, document["gateways"])) or "No gateway runs."


def _gateway_text(gateway: dict[str, Any]) -> str:
    if gateway["stuck"]:
        return f"{gateway['line']}: gateway (pid {gateway['pid']}) does not answer"
    lines = [f"{gateway['line']}: {gateway['baud']} baud, gateway (pid {gateway['pid']})"]
    lines += [f"  {tool['tool']} (pid {tool['pid']})" for tool in gateway["tools"]]
    return "\n".join([*lines, f"  {gateway['claim']}"] if gateway["claim"] else lines)


def stopped_text(document: dict[str, Any]) -> str:
    lines = [f"{gateway['line']}: gateway (pid {gateway['pid']}) ended" for gateway in document["stopped"]]
    return "\n".join(lines) or "No gateway runs."
