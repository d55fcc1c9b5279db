"""Lines whose bits lie side by side, in the device and in the inputs or outputs, are copied together, others not."""

from __future__ import annotations

from pathlib import Path

import pytest
from io_support import build, configuration

from plctool.io.configuration import ChannelEntry
from plctool.sim import Simulator

LINES = 12
TYPICAL = {f"DI{n}": f"%IX0.{n}" if n < 8 else f"%IX1.{n - 8}" for n in range(LINES)}


def channels(folder: Path, inputs: dict[str, str], outputs: dict[str, str] | None = None) -> list[ChannelEntry]:
    """Those of the image, of a program that has all of these places."""
    places = [*inputs.values(), *(outputs or {}).values()]
    names = {
        place: f"v{i}" for i, place in enumerate(place.split('"')[1] if '"' in place else place for place in places)
    }
    variables = " ".join(f"{name} AT {place} : BOOL;" for place, name in names.items())
    uses = " ".join(f"{n} := NOT {n};" if place[1] == "Q" else f"x := x OR {n};" for place, n in names.items())
    program = f"VAR_GLOBAL {variables} END_VAR PROGRAM Main VAR x : BOOL; END_VAR {uses} END_PROGRAM"
    description = "[gpio.in]\n" + "".join(f'{line} = "{place}"\n' for line, place in inputs.items())
    if outputs:
        description += "[gpio.out]\n" + "".join(f"{line} = {place}\n" for line, place in outputs.items())
    tasks = configuration(build(folder, program, description)).task_maps
    return [channel for task in tasks for connector in task.connectors for channel in connector.channels]


def sizes(found: list[ChannelEntry]) -> list[tuple[int, int]]:
    return [(channel.area_bit, channel.bits) for channel in found]


def test_lines_in_the_order_of_their_bits_are_bytes(tmp_path: Path) -> None:
    assert sizes(channels(tmp_path, TYPICAL)) == [(0, 8), (8, 4)]


def test_a_gap_separates(tmp_path: Path) -> None:
    assert sizes(channels(tmp_path, {"DI0": "%IX0.0", "DI1": "%IX0.1", "DI2": "%IX0.3"})) == [(0, 2), (3, 1)]


def test_another_order_separates(tmp_path: Path) -> None:
    assert sizes(channels(tmp_path, {"DI0": "%IX0.1", "DI1": "%IX0.0"})) == [(1, 1), (0, 1)]


def test_the_end_of_a_byte_separates_on_either_side(tmp_path: Path) -> None:
    shifted = {f"DI{n}": f"%IX{(n + 3) // 8}.{(n + 3) % 8}" for n in range(LINES)}
    assert sizes(channels(tmp_path, shifted)) == [(3, 5), (8, 3), (11, 4)]


def test_what_becomes_of_them_at_a_stop_separates(tmp_path: Path) -> None:
    outputs = {
        "DO0": '{ var = "%QX0.0", on_stop = "hold" }',
        "DO1": '{ var = "%QX0.1", on_stop = "hold" }',
        "DO2": '"%QX0.2"',
        "DO3": '{ var = "%QX0.3", on_stop = 1 }',
        "DO4": '{ var = "%QX0.4", on_stop = 0 }',
        "DO5": '{ var = "%QX0.5", on_stop = 1 }',
    }
    found = channels(tmp_path, {}, outputs)
    assert sizes(found) == [(0, 2), (2, 1), (3, 3)]
    assert found[2].value == 0b101


@pytest.mark.parametrize("bit", range(LINES))
def test_each_line_still_is_a_variable(tmp_path_factory: pytest.TempPathFactory, bit: int) -> None:
    """An input and an output of all, and what the output is when the program stops."""
    folder = tmp_path_factory.mktemp("lines")
    names = [f"{n // 8}.{n % 8}" for n in range(LINES)]
    variables = "".join(f"i{n} AT %IX{place} : BOOL; q{n} AT %QX{place} : BOOL; " for n, place in enumerate(names))
    code = " ".join(f"q{n} := i{n};" for n in range(LINES))
    program = f"PROGRAM Main VAR {variables} END_VAR {code} END_PROGRAM"
    inputs = "".join(f'DI{n} = "Main.i{n}"\n' for n in range(LINES))
    outputs = "".join(f'DO{n} = {{ var = "Main.q{n}", on_stop = {n % 3 == 0:d} }}\n' for n in range(LINES))
    built = build(folder, program, f"[gpio.in]\n{inputs}[gpio.out]\n{outputs}")
    built.write(folder / "main.cdl")
    with Simulator.from_file(folder / "main.cdl") as plc:
        plc.set_input(f"gpio.DI{bit}", True)
        plc.run_cycles(1)
        assert [plc.output(f"gpio.DO{n}") for n in range(LINES)] == [n == bit for n in range(LINES)]
        plc.stop()
        assert [plc.output(f"gpio.DO{n}") for n in range(LINES)] == [n % 3 == 0 for n in range(LINES)]
