"""The CAN adapter of plcrt as CANopen manager is unplugged while its nodes run, and plugged in again."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).parents[1]))

from canopen_nodes import ForeignNode
from canopen_programs import write_program
from processes import processor_ns

from plctool import connect
from plctool.testing.can_hub import CanHub
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually

RESETS = (0x81, 0x82)
MOST_LOAD = 0.3  # of a processor; a loop that does not wait takes all of it


@contextmanager
def plugged_in(adapter: Path) -> Iterator[CanHub]:
    """A bus whose first adapter has this name, as udev names a USB adapter."""
    with CanHub(2) as hub:
        adapter.symlink_to(hub.paths[0])
        try:
            yield hub
        finally:
            adapter.unlink()


class BootingNode(ForeignNode):
    """A node that sends its boot-up after a reset, which python canopen's does not."""

    def __enter__(self) -> BootingNode:
        super().__enter__()
        self._network.subscribe(0, lambda _cob, data, _time: self._boot() if data[0] in RESETS else None)
        return self

    def _boot(self) -> None:
        self.node.nmt.stop_heartbeat()
        self.node.nmt.state = "INITIALISING"
        self.node.nmt.state = "PRE-OPERATIONAL"


def load_of(pid: int) -> float:
    """The share of a processor that a process takes for a second."""
    begun, used = time.monotonic(), processor_ns(pid)
    eventually(lambda: time.monotonic() - begun > 1)
    return (processor_ns(pid) - used) / 1e9 / (time.monotonic() - begun)


def test_nodes_are_lost_with_the_adapter_and_come_back_with_it(tmp_path: Path, tool: Any) -> None:
    image, adapter = tmp_path / "app.cdl", tmp_path / "adapter"
    built = tool("build", str(write_program(tmp_path / "program")), "-o", str(image))
    assert built.status == 0, built.err
    with ExitStack() as bus:
        hub = bus.enter_context(plugged_in(adapter))
        with Plcrt(tmp_path / "flash", "--can", f"slcan:{adapter}") as plcrt, connect(f"serial:{plcrt.port}") as plc:
            plc.flash(image)
            for _ in range(2):
                bus.enter_context(BootingNode(f"slcan:{hub.paths[1]}"))
                eventually(lambda: plc.read("Valves.ok"))
                bus.close()
                eventually(lambda: not plc.read("Valves.ok"))
                assert plcrt.worker is not None
                assert load_of(plcrt.worker) < MOST_LOAD
                hub = bus.enter_context(plugged_in(adapter))
            bus.enter_context(BootingNode(f"slcan:{hub.paths[1]}"))
            eventually(lambda: plc.read("Valves.ok"))
            texts = [entry.text for entry in plc.log()]
    assert "Valves is lost: the bus is off" in texts, texts
    assert texts.count("Valves is back") == 2, texts
