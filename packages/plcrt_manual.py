"""The manual page of plcrt, made of what `plcrt --help` prints: `packages/plcrt_manual.py FILE` prints it."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

OPTION = re.compile(r"  (--\S+(?: (?:[A-Z]|pty)\S*)?)(?: +(.*))?")
DESCRIPTION = """\
plcrt turns a Linux machine into a PLC. It takes programs that plctool has compiled, checks them, keeps them in a file
that stands for the flash memory of a controller, and runs their tasks. A supervisor starts the controller again if its
process dies."""
SERVICE = """\
plcrt@NAME.service is a controller as a service of systemd: it runs plcrt as user plcrt with the options of
/etc/plcrt/NAME.conf (PLCRT_OPTIONS), and keeps its programs in /var/lib/plcrt/NAME."""
EXIT_STATUS = {
    "0": "everything was saved",
    "1": "a file or line cannot be opened, or not everything was saved",
    "2": "wrong use",
}


def text_of(text: str) -> str:
    """Running text in the language of man(7)."""
    escaped = text.replace("\\", r"\e").replace("-", r"\-")
    return rf"\&{escaped}" if escaped.startswith((".", "'")) else escaped


def options_of(usage: str) -> Iterator[tuple[str, str]]:
    """Each option of the usage with its description, whose lines are joined."""
    head, words = "", []
    for line in usage.splitlines():
        option = OPTION.fullmatch(line)
        if option or not line.startswith("    "):
            if head:
                yield head, " ".join(words)
            head, words = (option[1], [option[2] or ""]) if option else ("", [])
        elif head:
            words.append(line.strip())
    if head:
        yield head, " ".join(words)


def page(usage: str) -> Iterator[str]:
    synopsis, _, _ = usage.partition("\n\n")
    yield '.TH PLCRT 1 "" "plcrt" "User Commands"'
    yield from (".SH NAME", text_of("plcrt - runtime of IEC 61131-3 programs"))
    yield from (".SH SYNOPSIS", text_of(" ".join(synopsis.removeprefix("usage: ").split())))
    yield from (".SH DESCRIPTION", text_of(DESCRIPTION), ".SH OPTIONS")
    for head, text in options_of(usage):
        yield from (".TP", f".B {text_of(head)}", text_of(text.strip()))
    yield from (".SH SERVICE", text_of(SERVICE), ".SH EXIT STATUS")
    for status, text in EXIT_STATUS.items():
        yield from (".TP", f".B {status}", text_of(text))
    yield from (".SH SEE ALSO", r"\fBplctool\fR(1), \fBsystemctl\fR(1), \fBjournalctl\fR(1)")


if __name__ == "__main__":
    print("\n".join(page(Path(sys.argv[1]).read_text())))
