"""Files and plots of recordings, and `run --trace` with each of them."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from plctool.debug.recording import Column, Recording
from plctool.errors import UsageError
from plctool.iec.types import BOOL, LREAL
from plctool.trace_file import check_format, render
from plctool.trace_plot import plot

PROGRAM = """
PROGRAM Main VAR n : DINT; on : BOOL; r : REAL; s : STRING := 'x'; END_VAR
n := n + 1; on := NOT on; r := r + 0.1; END_PROGRAM
CONFIGURATION C RESOURCE R ON PLC TASK T(INTERVAL := T#10ms, PRIORITY := 1); PROGRAM Main WITH T : Main;
END_RESOURCE END_CONFIGURATION
"""


def recording(*values: list[float]) -> Recording:
    columns = [Column(f"Main.v{i}", LREAL) for i in range(len(values))]
    times = [i * 1_000_000 for i in range(len(values[0]))] if values else []
    return Recording("T", 1000, columns, times, [list(v) for v in values])


@pytest.mark.parametrize("name", ["trace.csv", "trace.json", "trace.html"])
def test_run_writes_each_kind_of_file(tool, tmp_path: Path, name: str) -> None:
    (tmp_path / "main.st").write_text(PROGRAM)
    assert tool("build", "main.st").status == 0
    assert tool("run", "app.cdl", "--trace", "Main.n", "Main.on", "Main.r", "-o", name, "--cycles", "4").status == 0
    content = (tmp_path / name).read_text()
    if name.endswith(".csv"):
        assert content.splitlines()[1].split(",")[1:] == ["1", "1", "0.1"]
    if name.endswith(".json"):
        assert json.loads(content)["values"] == {
            "Main.n": [1, 2, 3, 4], "Main.on": [True, False, True, False], "Main.r": [0.1, 0.2, 0.3, 0.4]
        }  # fmt: skip
    if name.endswith(".html"):
        assert '"Main.n": [1, 2, 3, 4]' in content


def test_run_says_what_has_no_place_in_a_plot(tool, tmp_path: Path) -> None:
    (tmp_path / "main.st").write_text(PROGRAM)
    assert tool("build", "main.st").status == 0
    done = tool("run", "app.cdl", "--trace", "Main.s", "-o", "trace.html")
    assert (done.status, "is a string, which cannot be traced" in done.err) == (2, True)


def test_a_plot_has_the_range_the_newest_value_and_the_time() -> None:
    text = plot(recording([0.0, 5.0, 10.0, 2.5]), 60)
    lines = text.splitlines()
    assert lines[0] == "Main.v0 = 2.5"
    assert lines[1].strip().startswith("10 ")
    assert lines[5].strip().startswith("0 ")
    assert lines[-1].split() == ["0", "ms", "3", "ms"]
    assert all(len(line) <= 60 for line in lines)


@pytest.mark.parametrize(
    "values", [[], [1.0], [2.0, 2.0, 2.0], [float("nan")] * 3, [float("inf"), -1e308, 1e308], [1e-300, float("-inf")]]
)
def test_any_values_can_be_plotted_and_written(values: list[float]) -> None:
    made = recording(values)
    for width, height in ((1, 0), (80, 24), (300, 1)):
        assert plot(made, width, height).splitlines()[0].startswith("Main.v0")
    assert json.loads(render(made, Path("x.json")))["lost"] == 0
    for name in ("x.csv", "x.html"):
        assert render(made, Path(name))


def test_a_plot_of_many_columns_keeps_to_the_height_of_the_terminal() -> None:
    made = recording(*[[1.0, 2.0]] * 6)
    made.columns[0] = Column("Main.b", BOOL)
    assert len(plot(made, 80, 24).splitlines()) <= 24


def test_markup_in_a_name_cannot_end_the_script() -> None:
    made = recording([1.0])
    made.columns[0] = Column("</script><script>alert(1)</script>", LREAL)
    page = render(made, Path("x.html")).decode()
    assert page.count("</script>") == 2


def test_a_picture_has_the_format_of_its_name() -> None:
    pytest.importorskip("matplotlib")
    assert render(recording([1.0, 2.0]), Path("x.png")).startswith(b"\x89PNG")


def test_a_name_that_is_no_format_is_refused() -> None:
    with pytest.raises(UsageError, match=r"\.csv, \.json, \.html or \.png"):
        check_format(Path("trace.txt"))


def test_a_picture_without_matplotlib_is_refused_with_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(UsageError, match=r"\.html.*'plctool\[plot\]'.*Debian package"):
        check_format(Path("trace.png"))
