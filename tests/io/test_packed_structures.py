"""Members of a packed structure that channels lead to, at addresses that are no multiple of their size."""

from __future__ import annotations

from pathlib import Path

from io_support import addresses, build

from plctool.sim import Simulator

PROGRAM = """TYPE
{attribute 'pack_mode' := '1'}
Telegram : STRUCT head : BYTE; value : DINT; tail : WORD; END_STRUCT
END_TYPE
PROGRAM Main
VAR received AT %IB2 : Telegram; sent AT %QB4 : Telegram; inside : Telegram; END_VAR
sent.value := received.value + inside.value;
sent.tail := received.tail;
END_PROGRAM
"""
DESCRIPTION = """[sim]
in = { a = 'Main.received.value', b = 'Main.received.tail', c = 'Main.inside.value' }
out = { x = 'Main.sent.value', y = 'Main.sent.tail' }
"""


def test_channels_lead_to_members_at_odd_addresses(tmp_path: Path) -> None:
    built = build(tmp_path, PROGRAM, DESCRIPTION)
    assert len(addresses(built)) == 5
    with Simulator(built.image, built.symbols) as plc:
        plc.set_input("Main.received.value", 100_000)
        plc.set_input("Main.received.tail", 0x1234)
        plc.set_input("Main.inside.value", 23)
        plc.run_cycles(2)
        assert plc.output("Main.sent.value") == 100_023
        assert plc.output("Main.sent.tail") == 0x1234
        plc.write({"Main.sent.head": 7})
        assert plc.read("Main.sent") == {"head": 7, "value": 100_023, "tail": 0x1234}
