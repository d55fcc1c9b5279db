"""Events that the driver of CANopen posts."""

from __future__ import annotations

from plctool.core import lib
from plctool.io.configuration import Configuration

_EVENTS = (int(lib.CANOPEN_PARAM_SYNC_EVENT), int(lib.CANOPEN_PARAM_WINDOW_EVENT))


def posted_events(configuration: Configuration) -> set[str]:
    """The names of the events of SYNC and its window."""
    parameters = (p for c in configuration.connectors if c.driver == "IoDrvCanopen" for p in c.parameters)
    return {p.value.rstrip(b"\0").decode("ascii", "replace") for p in parameters if p.id in _EVENTS}
