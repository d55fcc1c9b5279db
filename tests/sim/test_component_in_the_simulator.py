"""A component of a vendor in the simulator denies events, as it does on plcrt.

The simulator with the component is a module of its own, which a process of its own loads.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))

import _plccore
from vendor_component import cmp_list_of, door, relink

CORE = Path(_plccore.__file__).resolve()
BUILD = CORE.parents[1]
NAME, LIBRARY = f"host/{CORE.name}", "librts_sim_bus.a.p"
SCRIPT = """
import os, sys
from pathlib import Path
from plctool.core import lib
from plctool.errors import DeviceError
from plctool.sim import Simulator

def refusal(operate):
    try:
        operate()
    except DeviceError as error:
        assert error.result == lib.ERR_OPERATION_DENIED
        return error.message

with Simulator.from_sources("main.st") as plc:
    image = Path(sys.argv[1]).read_bytes()
    switch = Path(os.environ["ACME_DOOR"])
    switch.touch()
    print(refusal(lambda: plc.flash(image)))
    print(plc.status().state)
    plc.stop()
    print(refusal(plc.start))
    plc.reset("origin")
    print(refusal(lambda: plc.flash(image)))
    switch.unlink()
    plc.flash(image)
    print(plc.status().state)
"""
REFUSAL = "The device refused the {}: the door is open (ERR_OPERATION_DENIED)."


@pytest.mark.skipif(not (BUILD / "build.ninja").exists(), reason="the module is not in its build folder")
def test_a_component_denies_start_and_download_with_its_words(tmp_path: Path) -> None:
    from plctool.cli.main import main as plctool

    folder = tmp_path / "product"
    folder.mkdir()
    shutil.copy(cmp_list_of(BUILD, NAME, LIBRARY), folder)
    door(folder)
    relink(BUILD, NAME, folder, LIBRARY)
    (tmp_path / "main.st").write_text("PROGRAM Main VAR n : DINT; END_VAR n := n + 1; END_PROGRAM")
    (tmp_path / "next.st").write_text("PROGRAM Main VAR n : DINT; END_VAR n := n + 2; END_PROGRAM")
    assert plctool(["build", str(tmp_path / "next.st"), "-o", str(tmp_path / "next.cdl")]) == 0
    paths = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])
    environment = os.environ | {"PYTHONPATH": paths, "ACME_DOOR": str(tmp_path / "open")}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, "next.cdl"],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    download, start = REFUSAL.format("download"), REFUSAL.format("start")
    assert done.stdout.splitlines() == [download, "run", start, download, "run"]
