"""Measures the processor time of `plctool ui` and plcrt while browsers show 500 changing values over TCP."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1] / "tests"))

from page_browsers import Browser, Page

from plctool import connect
from plctool.testing.plcrt import Plcrt

VALUES = 500
SECONDS = 10.0
GOAL = 10  # % of a core
PROGRAM = f"""
PROGRAM Main VAR n : DINT; list : ARRAY[1..{VALUES}] OF DINT; i : DINT; END_VAR
n := n + 1;
FOR i := 1 TO {VALUES} DO list[i] := n; END_FOR
END_PROGRAM
CONFIGURATION C RESOURCE R ON PLC TASK T(INTERVAL := T#10ms, PRIORITY := 1); PROGRAM Main WITH T : Main;
END_RESOURCE END_CONFIGURATION
"""


def _seconds(pid: int) -> float:
    """Processor time that a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def measure(folder: Path) -> tuple[float, float, int, int]:
    """Shares of a core of plctool and of plcrt [%], readings, torn readings."""
    (folder / "page.st").write_text(PROGRAM)
    image = folder / "page.cdl"
    build = [sys.executable, "-m", "plctool", "build", "page.st", "-o", image.name]
    modules = {"PYTHONPATH": os.pathsep.join(str(Path(path).resolve()) for path in sys.path if path)}
    subprocess.run(build, cwd=folder, env=os.environ | modules, check=True, capture_output=True)
    names = [f"Main.list[{i}]" for i in range(1, VALUES + 1)]
    with Plcrt(folder / "page.flash", "--tcp", "0") as plcrt:
        with connect(f"tcp:{plcrt.tcp}") as plc:
            plc.flash(image)
        page = Page(folder, "--tcp", plcrt.tcp, "--symbols", "page.sym", **modules)
        browsers = [Browser(page).ready() for _ in range(2)]
        for browser, part in zip(browsers, (names[: VALUES // 2], names[VALUES // 2 :]), strict=True):
            browser.ask("show", names=part, views=[])
        first = browsers[0]
        first.until(lambda b: len(b.values) == VALUES // 2)
        worker = plcrt.worker
        assert worker
        pids = (page.process.pid, worker)
        before, begin, readings, torn = [_seconds(pid) for pid in pids], time.monotonic(), 0, 0
        while time.monotonic() < begin + SECONDS:
            if first.take()["is"] == "values":
                readings += 1
                torn += len({value[0] for value in first.values.values()}) > 1
        taken = time.monotonic() - begin
        shares = [(_seconds(pid) - was) / taken * 100 for pid, was in zip(pids, before, strict=True)]
        for browser in browsers:
            browser.socket.close()
        page.end()
    return shares[0], shares[1], readings, torn


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        tool, runtime, readings, torn = measure(Path(folder))
    print(f"\nThe page with {VALUES} values that change, over TCP, in two browsers for {SECONDS:.0f} s")
    print(f"{readings / SECONDS:6.1f}  readings a second, {torn} of them torn")
    print(f"{tool + runtime:6.1f}  % of a core (plctool {tool:.1f}, plcrt {runtime:.1f}), goal {GOAL}")


if __name__ == "__main__":
    main()
