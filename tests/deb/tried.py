"""What both tests of the packages use: the program that is flashed, and the capabilities of the controller."""

from __future__ import annotations

SKIPPED = 77  # exit status: it cannot be done here
PROGRAM = """\
PROGRAM Main
VAR n : DINT; END_VAR
VAR RETAIN total : DINT; END_VAR
    n := n + 1;
    total := total + 1;
END_PROGRAM
"""
CAPABILITIES = {"CAP_IPC_LOCK": 14, "CAP_SYS_NICE": 23}  # linux/capability.h


def say(text: str) -> None:
    """Prints the step that begins."""
    print(f"-- {text}", flush=True)
