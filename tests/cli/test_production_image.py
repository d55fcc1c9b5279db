"""`plctool image` writes what a programmer burns, refuses what does not go together, and `info` reads it back."""

from __future__ import annotations

import io
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from intelhex import IntelHex

from plctool.core import ffi, lib
from plctool.image.board import Board, board_of, known_boards, read_firmware
from plctool.image.c_functions import C_FUNCTIONS
from plctool.image.production import production_pieces, write_production

PROGRAM = "PROGRAM Main VAR n : DINT; END_VAR n := n + 1; END_PROGRAM"
TASKS = "".join(f"PROGRAM P{i} VAR n : DINT; END_VAR n := n + 1; END_PROGRAM\n" for i in range(3)) + (
    "CONFIGURATION C RESOURCE R ON PLC\n"
    + "".join(f"TASK T{i}(INTERVAL := T#1s); PROGRAM I{i} WITH T{i} : P{i};\n" for i in range(3))
    + "END_RESOURCE END_CONFIGURATION"
)
SIZE = 5 * 1024 * 1024  # of plcrt's flash
FLASH = 0x2100_0000  # of the mps2-an385


@pytest.fixture
def build(tool: Any, scratch: Path) -> Callable[..., Path]:
    def build(text: str = PROGRAM, *options: str) -> Path:
        (scratch / "app.st").write_text(text)
        assert tool("build", "app.st", "-o", "app.cdl", *options).status == 0
        return scratch / "app.cdl"

    return build


@pytest.fixture
def for_m3(build: Callable[..., Path]) -> Path:
    return build(PROGRAM, "--target", "cortex-m3")


def facts(slug: str, **changes: int | bytes | list[tuple[int, int]]) -> bytes:
    """Those of a board, with changes."""
    index = [board.slug for board in known_boards()].index(slug)
    copy = ffi.new("BOARD_FACTS *", lib.SimBoard(index)[0])
    for name, value in changes.items():
        setattr(copy, name, value)
    return bytes(ffi.buffer(copy))


def elf(data: bytes, section: str = "board_facts", address: int = 0, size: int = 64) -> bytes:
    """The file of a firmware: one segment, and one section that is not loaded."""
    names = f"\0{section}\0.shstrtab\0".encode()
    code = bytes(range(size % 256 or 1)) + bytes(size - (size % 256 or 1))
    at_code = 52 + 32
    at_data = at_code + len(code)
    at_names = at_data + len(data)
    at_sections = at_names + len(names)
    head = b"\x7fELF\1\1\1" + bytes(9)
    head += struct.pack("<HHIIIIIHHHHHH", 2, 40, 1, address, 52, at_sections, 0, 52, 32, 1, 40, 3, 2)
    segment = struct.pack("<8I", 1, at_code, address, address, len(code), len(code), 5, 4)
    none = bytes(40)
    of_data = struct.pack("<10I", 1, 1, 0, 0, at_data, len(data), 0, 0, 4, 0)
    of_names = struct.pack("<10I", 2 + len(section), 3, 0, 0, at_names, len(names), 0, 0, 1, 0)
    return head + segment + code + data + names + none + of_data + of_names


def refused(done: Any, *words: str) -> None:
    assert done.status == 2
    for word in words:
        assert word in done.err


def test_bin_is_the_whole_flash_and_info_reads_it_back(tool: Any, scratch: Path, build: Any) -> None:
    image = build().read_bytes()
    document = tool("image", "app.cdl", "--board", "plcrt", "-o", "flash.bin", "--json").json
    data = (scratch / "flash.bin").read_bytes()
    assert len(data) == SIZE
    assert data.startswith(image)
    parts = ["program", "empty slot", "commit log", "retain log", "catalog of files"]
    assert [piece["what"] for piece in document["pieces"]] == parts
    (program,) = tool("info", "flash.bin", "--json").json["programs"]
    described = tool("info", "app.cdl", "--json").json
    assert program["crc"] == described["crc"] == document["crc"]
    assert program["seal"] == 1
    assert program["tasks"] == described["tasks"]


