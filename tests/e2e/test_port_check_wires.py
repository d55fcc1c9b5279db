"""Loop-back wires of `plctool port-check`: right ones, missing ones, crossed ones, slow ones, on plcrt with a GPIO chip
whose lines are wired."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from plctool import connect
from plctool.link.transports import parse_link
from plctool.port_check import parse_wire
from plctool.port_check.bench import Bench
from plctool.port_check.report import Outcome, judge
from plctool.port_check.wires import EDGES, LIMIT_MS, Wires
from plctool.testing.plcrt import Plcrt

CHIP = Path(__file__).with_name("wired_gpio.c")
DEVICE = """
name = "Wired"
[gpio]
in = { DI0 = "L8", DI1 = "L9" }
out = { DO0 = "L0", DO1 = "L1" }
"""


@pytest.fixture(scope="module")
def chip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    library = tmp_path_factory.mktemp("chip") / "wired_gpio.so"
    compiler = shutil.which("cc") or "gcc"
    subprocess.run([compiler, "-O1", "-shared", "-fPIC", "-o", library, CHIP, "-ldl"], check=True)
    return library


@pytest.fixture
def wired(chip, tmp_path, monkeypatch):
    """A controller whose lines are wired: a context that gives its link."""

    @contextmanager
    def start(wires: str) -> Iterator[str]:
        monkeypatch.setenv("LD_PRELOAD", str(chip))
        monkeypatch.setenv("WIRES", wires)
        with Plcrt(tmp_path / "plc.flash") as plc:
            monkeypatch.delenv("LD_PRELOAD")
            yield plc.port

    return start


def check(port: str, folder: Path, *wires: str, device: Path | None = None) -> dict[str, Outcome]:
    """The wires alone, by their names."""
    link = parse_link(f"serial:{port}")
    with connect(link) as plc:
        bench = Bench(lambda: connect(link), plc, "x86_64-linux", folder, link)
        checks = Wires(bench, [parse_wire(wire) for wire in wires], device).checks()
        found = {outcome.name.removeprefix("wire "): outcome for outcome in map(judge, checks)}
        if any(outcome.figures for outcome in found.values()):
            assert plc.read("Main.drive[0]") is False  # all outputs are low at the end
        return found


def test_wires_that_are_there_pass_with_their_delay(wired, tmp_path):
    with wired("0>8 1>9:30") as port:
        found = check(port, tmp_path, "L0=L8", "L1=L9")
    quick, slow = found["L0=L8"], found["L1=L9"]
    assert (quick.verdict, slow.verdict) == ("passed", "passed"), found
    assert quick.figures["edges"] == slow.figures["edges"] == EDGES
    assert quick.figures["cycles"][0] == 1
    assert 30 <= slow.figures["longest_ms"] <= LIMIT_MS
    assert slow.text.startswith("follows within ")


def test_an_output_leads_to_several_inputs(wired, tmp_path):
    with wired("0>8 0>9") as port:
        found = check(port, tmp_path, "L0=L8", "L0=L9")
    assert [outcome.verdict for outcome in found.values()] == ["passed", "passed"], found


def test_a_missing_wire_fails_alone(wired, tmp_path):
    with wired("1>9") as port:
        found = check(port, tmp_path, "L0=L8", "L1=L9")
    assert found["L1=L9"].verdict == "passed"
    assert found["L0=L8"].verdict == "failed"
    assert found["L0=L8"].text == f"L8 does not follow L0 within {LIMIT_MS} ms: it stays low"


def test_wires_at_each_others_terminals_are_named(wired, tmp_path):
    with wired("0>9 1>8") as port:
        found = check(port, tmp_path, "L0=L8", "L1=L9")
    assert found["L0=L8"].text.endswith("it stays low; L9 follows it")
    assert found["L1=L9"].text.endswith("it stays low; L8 follows it")


def test_an_input_that_follows_two_outputs_is_a_short_circuit(wired, tmp_path):
    with wired("0>8 0>9") as port:
        found = check(port, tmp_path, "L0=L8", "L1=L9")
    assert (found["L0=L8"].verdict, found["L0=L8"].text) == ("failed", "L9 follows L0, too")
    assert found["L1=L9"].verdict == "failed"


def test_a_wire_that_is_too_slow_fails(wired, tmp_path):
    with wired(f"0>8:{2 * LIMIT_MS}") as port:
        found = check(port, tmp_path, "L0=L8")
    assert found["L0=L8"].verdict == "failed"


def test_the_names_of_the_board_are_known(wired, tmp_path):
    device = tmp_path / "device.toml"
    device.write_text(DEVICE)
    with wired("0>8 1>9") as port:
        found = check(port, tmp_path, "DO0=DI0", "DO1=DI1", device=device)
    assert [outcome.verdict for outcome in found.values()] == ["passed", "passed"], found


MODULE = f"""{DEVICE}
[[module]]
name = "Digital"
driver = "IoDrvSim"
in = {{ DI0 = {{ type = "BOOL", parameter = 1 }}, AI0 = {{ type = "INT", parameter = 3 }} }}
out = {{ DO0 = {{ type = "BOOL", parameter = 2 }} }}
"""


def test_channels_of_a_vendors_driver_are_checked(wired, tmp_path):
    """A simulated device has no wire, so the input stays low."""
    device = tmp_path / "device.toml"
    device.write_text(MODULE)
    with wired("0>8") as port:
        found = check(port, tmp_path, "DO0=DI0", "Digital.DO0=Digital.DI0", device=device)
    assert found["DO0=DI0"].verdict == "passed", found
    text = f"Digital.DI0 does not follow Digital.DO0 within {LIMIT_MS} ms: it stays low"
    assert found["Digital.DO0=Digital.DI0"].text == text


def test_channels_that_are_no_bits_are_refused(wired, tmp_path):
    device = tmp_path / "device.toml"
    device.write_text(MODULE)
    with wired("") as port:
        found = check(port, tmp_path, "Digital.DO0=Digital.AI0", device=device)
    outcome = found["Digital.DO0=Digital.AI0"]
    assert outcome.verdict == "failed"
    assert "INT" in outcome.text and "BOOL" in outcome.text, outcome.text


def test_a_line_that_is_not_there_is_named(wired, tmp_path):
    with wired("") as port:
        found = check(port, tmp_path, "L0=L8", "L1=L77")
    assert {outcome.verdict for outcome in found.values()} == {"failed"}
    assert "this device has no line L77" in found["L0=L8"].text


def test_a_name_that_the_board_has_not_is_named(wired, tmp_path):
    device = tmp_path / "device.toml"
    device.write_text(DEVICE)
    with wired("") as port:
        found = check(port, tmp_path, "DO0=DI7", device=device)
    assert found["DO0=DI7"].verdict == "failed"
    assert "DI7" in found["DO0=DI7"].text


def test_the_command_checks_wires(tool, wired):
    with wired("0>8") as port:
        done = tool("port-check", "--port", port, "--wire", "L0=L8", "--wire", "L1=L9", "--json", timeout=300)
    outcomes = {outcome["name"]: outcome for outcome in done.json["checks"]}
    assert outcomes["wire L0=L8"]["verdict"] == "passed", outcomes["wire L0=L8"]
    assert outcomes["wire L0=L8"]["limits"]["longest_ms"] == {"max": LIMIT_MS}
    assert outcomes["wire L1=L9"]["verdict"] == "failed"
    assert (done.status, done.json["failed"]) == (1, 1)


@pytest.mark.parametrize(
    "wires, problem",
    [
        (["DO0"], "'DO0' is no wire; write OUTPUT=INPUT"),
        (["=DI0"], "'=DI0' is no wire"),
        (["DO0=DI0=DI1"], "is no wire"),
        (["DO0=DI0", "DO1=DI0"], "DI0 is the input of two wires, DO0=DI0 and DO1=DI0"),
        (["DO0=DI0", "DI0=DI1"], "DI0 is the input of one wire and the output of another one"),
    ],
)
def test_wires_that_make_no_sense_are_refused(tool, plcrt, wires, problem):
    done = tool("port-check", "--port", plcrt.port, "--yes", *(f"--wire={wire}" for wire in wires))
    assert done.status == 2
    assert problem in done.err
