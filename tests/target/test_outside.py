"""Firmware in a folder of a vendor, built by the Makefile of porting.md, step 15: each configuration, and what
docs/c-functions.md, docs/io-driver.md and docs/porting.md add to one runs and is read by plctool.

Blocks of these pages that name a file say what belongs into it: `merge` puts it there, as a vendor would.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parents[1]))

from environment import MACHINE, ROOT
from programs import compile_text, program
from qemu import Board
from vendor_component import blocks, merge, tank

from plctool.cli.main import main as plctool
from plctool.compiler import compile_sources
from plctool.core import lib
from plctool.debug.symbols import symbol_path
from plctool.device import Plc, scan
from plctool.errors import DeviceError
from plctool.link.connection import Connection
from plctool.link.services import AppState
from plctool.testing.waiting import eventually

PORT = ROOT / "firmware/port/baremetal"
TARGET = "cortex-m3"
pytestmark = pytest.mark.skipif(MACHINE != "mps2-an385", reason="the pages show this board")

LAST_WORDS = b"\r\nStart of SysAcme failed: 0x00000028\r\n"
DEVICE = """
name = "MPS2 AN385"
[[module]]
name = "Analog"
driver = "IoDrvAcmeAdc"
in = { AI0 = { type = "INT", parameter = 1 } }
"""
DESCRIPTION = """
device = "device.toml"
[local.Analog]
name = "Analog"
in = { AI0 = "Main.level" }
"""


def copy_product(folder: Path, config: str) -> Path:
    """Copies the board of QEMU and a configuration to a folder; the repository is a link in it, as a submodule."""
    (folder / "subprojects").mkdir(parents=True)
    (folder / "subprojects/plctool").symlink_to(ROOT)
    for pattern in ("outside/*", "boards/mps2/*", "boards/mps2_an385/*.h", f"configs/{config}/*"):
        for file in PORT.glob(pattern):
            shutil.copy(file, folder)
    (folder / "mps2.ld").rename(folder / "board.ld")
    return folder


def make(folder: Path) -> Path:
    """Builds the firmware with `make`."""
    done = subprocess.run(["make"], cwd=folder, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stderr
    assert "warning" not in done.stderr
    return folder / "firmware.elf"


@pytest.fixture(scope="module")
def full_product(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the full configuration, which most tests add to: built, so that only their files are compiled."""
    folder = copy_product(tmp_path_factory.mktemp("full") / "product", "full")
    make(folder)
    return folder


@pytest.fixture
def product(tmp_path: Path, request: pytest.FixtureRequest) -> Callable[[str], Path]:
    """Makes a folder with the board of QEMU and a configuration."""

    def copy(config: str) -> Path:
        folder = tmp_path / "product"
        if config == "full":
            return Path(shutil.copytree(request.getfixturevalue("full_product"), folder, symlinks=True))
        return copy_product(folder, config)

    return copy


@pytest.mark.parametrize("config", ["modbus", "can", "full"])
def test_configuration_is_built_as_it_is(product: Callable[[str], Path], config: str) -> None:
    folder = product(config)
    with Board(MACHINE, make(folder), folder) as board, Plc(Connection(board.line())) as plc:
        assert plc.identity().device_name == "MPS2 AN385"


@pytest.mark.parametrize("config", ["standard", "full"])
def test_a_c_function_is_called_by_a_program(product: Callable[[str], Path], config: str) -> None:
    folder = product(config)
    (source,) = blocks("c-functions.md", "acme.st")
    (folder / "acme.st").write_text(source)
    assert plctool(["export-itf", str(folder / "acme.st"), "-o", str(folder)]) == 0
    body = folder / "acme.c"
    body.write_text(body.read_text().replace("result = 0;", "result = 1.5f * (RTS_REAL32)channel;"))
    (lines,) = blocks("c-functions.md", "cmp_list.c")
    merge(folder / "cmp_list.c", lines)
    built = compile_text(source + program("VAR level : REAL; END_VAR", "level := AcmeAdc(5);"), TARGET, folder)
    with Board(MACHINE, make(folder), folder) as board, Plc(Connection(board.line())) as plc:
        plc.flash(built.path)
        eventually(lambda: plc.read("Main.level") == 7.5)