def test_hex_has_the_same_bytes_and_nothing_of_the_rest(tool: Any, scratch: Path, for_m3: Path) -> None:
    for name in ("flash.bin", "flash.hex"):
        assert tool("image", "app.cdl", "--board", "mps2-an385/standard", "-o", name).status == 0
    content = IntelHex(str(scratch / "flash.hex"))
    data = (scratch / "flash.bin").read_bytes()
    assert content.minaddr() == FLASH
    assert all(data[address - FLASH] == content[address] for address in content.addresses())
    inside = {address - FLASH for address in content.addresses()}
    assert all(byte == 0xFF for offset, byte in enumerate(data) if offset not in inside)
    (program,) = tool("info", "flash.hex", "--json").json["programs"]
    assert (program["address"], program["seal"]) == (f"{FLASH:08X}", 1)


def test_logs_of_a_used_device_are_overwritten(tool: Any, scratch: Path, for_m3: Path) -> None:
    tool("image", "app.cdl", "--board", "mps2-an385/standard", "-o", "flash.hex")
    content = IntelHex(str(scratch / "flash.hex"))
    flash = next(board.flash for board in known_boards() if board.slug == "mps2-an385/standard")
    for file in (lib.FILE_COMMIT, lib.FILE_RETAIN):
        begin = FLASH + flash.files[file].offset
        assert set(range(begin, begin + flash.files[file].size)) <= set(content.addresses())
    slot = FLASH + flash.files[lib.FILE_SLOT_B].offset
    assert all(content[address] == 0xFF for address in range(slot, slot + flash.sector_size))


def test_files_of_a_used_device_are_forgotten(tool: Any, scratch: Path, for_m3: Path) -> None:
    """A device that was tested has files and their catalog, which is a log."""
    flash = next(board.flash for board in known_boards() if board.slug == "mps2-an385/full")
    assert flash.store is not None
    begin = FLASH + flash.store.offset
    for name in ("flash.hex", "flash.bin"):
        assert tool("image", "app.cdl", "--board", "mps2-an385/full", "-o", name).status == 0
    content = IntelHex(str(scratch / "flash.hex"))
    assert all(content[address] == 0xFF for address in range(begin, begin + 2 * flash.sector_size))
    assert set(range(begin, begin + 2 * flash.sector_size)) <= set(content.addresses())
    kept_log = flash.store.offset + flash.store.size  # what the device has gone through stays
    assert (scratch / "flash.bin").stat().st_size == kept_log < flash.size


DEEP = (
    "PROGRAM Main VAR n : DINT; END_VAR VAR_TEMP t : ARRAY[0..1199] OF BYTE; END_VAR "
    "MEMSET(ADR(t), DINT_TO_BYTE(n), SIZEOF(t)); n := n + t[n MOD 1200]; END_PROGRAM"
)


def test_a_program_that_fills_the_stack_is_refused(tool: Any, scratch: Path, build: Any) -> None:
    """How much it needs is in its symbols; a C function that is not known makes that at least so much."""
    build(DEEP, "--target", "cortex-m3")
    command = ("image", "app.cdl", "--board", "mps2-an385/standard", "-o", "x.hex")
    refused(tool(*command), "bytes of stack, the device has 944 (the deepest calls", "Main 12")
    assert not (scratch / "x.hex").exists()
    assert tool("image", "app.cdl", "--board", "mps2-an385/full", "-o", "x.hex", "--json").json["stack"]["bytes"] > 1200
    own = "{attribute 'external' := 'own'} FUNCTION Own VAR_INPUT n : DINT; END_VAR END_FUNCTION "
    build(own + "PROGRAM Main Own(1); END_PROGRAM", "--target", "cortex-m3")
    assert "needs at least" in tool(*command).out


