"""A plant steps at its time, before the cycles that are due then, whether cycles or time are asked for."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from plctool.errors import DeviceError
from plctool.sim import Simulator

PROGRAM = """
VAR_GLOBAL measured : DINT; END_VAR
PROGRAM Main
VAR seen, last : DINT; END_VAR
last := seen * 1000 + measured;
seen := seen + 1;
END_PROGRAM
"""
RUNS: dict[str, Callable[[Simulator], None]] = {
    "time": lambda plc: plc.run_for(95),
    "cycles": lambda plc: plc.run_cycles(10),
    "cycle by cycle": lambda plc: [plc.run_cycles(1) for _ in range(10)] and None,
}


def source(folder: Path, text: str) -> Path:
    (folder / "main.st").write_text(text)
    return folder / "main.st"


@pytest.mark.parametrize("every_ms", [1, 3, 10, 25, 40])
def test_what_the_program_sees_does_not_depend_on_how_it_is_run(tmp_path: Path, every_ms: int) -> None:
    found = {}
    for name, run in RUNS.items():
        with Simulator.from_sources(source(tmp_path, PROGRAM)) as plc:
            times: list[int] = []

            def step(plant: Simulator, times: list[int] = times) -> None:
                times.append(plant.now_ns // 1_000_000)
                plant.write({"measured": times[-1]})

            plc.attach(step, every_ms)
            plc.at(35, lambda plant: plant.write({"Main.seen": 100}))
            run(plc)
            found[name] = (plc.read("Main.seen"), plc.read("Main.last"), [t for t in times if t <= 90])
    assert found["cycles"] == found["cycle by cycle"] == found["time"]
    assert found["cycles"][2] == list(range(every_ms, 91, every_ms))


def test_a_task_that_waits_for_nothing_is_reported_beside_a_plant(tmp_path: Path) -> None:
    text = """
    VAR_GLOBAL wanted : BOOL; END_VAR
    PROGRAM Main END_PROGRAM
    CONFIGURATION C RESOURCE R ON D
        TASK Waits(SINGLE := wanted);
        PROGRAM Main WITH Waits : Main;
    END_RESOURCE END_CONFIGURATION
    """
    with Simulator.from_sources(source(tmp_path, text)) as plc:
        plc.attach(lambda plant: None, every_ms=60_000)
        with pytest.raises(DeviceError, match="waits for something that does not happen"):
            plc.run_cycles(1)
