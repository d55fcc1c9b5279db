"""docs/library.md: where each function works, compared with the library and the lists of components."""

from __future__ import annotations

import re
from functools import cache

import pytest
from prose import ROOT

from plctool.compiler.syntax.library import standard_library, without_library
from plctool.image.c_functions import C_FUNCTIONS

LISTS = {
    "`plcrt`, simulator": ("port/linux", "port/sim"),
    "`full`": ("port/baremetal/configs/full",),
    "`plus`": ("port/baremetal/configs/plus",),
    "`standard`, `minimal`": ("port/baremetal/configs/standard", "port/baremetal/configs/minimal"),
}
ANSWERS = {"NO_PORT": "IEC_COMS", "NO_NETWORK": "IEC_SOCKETS"}
"""What a device answers that has the component, and none of its things."""


def table() -> list[dict[str, str]]:
    text = (ROOT / "docs/library.md").read_text().partition("## Where each function works")[2]
    lines = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line[:1] == "|"]
    return [dict(zip(lines[0], line, strict=True)) for line in lines[2:]]


@cache
def needs(name: str) -> frozenset[str]:
    """The external functions that a unit of the library calls, itself or by others."""
    found, seen, open_names = set(), set(), [name]
    while open_names:
        entry = standard_library().entry(open_names.pop().casefold())
        if entry is None or (entry.source.path, entry.start) in seen:
            continue
        seen.add((entry.source.path, entry.start))
        text = re.sub(r"\(\*.*?\*\)", "", entry.source.text[entry.start : entry.end], flags=re.DOTALL)
        found.update(re.findall(r"'external' := '(\w+)'", text))
        open_names += re.findall(r"[A-Za-z_]\w+", text)
    return frozenset(found)


def config(folder: str) -> str:
    """The settings of a port or configuration."""
    names = ("cmp_list.c", "rts_config_port.h", "rts_config_size.h")
    return "\n".join(p.read_text() for n in names if (p := ROOT / "firmware" / folder / n).is_file())


def has(folder: str, function: str) -> bool:
    text = config(folder)
    component = next(f.component for f in C_FUNCTIONS.values() if f.name == function)
    return f"#define HAS_{component} " in text and (function != "call_wait" or "#define APP_CALL_WAIT_MS" in text)


@pytest.mark.parametrize("row", table(), ids=lambda row: next(iter(row.values())))
def test_each_function_works_where_the_table_says(row: dict[str, str]) -> None:
    names = [without_library(name) for name in re.findall(r"`([^`{]+)`", row["functions and blocks"])]
    for column, folders in LISTS.items():
        for folder in folders:
            missing = {name: [f for f in needs(name) if not has(folder, f)] for name in names}
            answer = row[column]
            assert {bool(m) for m in missing.values()} == {answer == "refused"}, f"{folder}: {missing}"
            if answer == "refused":
                assert all(row["need"].strip("`") in m for m in missing.values()), f"{folder}: {missing}"
            if row["need"].strip("`") in ("com_call", "socket_call"):
                thing = "IEC_COMS" if "com" in row["need"] else "IEC_SOCKETS"
                assert (f"#define {thing} " in config(folder)) == (answer == "yes")
                assert ANSWERS.get(answer, thing) == thing


def test_every_external_function_of_files_ports_sockets_and_clocks_is_in_the_table() -> None:
    listed = {row["need"].strip("`") for row in table()}
    assert {"file_call", "com_call", "socket_call", "clock_get", "clock_now", "call_wait", "log_add"} <= listed
