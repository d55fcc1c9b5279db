"""The gateways of this user: which there are, which tools they serve, and how they are ended (`plctool gateway`)."""

from __future__ import annotations

import os
import signal
from contextlib import suppress
from typing import Any

from plctool.errors import LinkError, UsageError
from plctool.gateway.client import Ended, ask, connect, greet
from plctool.gateway.frames import Kind, document_frame
from plctool.gateway.place import Holder, NoGateway, Place, find_holder, find_place, locked, running, runtime_folder

_ANSWER_PATIENCE = 3.0  # for the first frame of a gateway [s]
_END_PATIENCE = 5.0  # for a gateway to close its line [s]
_TERM_PATIENCE = 2.0  # for one that does not answer [s]


def gateways(port: str | None = None) -> list[dict[str, Any]]:
    """What each gateway of this user does, or the one of a port. One that does not answer has `stuck` true."""
    return [_status(place, holder) for place, holder in _find(port)]


def stop_gateways(port: str | None = None) -> list[dict[str, Any]]:
    """Ends the gateways of this user, or the one of a port; what was ended. Their tools get an error that says so.

    Raises LinkError while a program is being downloaded.
    """
    ended = []
    for place, holder in _find(port):
        try:
            _dismiss(place, only_idle=False)
        except (TimeoutError, LinkError) as error:
            if getattr(error, "code", "gateway-stuck") != "gateway-stuck":
                raise
            _kill(place, holder)
        ended.append({"line": holder.line, "pid": holder.pid})
    return ended


def _dismiss(place: Place, only_idle: bool) -> None:
    """Asks a gateway to end and waits until it has closed its line. Raises LinkError, TimeoutError."""
    try:
        ends = _ask(place, {"op": "stop", "only_idle": only_idle})["ends"]
    except Ended:
        ends = True
    if ends:
        with locked(place.lock, _END_PATIENCE):
            pass


def dismiss_idle(port: str) -> None:
    """Ends the gateway of a port if it serves no tool just now, so that the line can be used directly."""
    with suppress(NoGateway, LinkError, TimeoutError):
        place = find_place(port)
        if find_holder(place.lock):
            _dismiss(place, only_idle=True)


def _find(port: str | None) -> list[tuple[Place, Holder]]:
    if port is not None:
        try:
            place = find_place(port)
        except NoGateway as error:
            raise UsageError(f"There can be no gateway for {port}: {error}.", "no-gateway") from None
        holder = find_holder(place.lock)
        return [(place, holder)] if holder else []
    return [(Place(runtime_folder(), holder.line), holder) for holder in running()]


def _status(place: Place, holder: Holder) -> dict[str, Any]:
    stuck = {"line": holder.line, "pid": holder.pid, "stuck": True, "tools": []}
    try:
        return {"stuck": False, **_ask(place, {"op": "status"})}
    except (LinkError, Ended):
        return stuck


def _ask(place: Place, call: dict[str, Any]) -> dict[str, Any]:
    """Raises LinkError, Ended."""
    pipe = connect(place)
    if pipe is None:
        raise Ended
    try:
        greet(pipe, place, {"asks_only": True, "tool": "plctool gateway"}, _ANSWER_PATIENCE)
        return ask(pipe, place, document_frame(Kind.CALL, 2, call), _ANSWER_PATIENCE)
    finally:
        pipe.close()


def _kill(place: Place, holder: Holder) -> None:
    """Ends one that does not answer; it holds its lock, so the process number is still its own."""
    for number, patience in ((signal.SIGTERM, _TERM_PATIENCE), (signal.SIGKILL, _END_PATIENCE)):
        with suppress(ProcessLookupError, TimeoutError):
            os.kill(holder.pid, number)
            with locked(place.lock, patience):
                return
