"""Tests that are not for a plcrt in QEMU's user mode, by a part of their name, each with the reason."""

from __future__ import annotations

_VENDOR = "plcrt with a driver of the test's is compiled for this machine"
_IMAGE = "plctool knows the flash of plcrt for x86-64 only (plctool image --board plcrt)"
NOT_EMULATED = {
    "test_demo.py": "the demo builds for the machine that it runs on",
    "test_plcrt_process.py::test_no_function_is_looked_up": "it reads the ELF file of plcrt, which is a script here",
    "test_port_check.py::test_this_machine_keeps": "it expects the target of this machine",
    "test_port_check_wires.py": _VENDOR,
    "test_process_image.py": "the image is one of tests/attack, for this machine",
    "test_production_image.py": _IMAGE,
    "test_supervisor.py::test_ps_tells_them_apart": "the supervisor has the name of QEMU",
    "test_vendor_driver.py": _VENDOR,
}
_FRAME = "20 bytes past the array do not reach the return address in a frame of this processor"
NOT_ON = {
    "aarch64-linux": {
        "stopped_and_rolled_back_at_the_next_start[initialisation]": _FRAME,
        "stopped_and_rolled_back_at_the_next_start[cyclic task]": _FRAME,
        "test_a_program_that_overruns_its_stack_does_not_end_plcrt_at_start_after_start": _FRAME,
    },
}


def reason_to_skip(node: str, target: str) -> str:
    """Why a test, as tests/e2e/test_x.py::test_y, is not for an emulated plcrt of a target; "" if it is."""
    reasons = NOT_EMULATED | NOT_ON.get(target, {})
    return next((reason for name, reason in reasons.items() if name in node), "")