def test_without_symbols_the_stack_is_said_not_to_be_known(
    tool: Any, scratch: Path, build: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    build(DEEP, "--target", "cortex-m3")
    (scratch / "app.sym").unlink()
    monkeypatch.setenv("XDG_CACHE_HOME", str(scratch / "empty"))
    done = tool("image", "app.cdl", "--board", "mps2-an385/standard", "-o", "x.hex")
    assert done.status == 0 and "the symbols of the program are not found" in done.out


def test_retain_variables_fit_a_half_of_their_log(tool: Any, scratch: Path, build: Any) -> None:
    """However much RAM the firmware has for them."""
    build(
        "PROGRAM Main VAR RETAIN a : ARRAY[1..6000] OF BYTE; END_VAR END_PROGRAM",
        "--target",
        "cortex-m3",
        "--no-limits",
    )
    known = next(board.flash for board in known_boards() if board.slug == "mps2-an385/standard")
    files = [(part.offset, part.size) for part in known.files]
    files[lib.FILE_RETAIN] = (files[lib.FILE_RETAIN][0], 10240)
    areas = [16384, 8192, 64, 64, 64]
    (scratch / "fw.elf").write_bytes(elf(facts("mps2-an385/standard", area=areas, file=files)))
    done = tool("image", "app.cdl", "--firmware", "fw.elf", "-o", "x.hex")
    refused(done, "It needs 6000 bytes of RETAIN variables, the device has 5100")


def test_a_bin_without_firmware_erases_only_what_is_for_programs(scratch: Path, for_m3: Path) -> None:
    """Here sectors for firmware, of any size, come before those for programs and after them."""
    whole = {board.slug: board for board in known_boards()}["mps2-an385/standard"].flash.files
    moved = [(file.offset + 0x8000, file.size) for file in whole]
    (scratch / "fw.elf").write_bytes(elf(facts("mps2-an385/standard", flash_size=0x100000, file=moved)))
    board = read_firmware(scratch / "fw.elf").board
    assert write_production(scratch / "x.bin", production_pieces(for_m3.read_bytes(), board, None), board) == 0x21008000
    assert (scratch / "x.bin").stat().st_size == 0x80000
    assert (scratch / "x.bin").read_bytes().startswith(for_m3.read_bytes())


def test_a_bin_that_would_erase_the_firmware_is_refused(tool: Any, scratch: Path, build: Any) -> None:
    build(PROGRAM, "--target", "cortex-m4f")
    done = tool("image", "app.cdl", "--board", "stm32f405/standard", "-o", "x.bin")
    refused(done, "would erase 0x0800C000 to 0x0803FFFF", "--firmware", "write x.hex")
    assert not (scratch / "x.bin").exists()
    (scratch / "fw.elf").write_bytes(elf(facts("stm32f405/standard"), address=0x0800_0000))
    done = tool("image", "app.cdl", "--firmware", "fw.elf", "-o", "x.bin")
    assert "burn it at 0x08000000" in done.out
    assert (scratch / "x.bin").stat().st_size == 0x100000


@pytest.mark.parametrize(
    ("board", "address"), [("mps2-an385/full", "21000000"), ("lm3s6965-board/standard", "00000000")]
)
def test_the_address_of_a_bin_is_said(tool: Any, for_m3: Path, board: str, address: str) -> None:
    words = ("image", "app.cdl", "--board", board, "-o")
    assert f"burn it at 0x{address}" in tool(*words, "x.bin").out
    assert "burn it at" not in tool(*words, "x.hex").out
    assert tool(*words, "x.bin", "--json").json["burn_at"] == address
    assert tool(*words, "x.hex", "--json").json["burn_at"] is None


def test_info_of_a_bin_says_that_it_counts_from_0(tool: Any, for_m3: Path) -> None:
    for name, addresses in (("x.bin", "file"), ("x.hex", "memory")):
        assert tool("image", "app.cdl", "--board", "mps2-an385/standard", "-o", name).status == 0
        assert tool("info", name, "--json").json["addresses"] == addresses
        assert ("these count from its beginning" in tool("info", name).out) == (addresses == "file")


def test_firmware_is_burned_too(tool: Any, scratch: Path, for_m3: Path) -> None:
    (scratch / "fw.elf").write_bytes(elf(facts("mps2-an385/standard")))
    done = tool("image", "app.cdl", "--firmware", "fw.elf", "-o", "flash.hex", "--json")
    assert (done.json["board"], done.json["burn_apart"]) == ("MPS2 AN385 (standard)", None)
    content = IntelHex(str(scratch / "flash.hex"))
    assert bytes(content.tobinarray(start=0, end=63)) == bytes(range(64))
    assert len(tool("info", "flash.hex", "--json").json["programs"]) == 1


def test_an_image_for_another_target_is_refused(tool: Any, build: Any) -> None:
    build()
    done = tool("image", "app.cdl", "--board", "mps2-an385/full", "-o", "flash.hex")
    refused(done, "x86_64-linux", "MPS2 AN385 (full)", "--target cortex-m3")


def test_a_program_that_does_not_fit_is_refused(tool: Any, build: Any) -> None:
    build(TASKS, "--target", "cortex-m3")
    assert tool("image", "app.cdl", "--board", "mps2-an385/standard", "-o", "flash.hex").status == 0
    done = tool("image", "app.cdl", "--board", "mps2-an385/minimal", "-o", "flash.hex")
    refused(done, "needs 3 tasks, the device has 2 (T0, T1, T2)")


def test_unknown_and_ambiguous_boards_are_refused(tool: Any, for_m3: Path) -> None:
    refused(tool("image", "app.cdl", "--board", "mps2-an385", "-o", "x.hex"), "mps2-an385/minimal", "say which")
    refused(tool("image", "app.cdl", "--board", "plrct", "-o", "x.hex"), "did you mean plcrt?")
    refused(tool("image", "app.cdl", "-o", "x.hex"), "--board")


def test_a_firmware_of_another_board_is_refused(tool: Any, scratch: Path, for_m3: Path) -> None:
    (scratch / "fw.elf").write_bytes(elf(facts("mps2-an386/standard")))
    done = tool("image", "app.cdl", "--board", "mps2-an385/standard", "--firmware", "fw.elf", "-o", "x.hex")
    refused(done, "firmware of MPS2 AN386 (standard)")
    done = tool("image", "app.cdl", "--board", "mps2-an386/full", "--firmware", "fw.elf", "-o", "x.hex")
    refused(done, "firmware of MPS2 AN386 (standard)")


@pytest.mark.parametrize("board", [board for board in known_boards() if board.config], ids=lambda board: board.slug)
def test_the_firmware_of_a_board_goes_with_its_name(scratch: Path, board: Board) -> None:
    """With and without its configuration; the flash of one may be divided in another way than that of the others."""
    (scratch / "fw.elf").write_bytes(elf(facts(board.slug)))
    for name in (board.slug, board.slug.partition("/")[0]):
        assert board_of(name, read_firmware(scratch / "fw.elf")) == board


def test_a_configuration_of_ones_own_has_the_map_of_any_other(tool: Any, scratch: Path, for_m3: Path) -> None:
    words = ("image", "app.cdl", "--board", "mps2-an385", "--firmware", "fw.elf", "-o", "x.hex")
    for slug in ("mps2-an385/standard", "mps2-an385/full"):
        (scratch / "fw.elf").write_bytes(elf(facts(slug, config=b"own")))
        assert tool(*words).status == 0
    (scratch / "fw.elf").write_bytes(elf(facts("mps2-an385/full", config=b"own", sector_size=8192)))
    refused(tool(*words), "another map", "Leave --board out")


def test_a_firmware_with_another_map_is_refused(tool: Any, scratch: Path, for_m3: Path) -> None:
    (scratch / "fw.elf").write_bytes(elf(facts("mps2-an385/standard", sector_size=8192)))
    done = tool("image", "app.cdl", "--board", "mps2-an385/standard", "--firmware", "fw.elf", "-o", "x.hex")
    refused(done, "another map", "sectors have 0x2000, not 0x1000")
    (scratch / "fw.elf").write_bytes(elf(facts("mps2-an385/full", config=b"standard")))
    done = tool("image", "app.cdl", "--board", "mps2-an385", "--firmware", "fw.elf", "-o", "x.hex")
    refused(done, "another map of the flash than MPS2 AN385 (standard)", "slot B is at 0x28000, not 0x36000")


def test_firmware_over_the_programs_is_refused(tool: Any, scratch: Path, for_m3: Path) -> None:
    for address in (FLASH - 32, FLASH + 0x10000):
        (scratch / "fw.elf").write_bytes(elf(facts("mps2-an385/standard"), address=address))
        done = tool("image", "app.cdl", "--firmware", "fw.elf", "-o", "x.hex")
        refused(done, f"firmware at 0x{address:08X}", "over the flash for programs at 0x21000000 to 0x2107FFFF")
    (scratch / "fw.elf").write_bytes(elf(facts("mps2-an385/standard"), address=FLASH - 64))
    assert tool("image", "app.cdl", "--firmware", "fw.elf", "-o", "x.hex").status == 0


def test_firmware_may_be_in_sectors_that_programs_and_logs_leave_free(tool: Any, scratch: Path, build: Any) -> None:
    build(PROGRAM, "--target", "cortex-m4f")
    for address, free in ((0x0800_0000, True), (0x0801_0000, True), (0x0800_4000, False), (0x0803_FFF0, False)):
        (scratch / "fw.elf").write_bytes(elf(facts("stm32f405/standard"), address=address))
        done = tool("image", "app.cdl", "--firmware", "fw.elf", "-o", "x.hex")
        assert (done.status == 0) == free, hex(address)
        if not free:
            refused(done, f"firmware at 0x{address:08X}", "over the flash for programs")


def test_a_memory_of_its_own_is_written_without_the_firmware(tool: Any, scratch: Path, for_m3: Path) -> None:
    """Also where the firmware has the addresses that the memory counts from 0, as those of a board of one's own."""
    of_own = facts("lm3s6965-board/standard", name=b"Acme EEPROM")
    for address in (0, 0x0800_0000):
        (scratch / "fw.elf").write_bytes(elf(of_own, address=address))
        for name in ("x.hex", "x.bin"):
            done = tool("image", "app.cdl", "--firmware", "fw.elf", "-o", name)
            assert done.status == 0
            assert "Acme EEPROM (standard)" in done.out
            assert "burn fw.elf into the processor as it is" in done.out
            assert tool("image", "app.cdl", "--board", "lm3s6965-board/standard", "-o", f"known-{name}").status == 0
            assert (scratch / name).read_bytes() == (scratch / f"known-{name}").read_bytes()
    document = tool("image", "app.cdl", "--firmware", "fw.elf", "-o", "x.hex", "--json").json
    assert document["burn_apart"] == "fw.elf"
    assert [piece["what"] for piece in document["pieces"] if piece["address"] == "00000000"] == ["program"]


def test_the_program_of_a_memory_of_its_own_is_checked(tool: Any, scratch: Path, build: Any) -> None:
    (scratch / "fw.elf").write_bytes(elf(facts("lm3s6965-board/minimal", name=b"Acme EEPROM")))
    build(TASKS, "--target", "cortex-m3")
    refused(tool("image", "app.cdl", "--firmware", "fw.elf", "-o", "x.hex"), "needs 3 tasks", "has 2")
    build()
    refused(tool("image", "app.cdl", "--firmware", "fw.elf", "-o", "x.hex"), "x86_64-linux", "Acme EEPROM (minimal)")


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (b"nothing", "fw.elf is not an ELF file"),
        (b"", "fw.elf is empty"),
        (elf(facts("mps2-an385/full"))[:-1], "fw.elf is an ELF file that is cut off"),
        (elf(facts("mps2-an385/full"))[:100], "fw.elf is an ELF file that is cut off"),
        (elf(facts("mps2-an385/full"))[:20], "fw.elf is an ELF file that is cut off"),
        (elf(b"", section="other"), "does not say what its board is"),
        (elf(facts("mps2-an385/full")[:-4]), "another version"),
        (elf(facts("mps2-an385/full", size=4)), "another version"),
    ],
)
def test_what_is_no_firmware_is_refused(tool: Any, scratch: Path, for_m3: Path, content: bytes, word: str) -> None:
    (scratch / "fw.elf").write_bytes(content)
    refused(tool("image", "app.cdl", "--firmware", "fw.elf", "-o", "x.hex"), word)


