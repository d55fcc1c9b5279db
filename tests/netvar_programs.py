"""Programs with network variables, and their telegrams."""

from __future__ import annotations

import struct

PROGRAM = """
TYPE
    {attribute 'pack_mode' := '1'}
    Line : STRUCT
        running : BOOL;
        speed : REAL;
        name : STRING(10);
        count : DINT;
    END_STRUCT;
END_TYPE
PROGRAM Main
VAR
    own, toPort : UINT := 1202; to : NBS.IP_ADDR; interval : TIME; onChange, event : BOOL; sends : BOOL;
    out, in : Line; net : NETVARS; sender : NETVAR_SENDER; receiver : NETVAR_RECEIVER;
END_VAR
net(xEnable := TRUE, uiPort := own);
sender(xEnable := sends, hPeer := net.hPeer, ipAddr := to, uiPort := toPort, uiList := 7, uiItems := 4,
    pData := ADR(out), szData := SIZEOF(out), tInterval := interval, xOnChange := onChange, xEvent := event);
receiver(net := net, uiList := 7, uiItems := 4, pData := ADR(in), szData := SIZEOF(in), tTimeOut := T#1s);
END_PROGRAM
"""

OVER_CAN = """
TYPE
    {attribute 'pack_mode' := '1'}
    Line : STRUCT running : BOOL; speed : REAL; name : STRING(10); count : DINT; END_STRUCT;
END_TYPE
PROGRAM Main
VAR
    out, in : Line; sends, onChange, event : BOOL; interval : TIME; id : DWORD := 16#300; size : UDINT := 20;
    sender : NETVAR_CAN_SENDER; receiver : NETVAR_CAN_RECEIVER;
END_VAR
sender(xEnable := sends, dwCobId := id, pData := ADR(out), szData := size, tInterval := interval,
    xOnChange := onChange, xEvent := event);
receiver(dwCobId := 16#340, pData := ADR(in), szData := SIZEOF(in), tTimeOut := T#1s);
END_PROGRAM
"""

_HEAD = struct.Struct("<4sIHHHHHBB")
_DATA = struct.Struct("<?f11si")
SIZE = _HEAD.size + _DATA.size


def telegram(count: int, *, list_id: int = 7, items: int = 4, counter: int = 0) -> bytes:
    data = _DATA.pack(True, 1.5, b"press", count)
    return _HEAD.pack(b"\0-S3", 0, list_id, 0, items, _HEAD.size + len(data), counter, 0, 0) + data


def count_in(data: bytes) -> int:
    """The value of `count` in a telegram that a program has sent. Checks the rest of the layout."""
    identity, kind, list_id, part, items, length, _, flags, checksum = _HEAD.unpack(data[: _HEAD.size])
    assert (identity, kind, list_id, part, items, length) == (
        b"\0-S3",
        0,
        7,
        0,
        4,
        len(data),
    ) and flags == checksum == 0
    return int(_DATA.unpack(data[_HEAD.size :])[3])
