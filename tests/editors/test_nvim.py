"""Neovim with editors/nvim, in batch mode: file type, highlighting by tree-sitter, `:make`, and the language server."""

from __future__ import annotations

import json
import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import tree_sitter_iecst

ROOT = Path(__file__).resolve().parents[2]
NVIM = os.environ.get("NVIM_TESTED") or shutil.which("nvim")
SOURCE = "PROGRAM Main\nVAR\n    x : INT;\nEND_VAR\nx := unknown;\nEND_PROGRAM\n"

pytestmark = pytest.mark.skipif(NVIM is None, reason="Neovim is not installed; make test-editors installs it")

READY = """
local function wait(condition)
  return vim.wait(60000, condition, 20)
end
local function report(found)
  io.stdout:write('REPORT ' .. vim.fn.json_encode(found) .. '\\n')
  vim.cmd('qall!')
end
"""


@pytest.fixture(scope="session")
def parsers(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for 'runtimepath' with the compiled parser."""
    folder = tmp_path_factory.mktemp("nvim")
    (folder / "parser").mkdir()
    tree_sitter_iecst.compiled(folder / "parser")
    return folder


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A project with an error, and a plctool to start beside it."""
    (tmp_path / "plc.toml").write_text('sources = ["main.st"]\n')
    (tmp_path / "main.st").write_text(SOURCE)
    paths = [str(Path(entry).resolve()) for entry in os.environ.get("PYTHONPATH", "").split(os.pathsep) if entry]
    command = tmp_path / "bin" / "plctool"
    command.parent.mkdir()
    environment = f"PYTHONPATH={shlex.quote(os.pathsep.join(paths))}"
    command.write_text(f'#!/bin/sh\n{environment} exec {shlex.quote(sys.executable)} -m plctool "$@"\n')
    command.chmod(0o755)
    return tmp_path


def run(project: Path, parsers: Path, script: str, *, lsp: bool = False) -> Any:
    """What a script in Lua reports in Neovim with main.st open."""
    (project / "init.lua").write_text(
        f"vim.opt.runtimepath:prepend({json.dumps(str(ROOT / 'editors' / 'nvim'))})\n"
        f"vim.opt.runtimepath:prepend({json.dumps(str(parsers))})\n"
        "vim.g.plctool_setup = false\n"
        f"require('plctool').setup {{ lsp = {str(lsp).lower()} }}\n"
        "vim.cmd('filetype plugin on')\n"
    )
    (project / "script.lua").write_text(READY + script)
    environment = {
        **os.environ,
        "HOME": str(project),
        "XDG_CONFIG_HOME": str(project / "config"),
        "XDG_DATA_HOME": str(project / "data"),
        "XDG_STATE_HOME": str(project / "state"),
        "PATH": f"{project / 'bin'}{os.pathsep}{os.environ['PATH']}",
    }
    assert NVIM is not None
    command = [NVIM, "--headless", "-n", "-u", "init.lua", "main.st", "-c", "luafile script.lua"]
    ran = subprocess.run(command, cwd=project, env=environment, capture_output=True, text=True, timeout=180)
    said = ran.stdout + ran.stderr
    lines = [line for line in said.splitlines() if "REPORT " in line]
    assert lines, said
    return json.loads(lines[0].partition("REPORT ")[2])


def test_a_source_has_the_file_type_and_its_settings(project: Path, parsers: Path) -> None:
    found = run(project, parsers, "report { vim.bo.filetype, vim.bo.commentstring, vim.bo.shiftwidth }")
    assert found == ["iecst", "// %s", 4]


def test_a_source_is_highlighted_by_tree_sitter(project: Path, parsers: Path) -> None:
    found = run(
        project,
        parsers,
        """
        local buffer = vim.api.nvim_get_current_buf()
        local root = vim.treesitter.get_parser(buffer, 'iecst'):parse()[1]:root()
        local get = vim.treesitter.query.get or vim.treesitter.query.get_query
        local query, kinds = get('iecst', 'highlights'), {}
        for id, node in query:iter_captures(root, buffer, 0, -1) do
          local row, column = node:start()
          kinds[row .. ':' .. column] = query.captures[id]
        end
        report { active = vim.treesitter.highlighter.active[buffer] ~= nil, kinds = kinds, broken = root:has_error() }
        """,
    )
    assert found["active"]
    assert not found["broken"]
    assert found["kinds"]["0:0"] == "keyword.function"
    assert found["kinds"]["0:8"] == "type.definition"
    assert found["kinds"]["2:8"] == "type.builtin"


def test_the_parser_is_compiled_by_a_command(project: Path, tmp_path: Path) -> None:
    script = """
    vim.cmd('PlctoolInstallParser')
    report(vim.fn.filereadable(vim.fn.stdpath('data') .. '/site/parser/iecst.so'))
    """
    assert run(project, tmp_path, script) == 1


def test_make_lists_the_errors_of_the_compiler(project: Path, parsers: Path) -> None:
    script = """
    vim.cmd('silent make!')
    local found = vim.tbl_filter(function(item) return item.valid == 1 end, vim.fn.getqflist())
    report(vim.tbl_map(function(item) return { vim.fn.bufname(item.bufnr), item.lnum, item.col, item.type } end, found))
    """
    assert run(project, parsers, script) == [["main.st", 5, 6, "e"]]


def test_gq_formats_the_file(project: Path, parsers: Path) -> None:
    (project / "main.st").write_text("program Main\nvar\nx:INT;\nend_var\nx:=1;\nend_program\n")
    script = "vim.cmd('normal! gggqG') report(vim.api.nvim_buf_get_lines(0, 0, -1, false))"
    assert run(project, parsers, script) == ["PROGRAM Main", "VAR", "    x : INT;", "END_VAR", "x := 1;", "END_PROGRAM"]


def test_the_language_server_attaches_and_reports_the_error(project: Path, parsers: Path) -> None:
    script = """
    wait(function() return #vim.diagnostic.get(0) > 0 end)
    report(vim.tbl_map(function(one) return { one.lnum, one.col, one.severity } end, vim.diagnostic.get(0)))
    """
    assert [4, 5, 1] in run(project, parsers, script, lsp=True)


def test_the_debug_adapter_is_known_to_nvim_dap(project: Path, parsers: Path) -> None:
    script = """
    package.loaded.dap = { adapters = {}, configurations = {} }
    require('plctool').setup { command = 'plctool', link = 'tcp:10.0.0.2' }
    local dap = package.loaded.dap
    report { dap.adapters.plctool.args[1], dap.configurations.iecst[1].request, dap.configurations.iecst[2].link }
    """
    assert run(project, parsers, script) == ["dap", "launch", "tcp:10.0.0.2"]