def test_output_that_cannot_be_is_refused(tool: Any, scratch: Path, for_m3: Path) -> None:
    (scratch / "fw.elf").write_bytes(elf(facts("mps2-an385/standard")))
    refused(tool("image", "app.cdl", "--firmware", "fw.elf", "-o", "x.bin"), "write x.hex")
    refused(tool("image", "app.cdl", "--firmware", "fw.elf", "-o", "x.elf"), "neither .bin nor .hex", "-o x.hex")
    for name in (".hex", ".bin", "hex"):
        refused(tool("image", "app.cdl", "--board", "plcrt", "-o", name), "neither .bin nor .hex", "-o product.hex")
    done = tool("image", "app.cdl", "--firmware", "fw.elf", "-o", "none/x.hex")
    refused(done, "none/x.hex cannot be written: the folder none does not exist; make it first")
    refused(tool("image", "none.cdl", "--board", "plcrt", "-o", "x.hex"), "none.cdl")


def test_info_of_a_file_without_program_or_seal(tool: Any, scratch: Path, build: Any) -> None:
    image = build().read_bytes()
    (scratch / "x.bin").write_bytes(b"\xff" * 4096)
    refused(tool("info", "x.bin"), "no program")
    (scratch / "x.bin").write_bytes(image[:-1].ljust(4096, b"\xff"))
    refused(tool("info", "x.bin"), "no program")
    (scratch / "x.hex").write_text("no hex")
    refused(tool("info", "x.hex"), "not an Intel HEX file")
    content, text = IntelHex(), io.StringIO()
    content.frombytes(image, 0x1000)
    content.write_hex_file(text)
    (scratch / "x.hex").write_text(text.getvalue())
    (program,) = tool("info", "x.hex", "--json").json["programs"]
    assert (program["address"], program["seal"]) == ("00001000", None)
    assert "without a valid seal" in tool("info", "x.hex").out


