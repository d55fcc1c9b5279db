"""The extension for VS Code: what it declares fits the compiler and its own code; its tests in TypeScript pass."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from plctool.compiler.base.source import Source
from plctool.compiler.syntax.lexer import KEYWORDS
from plctool.compiler.syntax.parser import parse_all
from plctool.iec.types import ELEMENTARY

ROOT = Path(__file__).resolve().parents[2]
EXTENSION = ROOT / "editors" / "vscode"
MANIFEST = json.loads((EXTENSION / "package.json").read_text())
CONTRIBUTED = MANIFEST["contributes"]
CODE = "".join(path.read_text() for path in sorted((EXTENSION / "src").glob("*.ts")))
ESBUILD = EXTENSION / "node_modules" / ".bin" / "esbuild"


def _patterns(rule: Any) -> Iterator[str]:
    if isinstance(rule, dict):
        yield from (rule[name] for name in ("match", "begin") if isinstance(rule.get(name), str))
        for part in rule.values():
            yield from _patterns(part)
    elif isinstance(rule, list):
        for part in rule:
            yield from _patterns(part)


def test_every_word_of_the_compiler_is_highlighted() -> None:
    grammar = json.loads((EXTENSION / "syntaxes" / "iecst.tmLanguage.json").read_text())
    rules = [grammar["repository"][name] for name in ("keywords", "literals")]
    patterns = [re.compile(pattern) for pattern in _patterns(rules) if "\\p" not in pattern]
    words = {word for word, kind in KEYWORDS.items() if kind not in ("MISSPELT", "REFUSED")} | set(ELEMENTARY)
    assert {word for word in words if not any(pattern.fullmatch(word) for pattern in patterns)} == set()


def test_commands_settings_and_views_are_those_of_the_code() -> None:
    declared = {entry["command"].removeprefix("plctool.") for entry in CONTRIBUTED["commands"]}
    actions = set(re.findall(r"case '(\w+)':", (EXTENSION / "src" / "actions.ts").read_text()))
    registered = actions | set(re.findall(r"command\('(\w+)'", (EXTENSION / "src" / "extension.ts").read_text()))
    live = (EXTENSION / "src" / "live.ts").read_text()
    registered |= {f"values.{name}" for name in re.findall(r"command\('(\w+)'", live)}
    assert registered == declared
    settings = {name.removeprefix("plctool.") for name in CONTRIBUTED["configuration"]["properties"]}
    assert set(re.findall(r"settings\(\)\.get(?:<\w+>)?\('(\w+)'", CODE)) == settings
    used = {command for menu in CONTRIBUTED["menus"].values() for command in (entry["command"] for entry in menu)}
    assert {command.removeprefix("plctool.") for command in used} <= declared


def test_the_version_is_that_of_plctool() -> None:
    version = re.search(r"version: '([\d.]+)'", (ROOT / "meson.build").read_text())
    assert version is not None
    assert MANIFEST["version"] == version[1]


SNIPPETS = json.loads((EXTENSION / "snippets" / "iecst.json").read_text())
UNITS = ("PROGRAM", "FUNCTION", "CONFIGURATION", "TYPE", "TEST", "METHOD", "PROPERTY", "VAR")


@pytest.mark.parametrize("name", SNIPPETS)
def test_a_snippet_is_read_by_the_compiler(name: str) -> None:
    text = "\n".join(SNIPPETS[name]["body"])
    text = re.sub(r"\$\{\d+:([^}]*)\}", r"\1", text)
    text = re.sub(r"\$\{\d+\|(\w+)[^}]*\}", r"\1", text)
    text = re.sub(r"(?<=\.)\$0|(?<=:= )\$\d", "x", text)
    text = re.sub(r"\$\d+|\$\{0\}", "", text)
    if not text.startswith(UNITS):
        text = f"PROGRAM p\n{text}\nEND_PROGRAM"
    elif text.startswith(("VAR", "METHOD", "PROPERTY")):
        text = f"FUNCTION_BLOCK b\n{text}\nEND_FUNCTION_BLOCK"
    said: list[tuple[int, str, str]] = []
    parse_all(Source("snippet.st", text), lambda *report: said.append(report))
    assert said == []


def test_the_problem_matcher_reads_what_check_prints(tmp_path: Path) -> None:
    (tmp_path / "a.st").write_text("PROGRAM Main\nVAR x : INT; END_VAR\nx := y;\nEND_PROGRAM\n")
    ran = subprocess.run(
        [sys.executable, "-m", "plctool", "check", "a.st"],
        cwd=tmp_path,
        env=_environment(),
        capture_output=True,
        text=True,
    )
    (pattern,) = CONTRIBUTED["problemPatterns"]
    found = [match for line in (ran.stdout + ran.stderr).splitlines() if (match := re.match(pattern["regexp"], line))]
    assert [(m[pattern["file"]], m[pattern["line"]], m[pattern["column"]], m[pattern["severity"]]) for m in found] == [
        ("a.st", "3", "6", "error")
    ]


def _environment() -> dict[str, str]:
    paths = [str(Path(entry).resolve()) for entry in os.environ.get("PYTHONPATH", "").split(os.pathsep) if entry]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}


@pytest.mark.parametrize(
    "line", ["VAR", "if x then", "ELSE", "CASE x OF", "    1, 2:", "S : STRUCT", "VAR_INPUT RETAIN"]
)
def test_what_follows_an_opening_line_is_indented(line: str) -> None:
    increase, _ = _indentation()
    assert increase.search(line)


@pytest.mark.parametrize(
    "line", ["x := 1;", "IF x THEN y := 1; END_IF", "VAR x : INT; END_VAR", "x : INT;", "f(a, b);"]
)
def test_what_follows_a_whole_line_is_not_indented(line: str) -> None:
    increase, _ = _indentation()
    assert not increase.search(line)


def test_the_end_of_what_was_indented_is_not() -> None:
    _, decrease = _indentation()
    assert all(decrease.search(line) for line in ("END_IF;", "  end_var", "ELSIF x THEN", "UNTIL x"))
    assert not any(decrease.search(line) for line in ("END_PROGRAM", "ender := 1;", "x := 1;"))


def _indentation() -> tuple[re.Pattern[str], re.Pattern[str]]:
    rules = json.loads((EXTENSION / "language-configuration.json").read_text())["indentationRules"]
    increase, decrease = rules["increaseIndentPattern"], rules["decreaseIndentPattern"]
    assert increase["flags"] == decrease["flags"] == "i"
    return re.compile(increase["pattern"], re.IGNORECASE), re.compile(decrease["pattern"], re.IGNORECASE)


@pytest.mark.skipif(not shutil.which("node"), reason="node is not installed; make test-editors installs it")
@pytest.mark.skipif(not ESBUILD.exists(), reason="the npm packages are not installed; make test-editors installs them")
def test_the_code_of_the_extension_passes_its_own_tests() -> None:
    ran = subprocess.run(["npm", "test", "--silent"], cwd=EXTENSION, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert re.search(r"^# pass [1-9]", ran.stdout, re.MULTILINE)


@pytest.mark.skipif(not shutil.which("node"), reason="node is not installed; make test-editors installs it")
@pytest.mark.skipif(not ESBUILD.exists(), reason="the npm packages are not installed; make test-editors installs them")
def test_the_extension_compiles_to_one_file_that_needs_vscode_only(tmp_path: Path) -> None:
    made = tmp_path / "extension.js"
    options = ["--bundle", "--external:vscode", "--platform=node", "--target=node20", f"--outfile={made}"]
    subprocess.run([ESBUILD, "src/extension.ts", *options, "--log-level=error"], cwd=EXTENSION, check=True)
    wanted = set(re.findall(r'require\("([^"]+)"\)', made.read_text()))
    assert "vscode" in wanted
    builtin = subprocess.run(
        ["node", "-p", "JSON.stringify(require('module').builtinModules)"], capture_output=True, text=True, check=True
    )
    assert {name.removeprefix("node:") for name in wanted} - {"vscode"} <= set(json.loads(builtin.stdout))
