"""The worst age of an input that `build` prints is not exceeded on a simulated line, and is not far from it."""

from __future__ import annotations

import random
from pathlib import Path
from tempfile import TemporaryDirectory

from hypothesis import assume, given
from hypothesis import strategies as st
from shares import examples

from plctool import Simulator

READS = st.fixed_dictionaries({"every": st.sampled_from([50, 100, 200, 500]), "count": st.integers(1, 20)})
WRITES = st.fixed_dictionaries(
    {"every": st.sampled_from([50, 100, 300]), "on_change": st.booleans(), "verify": st.booleans()}
)


def sources(folder: Path, baud: int, reads: list[dict[str, int]], writes: list[dict[str, int]]) -> Path:
    """A line with a device for each read and each write; the program changes all that is written in each cycle."""
    lines = [f'[[modbus.rs485]]\nport = "/dev/ttyS1"\nbaud = {baud}\n']
    declared = ["n : INT;"]
    for i, read in enumerate(reads):
        declared.append(f"r{i} : INT; a{i} : ARRAY[1..{read['count']}] OF INT;")
        lines.append(
            f'[[modbus.rs485.device]]\nname = "R{i}"\nunit = {i + 1}\n[[modbus.rs485.device.read]]\nfunction = 4\n'
            f'address = 30001\nevery = "T#{read["every"]}ms"\nvars = ["Main.r{i}", "Main.a{i}"]\n'
        )
    for i, write in enumerate(writes):
        declared.append(f"w{i} : INT;")
        lines.append(
            f'[[modbus.rs485.device]]\nname = "W{i}"\nunit = {100 + i}\n[[modbus.rs485.device.write]]\nfunction = 16\n'
            f'address = 40001\nevery = "T#{write["every"]}ms"\non_change = {str(write["on_change"]).lower()}\n'
            f'verify = {str(write["verify"]).lower()}\nvar = "Main.w{i}"\n'
        )
    body = "n := n + 1;\n" + "".join(f"w{i} := n / 30;\n" for i in range(len(writes)))
    (folder / "main.io.toml").write_text("".join(lines))
    (folder / "main.st").write_text("PROGRAM Main\nVAR " + " ".join(declared) + f" END_VAR\n{body}END_PROGRAM\n")
    return folder / "main.st"


def delay_ms(plc: Simulator, name: str, value: int) -> int:
    """Until the program has what a device measures from now on."""
    plc.set_input(name, value)
    for ms in range(5000):
        if plc.read(name) == value:
            return ms
        plc.run_for(1)
    raise AssertionError(f"{name} never became {value}")


@examples(25)
@given(
    baud=st.sampled_from([9600, 19200, 115200]),
    reads=st.lists(READS, min_size=1, max_size=4),
    writes=st.lists(WRITES, max_size=3),
    seed=st.integers(0, 1000),
)
def test_no_input_is_older(baud: int, reads: list[dict[str, int]], writes: list[dict[str, int]], seed: int) -> None:
    source = random.Random(seed)
    with TemporaryDirectory() as folder, Simulator.from_sources(sources(Path(folder), baud, reads, writes)) as plc:
        plc.run_for(2000)
        assume(plc.symbols().io["devices"][0]["load"] < 0.8)  # `build` warns of a line that is too slow
        ages = {c["device"]: c["age_us"] / 1000 for c in plc.symbols().io["channels"] if not c["output"]}
        for value in range(1, 9):
            i = source.randrange(len(reads))
            plc.run_for(source.randrange(1, 250))
            assert delay_ms(plc, f"Main.r{i}", value) <= ages[f"R{i}"] + 1


def test_a_full_line_comes_near_to_it(tmp_path: Path) -> None:
    """Of a bound that is never reached nothing can be learned."""
    reads = [{"every": 100, "count": 20}] * 3
    with Simulator.from_sources(sources(tmp_path, 9600, reads, [])) as plc:
        plc.run_for(2000)
        age = next(c["age_us"] for c in plc.symbols().io["channels"] if c["device"] == "R0") / 1000
        worst = 0
        for value in range(1, 60):
            worst = max(worst, delay_ms(plc, "Main.r0", value))
            plc.run_for(7 * value % 97 + 1)
    assert 0.5 * age < worst <= age + 1
