"""Whether a program fits the firmware of a board: room, components of the runtime, and what drivers have room for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from plctool.image.board import Board, known_boards
from plctool.image.c_functions import C_FUNCTIONS
from plctool.image.file import Image
from plctool.image.limits import Need, check_fit
from plctool.io.room import DRIVERS, configuration_of_image, needs_of_io, required

_IO_MANAGER = "CmpIoMgrEmbedded"
_UNNAMED = {
    "CmpIntCalls": "LINT and division",
    "CmpRealCalls": "REAL",
    "CmpLrealCalls": "LREAL",
}
"""What the functions are for that no program names."""


def check_board(image: Image, needs: Mapping[str, Need], board: Board, advice: str) -> None:
    """Raises UsageError that says all that a board lacks for an image. `needs`: what is known of it besides its inputs
    and outputs; `advice`: a sentence about what to do when it needs too much."""
    configuration = configuration_of_image(image)
    of_io = {} if configuration is None else needs_of_io(configuration)
    check_fit({**needs, **of_io}, board.limits, board.title, advice, _lacking(image, board))


def components_of_image(image: Image) -> dict[str, list[str]]:
    """The components that it needs, and what of it needs each. Of functions and drivers of a vendor's own they are not
    known."""
    found: dict[str, list[str]] = {}
    for external in image.externals:
        function = C_FUNCTIONS.get(external.name)
        if function is not None:
            names = found.setdefault(function.component, [])
            name = _UNNAMED.get(function.component, external.name)
            names += [name] if name not in names else []
    configuration = configuration_of_image(image)
    if configuration is not None:
        found[_IO_MANAGER] = ["inputs and outputs"]
        for connector in required(configuration):
            if connector.driver in DRIVERS:
                found.setdefault(connector.driver, []).append(connector.name)
    return found


def _lacking(image: Image, board: Board) -> Iterator[str]:
    """A sentence for each component that the firmware does not have."""
    for component, users in components_of_image(image).items():
        if component in board.components:
            continue
        others = [b.slug for b in known_boards() if b.name == board.name and component in b.components]
        where = f"; {_list(others)} {'have' if len(others) > 1 else 'has'} it" if others else ""
        yield f"It needs {component} for {_list(users)}, which the firmware does not have{where}."


def _list(names: Sequence[str]) -> str:
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last
