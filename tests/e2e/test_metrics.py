"""`plcrt --metrics`: the figures of a controller as a file that Prometheus reads."""

from __future__ import annotations

import os
import re
import signal
import stat
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from conftest import Tool

from plctool import connect
from plctool.testing.plcrt import Plcrt

SAMPLE = re.compile(r'(plcrt_[a-z_]+)\{((?:[a-z]+="(?:[^"\\\n]|\\["\\])*",?)+)\} (\d+(?:\.\d+)?)')
FAMILY = re.compile(r"# (HELP|TYPE) (plcrt_[a-z_]+) (.+)")
Eventually = Callable[[Callable[[], Any]], Any]


def read_samples(file: Path) -> dict[tuple[str, str], float]:
    """The samples of a file by name and labels; the form of each line is checked, and the order of families."""
    samples: dict[tuple[str, str], float] = {}
    family = ""
    for line in file.read_text(encoding="ascii").splitlines():
        if comment := FAMILY.fullmatch(line):
            family = comment[2]
            continue
        sample = SAMPLE.fullmatch(line)
        assert sample and sample[1] == family, line
        assert (sample[1], sample[2]) not in samples
        samples[sample[1], sample[2]] = float(sample[3])
    return samples


@pytest.fixture
def metrics(tmp_path: Path) -> Path:
    return tmp_path / "main.prom"


@pytest.fixture
def measured(tmp_path: Path, metrics: Path) -> Iterator[Plcrt]:
    with Plcrt(tmp_path / "plc.flash", "--metrics", str(metrics), "--metrics-every", "1") as running:
        yield running


def value_of(metrics: Path, name: str, labels: str = 'plc="main"') -> float | None:
    return read_samples(metrics).get((f"plcrt_{name}", labels)) if metrics.exists() else None


def test_the_file_has_cycles_load_and_state_of_each_task(
    measured: Plcrt, metrics: Path, tool: Tool, eventually: Eventually
) -> None:
    image = tool.build("counter", "PROGRAM Main VAR n : DINT; END_VAR n := n + 1; END_PROGRAM")
    eventually(lambda: value_of(metrics, "state", 'plc="main",state="none"') == 1)
    crc = int(tool.ok("info", str(image))["crc"], 16)
    tool.ok("flash", "--port", measured.port, str(image))
    eventually(lambda: value_of(metrics, "state", 'plc="main",state="run"') == 1)
    [task] = tool.ok("tasks", "--port", measured.port)["tasks"]
    of_task = f'plc="main",task="{task["name"]}"'
    eventually(lambda: (value_of(metrics, "task_cycles_total", of_task) or 0) > task["cycles"])
    samples = read_samples(metrics)
    assert samples["plcrt_image_info", f'plc="main",crc="{crc:08X}"'] == 1
    assert 0 < samples["plcrt_task_longest_seconds", of_task] < 10
    assert samples["plcrt_task_longest_seconds", of_task] >= samples["plcrt_task_shortest_seconds", of_task]
    assert ("plcrt_task_jitter_seconds", of_task) in samples and ("plcrt_task_overruns_total", of_task) in samples
    assert samples["plcrt_load_ratio", 'plc="main"'] < 10


def test_an_exception_and_the_death_of_the_controller_are_counted(
    measured: Plcrt, metrics: Path, tool: Tool, eventually: Eventually
) -> None:
    image = tool.build(
        "bad", "PROGRAM Main VAR n, d : DINT; go : BOOL; END_VAR IF go THEN n := 1 / d; END_IF END_PROGRAM"
    )
    tool.ok("flash", "--port", measured.port, str(image))
    tool.ok("write", "--port", measured.port, "Main.go=TRUE")
    eventually(lambda: value_of(metrics, "state", 'plc="main",state="exception"') == 1)
    assert value_of(metrics, "log_entries_total", 'plc="main",class="exception"') == 1
    assert value_of(metrics, "restarts_total") == 0
    worker = measured.worker
    assert worker
    os.kill(worker, signal.SIGKILL)
    eventually(lambda: value_of(metrics, "restarts_total") == 1)


def test_others_may_read_the_file_and_it_is_gone_after_an_orderly_end(
    measured: Plcrt, metrics: Path, eventually: Eventually
) -> None:
    eventually(metrics.exists)
    assert stat.S_IMODE(metrics.stat().st_mode) == 0o644
    assert measured.stop() == 0
    assert not list(metrics.parent.glob("main.prom*"))


def test_names_cannot_end_a_label(tmp_path: Path, eventually: Eventually) -> None:
    file = tmp_path / 'a"} 1.prom'
    with Plcrt(tmp_path / "plc.flash", "--metrics", str(file), "--name", 'x"\\\ny\xfc'):
        eventually(file.exists)
        labels = {labels for name, labels in read_samples(file) if name == "plcrt_info"}
        assert len(labels) == 1 and 'name="x\\"\\\\_y__"' in labels.pop()


def test_a_place_that_cannot_be_written_is_logged_once_and_used_when_it_can(
    tmp_path: Path, eventually: Eventually
) -> None:
    file = tmp_path / "later" / "main.prom"
    with Plcrt(tmp_path / "plc.flash", "--metrics", str(file), "--metrics-every", "1") as running:
        with connect(f"serial:{running.port}") as plc:
            told = [entry.text for entry in plc.log() if "metrics" in entry.text]
        assert told == [f"The metrics are not written to {file}: No such file or directory"]
        file.parent.mkdir()
        eventually(file.exists)


def test_a_link_in_place_of_the_temporary_file_is_not_followed(
    tmp_path: Path, metrics: Path, eventually: Eventually
) -> None:
    victim = tmp_path / "victim"
    victim.write_text("mine")
    Path(f"{metrics}.tmp").symlink_to(victim)
    with Plcrt(tmp_path / "plc.flash", "--metrics", str(metrics)):
        eventually(metrics.exists)
        assert victim.read_text() == "mine" and not metrics.is_symlink()
