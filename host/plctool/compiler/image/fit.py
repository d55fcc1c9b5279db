"""Whether a program fits its device, found out before it is flashed."""

from __future__ import annotations

from plctool.compiler.image.build import BuildResult
from plctool.core import lib
from plctool.image.board import Board, known_boards
from plctool.image.file import parse_image
from plctool.image.limits import LIMITS, check_fit
from plctool.image.targets import TARGETS, Target
from plctool.io.device_file import PROGRAM_LIMITS, DeviceFile
from plctool.io.fit import check_board

_OTHERWISE = "say so in a device file (docs/io.md) or build with --no-limits"


def check_program_fits(built: BuildResult, target: Target, board: Board | None, device: DeviceFile | None) -> None:
    """Compares with what `board` has and with the limits of the device file, without both with the most that any
    firmware of this repository has on this processor, or on its like. Raises UsageError saying what does not fit, and
    what needs most of it."""
    needs = built.needs
    own: dict[str, int] = {}
    if device is not None and device.target in ("", target.name):  # not when it is built for a simulator
        own = {name: n for name, n in device.limits.items() if name in PROGRAM_LIMITS}
    if board is not None:
        check_board(parse_image(built.image), needs, board, "Make the program smaller.")
    if own and device is not None:
        check_fit(
            needs, own, device.title,
            f"Make the program smaller; if the firmware has more room, correct {device.path}.",
        )  # fmt: skip
    elif board is None:
        same = _boards_like(target)
        limits = {name: max(b.limits.get(name, 0) for b in same) for name in LIMITS}
        names = " or ".join(dict.fromkeys(b.name for b in same))
        check_fit(needs, limits, names, f"Make the program smaller; if your firmware has more room, {_OTHERWISE}.")


def board_meant(target: Target, board: Board | None, device: DeviceFile | None) -> str:
    """What the device calls itself whose inputs and outputs a description means, "" for any that has them."""
    if device is not None and device.name:
        return device.name if device.target in ("", target.name) else ""  # else it is built for a simulator
    return "" if board is None or board.is_program else board.name


def _boards_like(target: Target) -> list[Board]:
    """The boards with this processor; of one that no board has, those with a processor of its size."""
    boards = {t.name: [b for b in known_boards() if b.device_id == getattr(lib, t.device_id)] for t in TARGETS.values()}
    alike = [b for t in TARGETS.values() if t.small_flash == target.small_flash for b in boards[t.name]]
    return boards[target.name] or alike
