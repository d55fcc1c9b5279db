"""What was traced until Ctrl-C, or until the plant failed, is in the file."""

from __future__ import annotations

from pathlib import Path

import pytest
from conftest import Tool

PLANT = """
def step(plc):
    if plc.now_ns >= 30_000_000:
        raise {failure}
"""


@pytest.mark.parametrize(("failure", "status"), [("KeyboardInterrupt", 130), ("RuntimeError('no water')", 2)])
def test_the_rows_are_written(tool: Tool, scratch: Path, failure: str, status: int) -> None:
    (scratch / "main.st").write_text("PROGRAM Main VAR n : INT; END_VAR n := n + 1; END_PROGRAM")
    (scratch / "plant.py").write_text(PLANT.format(failure=failure))
    assert tool("build", "main.st").status == 0
    done = tool("run", "app.cdl", "--time", "T#1s", "--plant", "plant.py", "--trace", "Main.n", "-o", "trace.csv")
    assert done.status == status, done.err
    assert (scratch / "trace.csv").read_text() == "time_ms,Main.n\n0,1\n10,2\n20,3\n"
