"""plcrt killed at any moment, which is a power cut for it: the program and its retain variables come back."""

import random
import signal
import threading
import time

import pytest

import plctool
from plctool.errors import PlcError


def test_the_boot_project_runs_after_a_kill_with_its_retain_variables(tool, plcrt, counter, eventually):
    tool.ok("flash", "--port", plcrt.port, str(counter))
    read = lambda: tool.ok("read", "--port", plcrt.port, "Main.total", "Main.count")["values"]  # noqa: E731
    assert eventually(lambda: read()["Main.total"] > 250)  # longer than retain variables take to be saved
    plcrt.stop(signal.SIGKILL)
    plcrt.start()
    assert tool.ok("status", "--port", plcrt.port)["state"] == "run"
    after = read()
    assert after["Main.total"] > after["Main.count"], "the total goes on from what was saved"


def large(tool, name: str, value: int):
    body = "\n".join(f"a[{i % 50}] := a[{(i * 7) % 50}] * {i * 7919 + value};" for i in range(600))
    return tool.build(
        name, f"PROGRAM Main VAR a : ARRAY[0..49] OF DINT; me : DINT := {value}; END_VAR\n{body}\nEND_PROGRAM"
    )


@pytest.mark.parametrize("seed", range(4))
def test_a_kill_during_a_download_leaves_the_old_or_the_new_program(tool, plcrt, seed):
    old, new = large(tool, "old", 1), large(tool, "new", 2)
    tool.ok("flash", "--port", plcrt.port, str(old))
    port = plcrt.port
    rng = random.Random(seed)

    def flash_new():
        try:
            with plctool.connect(f"serial:{port}") as plc:
                plc.flash(new)
        except PlcError:
            pass  # the device went away

    flashing = threading.Thread(target=flash_new)
    flashing.start()
    time.sleep(rng.uniform(0, 0.15))  # any moment will do
    plcrt.stop(signal.SIGKILL)
    plcrt.start()
    flashing.join()
    with plctool.connect(f"serial:{plcrt.port}") as plc:
        crcs = {int.from_bytes(image.read_bytes()[100:104], "little") for image in (old, new)}
        status = plc.status()
        assert status.state == "run" and status.image_crc in crcs
        plc.flash(new)
        assert plc.status().image_crc == int.from_bytes(new.read_bytes()[100:104], "little")
