"""plctool counts C functions with at least the stack that they take in the firmware, and not with much more."""

from __future__ import annotations

from functools import cache

import pytest
from environment import IS_RISCV, TARGET, firmware

from plctool.compiler.codegen.firmware_stacks import FirmwareStacks
from plctool.image.c_functions import C_FUNCTIONS
from plctool.image.targets import find_target

MACHINE = find_target(TARGET).machine
CONFIGS = [config for config in ("minimal", "standard", "plus", "full", "modbus") if firmware(config).exists()]


@cache
def measured() -> dict[str, int]:
    """What each function takes at most, of all firmwares of the board."""
    files = [FirmwareStacks(firmware(config), MACHINE) for config in CONFIGS]
    sizes = [
        (name, file.of_function(function.signature, with_pointers=True))
        for name, function in C_FUNCTIONS.items()
        for file in files
    ]
    return {name: max(s or 0 for n, s in sizes if n == name) for name, size in sizes if size is not None}


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
