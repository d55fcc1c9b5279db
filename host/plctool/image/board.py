"""What is known of a board without asking it: its flash, and what its firmware has room for (`BoardFacts.h`).

The facts are those its firmware is compiled with. plcrt and the boards of this repository are in the C core; any other
firmware has its own in its ELF file.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

from plctool.core import ffi, lib
from plctool.errors import UsageError, did_you_mean
from plctool.iec.areas import Area
from plctool.image.file import ELF_TAG, target_name
from plctool.image.limits import ROOM, of_area
from plctool.image.targets import TARGETS

SLOT_A, SLOT_B, COMMIT, RETAIN = (int(n) for n in (lib.FILE_SLOT_A, lib.FILE_SLOT_B, lib.FILE_COMMIT, lib.FILE_RETAIN))
_SECTION = "board_facts"


@dataclass(frozen=True)
class Part:
    """A part of the flash: `offset` and `size` in bytes, both multiples of a sector."""

    offset: int
    size: int


@dataclass(frozen=True)
class Flash:
    """The flash that keeps programs. `address`: where it is in the memory of the processor; None if it is not memory.
    `files`: by FILE_*; `store`: the catalog, two sectors, and the files that tools keep there; None without."""

    address: int | None
    size: int
    sector_size: int
    erased: int
    files: tuple[Part, ...]
    store: Part | None = None

    def parts(self) -> tuple[Part, ...]:
        """All that the runtime writes to."""
        return self.files if self.store is None else (*self.files, self.store)

    @property
    def retained(self) -> int:
        """Bytes of RETAIN variables that a half of their log has room for."""
        return self.files[RETAIN].size // 2 - int(ffi.sizeof("FLASH_LOG_HEAD"))


@dataclass(frozen=True)
class Board:
    """`device_id`: of the processor; `images_for`: what its images are for, another one if its vendor has numbers.
    `limits`: what a program may need at most, by the names of `limits.py`. `record`: bytes of a commit record.
    `components`: of the runtime that its firmware has. `content`: the firmware, if its file was read."""

    name: str
    config: str
    device_id: int
    images_for: int
    flash: Flash
    record: int
    limits: dict[str, int] = field(hash=False)
    components: frozenset[str]
    content: bytes = field(default=b"", repr=False, compare=False)

    def offers(self, signature: int) -> bool:
        """Whether its firmware may have a C function with this signature in a component of another name."""
        return signature.to_bytes(4, "little") in self.content

    @property
    def target(self) -> str:
        return target_name(self.device_id)

    @property
    def is_program(self) -> bool:
        """Whether it is plcrt, which does not know what board it runs on unless its user says so."""
        return not TARGETS[self.target].small_flash

    @property
    def title(self) -> str:
        """How messages call it."""
        return f"{self.name} ({self.config})" if self.config else self.name

    @property
    def slug(self) -> str:
        """What `--board` calls it, such as mps2-an385/standard."""
        return f"{_slug(self.name)}/{self.config}" if self.config else _slug(self.name)


@dataclass(frozen=True)
class Segment:
    """Bytes that are programmed at an address."""

    address: int
    data: bytes

    @property
    def end(self) -> int:
        return self.address + len(self.data)


@dataclass(frozen=True)
class Firmware:
    """An ELF file: what it has in memory, and the facts of its board."""

    path: Path
    board: Board
    segments: tuple[Segment, ...]


def _slug(name: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", name.casefold()).strip("-")


@cache
def known_boards() -> tuple[Board, ...]:
    """plcrt, and the boards of this repository with each firmware they have."""
    return tuple(map(_board, _all_facts()))


def _all_facts() -> Iterator[Any]:
    index = 0
    while (facts := lib.SimBoard(index)) != ffi.NULL:
        yield facts
        index += 1


def _board(facts: Any) -> Board:
    files = tuple(Part(int(f.offset), int(f.size)) for f in facts.file)
    address = int(facts.flash_address) if facts.has_address else None
    store = Part(int(facts.store.offset), int(facts.store.size)) if facts.store.size else None
    flash = Flash(address, int(facts.flash_size), int(facts.sector_size), int(facts.erased), files, store)
    slot = min(files[SLOT_A].size, files[SLOT_B].size) - ffi.sizeof("APP_SEAL")
    limits = {
        "tasks": int(facts.tasks),
        "functions": int(facts.imports),
        **{of_area(Area(index)): int(size) for index, size in enumerate(facts.area)},
        "code": int(facts.code) or slot,
        "image": slot,
    }
    limits |= {name: int(getattr(facts, name)) for name in ROOM}
    limits["retain"] = min(limits["retain"], flash.retained)
    if facts.copies:
        limits["all_copies" if facts.copies_always else "copies"] = int(facts.copies)
    if facts.stack:
        limits["stack"] = int(facts.stack)
    name, config, components = (
        ffi.string(text).decode("ascii", "replace") for text in (facts.name, facts.config, facts.components)
    )
    ids = int(facts.target_id), int(facts.device_id)
    return Board(name, config, *ids, flash, int(facts.record), limits, frozenset(components.split()))


def find_board(text: str) -> Board:
    """The board that `--board` names. Raises UsageError when it is not known, or has several firmwares."""
    boards = known_boards()
    name, _, config = text.partition("/")
    found = [b for b in boards if _slug(b.name) == _slug(name) and (not config or b.config == config.casefold())]
    if len(found) == 1:
        return found[0]
    if found:
        names = ", ".join(b.slug for b in found)
        raise UsageError(
            f"{found[0].name} has several firmwares; say which one it has: {names}, or give its ELF file with "
            "--firmware.",
            "no-such-board",
        )
    slugs = [b.slug for b in boards]
    raise UsageError(
        f"There is no board '{text}'{did_you_mean(text, slugs) or '.'} Choose one of {', '.join(slugs)}; for a board "
        "of your own give its ELF file with --firmware.",
        "no-such-board",
    )


def read_firmware(path: Path) -> Firmware:
    """Raises UsageError when it is not a firmware that says what its board is."""
    from elftools.common.exceptions import ELFError  # late, as most programs are built without a firmware
    from elftools.elf.elffile import ELFFile

    try:
        with path.open("rb") as file:
            head = file.read(len(ELF_TAG))
            elf = ELFFile(file)
            section = elf.get_section_by_name(_SECTION)
            data = b"" if section is None else section.data()
            segments = tuple(
                Segment(int(s["p_paddr"]), s.data())
                for s in elf.iter_segments("PT_LOAD")
                if s["p_filesz"] and section is not None
            )
    except OSError as error:
        raise UsageError(f"The firmware {path} cannot be read: {error.strerror}.", "no-firmware") from None
    except ELFError:
        raise UsageError(f"{path} {_not_elf(head)}", "bad-firmware") from None
    facts = ffi.new("BOARD_FACTS *")
    if not data:
        raise UsageError(
            f"{path} does not say what its board is; give BOARD_FLASH_SECTOR_SIZE and the others of BoardFacts.h in "
            "its rts_config_port.h, and build it again. plcrt has no firmware in its flash.",
            "bad-firmware",
        )
    ffi.buffer(facts)[: min(len(data), ffi.sizeof("BOARD_FACTS"))] = data[: ffi.sizeof("BOARD_FACTS")]
    if facts.magic != lib.BOARD_FACTS_MAGIC or facts.size != ffi.sizeof("BOARD_FACTS") or len(data) != facts.size:
        raise UsageError(
            f"{path} is a firmware of another version of plctool; build it again with this one.", "bad-firmware"
        )
    return Firmware(path, replace(_board(facts), content=b"".join(s.data for s in segments)), segments)


def _not_elf(head: bytes) -> str:
    if head == ELF_TAG:
        return "is an ELF file that is cut off or damaged; copy or link it again."
    if not head:
        return "is empty; copy or link it again."
    return "is not an ELF file; name what the linker wrote, not a .bin or .hex."


def board_of(name: str | None, firmware: Firmware | None) -> Board:
    """The board that both agree on. Raises UsageError when they do not, or neither is given."""
    if firmware is None:
        if name is None:
            raise UsageError("Name the board with --board, or give its ELF file with --firmware.", "usage")
        return find_board(name)
    board = firmware.board
    if name is None:
        return board
    wanted, _, config = name.partition("/")
    if _slug(wanted) != _slug(board.name) or config.casefold() not in ("", board.config):
        raise UsageError(
            f"{firmware.path} is the firmware of {board.title}, not of {name}; name it --board {board.slug}, or give "
            "the firmware of the other.",
            "other-firmware",
        )
    _check_map(firmware)
    return board


def _check_map(firmware: Firmware) -> None:
    """The flash of a firmware is that of its configuration here; of one that is not from here, that of any other of
    the board."""
    board = firmware.board
    of_board = [known for known in known_boards() if _slug(known.name) == _slug(board.name)]
    known = [k for k in of_board if k.config == board.config] or of_board
    if known and all(k.flash != board.flash for k in known):
        raise UsageError(
            f"{firmware.path} has another map of the flash than {known[0].title} of this plctool: "
            f"{_difference(board.flash, known[0].flash)}. Leave --board out to go by the firmware, or build it again.",
            "other-firmware",
        )


def _difference(of_firmware: Flash, known: Flash) -> str:
    for name, one, other in (
        ("its address is", of_firmware.address, known.address),
        ("its size is", of_firmware.size, known.size),
        ("its sectors have", of_firmware.sector_size, known.sector_size),
        ("slot B is at", of_firmware.files[SLOT_B].offset, known.files[SLOT_B].offset),
        ("the commit log is at", of_firmware.files[COMMIT].offset, known.files[COMMIT].offset),
    ):
        if one != other:
            return f"{name} {_hex(one)}, not {_hex(other)}"
    return "its files have other sizes"


def _hex(number: int | None) -> str:
    return "none" if number is None else f"0x{number:X}"
