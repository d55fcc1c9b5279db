"""Every bit of every area, written by all that may: two tasks, the PC over the line, a test in Python. It takes the
value it is given and no other bit changes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from shares import examples

from plctool.compiler import compile_sources
from plctool.compiler.image.build import BuildResult
from plctool.debug.symbols import symbol_path
from plctool.device import Plc
from plctool.link.connection import Connection
from plctool.link.sim import SimTransport
from plctool.sim import Simulator

BYTES = 3  # of each area
AREAS = {"I": "ins", "Q": "outs", "M": "mem"}
BITS = [f"%{a}X{byte}.{bit}" for a in AREAS for byte in range(BYTES) for bit in range(8)]
BITS += [f"word.{bit}" for bit in range(32)]  # of a variable without an address
CONFIGURATION = """
CONFIGURATION C
  RESOURCE R ON Device
    TASK Quick(INTERVAL := T#1ms, PRIORITY := 1);
    TASK Calm(INTERVAL := T#5ms, PRIORITY := 5);
    PROGRAM Fast WITH Quick : Writer;
    PROGRAM Slow WITH Calm : Writer;
  END_RESOURCE
END_CONFIGURATION
"""


def _source() -> str:
    """A program for two tasks that sets the bit with the number `which`, from 1 on, and names for all bits."""
    cases = "\n".join(f"    {n}: {bit} := value;" for n, bit in enumerate(BITS, 1))
    bytes_ = "\n".join(f"    {name} AT %{a}B0 : ARRAY[0..{BYTES - 1}] OF BYTE;" for a, name in AREAS.items())
    return (
        "PROGRAM Writer\nVAR which : INT; value : BOOL; runs : UDINT; END_VAR\n"
        f"  runs := runs + 1;\n  CASE which OF\n{cases}\n  END_CASE;\nEND_PROGRAM\n"
        f"VAR_GLOBAL\n    word : DWORD;\n{bytes_}\nEND_VAR\n{CONFIGURATION}"
    )


@dataclass
class Bench:
    """The simulator, and a client of it."""

    simulator: Simulator
    plc: Plc

    def state(self) -> list[bool]:
        """All bits, in the order of BITS."""
        values = self.simulator.read_all([*AREAS.values(), "word"])
        numbers = [int.from_bytes(bytes(values[name]), "little") for name in AREAS.values()]
        bits = [bool(number >> n & 1) for number in numbers for n in range(8 * BYTES)]
        return bits + [bool(values["word"] >> n & 1) for n in range(32)]

    def write(self, who: str, bit: int, value: bool) -> None:
        if who == "PC":
            self.plc.write({BITS[bit]: value})
        elif who == "test":
            self.simulator.write({BITS[bit]: value})
        else:
            self.simulator.write({f"{who}.value": value})
            self.simulator.write({f"{who}.which": bit + 1})
            self.simulator.run_for(ms=5)
            self.simulator.write({f"{who}.which": 0})


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[BuildResult, Path]:
    folder = tmp_path_factory.mktemp("bits")
    (folder / "main.st").write_text(_source())
    result = compile_sources([folder / "main.st"])
    result.write(folder / "main.cdl")
    return result, folder / "main.cdl"


@pytest.fixture(scope="module")
def bench(built: tuple[BuildResult, Path]) -> Iterator[Bench]:
    result, path = built
    with (
        Simulator(result.image, result.symbols) as simulator,
        Plc(Connection(SimTransport()), symbol_path(path)) as plc,
    ):
        yield Bench(simulator, plc)


WRITERS = ["PC", "test", "Fast", "Slow"]


@pytest.mark.parametrize("who", WRITERS)
@pytest.mark.parametrize("value", [True, False])
def test_every_bit_takes_its_value_and_no_other_changes(bench: Bench, who: str, value: bool) -> None:
    for n in range(len(BITS)):
        bench.write("test", n, not value)
    expected = [not value] * len(BITS)
    for n in range(len(BITS)):
        bench.write(who, n, value)
        expected[n] = value
        assert bench.state() == expected, BITS[n]


STEPS = st.lists(st.tuples(st.sampled_from(WRITERS), st.integers(0, len(BITS) - 1), st.booleans()), max_size=30)


@examples(30)
@given(start=st.lists(st.booleans(), min_size=len(BITS), max_size=len(BITS)), steps=STEPS)
def test_whoever_writes_in_whatever_order(bench: Bench, start: list[bool], steps: list[tuple[str, int, bool]]) -> None:
    for n, value in enumerate(start):
        bench.simulator.write({BITS[n]: value})
    expected = list(start)
    for who, n, value in steps:
        bench.write(who, n, value)
        expected[n] = value
        assert bench.state() == expected


def test_bits_of_one_byte_and_the_byte_go_in_the_order_of_one_command(bench: Bench) -> None:
    bench.plc.write({"mem[1]": 0xF0, "%MX1.0": True, "%MX1.7": False, "%MX1.1": True})
    assert bench.simulator.read("mem[1]") == 0x73
    bench.plc.write({"%MX1.0": False, "mem[1]": 0x81})
    assert bench.simulator.read("mem[1]") == 0x81
