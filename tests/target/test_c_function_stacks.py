"""plctool counts C functions with at least the stack that they take in the firmware, and not with much more."""

from __future__ import annotations

from functools import cache

import pytest
from c_stack import Stacks, c_functions
from environment import IS_RISCV, TARGET, firmware

from plctool.image.c_functions import C_FUNCTIONS
from plctool.image.targets import find_target

MACHINE = find_target(TARGET).machine
CONFIGS = [config for config in ("minimal", "standard", "full", "modbus") if firmware(config).exists()]


@cache
def measured() -> dict[str, int]:
    """What each function takes at most, of all firmwares of the board."""
    found: dict[str, int] = {}
    for config in CONFIGS:
        stacks = Stacks(firmware(config), IS_RISCV)
        for name, function in c_functions(firmware(config)):
            found[name] = max(found.get(name, 0), stacks.deepest(function))
    return found


def test_the_functions_of_all_components_are_found() -> None:
    assert {"iecraise", "ieckept", "sin", "powf", "__divdi3", "__adddf3"} <= measured().keys()
    assert measured()["sin"] > 400  # an argument that is far from 0 takes long


@pytest.mark.parametrize("name", C_FUNCTIONS)
def test_a_function_takes_no_more_than_plctool_counts(name: str) -> None:
    if name in measured():
        assert measured()[name] <= C_FUNCTIONS[name].stack(MACHINE)


def test_what_takes_much_is_not_counted_much_higher() -> None:
    """On RISC-V compilers differ: one has all of the arithmetic of LREAL in each function."""
    allowed = 3 if IS_RISCV else 1.5
    large = {name: size for name, size in measured().items() if size >= 256}
    assert large and {n for n, size in large.items() if C_FUNCTIONS[n].stack(MACHINE) > allowed * size} == set()
