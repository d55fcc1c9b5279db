"""Whether a program fits the firmware of a board: room, components of the runtime, and what drivers have room for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from plctool.errors import listed
from plctool.image.board import Board, known_boards
from plctool.image.c_functions import COMPILER_COMPONENTS, CFunction, find_c_function
from plctool.image.file import Image
from plctool.image.limits import MOST_SHOWN, Need, check_fit
from plctool.image.targets import TARGETS
from plctool.io.configuration import configuration_of_image
from plctool.io.room import DRIVER_OF, DRIVERS, IO_MANAGER, MODBUS, needs_of_io, required


def check_board(image: Image, needs: Mapping[str, Need], board: Board, advice: str) -> None:
    """Raises UsageError that says all that a board lacks for an image. `needs`: what is known of it besides its inputs
    and outputs; `advice`: a sentence about what to do when it needs too much."""
    lacking = _lacking(image, board)
    limits = {name: limit for name, limit in board.limits.items() if DRIVER_OF.get(name) not in lacking}
    sentences = [*_sentences(lacking, board), *_other_processors(_unregistered(image, board), board)]
    check_fit({**needs, **_needs_of_io(image)}, limits, board.title, advice, sentences)


def _needs_of_io(image: Image) -> dict[str, Need]:
    configuration = configuration_of_image(image)
    calls = any(function.component == MODBUS for function in _functions(image))
    return ({} if configuration is None else needs_of_io(configuration)) | {"modbus_calls": Need(int(calls))}


def _unregistered(image: Image, board: Board) -> list[str]:
    """Functions that a component of the firmware has, but not on this processor."""
    target = TARGETS[board.target]
    return [
        function.name
        for function in _functions(image)
        if function.component in board.components
        and not function.is_registered(target)
        and not board.offers(function.signature)
    ]


def _lacking(image: Image, board: Board) -> dict[str, list[str]]:
    """By component that the firmware does not have: what of the image needs it. Of functions and drivers of a vendor's
    own nothing is known."""
    found: dict[str, list[str]] = {}
    for function in _functions(image):
        if function.component not in board.components and not board.offers(function.signature):
            names = found.setdefault(function.component, [])
            name = COMPILER_COMPONENTS.get(function.component, function.name)
            names += [name] if name not in names else []
    configuration = configuration_of_image(image)
    if configuration is not None:
        users = [(IO_MANAGER, "inputs and outputs")]
        users += [(c.driver, c.name) for c in required(configuration) if c.driver in DRIVERS]
        for component, user in users:
            if component not in board.components:
                found.setdefault(component, []).append(user)
    return found


def _functions(image: Image) -> Iterator[CFunction]:
    found = (find_c_function(external.name, external.signature) for external in image.externals)
    return (function for function in found if function is not None)


def _sentences(lacking: Mapping[str, Sequence[str]], board: Board) -> Iterator[str]:
    for component, users in lacking.items():
        others = [b.slug for b in known_boards() if b.name == board.name and component in b.components]
        where = f"; {listed(others)} {'have' if len(others) > 1 else 'has'} it" if others else ""
        yield f"It needs {component} for {_shown(users)}, which the firmware does not have{where}."


def _other_processors(names: Sequence[str], board: Board) -> Iterator[str]:
    if names:
        yield f"It calls {_shown(names)}, which firmware for {board.target} does not have; build it with another -O."


def _shown(names: Sequence[str]) -> str:
    more = len(names) - MOST_SHOWN
    return listed(names if more <= 0 else [*names[:MOST_SHOWN], f"{more} more"])
