"""Network variables between two plcrt, and between plcrt and a script of another maker."""

from __future__ import annotations

import socket
import sys
from contextlib import ExitStack
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1]))

from netvar_programs import PROGRAM, count_in, telegram

from plctool import connect
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually


def free_port() -> int:
    with socket.socket(type=socket.SOCK_DGRAM) as udp:
        udp.bind(("127.0.0.1", 0))
        return int(udp.getsockname()[1])


def test_two_controllers_and_a_script_share_a_list(plcrt: Plcrt, tool, tmp_path: Path) -> None:
    image = tool.build("netvars", PROGRAM)
    plcrt.stop()
    other = Plcrt(tmp_path / "other.flash")
    own, theirs = free_port(), free_port()
    with ExitStack() as stack:
        for runtime in (plcrt, other):
            runtime.options = ("--tcp", "0")
            runtime.start()
            stack.callback(runtime.stop)
        one, two = (stack.enter_context(connect(f"tcp:{runtime.tcp}")) for runtime in (plcrt, other))
        for plc, port, to in ((one, own, theirs), (two, theirs, own)):
            plc.flash(image)
            plc.write({"Main.own": port, "Main.toPort": to, "Main.to.sAddr": "127.0.0.1", "Main.onChange": True})
            plc.stop()  # opens the port again, at the number that it has now
            plc.start()
            eventually(lambda plc=plc: plc.read("Main.net.xActive"))
        one.write({"Main.sends": True, "Main.out.count": 77})
        eventually(lambda: two.read("Main.in.count") == 77)
        two.write({"Main.sends": True, "Main.out.count": -8})
        eventually(lambda: one.read("Main.in.count") == -8)
        with socket.socket(type=socket.SOCK_DGRAM) as script:
            script.bind(("127.0.0.1", 0))
            script.settimeout(20)
            script.sendto(telegram(99), ("127.0.0.1", own))
            eventually(lambda: one.read("Main.in.count") == 99 and one.read("Main.in.name") == "press")
            script.sendto(b"rubbish", ("127.0.0.1", own))
            eventually(lambda: one.read("Main.net.udiBad") == 1)
            one.write({"Main.toPort": script.getsockname()[1], "Main.out.count": 12})
            while count_in(script.recv(1000)) != 12:
                pass
