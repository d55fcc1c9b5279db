"""Tasks that share a pool need a processor that compares and exchanges in one step."""

from __future__ import annotations

from pathlib import Path

import pytest

from plctool.compiler import compile_sources
from plctool.errors import UsageError
from plctool.image.targets import TARGETS

POOL = """
{attribute 'pool' := '4'}
TYPE Item : STRUCT value : DINT; END_STRUCT END_TYPE
PROGRAM One
VAR p : POINTER TO Item; END_VAR
p := __NEW(Item);
__DELETE(p);
END_PROGRAM
"""
SECOND = """
PROGRAM Two
VAR n : DINT; END_VAR
n := n + 1;
END_PROGRAM
CONFIGURATION Config
    TASK A(INTERVAL := T#1ms);
    TASK B(INTERVAL := T#2ms);
    PROGRAM One WITH A : One;
    PROGRAM Two WITH B : Two;
END_CONFIGURATION
"""


@pytest.mark.parametrize("target", TARGETS)
def test_a_program_with_one_task_may_use_a_pool_everywhere(target: str, tmp_path: Path) -> None:
    source = tmp_path / "main.st"
    source.write_text(POOL)
    assert compile_sources([source], target=target).image


@pytest.mark.parametrize("target", TARGETS)
def test_a_program_with_several_tasks_needs_a_processor_that_exchanges(target: str, tmp_path: Path) -> None:
    source = tmp_path / "main.st"
    source.write_text(POOL + SECOND)
    if target == "cortex-m0":
        with pytest.raises(UsageError, match="use one task, or another target"):
            compile_sources([source], target=target)
    else:
        assert compile_sources([source], target=target).image
