"""The compiler's packages stand on each other in one direction."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import plctool.compiler

PACKAGES = Path(plctool.compiler.__file__).parent
NOT_BELOW = {"syntax": {"semantics", "codegen"}, "semantics": {"codegen"}, "codegen": {"syntax", "semantics"}}


@pytest.mark.parametrize("package", NOT_BELOW)
def test_package_imports_none_that_does_not_lie_below_it(package: str) -> None:
    modules = list((PACKAGES / package).glob("*.py"))
    assert modules
    imports = {
        (module.name, name)
        for module in modules
        for name in re.findall(r"^\s*(?:from|import) plctool\.compiler\.(\w+)", module.read_text(), re.MULTILINE)
    }
    assert {(module, name) for module, name in imports if name in NOT_BELOW[package]} == set()
