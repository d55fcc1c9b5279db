"""Random descriptions: the image has each device and channel as it was described, where the variable is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from io_support import build, configuration
from shares import examples

from plctool.io.configuration import ConnectorEntry

TYPES = {"BOOL": 1, "BYTE": 8, "INT": 16, "REAL": 32, "LINT": 64}
CHANNELS = st.lists(st.tuples(st.sampled_from(sorted(TYPES)), st.booleans(), st.integers(0, 2)), max_size=6)
DEVICES = st.lists(st.tuples(st.booleans(), st.booleans(), CHANNELS), min_size=1, max_size=3)
STOPS = {0: '"hold"', 1: '"zero"', 2: "1"}


@examples(12)
@given(DEVICES)
def test_image_has_what_was_described(tmp_path: Path, devices: list[Any]) -> None:
    declared, used, text = [], [], ""
    expected: dict[tuple[int, int], tuple[str, int, int]] = {}
    for d, (named, optional, channels) in enumerate(devices):
        text += f"[[sim]]\noptional = {str(optional).lower()}\n"
        text += f"name = 'Dev{d}'\n" if named else ("" if d == 0 else f"name = 'Other{d}'\n")
        number = 0
        for output in (False, True):
            text += f"[sim.{'out' if output else 'in'}]\n"
            for c, (t, is_output, stop) in enumerate(channels):
                if is_output is not output:
                    continue
                number += 1
                name = f"v{d}_{c}"
                declared.append(f"{name} : {t};")
                used.append(f"{name} := {name};" if output else f"x := x OR {name} <> y_{t};")
                text += f"c{c} = {{ var = 'Main.{name}', {'on_stop' if output else 'on_error'} = {STOPS[stop]} }}\n"
                expected[d, number] = (f"Main.{name}", TYPES[t], stop)
    zeros = " ".join(f"y_{t} : {t};" for t in TYPES)
    program = (
        f"PROGRAM Main\nVAR x : BOOL; {zeros} {' '.join(declared)} END_VAR\n" + "\n".join(used) + "\nEND_PROGRAM\n"
    )
    built = build(tmp_path, program, text)
    found = configuration(built)

    flags = [c.flags for c in found.connectors]
    assert flags == [1 | 2 * optional for _, optional, _ in devices]
    assert all(isinstance(c, ConnectorEntry) and c.driver == "IoDrvSim" for c in found.connectors)
    seen = {}
    for task_map in found.task_maps:
        for connector in task_map.connectors:
            for channel in connector.channels:
                seen[connector.connector, channel.parameter] = channel
                name, bits, stop = expected[connector.connector, channel.parameter]
                symbol = built.symbols.resolve(name)
                assert (channel.area_bit, channel.bits, channel.flags & 3) == (symbol.offset * 8, bits, stop)
                assert symbol.area == (3 if task_map.type else 2)
    assert seen.keys() == expected.keys()
