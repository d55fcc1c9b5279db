"""What the commands on production images do, as functions that return the document `--json` prints."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from plctool.cli.io_documents import Document, board_in
from plctool.errors import UsageError
from plctool.files import read_image


def production(image: Path, board: str | None, firmware: Path | None, output: Path) -> Document:
    """Writes what a programmer burns to `output`; "burn_at" is the address that a .bin belongs to, "burn_apart" the
    firmware that cannot be in it, "stack" what the program needs of it, if its symbols are found. Raises UsageError
    when the parts do not go together."""
    from plctool.debug.symbols import find_symbols
    from plctool.image.board import board_of, read_firmware
    from plctool.image.file import image_crc, parse_image, read_program
    from plctool.image.limits import needs_of_image
    from plctool.image.production import is_production, production_pieces, write_production
    from plctool.io.fit import check_board

    if not is_production(output):
        raise UsageError(f"{output} is neither .bin nor .hex; write for example -o {_as_hex(output)}.", "bad-output")
    of_firmware = None if firmware is None else read_firmware(firmware)
    wanted = board_of(board, of_firmware)
    data = read_program(image)
    meant = board_in(data)
    if meant not in ("", wanted.name) and not wanted.is_program:
        raise UsageError(
            f"The inputs and outputs of {image} are those of {meant}, this is {wanted.title}; build it for this board.",
            "other-board",
        )
    pieces = production_pieces(data, wanted, of_firmware)
    advice = "Make the program smaller, or use a firmware with more room."
    parsed = parse_image(data)
    needs, stack = needs_of_image(parsed, len(data)), None
    with suppress(UsageError):
        stack = find_symbols(parsed.crc, image).stack
    check_board(parsed, needs if stack is None else {**needs, "stack": stack}, wanted, advice)
    start = write_production(output, pieces, wanted)
    apart = None if firmware is None or wanted.flash.address is not None else str(firmware)
    return {
        "output": str(output),
        "board": wanted.title,
        "target": wanted.target,
        "crc": f"{image_crc(data):08X}",
        "pieces": [
            {"address": f"{p.segment.address:08X}", "size": len(p.segment.data), "what": p.what} for p in pieces
        ],
        "burn_at": None if start is None else f"{start:08X}",
        "burn_apart": apart,
        "stack": None if stack is None else {"bytes": stack.amount, "at_least": stack.at_least},
    }


def _as_hex(output: Path) -> Path:
    """A name for a file that has none for its kind."""
    name = output.stem.lstrip(".")
    return output.parent / f"{'product' if name.lower() in ('', 'bin', 'hex') else name}.hex"


def production_info(path: Path) -> Document:
    """What is in a .bin or .hex."""
    from plctool.image.production import describe_production

    return describe_production(path, read_image(path))
