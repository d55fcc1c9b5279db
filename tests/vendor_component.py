"""A component of a vendor as the pages of docs/ show it, in a firmware: for plcrt and boards.

Blocks of the pages that name a file say what belongs into it: `merge` puts it there, as a vendor would.
"""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
from pathlib import Path

from plctool.cli.main import main as plctool

ROOT = Path(__file__).resolve().parents[1]


def blocks(page: str, file: str) -> list[str]:
    """What a page of docs/ says belongs into a file."""
    text = (ROOT / "docs" / page).read_text()
    found: list[str] = re.findall(rf"^```\w+ {re.escape(file)}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    assert found, f"{page} has no block for {file}"
    return found


def merge(file: Path, lines: str) -> None:
    """Puts lines of a page into a header or cmp_list.c: a macro that is there gets its new value, PORT_COMPONENTS the
    component that is new; other lines come first."""
    text = file.read_text()
    first = text.index("*/\n") + 3
    if "#ifndef RTS_CONFIG" in text:
        first = text.index("\n", text.index("#define RTS_CONFIG")) + 1
    for line in lines.splitlines():
        macro = re.match(r"#define (\w+)", line)
        there = macro and re.search(rf"^#define {macro[1]}\b.*\n", text, re.MULTILINE)
        if there and line.startswith("#define PORT_COMPONENTS"):
            text = text.replace(there[0], there[0].rstrip() + " " + line.split()[-1] + "\n")
        elif there:
            text = text.replace(there[0], line + "\n")
        elif macro and file.name == "cmp_list.c":
            text = text.replace('#include "CmpList.h"', f'{line}\n#include "CmpList.h"')
        else:
            text = text[:first] + line + "\n" + text[first:]
            first += len(line) + 1
    file.write_text(text)


def tank(folder: Path) -> str:
    """Puts AcmeTank of c-functions.md into a folder with a cmp_list.c. Returns the Structured Text that it calls."""
    (source,), (component,) = blocks("c-functions.md", "tank.st"), blocks("c-functions.md", "AcmeTank.c")
    (folder / "tank.st").write_text(source)
    assert plctool(["export-itf", str(folder / "tank.st"), "-o", str(folder)]) == 0
    (folder / "AcmeTank.c").write_text(component)
    hook = "enum { CMPID_AcmeTank = 0x8006 };\nRTS_RESULT AcmeTank_Hook(CMP_HOOK hook);"
    (folder / "AcmeTank.h").write_text(f'#include "CmpItf.h"\n{hook}\n')
    merge(folder / "cmp_list.c", '#include "AcmeTank.h"\n#define PORT_COMPONENTS(X) X(AcmeTank)')
    return source


_SWITCH = """
#include "AcmeDoor.h"

#include <stdlib.h>
#include <unistd.h>

bool DoorIsOpen(void)
{
    const char *path = getenv("ACME_DOOR");

    return path != NULL && access(path, F_OK) == 0;
}
"""


def door(folder: Path) -> None:
    """Puts AcmeDoor of events.md into a folder with a cmp_list.c. Its door is open while the file is there that the
    environment's ACME_DOOR names."""
    (component,) = blocks("events.md", "AcmeDoor.c")
    (folder / "AcmeDoor.c").write_text(component)
    (folder / "AcmeSwitch.c").write_text(_SWITCH)
    hook = "enum { CMPID_AcmeDoor = 0x8008 };\nRTS_RESULT AcmeDoor_Hook(CMP_HOOK hook);\nbool DoorIsOpen(void);"
    (folder / "AcmeDoor.h").write_text(f'#include "CmpItf.h"\n{hook}\n')
    merge(folder / "cmp_list.c", '#include "AcmeDoor.h"\n#define PORT_COMPONENTS(X) X(AcmeDoor)')


def cmp_list_of(build: Path, program: str, library: str = "") -> Path:
    """The list of the components of a program in a build folder. `library`: the one that has the list, if several
    have one."""
    return build / _compilation(_commands(build, program), library)[-1]


def relink(build: Path, program: str, folder: Path, library: str = "") -> Path:
    """Links a program of a build folder again, with the cmp_list.c and the other sources of `folder`. A `library` keeps
    its own list; the new one comes first and counts."""
    commands = _commands(build, program)
    objects = [_compile(build, _compilation(commands, library), source) for source in sorted(folder.glob("*.c"))]
    link = [word for word in shlex.split(commands[-1]) if not word.endswith("cmp_list.c.o")]
    output = folder / Path(program).name
    link[link.index("-o") + 1] = str(output)
    first = next(i for i, word in enumerate(link) if word.endswith(".o"))
    twice = ["-Wl,--allow-multiple-definition"] if library else []
    subprocess.run([*link[:first], *objects, *link[first:], *twice], cwd=build, check=True, timeout=300)
    return output


def _commands(build: Path, program: str) -> list[str]:
    """The commands that make a program, the one that links it last."""
    ninja = [shutil.which("ninja") or "ninja", "-C", str(build), "-t", "commands", program]
    return subprocess.run(ninja, capture_output=True, text=True, check=True, timeout=60).stdout.splitlines()


def _compilation(commands: list[str], library: str) -> list[str]:
    """The one that compiles the list of components."""
    lists = [command for command in commands if command.endswith("cmp_list.c") and library in command]
    (command,) = map(shlex.split, lists)
    return command


def _compile(build: Path, compiled: list[str], source: Path) -> str:
    words = list(compiled)
    words[words.index("-o") + 1] = str(source.with_suffix(".o"))
    words[words.index("-MF") + 1] = str(source.with_suffix(".d"))
    words[-1] = str(source)
    subprocess.run([*words, f"-I{source.parent}"], cwd=build, check=True, timeout=120)
    return str(source.with_suffix(".o"))
