"""Network management: commands to nodes, and the states that their heartbeats show."""

from __future__ import annotations

from enum import IntEnum

from plctool.canopen.bus import HEARTBEAT, NMT, CanopenBus, Frame
from plctool.canopen.words import LAST_NODE, State, state_text
from plctool.errors import DeviceError


class Command(IntEnum):
    """The first byte of an NMT frame."""

    START = 0x01
    STOP = 0x02
    PREOP = 0x80
    RESET = 0x81
    RESET_COMM = 0x82


COMMANDS = {command.name.lower().replace("_", "-"): command for command in Command}
_LEADS_TO = {
    Command.START: {State.OPERATIONAL},
    Command.STOP: {State.STOPPED},
    Command.PREOP: {State.PRE_OPERATIONAL},
    Command.RESET: {State.BOOT_UP},
    Command.RESET_COMM: {State.BOOT_UP},
}
ALL = 0


def heartbeat_of(frame: Frame) -> tuple[int, int] | None:
    """Node and state that a heartbeat or boot-up shows, None for another frame."""
    node = frame.identifier - HEARTBEAT
    if not 1 <= node <= LAST_NODE or len(frame.data) != 1:
        return None
    return node, frame.data[0] & 0x7F  # bit 7 is the toggle bit of node guarding


def command(bus: CanopenBus, what: Command, node: int, timeout: float) -> dict[int, int]:
    """Sends a command to a node or to ALL, and returns the state of each node that shows one within the time.
    Raises DeviceError if a node shows another state than the command leads to."""
    bus.drain()
    bus.send(NMT, bytes([what, node]))
    states: dict[int, int] = {}
    reached: set[int] = set()
    for frame in bus.frames(timeout):
        beat = heartbeat_of(frame)
        if beat is None or node not in (ALL, beat[0]) or beat[0] in reached:
            continue
        states[beat[0]] = beat[1]
        if beat[1] in _LEADS_TO[what]:
            reached.add(beat[0])
            if node != ALL:
                break
    _check(what, states, reached)
    return dict(sorted(states.items()))


def _check(what: Command, states: dict[int, int], reached: set[int]) -> None:
    others = {node: state for node, state in sorted(states.items()) if node not in reached}
    if others:
        wanted = "has not booted" if State.BOOT_UP in _LEADS_TO[what] else f"is not {min(_LEADS_TO[what])}"
        texts = ", ".join(f"node {node} {wanted} but {state_text(state)}" for node, state in others.items())
        raise DeviceError(f"The command was sent, but {texts}.", "nmt-state")
