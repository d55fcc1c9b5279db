"""Tests that a plcrt in QEMU's user mode cannot pass, by the name of the file and of the test, each with the reason."""

from __future__ import annotations

NOT_EMULATED: dict[str, str] = {}


def reason_to_skip(node: str) -> str:
    """Why a test, as tests/e2e/test_x.py::test_y, is not for an emulated plcrt; "" if it is."""
    return next((reason for name, reason in NOT_EMULATED.items() if name in node), "")