def test_a_function_block_in_c_keeps_to_its_instance_and_the_structure_of_the_firmware(
    product: Callable[[str], Path],
) -> None:
    folder = product("full")
    (source,) = blocks("c-functions.md", "acmepid.st")
    (folder / "acmepid.st").write_text(source)
    assert plctool(["export-itf", str(folder / "acmepid.st"), "-o", str(folder)]) == 0
    body, (implementation,) = folder / "acmepid.c", blocks("c-functions.md", "acmepid.c")
    registration = body.read_text().partition("static const CMP_EXT_FUNCTION")
    body.write_text(implementation + "\n" + registration[1] + registration[2])
    merge(folder / "cmp_list.c", '#include "acmepidItf.h"\n#define PORT_COMPONENTS(X) X(acmepid)')
    text = program("VAR one : AcmePid(gain := 2); two : AcmePid(gain := 3); END_VAR", "one(setpoint := 5); two();")
    good = compile_text(source + text, TARGET, folder)
    other = compile_text(source.replace("VAR\n    gain", "VAR\n    first : BOOL; gain") + text, TARGET, folder)
    with Board(MACHINE, make(folder), folder) as board, Plc(Connection(board.line())) as plc:
        with pytest.raises(DeviceError, match=r"acme_pid__main \(other parameters\)"):
            plc.flash(other.path)
        plc.flash(good.path)
        eventually(lambda: plc.read("Main.one.y") == 10.0)
        assert plc.read("Main.two.gain") == 3.0


def test_a_component_of_codesys_starts_and_is_called_by_a_program(product: Callable[[str], Path]) -> None:
    folder = product("full")
    files = ("CmpFooItf.m4", "CmpFooDep.m4", "CmpFoo.c")
    for name in files:
        (text,) = blocks("v3-components.md", name)
        (folder / name).write_text(text)
    assert plctool(["export-itf", "--from", *(str(folder / name) for name in files[:2]), "-o", str(folder)]) == 0
    (lines,) = blocks("v3-components.md", "cmp_list.c")
    merge(folder / "cmp_list.c", lines)
    call = "r := FooScale(total, 3, 2.5, 'Anna', valid => valid);"
    text = program("VAR total : DINT; valid : BOOL; r : REAL; END_VAR", call)
    built = compile_text((folder / "CmpFoo.st").read_text() + text, TARGET, folder)
    with Board(MACHINE, make(folder), folder) as board, Plc(Connection(board.line())) as plc:
        assert ("CmpFoo", "Foo is there, 4") in [(entry.component, entry.text) for entry in plc.log()]
        plc.flash(built.path)
        eventually(lambda: plc.read("Main.r") == 7.5)
        assert plc.read("Main.valid") is True


def test_a_driver_from_the_blank_one_has_a_device(product: Callable[[str], Path]) -> None:
    folder = product("io")
    for name in ("IoDrvBlank.c", "IoDrvBlank.h"):
        shutil.copy(PORT / "blank" / name, folder)
    for command in re.findall(r"^\$ (sed .*)$", (ROOT / "docs/io-driver.md").read_text(), re.MULTILINE):
        subprocess.run(command, shell=True, cwd=folder, check=True, timeout=60)
    for name in ("IoDrvBlank.c", "IoDrvBlank.h"):
        (folder / name).unlink()
    driver = folder / "IoDrvAcmeAdc.c"
    driver.write_text(
        driver.read_text().replace(
            "connector);\n    return ERR_OK;", "connector);\n    blank.inputs[0] = 7;\n    return ERR_OK;", 1
        )
    )
    for name in ("cmp_list.c", "rts_config_size.h"):
        (lines,) = blocks("io-driver.md", name)
        merge(folder / name, lines)
    (folder / "main.st").write_text(program("VAR level : INT; END_VAR", ";"))
    (folder / "main.io.toml").write_text(DESCRIPTION)
    (folder / "device.toml").write_text(DEVICE)
    built = compile_sources([folder / "main.st"], target=TARGET)
    image = folder / "main.cdl"
    image.write_bytes(built.image)
    built.symbols.save(symbol_path(image))
    with Board(MACHINE, make(folder), folder) as board, Plc(Connection(board.line())) as plc:
        plc.flash(image)
        eventually(lambda: plc.read("Main.level") == 7)
        assert plc.read("Analog.ok") is True
        assert plc.io_devices()[0].state == "ok"