def test_program_of_another_board_is_not_burned(build: Callable[..., Path], tool: Any, scratch: Path) -> None:
    (scratch / "app.io.toml").write_text("[[sim]]\noptional = true\nin = { a = '%IX0.0' }\n")
    image = build(PROGRAM, "--board", "lm3s6965-board/full")
    refused = tool("image", str(image), "--board", "mps2-an385/full", "-o", "flash.bin")
    assert refused.status == 2
    assert f"The inputs and outputs of {image} are those of LM3S6965 board, this is MPS2 AN385 (full)" in refused.err
    image = build(PROGRAM, "--board", "mps2-an385/full")
    assert tool("image", str(image), "--board", "mps2-an385/full", "-o", "flash.bin").status == 0


@pytest.mark.parametrize("suffix", [".bin", ".hex"])
@pytest.mark.parametrize(
    "command", ["run FLASH", "symbols FLASH", "bench FLASH", "image FLASH --board plcrt -o other.bin"]
)
def test_a_production_image_in_place_of_a_program_is_called_so(
    tool: Any, build: Callable[..., Path], command: str, suffix: str
) -> None:
    assert tool("image", str(build()), "--board", "plcrt", "-o", f"flash{suffix}").status == 0
    done = tool(*command.replace("FLASH", f"flash{suffix}").split())
    assert done.status == 2
    assert f"flash{suffix} is a production image, for a programmer; name the .cdl that it was made of." in done.err


