"""CmpList.h makes the room for what components register in, and refuses a list whose components lack something."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections import Counter
from pathlib import Path

import pytest

FIRMWARE = Path(__file__).resolve().parents[2] / "firmware"
BLANK = FIRMWARE / "port/baremetal/blank"
ROOMS = {"CMP_EXT_TABLE_ROOM": "CMRegisterExternal", "SRV_GROUP_ROOM": "SrvRegisterGroup"}
PARTS = {"CanopenCalls": "IoDrvCanopen", "ModbusCalls": "IoDrvModbus"}  # sources whose component has another name
DEFINERS = ("CmpMgr", "CmpSrv")
RUNTIME = "#define HAS_CmpLog 1\n#define HAS_COMMUNICATION 1\n#define HAS_CmpBlkDrvSimpleCom 1\n"


@pytest.mark.parametrize(("room", "function"), ROOMS.items())
def test_there_is_room_for_each_registration_of_the_runtime(room: str, function: str) -> None:
    text = (FIRMWARE / "include/CmpList.h").read_text()
    found = re.search(rf"^    {room} = .*?^}};", text, re.MULTILINE | re.DOTALL)
    assert found
    counted = Counter(name for name in re.findall(r"CMP_ONE\((\w+)\)", found[0]))
    registered: Counter[str] = Counter()
    for source in (FIRMWARE / "src").glob("*/*.c"):
        if source.stem not in DEFINERS:
            registered[PARTS.get(source.stem, source.stem)] += source.read_text().count(f"{function}(")
    assert counted == +registered


def compile_list(folder: Path, lines: str) -> str:
    """What the compiler says of a cmp_list.c."""
    source = folder / "cmp_list.c"
    source.write_text(f'{lines}#include "CmpList.h"\n')
    compiler = shutil.which("cc")
    assert compiler, "this test needs a C compiler: install gcc or clang"
    flags = ["-std=c99", "-Wall", "-Wextra", "-fsyntax-only", f"-I{BLANK}", f"-I{FIRMWARE / 'include'}"]
    done = subprocess.run([compiler, *flags, str(source)], capture_output=True, text=True, timeout=120, check=False)
    return done.stderr


def test_a_list_whose_components_have_what_they_need_is_compiled(tmp_path: Path) -> None:
    assert compile_list(tmp_path, RUNTIME) == ""


@pytest.mark.parametrize(
    ("component", "sizes", "message"),
    [
        ("HAS_CmpIoMgrEmbedded", "#undef IO_MAX_CONNECTORS\n#define IO_MAX_CONNECTORS 0\n", "set IO_MAX_CONNECTORS"),
        ("HAS_CmpIoMgrSrv", "", "need HAS_CmpIoMgrEmbedded in cmp_list.c"),
        ("HAS_IoDrvGpio", "", "need HAS_CmpIoMgrEmbedded in cmp_list.c"),
        ("HAS_CmpEventMgrEmbedded", "#define EVENT_MAX_CALLBACKS 0\n", "set EVENT_MAX_CALLBACKS"),
        ("HAS_CmpUserMgr", "", "set COMM_PASSWORD to 1"),
        ("HAS_CmpFileTransfer", "", "set FILE_STORE_FILES and FILE_STORE_SIZE"),
        ("HAS_CmpBlkDrvCan", "", "set COMM_ENDPOINTS to 1"),
    ],
)
def test_a_component_that_lacks_something_is_refused_with_what_to_write(
    tmp_path: Path, component: str, sizes: str, message: str
) -> None:
    said = compile_list(tmp_path, f'#include "rts_config_port.h"\n{sizes}{RUNTIME}#define {component} 1\n')
    assert message in said