def test_a_component_calls_a_function_of_the_program(product: Callable[[str], Path]) -> None:
    folder = product("full")
    source = tank(folder)
    built = compile_text(source + program("VAR n : DINT; END_VAR", "n := n + 1;"), TARGET, folder)
    failing = source.replace("level := INT_TO_REAL(raw)", "level := INT_TO_REAL(raw / (raw - 525))")
    other = compile_text(failing + program("VAR n : DINT; END_VAR", "n := n + 1;"), TARGET, folder)
    with Board(MACHINE, make(folder), folder) as board, Plc(Connection(board.line())) as plc:
        plc.flash(built.path)
        eventually(lambda: "The level is above the limit" in [entry.text for entry in plc.log()])
        assert plc.read("level") == 52.5
        plc.flash(other.path)
        eventually(lambda: plc.status().exception is not None)
        exception = plc.status().exception
        assert exception is not None and (exception.name, str(exception.pou).upper()) == ("DIVIDEBYZERO", "MEASURED")


LABEL = "[information]\nname = 'P'\n[information.properties]\nserial = 'A-17'\n"


def test_a_component_reads_a_property_of_the_project(product: Callable[[str], Path]) -> None:
    folder = product("full")
    (source,) = blocks("projects.md", "AcmeLabel.c")
    (folder / "AcmeLabel.c").write_text(source)
    hook = "enum { CMPID_AcmeLabel = 0x8005 };\nRTS_RESULT AcmeLabel_Hook(CMP_HOOK hook);"
    (folder / "AcmeLabel.h").write_text(f'#include "CmpItf.h"\n{hook}\n')
    merge(folder / "cmp_list.c", '#include "AcmeLabel.h"\n#define PORT_COMPONENTS(X) X(AcmeLabel)')
    project = folder / "project"
    project.mkdir()
    (project / "main.st").write_text(program("VAR n : DINT; END_VAR", "n := n + 1;"))
    (project / "plc.toml").write_text(f"sources = 'main.st'\ntarget = '{TARGET}'\n{LABEL}")
    assert plctool(["build", str(project), "-o", str(folder / "main.cdl")]) == 0
    with Board(MACHINE, make(folder), folder) as board, Plc(Connection(board.line())) as plc:
        plc.flash(folder / "main.cdl")
        eventually(lambda: "Serial number A-17" in [entry.text for entry in plc.log()])


NUMBERS = 'vendor = "Acme"\ntarget = "cortex-m3"\nvendor_id = 0x1234\ndevice_id = 5\n'


def test_a_device_with_numbers_of_its_vendor_takes_programs_for_it_alone(product: Callable[[str], Path]) -> None:
    folder = product("full")
    device = 'name = "MPS2 AN385"\n' + NUMBERS
    (folder / "device.toml").write_text(device)
    assert plctool(["export-itf", "--device", str(folder / "device.toml"), "-o", str(folder)]) == 0
    port = folder / "rts_config_port.h"
    port.write_text(re.sub("#define BOARD_DEVICE_NAME.*", '#include "MPS2_AN385Io.h"', port.read_text()))
    elf = make(folder)
    text = program("VAR n : DINT; END_VAR", "n := n + 1;")
    (folder / "main.st").write_text(text)
    (folder / "other.toml").write_text(device.replace("= 5", "= 6"))
    for name in ("device", "other"):
        (folder / f"{name}.io.toml").write_text(f'device = "{name}.toml"\n')
    (folder / "plain").mkdir()
    (folder / "plain/main.st").write_text(text)

    def build(source: str, *options: str) -> Path:
        image = folder / f"image{len(list(folder.glob('*.cdl')))}.cdl"
        assert plctool(["build", str(folder / source), *options, "-o", str(image)]) == 0
        return image

    own = build("main.st", "--io", str(folder / "device.io.toml"))
    by_firmware = build("plain/main.st", "--firmware", str(elf))
    wrong = {
        "1234:0006": build("main.st", "--io", str(folder / "other.io.toml")),
        "cortex-m3": build("plain/main.st", "--target", TARGET),
    }
    with Board(MACHINE, elf, folder) as board:
        (node,) = scan(f"serial:{board.port}", gateway=False)
        assert (node.vendor_name, node.target_id) == ("Acme", 0x12340005)
        with Plc(Connection(board.line())) as plc:
            for name, image in wrong.items():
                with pytest.raises(
                    DeviceError, match=f"for {name}, this device is 1234:0005: build it with the device"
                ):
                    plc.flash(image)
            for image in (own, by_firmware):
                plc.flash(image, force=True)
                eventually(lambda: plc.read("Main.n") > 0)


