"""All ports have their components in one order, in which a component comes after those it uses."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from test_firmware_layers import DEFINED, FIRMWARE, INSTEAD_OF, MODULES, stands_on

ROOT = FIRMWARE.parent
ORDER = re.findall(r"^X\((\w+)\)", (FIRMWARE / "include/CmpOrder.h").read_text(), re.MULTILINE)
LISTS = sorted(path for folder in (FIRMWARE, ROOT / "tests", ROOT / "examples") for path in folder.rglob("cmp_list.c"))


def _reached(module: str) -> set[str]:
    """All modules that a module stands on, also by way of others."""
    found: set[str] = set()
    new = stands_on(module)
    while new:
        found |= new
        new = {other for name in new for other in stands_on(name)} - found
    return {INSTEAD_OF.get(name, name) for name in found}


def _components(path: Path) -> list[str]:
    """The components of a list, as the compiler sees it."""
    compiler = shutil.which("cc")
    assert compiler, "this test needs a C compiler: install gcc or clang"
    has_sizes = (path.parent / "rts_config_port.h").exists()
    own = path.parent if has_sizes else FIRMWARE / "port/sim"
    shared = "HAS_CmpCan" in path.read_text() and not has_sizes
    sizes = ["-DCAN_SHARED=1", "-DCANOPEN_DEVICE_DATA=256", "-DCANOPEN_MAX_DEVICES=8"] if shared else []
    include = [FIRMWARE / "include", FIRMWARE / "port/baremetal/common", own]
    done = subprocess.run(
        [compiler, "-E", "-P", "-std=c99", "-DCOMM_ENDPOINTS=1", *sizes, *(f"-I{folder}" for folder in include), path],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    return re.findall(r'"(\w+)"', done.stdout[done.stdout.index("cmp_names[] =") :])


def test_every_component_that_is_here_is_in_the_order() -> None:
    hooks = {name.removesuffix("_Hook") for functions in DEFINED.values() for name in functions if "_Hook" in name}
    assert {name for name in hooks if not name.startswith("Sys") or name in MODULES} <= set(ORDER)


@pytest.mark.parametrize("component", [name for name in ORDER if name in MODULES])
def test_a_component_comes_after_those_it_uses(component: str) -> None:
    later = set(ORDER[ORDER.index(component) + 1 :])
    assert _reached(component) & later == set()


@pytest.mark.parametrize("path", LISTS, ids=lambda path: str(path.parent.relative_to(ROOT)))
def test_a_port_has_the_order_of_all(path: Path) -> None:
    components = _components(path)
    common = [name for name in components if name in ORDER]
    assert "CmpAppEmbedded" in common
    assert common == sorted(common, key=ORDER.index)
    assert len(set(components)) == len(components)


@pytest.mark.parametrize("path", LISTS, ids=lambda path: str(path.parent.relative_to(ROOT)))
def test_what_a_port_chooses_exists(path: Path) -> None:
    chosen = set(re.findall(r"^#define (\w+)", path.read_text(), re.MULTILINE))
    known = set(re.findall(r"\b(HAS_\w+|PORT_\w+)", (FIRMWARE / "include/CmpOrder.h").read_text()))
    assert chosen
    assert chosen <= known


def test_there_is_a_list_for_every_configuration() -> None:
    assert len(LISTS) == 13
