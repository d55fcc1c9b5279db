"""Programs in the habits of TwinCAT, CODESYS and OpenPLC: all of them compile as they are, and do what they should.

They are written for this test: each unit has a purpose of its own, and each project runs on the virtual clock.
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest
from conftest import Tool

from plctool import Simulator
from plctool.compiler import load_sources
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import Diagnostics
from plctool.compiler.syntax.parser import parse_all

ROOT = Path(__file__).parent
SYSTEMS = ("twincat", "codesys", "openplc")
PROJECTS = [path for system in SYSTEMS for path in sorted((ROOT / system).iterdir())]
EXPECTED: dict[str, Any] = tomllib.loads((ROOT / "expected.toml").read_text())
"""By project: `ms` to run, and the values of variables then."""


def units_of(project: Path) -> int:
    """How many objects a project has as its system counts them: POUs, types, lists of globals, interfaces, and their
    methods, properties and actions."""
    found = 0
    for source in load_sources([project]):
        declarations = parse_all(source, Diagnostics().at(source).error).declarations
        for decl in declarations:
            if isinstance(decl, ast.PouDecl):
                found += 1 + len({member.name.casefold() for member in decl.members})
        found += sum(isinstance(decl, ast.TypeDecl) for decl in declarations)
        found += any(isinstance(decl, ast.GlobalBlock) for decl in declarations)
    return found


def name_of(project: Path) -> str:
    """System and project."""
    return f"{project.parent.name}/{project.name}"


@pytest.mark.parametrize("system", SYSTEMS)
def test_each_system_has_three_hundred_units(system: str) -> None:
    assert sum(units_of(project) for project in PROJECTS if project.parent.name == system) >= 300


@pytest.mark.parametrize("project", PROJECTS, ids=name_of)
def test_project_is_checked_and_built(tool: Tool, project: Path, tmp_path: Path) -> None:
    status, said = tool("check", str(project))
    assert status == 0, said
    status, said = tool("build", str(project), "-o", str(tmp_path / "app.cdl"))
    assert status == 0, said


@pytest.mark.parametrize("project", PROJECTS, ids=name_of)
def test_project_does_what_it_should(project: Path) -> None:
    expected = EXPECTED[name_of(project)]
    with Simulator.from_sources(project) as plc:
        plc.run_for(ms=expected["ms"])
        found = {name: plc.read(name) for name in expected["values"]}
    for name, value in expected["values"].items():
        assert found[name] == (pytest.approx(value) if isinstance(value, float) else value), name