SECOND_TABLE = """
static const CMP_EXT_FUNCTION more[1];
RTS_RESULT acme_Hook(CMP_HOOK hook)
{
    RTS_RESULT result = ERR_OK;

    for (int i = 0; hook == CH_INIT3 && i < 4 && result == ERR_OK; i++)
        result = CMRegisterExternal(more, 1);
    return result;
}
"""


def test_a_component_that_finds_no_room_is_named_by_scan_and_log(product: Callable[[str], Path]) -> None:
    folder = product("io")
    (folder / "acme.c").write_text('#include "acme.h"\n' + SECOND_TABLE)
    (folder / "acme.h").write_text(
        '#include "CmpItf.h"\nenum { CMPID_acme = 0x8002 };\nRTS_RESULT acme_Hook(CMP_HOOK);\n'
    )
    merge(folder / "cmp_list.c", '#include "acme.h"\n#define PORT_COMPONENTS(X) X(acme)')
    built = compile_text(program("VAR n : DINT; END_VAR", "n := n + 1;"), TARGET, folder)
    with Board(MACHINE, make(folder), folder) as board:
        (node,) = scan(f"serial:{board.port}", gateway=False)
        assert node.left_out
        with Plc(Connection(board.line())) as plc:
            assert plc.status().state is AppState.NONE
            assert "Start of acme failed: raise CM_OWN_EXT_TABLES" in [entry.text for entry in plc.log()]
            with pytest.raises(DeviceError, match="a component of its firmware failed to start"):
                plc.flash(built.path)


def test_a_start_up_that_cannot_go_on_has_last_words_on_the_serial_line(product: Callable[[str], Path]) -> None:
    folder = product("full")
    (folder / "acme.c").write_text(
        '#include "acme.h"\nRTS_RESULT SysAcme_Hook(CMP_HOOK hook)\n'
        "{\n    return hook == CH_INIT2 ? ERR_DEVICE : ERR_OK;\n}\n"
    )
    (folder / "acme.h").write_text(
        '#include "CmpItf.h"\nenum { CMPID_SysAcme = 0x8003 };\nRTS_RESULT SysAcme_Hook(CMP_HOOK);\n'
    )
    merge(folder / "cmp_list.c", '#include "acme.h"\n#define PORT_SYSTEM(X) X(SysAcme)')
    with Board(MACHINE, make(folder), folder) as board:
        words = board.line().receive_raw(len(LAST_WORDS) * 3)
        assert words.count(LAST_WORDS) >= 2  # it tries again


def test_a_component_takes_part_in_the_cycle_of_the_minimal_configuration(product: Callable[[str], Path]) -> None:
    folder = product("minimal")
    (source,) = blocks("porting.md", "AcmeInputs.c")
    (folder / "AcmeInputs.c").write_text(source)
    for name in ("cmp_list.c", "rts_config_size.h"):
        (lines,) = blocks("porting.md", name)
        merge(folder / name, lines)
    text = program("VAR seen : DINT; lines AT %IB0 : BYTE; END_VAR", "seen := 1000 + BYTE_TO_DINT(lines);")
    built = compile_text(text, TARGET, folder)
    seen = built.symbols.resolve("Main.seen")
    assert seen.area == lib.APP_AREA_DATA
    with Board(MACHINE, make(folder), folder) as board, Plc(Connection(board.line())) as plc:
        plc.flash(built.path)
        place = board.address_of("areas") + seen.offset
        eventually(lambda: int.from_bytes(board.read_memory(place, 4), "little") == 1255)  # no button is pressed
