"""Network variables over CAN between two plcrt on a hub of pseudo terminals."""

from __future__ import annotations

import sys
from contextlib import ExitStack
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).parents[1]))

from netvar_programs import OVER_CAN

from plctool import connect
from plctool.testing.can_hub import CanHub
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually


def test_two_controllers_share_a_list(tmp_path: Path, tool: Any) -> None:
    image = tool.build("netvars", OVER_CAN)
    with ExitStack() as stack:
        hub = stack.enter_context(CanHub(2))
        plcs = []
        for number, path in enumerate(hub.paths):
            options = ("--can", f"slcan:{path}", "--tcp", "0")
            runtime = stack.enter_context(Plcrt(tmp_path / f"flash{number}", *options))
            plcs.append(stack.enter_context(connect(f"tcp:{runtime.tcp}")))
            plcs[-1].flash(image)
        one, two = plcs
        one.write({"Main.id": 0x340, "Main.onChange": True, "Main.out.name": "press", "Main.sends": True})
        for count in (77, -8):
            one.write({"Main.out.count": count})
            eventually(lambda count=count: two.read("Main.in.count") == count)
        assert two.read("Main.in.name") == "press"
