"""plcrt on Debian's kernel for arm64, in a virtual machine: flash, a power cut, and the program runs again. The script
`system` makes the machine and names its folder in $ARM_SYSTEM."""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path

import pytest
from tests.free_ports import free_port

from plctool.compiler import compile_sources
from plctool.device import Plc, connect
from plctool.errors import LinkError
from plctool.testing.children import ends_with_us
from plctool.testing.waiting import eventually

FOLDER = os.environ.get("ARM_SYSTEM", "")
pytestmark = pytest.mark.skipif(not FOLDER, reason="tests/linux_arm/system runs it")

# Time is the number of instructions, whatever else this machine does: one in 4 ns, and none while the processor waits.
INSTRUCTION_TIME = ("-icount", "shift=2,sleep=off")
PID = Path(__file__).resolve().parents[2] / "bench/programs/pid.st"
BOOT = 240.0  # of an emulated machine beside others [s]; about 10 on a quiet one
PROGRAM = """PROGRAM Main
VAR n : DINT; END_VAR
VAR RETAIN total : DINT; END_VAR
n := n + 1;
total := total + 1;
END_PROGRAM
CONFIGURATION Config
    TASK Fast(INTERVAL := T#10ms, PRIORITY := 1);
    PROGRAM Main WITH Fast : Main;
END_CONFIGURATION
"""


class Machine:
    """A virtual machine with a disk that outlives it."""

    def __init__(self, folder: Path) -> None:
        self.disk, self.console = folder / "disk", folder / "console"
        with self.disk.open("wb") as disk:
            disk.truncate(32 << 20)
        subprocess.run(["mke2fs", "-q", "-t", "ext4", "-F", self.disk], check=True)
        self.port = free_port()
        self.process: subprocess.Popen[bytes] | None = None

    def power_on(self, *options: str) -> None:
        (kernel,) = Path(FOLDER).glob("system/boot/vmlinuz-*")
        command = [
            "qemu-system-aarch64", "-M", "virt", "-cpu", "cortex-a53", "-m", "256", "-display", "none", "-no-reboot",
            "-nodefaults", "-serial", "stdio", "-kernel", str(kernel), "-initrd", f"{FOLDER}/initial.cpio",
            "-append", "console=ttyAMA0 panic=-1",
            "-netdev", f"user,id=net,restrict=on,hostfwd=tcp:127.0.0.1:{self.port}-10.0.2.15:11740",
            "-device", "virtio-net-device,netdev=net",
            "-drive", f"file={self.disk},format=raw,if=none,id=disk,cache=writethrough",
            "-device", "virtio-blk-device,drive=disk", *options,
        ]  # fmt: skip
        with self.console.open("ab") as console:
            self.process = subprocess.Popen(
                ends_with_us(command), stdin=subprocess.DEVNULL, stdout=console, stderr=subprocess.STDOUT
            )

    def cut_power(self) -> None:
        if self.process:
            self.process.kill()
            self.process.wait()

    def connected(self) -> Plc | None:
        """None as long as plcrt does not answer. What has ended fails the test with its console."""
        assert self.process and self.process.poll() is None, self.console.read_text(errors="replace")[-3000:]
        with suppress(LinkError), ExitStack() as opened:
            plc = opened.enter_context(connect(f"tcp:127.0.0.1:{self.port}"))
            plc.raw_status()  # QEMU takes the connection before the machine can
            opened.pop_all()
            return plc
        return None

    def booted(self) -> Plc:
        end = time.monotonic() + BOOT
        while (plc := self.connected()) is None:
            assert time.monotonic() < end, self.console.read_text(errors="replace")[-3000:]
            time.sleep(0.5)
        return plc


@pytest.fixture
def machine(tmp_path: Path) -> Iterator[Machine]:
    machine = Machine(tmp_path)
    yield machine
    machine.cut_power()


def test_a_program_runs_again_after_the_power_was_cut(machine: Machine, tmp_path: Path) -> None:
    (tmp_path / "main.st").write_text(PROGRAM)
    built = compile_sources([tmp_path / "main.st"], target="aarch64-linux")
    machine.power_on()
    with machine.booted() as plc:
        plc.add_symbols(built.symbols)
        plc.flash(built.image)
        eventually(lambda: plc.read("Main.total") > 400)  # it is saved once a second
        before = plc.read("Main.total")
    machine.cut_power()
    machine.power_on()
    with machine.booted() as plc:
        plc.add_symbols(built.symbols)
        assert plc.status().state == "run"
        total, n = plc.read("Main.total", "Main.n").values()
        assert total - n > before - 400
        (task,), (lateness,) = plc.tasks(), plc.lateness()
        assert abs(sum(late.count for late in lateness) - task.cycles) < 100  # some between the two questions


def test_cycles_in_instruction_time_take_and_begin_as_the_page_says(machine: Machine) -> None:
    """docs/raspberry-pi.md has the figures. They are of instructions, so they hold on a busy machine, too."""
    built = compile_sources([PID], target="aarch64-linux")
    machine.power_on(*INSTRUCTION_TIME)
    with machine.booted() as plc:
        plc.add_symbols(built.symbols)
        plc.flash(built.image)
        eventually(lambda: plc.tasks()[0].cycles > 3000)
        (task,), (lateness,) = plc.tasks(), plc.lateness()
    starts = sum(late.count for late in lateness)
    punctual = sum(late.count for late in lateness if late.below_ns <= 100_000)
    print(f"64 PID controllers: {task.avg_us} us (at least {task.min_us}) = {task.avg_us * 250} instructions")
    print(f"{punctual} of {starts} starts late by less than 100 us = 25 000 instructions, {task.overruns} overruns")
    assert 4 <= task.min_us <= task.avg_us <= 25
    assert punctual > 0.95 * starts
    assert task.overruns < 0.01 * starts