def test_a_program_may_be_named_bin(tool: Any, build: Callable[..., Path], scratch: Path) -> None:
    (scratch / "app.bin").write_bytes(build().read_bytes())
    assert tool("run", "app.bin").status == 0


@pytest.mark.parametrize("damage", [lambda line: line[:-2] + "00", lambda line: line[:-5]])
def test_a_damaged_hex_names_the_line(tool: Any, for_m3: Path, scratch: Path, damage: Callable[[str], str]) -> None:
    tool("image", str(for_m3), "--board", "mps2-an385/standard", "-o", "flash.hex")
    lines = (scratch / "flash.hex").read_text().splitlines()
    lines[4] = damage(lines[4])
    (scratch / "flash.hex").write_text("\n".join(lines))
    done = tool("info", "flash.hex")
    assert done.status == 2 and "is not an Intel HEX file, or damaged in line 5" in done.err


@pytest.mark.parametrize("lines", [0, 1, -1])
def test_a_hex_that_is_cut_off_at_the_end_of_a_line_is_refused(
    tool: Any, for_m3: Path, scratch: Path, lines: int
) -> None:
    """Also without a line missing but the end record: all of the program is there then."""
    tool("image", str(for_m3), "--board", "mps2-an385/standard", "-o", "flash.hex")
    whole = (scratch / "flash.hex").read_text().splitlines(keepends=True)
    (scratch / "flash.hex").write_text("".join(whole[:lines]))
    refused(tool("info", "flash.hex"), "flash.hex is cut off: its end record is missing")


