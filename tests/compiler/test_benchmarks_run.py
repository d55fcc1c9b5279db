"""The benchmarks go with the compiler: each of their parts is tried with little work."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path
from typing import Any

import pytest

BENCH = Path(__file__).resolve().parents[2] / "bench"
MODULES = sorted({path.stem for path in BENCH.glob("*.py")} - {"large_project"})  # which others use


@pytest.fixture(autouse=True)
def search_path(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", [str(BENCH), *sys.path])


@pytest.mark.parametrize("name", MODULES)
def test_module_can_be_loaded(name: str) -> None:
    assert "main" in runpy.run_path(str(BENCH / f"{name}.py"), run_name=name)


def test_stages_of_the_compiler_are_timed(tmp_path: Path) -> None:
    (tmp_path / "a.st").write_text("PROGRAM Main VAR n : DINT; s : STRING; END_VAR n := n + 1; s := 'a'; END_PROGRAM")
    stages = runpy.run_path(str(BENCH / "compiling.py"))["profile"](tmp_path / "a.st").seconds
    assert {"lexing, parsing", "lowering", "LLVM: code", "linking"} <= stages.keys()


@pytest.mark.parametrize("target", ["x86_64-linux", "cortex-m3"])
def test_program_is_measured_beside_its_twin(
    target: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import targets

    one: list[Any] = [p for p in targets.find_programs(None, tmp_path) if p.st.stem == "blocks"]
    monkeypatch.setattr(targets, "CALLS", 10)
    monkeypatch.setattr(targets, "ROUNDS", 1)
    if target == targets.HOST:
        targets.bench_host(one, tmp_path)
    else:
        targets.bench_guest(target, one, tmp_path)
    printed = capsys.readouterr().out
    assert "OTHER CHECKSUM" not in printed
    assert "geometric" in printed or "left out" in printed


def test_the_tanks_are_measured_beside_their_twin(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import tanks

    monkeypatch.setattr(tanks, "ROUNDS", 1)
    tanks.main()
    printed = capsys.readouterr().out
    assert printed.count("ControlTask") == printed.count("PlantTask") == len(tanks.HOST_VARIANTS)
    assert "OTHER CHECKSUM" not in printed