@pytest.mark.parametrize("command", ["image FILE --board mps2-an385/standard -o x.hex", "info FILE", "symbols FILE"])
@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("app.st", ("it is text, such as a source", "plctool build app.st -o app.cdl")),
        ("app.sym", ("it has the symbols of one", "name app.cdl")),
        ("fw.elf", ("it is an ELF file", "--firmware")),
        ("damaged.cdl", ("its checksum does not match", "build it again")),
    ],
)
def test_what_is_no_image_is_named_with_what_to_write(
    tool: Any, for_m3: Path, scratch: Path, command: str, name: str, words: tuple[str, ...]
) -> None:
    (scratch / "fw.elf").write_bytes(elf(facts("mps2-an385/standard")))
    (scratch / "damaged.cdl").write_bytes(for_m3.read_bytes()[:-1] + b"?")
    done = tool(*command.replace("FILE", name).split())
    refused(done, f"{name} is not a valid application image", *words)


def test_info_of_a_renamed_file_says_its_name(tool: Any, for_m3: Path, scratch: Path) -> None:
    for name, other in (("a.bin", "b.hex"), ("b.hex", "a.bin")):
        tool("image", str(for_m3), "--board", "mps2-an385/standard", "-o", name)
        (scratch / name).rename(scratch / other)
        refused(tool("info", other), f"name it {Path(other).with_suffix(Path(name).suffix)}")


def test_a_program_is_built_for_a_firmware(tool: Any, scratch: Path) -> None:
    (scratch / "app.st").write_text("PROGRAM Main VAR r : REAL; END_VAR r := r * 1.5; END_PROGRAM")
    words = ("build", "app.st", "-o", "app.cdl", "--firmware", "fw.elf")
    (scratch / "fw.elf").write_bytes(elf(facts("mps2-an385/standard", name=b"Acme One", config=b"")))
    assert tool(*words, "--json").json["target"] == "cortex-m3"
    assert "has a cortex-m3, not a cortex-m7" in tool(*words, "--target", "cortex-m7").err
    refused(tool(*words, "--board", "mps2-an385/full"), "fw.elf is the firmware of Acme One, not of mps2-an385/full")
    (scratch / "app.cdl").unlink()
    less = facts("mps2-an385/standard", name=b"Acme One", config=b"", components=b"CmpIecTask CmpRetain ", stack=8)
    (scratch / "fw.elf").write_bytes(elf(less))
    refused(
        tool(*words),
        "The program does not fit Acme One.",
        "bytes of stack, the device has 8 (",
        "It needs CmpRealCalls for REAL, which the firmware does not have.",
    )
    assert not (scratch / "app.cdl").exists()
    refused(tool(*words[:-1], "app.st"), "app.st is not an ELF file")


def test_a_firmware_may_have_a_function_in_a_component_of_its_own(tool: Any, scratch: Path) -> None:
    """It is found by its signature in what is loaded."""
    (scratch / "app.st").write_text("PROGRAM Main VAR r : REAL; END_VAR r := r * 1.5; END_PROGRAM")
    words = ("build", "app.st", "-o", "app.cdl", "--firmware", "fw.elf")
    less = facts("mps2-an385/standard", components=b"CmpIecTask AcmeReal ")
    signature = C_FUNCTIONS["__mulsf3"].signature.to_bytes(4, "little")
    for code, status in ((bytes(64), 2), (bytes(30) + signature + bytes(30), 0)):
        (scratch / "fw.elf").write_bytes(elf(less).replace(bytes(range(64)), code))
        assert tool(*words).status == status


def test_requests_to_modbus_need_a_firmware_with_room_for_them(tool: Any, scratch: Path) -> None:
    (scratch / "app.st").write_text(
        "PROGRAM Main VAR r : MODBUS_READ; words : ARRAY[0..3] OF WORD; END_VAR\n"
        "r(Execute := NOT r.Done, Device := 'Drive', FunctionCode := 3, Address := 1, Count := 4, Data := words);\n"
        "END_PROGRAM"
    )
    words = ("build", "app.st", "-o", "app.cdl", "--firmware", "fw.elf")
    for calls, status in ((2, 0), (0, 2)):
        (scratch / "fw.elf").write_bytes(elf(facts("mps2-an385/modbus", modbus_calls=calls)))
        done = tool(*words)
        assert done.status == status
        assert ("1 request of a program to Modbus devices at a time, the device has 0." in done.err) == (status > 0)
